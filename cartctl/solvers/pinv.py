"""Pseudo-inverse: u = A#_W (b - d).

A#_W = W^-1 A^T (A W^-1 A^T)^-1 where A has full row rank; through the SVD of A W^-1/2 for every shape and rank.
Of all u that leave the least residual, the one of least W-norm (Penrose 1955; Whitney 1969). W = M(q) gives the
least kinetic energy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import scale, svd
from cartctl.checks import FloatArray
from cartctl.solvers.base import Answer, System, stack
from cartctl.solvers.policy import PolicySolver


@dataclass(frozen=True)
class Pinv(PolicySolver):
    """Pseudo-inverse of all equations stacked: least residual, then least W-norm.

    policy: what becomes of small singular values.
    """

    stacks: ClassVar[bool] = True
    name: ClassVar[str] = "pinv"
    sources: ClassVar[tuple[str, ...]] = ("penrose1955", "whitney1969")

    def _impl(self, systems: list[System], problem: Problem, u0: FloatArray | None) -> Answer:
        A, c, ratio = stack(systems, problem.equations)
        decomposition = svd(A)
        size = ratio * scale(A)
        lost = self.policy.rank(decomposition.s, size) < min(A.shape)
        return Answer(self.policy.solve(decomposition, c, size), lost)
