"""An answer that holds its problem and grades itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cartctl.algebra.certificate import Certificate
from cartctl.algebra.metric import weighed
from cartctl.algebra.problem import Equation, Inequality, Problem
from cartctl.algebra.svd import norm, scale
from cartctl.checks import FloatArray
from cartctl.errors import UnsupportedProblem


class Status(Enum):
    """How a step went; the value is a sentence for the user."""

    OPTIMAL = "Every equation is met and the cost is minimal."
    INEXACT = "The equations cannot all be met at once; the residuals say by how much the least-squares answer misses."
    DAMPED = "The method holds back part of the commands (damping, or a gradient step); the residuals say how much."
    SCALED = "The commands are slowed down to stay within the bounds; the scales say by how much."
    OVERDETERMINED = (
        "More rows are stacked than there are unknowns, so the added tasks disturb the first; "
        "add at most n - m rows, or rank the tasks with task-priority."
    )
    SKIPPED = (
        "A task has no feasible scale and was left out (its scale is nan), the others were not; "
        "lower its drift, widen the bounds, or fit it by least squares."
    )
    INFEASIBLE = (
        "The bounds, constraint rows and commands contradict each other even at rest; u keeps the box, and "
        "bound_violation() says by how much constraint rows are missed."
    )
    YIELDED = (
        "Limits exclude each other here; constraints gave way first, then acceleration, velocity, position limits, "
        "torque bounds never: solution.yielded says which."
    )
    RECOVERING = (
        "A joint is outside a limit, or too fast to stop in time, and is being brought back at a bounded rate; "
        "the tasks get what is left."
    )
    SINGULAR = (
        "A task lost rank here: motion in the lost directions is left out, damped or slowed; "
        "move away from the singularity or drop an axis."
    )
    UNPROVEN = (
        "Commands are so nearly dependent that double precision cannot prove this answer optimal; u keeps the bounds, "
        "and certificate() says how far from proven it is."
    )
    FAILED = "The numbers over- or underflowed; u was set to zero. Check the scale of the matrices."

    def __str__(self) -> str:
        return self.name


class Method(Protocol):
    """What a Solution asks of the solver that made it, if it is asked."""

    def solve(self, problem: Problem) -> Solution:
        """Another answer of the same method."""

    def grade(self, solution: Solution) -> Status:
        """How the answer went."""

    def task_part(self, solution: Solution) -> FloatArray:
        """What of the answer the tasks ask for."""

    def certify(self, solution: Solution) -> Certificate:
        """The residuals of what the method claims."""


class Solution:
    """The answer of one solver to one problem.

    u: (n,). scales: (p,) in [0, 1], 1 where the method does not scale, nan where a task was skipped. saturated: (n,) -1
    at the lower bound, +1 at the upper, 0 free; saturated_rows the same for constraint rows. lost_rank: whether a task
    lost rank. The status, residuals, parts, multipliers and certificate are worked out when asked for.

    >>> import cartctl as cc
    >>> solution = cc.solve(cc.Problem([([[1.0, 1.0]], [4.0])], lower=[-1, -1], upper=[1, 1]), "sns")
    >>> print(solution.u, solution.scales, solution.saturated, solution.status)
    [1. 1.] [0.5] [1 1] SCALED
    >>> solution.certificate().holds(1e-9)
    True
    """

    __slots__ = (
        "_method",
        "_problem",
        "_residuals",
        "_saturated",
        "_saturated_rows",
        "_scales",
        "_status",
        "_task_part",
        "guarded",
        "lost_rank",
        "recovering",
        "solver",
        "u",
        "warm",
        "yielded",
    )

    def __init__(
        self,
        problem: Problem | Callable[[], Problem],
        u: FloatArray,
        solver: str,
        method: Method | None = None,
        status: Status | None = None,
        lost_rank: bool = False,
        scales: FloatArray | None = None,
    ) -> None:
        self._problem = problem
        self.u = u
        self.solver = solver
        self.lost_rank = lost_rank
        self.guarded = False  # set by a controller whose singularity policy took part of a command
        self.recovering = False  # set by a controller whose limits had to bring a joint back
        self.yielded: tuple[str, ...] = ()  # set by a controller: the classes of limits that gave way, the first first
        self.warm: Any = None  # what the same solver may start from next time
        self._method = method
        self._status = status
        self._scales = scales
        self._saturated: NDArray[np.int8] | None = None
        self._saturated_rows: NDArray[np.int8] | None = None
        self._residuals: FloatArray | None = None
        self._task_part: FloatArray | None = None

    @property
    def problem(self) -> Problem:
        """What was answered; a hot loop may leave it to be put together when somebody asks."""
        problem = self._problem
        if not isinstance(problem, Problem):
            problem = self._problem = problem()
        return problem

    @property
    def scales(self) -> FloatArray:
        """(p,) the share s_k of each command that is delivered."""
        if self._scales is None:
            self._scales = np.ones(len(self.problem.equations))
        return self._scales

    @property
    def residuals(self) -> FloatArray:
        """(p,) ``||A_k u + d_k - s_k b_k||``; of a skipped task what is missing at s = 1, of an inequality the miss."""
        if self._residuals is None:
            pairs = zip(self.problem.equations, np.nan_to_num(self.scales, nan=1.0), strict=True)
            self._residuals = np.nan_to_num([norm(e.miss(self.u, s)) for e, s in pairs], nan=np.inf, posinf=np.inf)
        return self._residuals

    @property
    def saturated(self) -> NDArray[np.int8]:
        """(n,) -1 at lower, +1 at upper, 0 free."""
        if self._saturated is None:
            self._saturated = _sides(self.u, self.problem.lower, self.problem.upper)
        return self._saturated

    @property
    def saturated_rows(self) -> NDArray[np.int8]:
        """(r,) the same for the rows of the constraints."""
        if self._saturated_rows is None:
            C, low, high = self.problem.constraints or (np.zeros((0, self.problem.n)), None, None)
            self._saturated_rows = _sides(C @ self.u, low, high)
        return self._saturated_rows

    @property
    def status(self) -> Status:
        """How it went: YIELDED where limits gave way, RECOVERING where joints come back, or the outcome."""
        outcome = self.outcome
        if self.guarded and outcome is Status.OPTIMAL:  # of what the policy left
            outcome = Status.SINGULAR
        if self.yielded and outcome not in (Status.FAILED, Status.INFEASIBLE):
            return Status.YIELDED
        return Status.RECOVERING if self.recovering and outcome is not Status.FAILED else outcome

    @property
    def failed(self) -> bool:
        """Whether the solver gave up; known without grading the answer."""
        return self._status is Status.FAILED

    @property
    def outcome(self) -> Status:
        """How the problem was solved; by the residuals alone where the solver does not say."""
        if self._status is None:
            by_residuals = Status.OPTIMAL if self.met else Status.INEXACT
            self._status = by_residuals if self._method is None else self._method.grade(self)
        return self._status

    @property
    def met(self) -> bool:
        """Whether every equation of positive weight holds, up to what round-off may leave."""
        return self.holds()

    def holds(self, fits: Sequence[str] = ("scale", "least_squares", "inequality")) -> bool:
        """The same of the equations of the given fits only; a skipped one does not hold."""
        pairs = zip(self.problem.equations, self.scales, strict=True)
        reference = self.problem.reference
        size = norm(self.u) if reference is None else norm(self.u) + norm(reference)  # what round-off is relative to
        return all(_holds(e, s, self.u, size) for e, s in pairs if e.weight > 0.0 and e.fit in fits)

    @property
    def task_part(self) -> FloatArray:
        """(n,) what the tasks ask for: the answer of the same method, at the same scales, with u0 = 0."""
        if self._task_part is None:
            if self.problem.reference is None or self._method is None:
                self._task_part = self.u
            else:
                self._task_part = self._method.task_part(self)
        return self._task_part

    @property
    def null_part(self) -> FloatArray:
        """(n,) what the reference u0 adds: u - task_part."""
        return self.u - self.task_part

    @property
    def multipliers(self) -> list[FloatArray]:
        """Lagrange multipliers lambda_k (m_k,) of the equations: ``W (u - u0) = sum_k A_k^T lambda_k``.

        The ones of least norm where the rows depend on each other; a least-squares fit where the method does not
        minimise ``(u - u0)^T W (u - u0)`` (damping, scaling, gradient steps).
        """
        p = self.problem
        step = self.u if p.reference is None else self.u - p.reference
        force = weighed(p.metric, step)
        A = np.concatenate([e.A for e in p.equations])
        stacked = np.linalg.lstsq(A.T, force, rcond=None)[0] if A.size else np.zeros(A.shape[0])
        return np.split(stacked, np.cumsum(p.sizes)[:-1])

    def certificate(self) -> Certificate:
        """Primal and dual residuals of the very statement the solver claims, level by level.

        Raises UnsupportedProblem where the method claims no optimum (damping, gradient steps, heuristics).
        """
        if self._method is None:
            raise UnsupportedProblem(f"solver {self.solver!r} claims no optimum here: status {self.status.name}")
        return self._method.certify(self)

    def bound_violation(self) -> float:
        """The largest amount by which u leaves the problem's bounds or constraint rows; 0 inside."""
        p = self.problem
        gaps = [0.0]
        if p.lower is not None:
            gaps.append(float((p.lower - self.u).max()))
        if p.upper is not None:
            gaps.append(float((self.u - p.upper).max()))
        if p.constraints is not None and p.constraints[0].shape[0]:
            C, low, high = p.constraints
            gaps += [float((low - C @ self.u).max()), float((C @ self.u - high).max())]
        return max(gaps)

    def __repr__(self) -> str:
        return f"Solution({self.solver}, {self.status.name}, u={np.array2string(self.u, precision=5)})"


