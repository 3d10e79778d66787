"""Saturation in the null space, the published iteration: u_k = u_{k-1} + what a greedy saturation gives task k.

Saturate the most critical joint, u = u_S + (A F)# (s b - d - A u_S), re-solve with the rest, and where no free joints
are left to carry the task, scale it by the largest feasible s; the best s met so far is kept (Flacco, De Luca & Khatib
2012, 2015). Rows of C saturate as joints do (Fiore et al. 2023). For one task at a time; each task starts with all
joints free again and moves in the null space of those above, as in task priority. Nothing checks whether a joint was
saturated wrongly: s may fall short of the optimum. For comparison; the exact solver is meant for use.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cartctl import checks
from cartctl.algebra.metric import Whitening
from cartctl.algebra.problem import Equation, Problem
from cartctl.algebra.solution import Solution, Status
from cartctl.algebra.svd import numerical_rank, round_off, scale, svd
from cartctl.checks import FloatArray, is_finite
from cartctl.solvers.base import Solver
from cartctl.solvers.greedy_kernel import Outcome, Task, most_scaled, nearest
from cartctl.solvers.inequalities import Inequalities


@dataclass(frozen=True)
class SNSGreedy(Solver):
    """Saturate the most critical joint, one after the other, before slowing a task (the published SNS iteration).

    Equations with ``fit="least_squares"`` are met as well as the null space and the bounds allow, by the same greedy
    saturation; so is the reference u0, at the very end. A task for which no s is found is skipped: its scale is nan.

    cutoff: singular values below it, relative to the Frobenius norm of the task's own matrix, carry no command; in
    [1e-13, 1). Raises ParameterError.
    """

    scales: ClassVar[bool] = True
    name: ClassVar[str] = "sns-greedy"
    sources: ClassVar[tuple[str, ...]] = ("flacco2012", "flacco2015", "fiore2023")
    honours: ClassVar[frozenset[str]] = frozenset({"bounds", "constraints", "reference"})
    cutoff: float = 1e-10

    def __post_init__(self) -> None:
        cutoff = checks.number("cutoff", self.cutoff, low=1e-13, high=math.nextafter(1.0, 0.0))
        object.__setattr__(self, "cutoff", cutoff)

    def _solve_impl(self, problem: Problem) -> Solution:
        rows = Inequalities.of(problem)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            try:
                start = rows.nearest_to_rest()
                if start is None:
                    return self._without_room(problem)
                u, outcomes, lost_rank = _descend(problem, start, rows, self.cutoff)
            except FloatingPointError:  # LAPACK met infinities
                u = np.full(problem.n, np.nan)
        if not is_finite(u):
            rest = problem.clip(np.zeros(problem.n))
            return Solution(problem, rest, self.name, status=Status.FAILED)
        u = problem.clip(u)
        scales = np.array([o.scale for o in outcomes])
        return Solution(problem, u, self.name, self, _status(problem, outcomes), lost_rank, scales)

    def _without_room(self, problem: Problem) -> Solution:
        """Bounds and rows exclude each other: the reference, clipped into the box, no task served."""
        u = np.zeros(problem.n) if problem.reference is None else problem.reference
        u = problem.clip(u)
        scales = np.array([np.nan if e.fit == "scale" else 1.0 for e in problem.equations])
        return Solution(problem, u, self.name, self, Status.INFEASIBLE, False, scales)

    def task_part(self, solution: Solution) -> FloatArray:
        """What of an answer the tasks ask for, (n,): the answer with u0 = 0."""
        return self._solve_impl(solution.problem.without_reference()).u


def _status(problem: Problem, outcomes: list[Outcome]) -> Status | None:
    """What the scales say of an answer; None where they say nothing, and rank and residuals decide."""
    slowed = [o for o, e in zip(outcomes, problem.equations, strict=True) if e.fit == "scale" and not o.scale >= 1.0]
    if not slowed:
        return None
    if all(o.by_rank for o in slowed):
        return Status.SINGULAR
    commanded = sum(e.fit == "scale" for e in problem.equations)
    skipped = sum(math.isnan(o.scale) for o in slowed)
    return Status.INFEASIBLE if skipped == commanded else Status.SCALED


def _descend(
    problem: Problem, u: FloatArray, rows: Inequalities, cutoff: float
) -> tuple[FloatArray, list[Outcome], bool]:
    """All tasks in order, then the reference: u (n,), what became of each task, and whether one lost rank."""
    n = problem.n
    white = None if problem.metric is None else Whitening(problem.metric / np.abs(problem.metric).max())
    N = np.eye(n) if white is None else white.back(np.eye(n))  # W-orthonormal: least ||y|| is least ||N y||_W
    units = np.sqrt(((rows.G @ N) ** 2).sum(axis=1))
    units[units == 0.0] = 1.0
    outcomes, lost_rank = [], False
    for e in problem.equations:
        task, floor = _task(e, white, cutoff)
        if e.fit == "scale":
            outcome = most_scaled(task, u, N, rows, units)
        else:
            outcome = Outcome(nearest(task, u, N, rows, units), 1.0, False)
        outcomes.append(outcome)
        u = outcome.u
        left = svd(np.asfortranarray(task.A @ N))
        lost_rank |= numerical_rank(left.s, task.cutoff) < min(e.A.shape[0], N.shape[1])
        if not math.isnan(outcome.scale):
            N = N @ left.Vt[numerical_rank(left.s, floor) :].T
    u0 = np.zeros(n) if problem.reference is None else problem.reference
    root = np.eye(n) if white is None else white.forward(np.eye(n))
    last = Task(root, root @ u0, np.zeros(n), round_off(root))
    return nearest(last, u, N, rows, units), outcomes, lost_rank


def _task(e: Equation, white: Whitening | None, cutoff: float) -> tuple[Task, float]:
    """The equation divided by the norm of A, so that no square over- or underflows, and what is round-off in it."""
    size = scale(e.A) or 1.0
    A, b = e.A / size, e.b / size
    d = np.zeros(b.shape) if e.drift is None else e.drift / size
    if not (is_finite(b) and is_finite(d)):
        raise FloatingPointError("the command is beyond the range of floating point in units of A")
    whitened = A if white is None else white.matrix(A)
    return Task(A, b, d, cutoff * e.ratio * scale(whitened)), e.ratio * round_off(whitened)
