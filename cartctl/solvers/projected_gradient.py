"""Projected gradient: u = A#_W (b - d) + (I - A#_W A) u0.

u0 = -k grad H descends an objective in the null space of the task (Liegeois 1977). The projector is exact to
round-off whatever policy solves the task, so u0 never moves the hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cartctl.algebra.inverses import InversePolicy
from cartctl.solvers.filtered import FilteredSolver
from cartctl.solvers.policy import PolicySolver


@dataclass(frozen=True)
class ProjectedGradient(FilteredSolver, PolicySolver):
    """Pseudo-inverse plus the reference u0, projected onto the null space of all equations stacked.

    policy: what becomes of small singular values in the task's part.

    >>> import cartctl as cc
    >>> problem = cc.Problem([([[1.0, 1.0]], [2.0])], reference=[1.0, 0.0])
    >>> print(cc.solve(problem, "projected-gradient").u)
    [1.5 0.5]
    """

    name: ClassVar[str] = "projected-gradient"
    sources: ClassVar[tuple[str, ...]] = ("liegeois1977",)

    def filter(self) -> InversePolicy:
        """The policy as given."""
        return self.policy
