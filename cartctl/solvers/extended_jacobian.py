"""Extended Jacobian: u = [A; A_e]^-1 [b - d; b_e], a square solve.

The added rows keep the configuration on the extremal set ``Z^T grad H = 0`` of an objective along the self-motion, Z a
basis of ker A (Baillieul 1985): ``A_e = Z^T (Hess H - sum_k lambda_k Hess r_k)``, ``lambda = A^{T#} grad H`` and
``b_e = -K Z^T grad H``. The level, which knows the state, appends them; the joint path then depends on the task alone,
so a closed task path gives a closed joint path.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cartctl import checks
from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import scale, svd
from cartctl.checks import FloatArray
from cartctl.errors import UnsupportedProblem
from cartctl.solvers.base import Answer, System, stack
from cartctl.solvers.policy import PolicySolver


@dataclass(frozen=True)
class ExtendedJacobian(PolicySolver):
    """The square solve of the tasks and the rows that keep an objective extremal: repeatable.

    policy: what becomes of small singular values of the extended matrix, whose singularities include algorithmic ones.
    gain: K in 1/s, > 0, by which the level brings the configuration back to the extremal set.
    """

    stacks: ClassVar[bool] = True
    name: ClassVar[str] = "extended-jacobian"
    sources: ClassVar[tuple[str, ...]] = ("baillieul1985",)
    extends: ClassVar[bool] = True
    gain: float = 20.0

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "gain", checks.number("gain", self.gain, low=0.0, strict=True))

    @property
    def takes_metric(self) -> bool:
        """No: a square solve leaves nothing to weigh."""
        return False

    def check(self, problem: Problem) -> None:
        """Refuse fewer rows than unknowns, besides what every solver refuses."""
        super().check(problem)
        rows, n = sum(e.A.shape[0] for e in problem.equations if e.weight > 0.0), problem.n
        if rows < n:
            raise UnsupportedProblem(
                f"solver {self.name!r} has {rows} rows for {n} unknowns; add {n - rows} equations, "
                "or give the Controller an objective whose extremal set adds them"
            )

    def _impl(self, systems: list[System], problem: Problem, u0: FloatArray | None) -> Answer:
        A, c, ratio = stack(_balanced(systems), problem.equations)
        decomposition = svd(A)
        size = ratio * scale(A)
        return Answer(self.policy.solve(decomposition, c, size), self.policy.rank(decomposition.s, size) < A.shape[1])


def _balanced(systems: list[System]) -> list[System]:
    """Equations of quite another size brought to that of the first: an objective's rows have a unit of their own."""
    first = scale(systems[0].A)
    sizes = [scale(system.A) for system in systems]
    apart = [size > 0.0 and first > 0.0 and not 1e-3 < size / first < 1e3 for size in sizes]
    factors = [first / size if far else 1.0 for size, far in zip(sizes, apart, strict=True)]
    return [System(f * A, f * c, ratio) for f, (A, c, ratio) in zip(factors, systems, strict=True)]
