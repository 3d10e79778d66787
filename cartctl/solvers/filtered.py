"""What the damped methods through the SVD share: filter factors for the task, an exact projector for u0."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from typing import ClassVar

from cartctl.algebra.inverses import InversePolicy
from cartctl.algebra.nullspace import null_part
from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import round_off, scale, svd
from cartctl.checks import FloatArray
from cartctl.solvers.base import Answer, EquationSolver, System, stack


class FilteredSolver(EquationSolver):
    """``u = V diag(phi) U^T (b - d) + (I - A# A) u0`` over all equations stacked; a subclass chooses phi."""

    stacks: ClassVar[bool] = True
    honours: ClassVar[frozenset[str]] = frozenset({"reference"})

    @abstractmethod
    def filter(self) -> InversePolicy:
        """The policy that the parameters stand for."""

    @property
    def damps(self) -> bool:
        """Whether the policy holds back what it could deliver."""
        return self._filter.damps

    def prepare(self) -> None:
        """Prepare the policy."""
        self._filter.prepare()

    @cached_property
    def _filter(self) -> InversePolicy:
        return self.filter()

    def _impl(self, systems: list[System], problem: Problem, u0: FloatArray | None) -> Answer:
        A, c, ratio = stack(systems, problem.equations)
        decomposition = svd(A)
        size, policy = ratio * scale(A), self._filter
        u = policy.solve(decomposition, c, size)
        if u0 is not None:
            u = u + null_part(decomposition, ratio * round_off(A), u0)
        return Answer(u, policy.rank(decomposition.s, size) < min(A.shape))
