"""Task scaling: the largest s in [0, 1] such that u(s) = A#_W (s b - d) + (I - A# A) u0 respects the bounds.

u is affine in s, so every bound and every row of C leaves an interval of s and the answer is in closed form: the hand
stays on its path and arrives later (Antonelli, Chiaverini & Fusco 2003). All commands are slowed alike; equations with
``fit="least_squares"`` are not slowed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from cartctl.algebra.inverses import InversePolicy, Truncated
from cartctl.algebra.metric import Whitening
from cartctl.algebra.nullspace import null_part
from cartctl.algebra.problem import Problem
from cartctl.algebra.solution import Solution, Status
from cartctl.algebra.svd import round_off, scale, svd
from cartctl.checks import FloatArray, is_finite
from cartctl.errors import ParameterError
from cartctl.solvers.base import Solver, stack, systems_of
from cartctl.solvers.policy import check_policy

_SLACK = 1e-12  # relative: a bound met to round-off is met


@dataclass(frozen=True)
class TaskScaling(Solver):
    """Slow the commands until the pseudo-inverse's answer stays within the bounds.

    policy: what becomes of small singular values; one whose answer is linear in the command. Raises ParameterError.
    """

    stacks: ClassVar[bool] = True
    scales: ClassVar[bool] = True
    name: ClassVar[str] = "task-scaling"
    sources: ClassVar[tuple[str, ...]] = ("antonelli2003",)
    honours: ClassVar[frozenset[str]] = frozenset({"bounds", "constraints", "reference"})
    policy: InversePolicy = field(default_factory=Truncated)

    def __post_init__(self) -> None:
        check_policy(self.policy)
        if not self.policy.linear:
            raise ParameterError(
                f"policy is {self.policy!r}, whose answer is not linear in the command, so no scale is in closed form; "
                "use another policy"
            )

    @property
    def damps(self) -> bool:
        """Whether the policy holds back what it could deliver."""
        return self.policy.damps

    def _solve_impl(self, problem: Problem) -> Solution:
        try:
            full, still, lost_rank = _ends(problem, self.policy)
        except FloatingPointError:  # LAPACK met infinities
            full = still = np.full(problem.n, np.nan)
        if not (is_finite(full) and is_finite(still)):
            return Solution(problem, np.zeros(problem.n), self.name, status=Status.FAILED)
        rate = full - still
        low, high = feasible_scales(problem, still, rate)
        slowed = np.array([e.fit == "scale" for e in problem.equations])
        if low > high:
            u = problem.clip(still)
            stopped = np.where(slowed, 0.0, 1.0)
            return Solution(problem, u, self.name, self, Status.INFEASIBLE, lost_rank, stopped)
        if high >= 1.0:
            return Solution(problem, problem.clip(full), self.name, self, None, lost_rank)
        u = problem.clip(still + high * rate)
        scales = np.where(slowed, high, 1.0)
        return Solution(problem, u, self.name, self, None, lost_rank, scales)

    def task_part(self, solution: Solution) -> FloatArray:
        """What of an answer the tasks ask for, (n,), at the scale it has."""
        return solution.u - _null_part(solution.problem, self.policy)

    def grade(self, solution: Solution) -> Status:
        """SCALED where the commands were slowed, else by rank and residuals."""
        if solution.scales.min(initial=1.0) < 1.0:
            return Status.SCALED
        return super().grade(solution)


def _null_part(problem: Problem, policy: InversePolicy) -> FloatArray:
    """``(I - A# A) u0``, (n,)."""
    with_it, _, _ = _ends(problem, policy)
    without, _, _ = _ends(problem.without_reference(), policy)
    return with_it - without


def feasible_scales(problem: Problem, offset: FloatArray, rate: FloatArray) -> tuple[float, float]:
    """The s in [0, 1] for which offset + s rate is within all bounds, as (low, high); low > high if there are none."""
    rows = [(offset, rate, problem.lower, problem.upper)] if problem.bounded else []
    if problem.constraints is not None:
        C, c_low, c_high = problem.constraints
        rows.append((C @ offset, C @ rate, c_low, c_high))
    low, high = 0.0, 1.0
    for start, slope, lower, upper in rows:
        for bound, sign in ((lower, -1.0), (upper, 1.0)):
            if bound is None:
                continue
            room, towards = sign * (bound - start), sign * slope
            slack = _SLACK * (np.abs(start) + np.where(np.isfinite(bound), np.abs(bound), 0.0))
            rising, falling = towards > 0.0, towards < 0.0
            if (room < -slack)[~(rising | falling)].any():
                return 1.0, 0.0
            high = min(high, float((room[rising] / towards[rising]).min(initial=1.0)))
            low = max(low, float((room[falling] / towards[falling]).max(initial=0.0)))
    return (low, high) if high < low - _SLACK else (low, max(high, low))


def _ends(problem: Problem, policy: InversePolicy) -> tuple[FloatArray, FloatArray, bool]:
    """The answers at s = 1 and s = 0, from one SVD, and whether rank was lost."""
    white = None if problem.metric is None else Whitening(problem.metric)
    systems = [
        system._replace(c=np.array([system.c, system.c - e.b if e.fit == "scale" else system.c]).T)
        for e, system in zip(problem.equations, systems_of(problem, white), strict=True)
    ]
    A, c, ratio = stack(systems, problem.equations)
    decomposition = svd(A)
    size = ratio * scale(A)
    k = decomposition.s.shape[0]
    phi = policy.factors(decomposition.s, size)
    ends = (decomposition.Vt[:k].T * phi) @ (decomposition.U.T @ c)
    full, still = ends[:, 0], ends[:, 1]
    if problem.reference is not None:
        u0 = problem.reference if white is None else white.forward(problem.reference)
        rest = null_part(decomposition, ratio * round_off(A), u0)
        full, still = full + rest, still + rest
    lost_rank = policy.rank(decomposition.s, size) < min(A.shape)
    return (full, still, lost_rank) if white is None else (white.back(full), white.back(still), lost_rank)
