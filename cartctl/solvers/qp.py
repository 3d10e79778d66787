"""Weighted tasks as a quadratic programme, by any of qpsolvers' backends.

    minimise sum_k w_k ||A_k u + d_k - b_k||^2 + rho (u - u0)^T W (u - u0)   within all bounds and rows of C,

rho = (damping ||[w_k^1/2 A_k L^-T]||_F)^2 with W = L L^T: damping is relative to the tasks' own scale, so that neither
units nor a factor in W changes the answer. The order of the equations means nothing here, only their weights do, and
no weight makes a priority strict. Nothing is scaled: a task that does not fit is missed by a residual. Redundancy
under inequalities as a quadratic programme: Cheng, Chen & Sun 1994; the backends OSQP: Stellato et al. 2020, and DAQP:
Arnstrom, Bemporad & Axehill 2022.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.algebra.certificate import Certificate
from cartctl.algebra.problem import Problem
from cartctl.algebra.solution import Solution, Status
from cartctl.checks import FloatArray, is_finite
from cartctl.errors import ParameterError, UnsupportedProblem
from cartctl.solvers.base import Solver
from cartctl.solvers.qp_backends import check_backend, choose, installed, run
from cartctl.solvers.qp_certificate import weighted_certificate
from cartctl.solvers.qp_polish import Point, polish
from cartctl.solvers.qp_program import Program, program_of

_KEPT = 1e-8  # of the programme's units: what an answer that cannot be polished may miss its rows by


class Duals(NamedTuple):
    """Multipliers of bounds and rows for half the cost, positive at an upper bound, negative at a lower one.

    ``sum_k w_k A_k^T (A_k u + d_k - b_k) + rho W (u - u0) + C^T rows + box = 0``.
    """

    u: FloatArray  # (n,)
    rows: FloatArray  # (r,)
    box: FloatArray  # (n,)
    rho: float


class QPSolution(Solution):
    """A Solution that knows its multipliers and the backend that found it, "none" where a linear system was enough."""

    __slots__ = ("backend", "point", "program")

    def __init__(
        self,
        problem: Problem,
        u: FloatArray,
        method: QP,
        backend: str,
        status: Status | None,
        scales: FloatArray | None = None,
        program: Program | None = None,
        point: Point | None = None,
    ) -> None:
        super().__init__(problem, u, method.name, method, status, False, scales)
        self.backend, self.program, self.point = backend, program, point

    @property
    def duals(self) -> Duals | None:
        """The multipliers of bounds and rows; None where the problem is infeasible or the numbers failed."""
        p, point = self.program, self.point
        if p is None or point is None:
            return None
        force = p.alpha * p.alpha * p.size
        rho = p.rho * p.alpha * p.alpha
        if self.problem.metric is not None:
            rho /= float(np.abs(self.problem.metric).max())  # what W was divided by
        return Duals(self.u, force * point.z / p.lengths, force * point.z_box, rho)

    def __repr__(self) -> str:
        return super().__repr__().replace(self.solver, f"{self.solver} ({self.backend})", 1)


@dataclass(frozen=True)
class QP(Solver):
    """Weighted least squares within bounds and rows, by a quadratic-programming backend.

    backend: a name of qpsolvers', or "auto": DAQP where the problem is small or dense, OSQP where it is large and
    sparse; ``solution.backend`` says which. damping: > 0, relative to the tasks' Frobenius norm; its square weighs
    ``(u - u0)^T W (u - u0)`` against the tasks, and without it the null space would be left to chance. tolerance: of
    iterative backends; the answer is polished to round-off afterwards. Raises ParameterError, with the pip command
    where a backend is missing.
    """

    stacks: ClassVar[bool] = True
    name: ClassVar[str] = "qp"
    sources: ClassVar[tuple[str, ...]] = ("cheng1994", "stellato2020", "arnstrom2022")
    honours: ClassVar[frozenset[str]] = frozenset({"bounds", "constraints", "reference"})
    backend: str = "auto"
    damping: float = 1e-3
    tolerance: float = 1e-7
    max_iterations: int = 20_000

    def __post_init__(self) -> None:
        put = object.__setattr__
        if not isinstance(self.backend, str):
            raise ParameterError(f"backend is {self.backend!r}; expected 'auto' or a name of qpsolvers'")
        check_backend(self.backend)
        put(self, "damping", checks.number("damping", self.damping, low=1e-6, high=1e3))
        put(self, "tolerance", checks.number("tolerance", self.tolerance, low=1e-14, high=1e-3))
        put(self, "max_iterations", int(checks.number("max_iterations", self.max_iterations, low=1.0, high=1e9)))

    @property
    def damps(self) -> bool:
        """Always."""
        return True

    def duals(self, problem: Problem) -> Duals | None:
        """The multipliers of bounds and rows at the answer; None where there is none. Raises UnsupportedProblem."""
        solution = self.solve(problem)
        assert isinstance(solution, QPSolution)
        return solution.duals

    def certify(self, solution: Solution) -> Certificate:
        """That no u within the bounds costs less: the saddle point's multipliers, checked on the problem itself."""
        duals = solution.duals if isinstance(solution, QPSolution) else None
        if duals is None:
            raise UnsupportedProblem(f"solver 'qp' claims no optimum here: status {solution.status.name}")
        return weighted_certificate(solution.problem, duals.u, duals.rho, duals.box, duals.rows)

    def grade(self, solution: Solution) -> Status:
        """INEXACT where bounds keep the tasks from being met, more than damping does; else by the residuals."""
        held = solution.saturated.any() or solution.saturated_rows.any()
        if not held or solution.met or self._explains(solution):
            return super().grade(solution)
        return Status.INEXACT

    def _explains(self, solution: Solution) -> bool:
        """Whether damping alone may leave such residuals: the tasks' cost is no larger than that of damping."""
        assert isinstance(solution, QPSolution)
        if solution.program is None or solution.point is None:
            return False
        p, v = solution.program, solution.point.v
        missed = p.A @ v - p.c
        return bool(missed @ missed <= p.rho * (v @ p.weigh(v)))

    def _solve_impl(self, problem: Problem) -> Solution:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            try:
                p = program_of(problem, self.damping)
            except FloatingPointError:
                return self._failed(problem)
            backend = "none" if p.is_free else choose(p) if self.backend == "auto" else self.backend
            point, backend = self._point(p, backend)
            if point is None:
                return self._failed(problem, backend) if p.has_room() else self._infeasible(problem, backend)
            u = problem.clip(p.origin + p.size * point.v)
        if not is_finite(u):
            return self._failed(problem, backend)
        return QPSolution(problem, u, self, backend, None, None, p, point)

    def _point(self, p: Program, backend: str) -> tuple[Point | None, str]:
        """The polished answer and the backend whose active set it is: DAQP's where the one asked for leads nowhere."""
        nothing = Point(np.zeros(p.n), np.zeros(p.C.shape[0]), np.zeros(p.n))
        if backend == "none":
            return polish(p, nothing), backend
        unpolished = None
        for name in dict.fromkeys((backend, "daqp")):
            if name != backend and not (p.has_room() and installed(name)):
                continue
            found = run(p, name, self.tolerance, self.max_iterations)
            point = polish(p, found.point)
            if point is not None:
                return point, name
            if unpolished is None and found.solved and p.violation(found.point.v) <= _KEPT:
                unpolished = found.point
        return unpolished, backend

    def _failed(self, problem: Problem, backend: str = "none") -> Solution:
        rest = problem.clip(np.zeros(problem.n))
        return QPSolution(problem, rest, self, backend, Status.FAILED)

    def _infeasible(self, problem: Problem, backend: str) -> Solution:
        """The answer without commands, clipped into the box."""
        still = tuple(replace(e, b=np.zeros(e.b.shape)) if e.fit == "scale" else e for e in problem.equations)
        u = self._solve_impl(replace(problem.without_bounds(), equations=still)).u
        scales = np.array([0.0 if e.fit == "scale" else 1.0 for e in problem.equations])
        u = problem.clip(u)
        return QPSolution(problem, u, self, backend, Status.INFEASIBLE, scales)
