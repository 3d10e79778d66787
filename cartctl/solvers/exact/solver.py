"""What the solvers on the exact engine share: warm start, status, certificate."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from cartctl.algebra.certificate import Certificate
from cartctl.algebra.problem import Problem
from cartctl.algebra.proofs import check_proofs
from cartctl.algebra.solution import Solution, Status
from cartctl.checks import FloatArray
from cartctl.solvers.base import Solver
from cartctl.solvers.exact.call import answer, certificate
from cartctl.solvers.exact.kinds import CONTRADICTORY, LOST_RANK, STUCK, UNPROVEN
from cartctl.solvers.exact.lexicographic import lexicographic


class ExactSolver(Solver):
    """A solver whose answer is the exact optimum of prioritised levels under bounds and rows."""

    honours: ClassVar[frozenset[str]] = frozenset({"bounds", "constraints", "reference"})

    @property
    def fits_all(self) -> bool:
        """Whether equations are met by least squares whatever their fit says."""
        return False

    def prepare(self) -> None:
        """Compile the engine, or fetch it from its cache."""
        _ = lexicographic.compiled

    def _solve_impl(self, problem: Problem) -> Solution:
        return self._solve_from(problem, None)

    def _solve_from(self, problem: Problem, start: Solution | None) -> Solution:
        try:
            found = answer(problem, self.fits_all, start)
        except FloatingPointError:
            return self._failed(problem)
        if found.flags & STUCK:
            return self._failed(problem)
        status = Status.UNPROVEN if found.flags & UNPROVEN else None
        if found.flags & CONTRADICTORY:
            status = Status.INFEASIBLE
        lost = bool(found.flags & LOST_RANK)
        solution = Solution(problem, found.u, self.name, self, status, lost, found.scales)
        solution.warm = found.active
        return solution

    def _astray(self, problem: Problem, u: FloatArray) -> Solution:
        return self._failed(problem)

    def _failed(self, problem: Problem) -> Solution:
        """FAILED, at the value inside the box that is nearest to zero."""
        return Solution(problem, problem.clip(np.zeros(problem.n)), self.name, status=Status.FAILED)

    def grade(self, solution: Solution) -> Status:
        """By what is skipped, by rank, by the scales, by what is asked for exactly."""
        scales = solution.scales
        if np.isnan(scales).any():
            return Status.SKIPPED
        if solution.lost_rank:
            return Status.SINGULAR
        if scales.min(initial=1.0) < 1.0:
            return Status.SCALED
        if not solution.holds(("scale", "inequality")):
            return Status.INEXACT
        return Status.OPTIMAL

    def task_part(self, solution: Solution) -> FloatArray:
        """What of an answer the tasks ask for, (n,): the answer with u0 = 0."""
        return self.solve(solution.problem.without_reference()).u

    def certify(self, solution: Solution) -> Certificate:
        """Scales that cannot be larger, misses that cannot be less, a u that cannot be nearer, with their proofs."""
        _ = check_proofs.compiled
        return certificate(solution, self.fits_all)