def _sides(values: FloatArray, lower: FloatArray | None, upper: FloatArray | None) -> NDArray[np.int8]:
    """-1 at the lower bound, +1 at the upper one, 0 between."""
    sides = np.zeros(values.shape[0], dtype=np.int8)
    for bound, side in ((lower, -1), (upper, 1)):
        if bound is not None:
            sides[np.abs(values - bound) <= 1e-10 * np.maximum(1.0, np.abs(bound))] = side
    return sides


def _holds(e: Equation | Inequality, s: float, u: FloatArray, size: float) -> bool:
    """Whether ``A u + d = s b`` up to what round-off may leave: of each row, and of a backward stable solve."""
    if isinstance(e, Inequality):
        finite = np.where(np.isfinite(e.lower), np.abs(e.lower), 0.0) + np.where(np.isfinite(e.upper), e.upper, 0.0)
        return bool((np.abs(e.miss(u, s)) <= 1e-9 * (np.abs(e.A) @ np.abs(u) + np.abs(finite))).all())
    if s != s:
        return False
    rhs = e.rhs if s == 1.0 else s * e.b - (0.0 if e.drift is None else e.drift)
    stable = 64.0 * float(np.finfo(np.float64).eps) * scale(e.A) * size
    with np.errstate(over="ignore", invalid="ignore"):
        allowed = 1e-9 * (np.abs(e.A) @ np.abs(u) + np.abs(rhs)) + stable
        return bool((np.abs(e.A @ u - rhs) <= allowed).all() and np.isfinite(allowed).all())
