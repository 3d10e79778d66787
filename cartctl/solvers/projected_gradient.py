"""Projected gradient: u = A#_W (b - d) + (I - A#_W A) u0.

u0 = -k grad H descends an objective in the null space of the task (Liegeois 1977). The projector is exact to
round-off whatever policy solves the task, so u0 never moves the hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cartctl.algebra.nullspace import null_part
from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import round_off, scale, svd
from cartctl.checks import FloatArray
from cartctl.solvers.base import Answer, stack
from cartctl.solvers.policy import PolicySolver


@dataclass(frozen=True)
class ProjectedGradient(PolicySolver):
    """Pseudo-inverse plus the reference u0, projected onto the null space of all equations stacked.

    policy: what becomes of small singular values in the task's part.
    """

    name: ClassVar[str] = "projected-gradient"
    honours: ClassVar[frozenset[str]] = frozenset({"reference"})

    def _impl(self, systems: list[tuple[FloatArray, FloatArray]], problem: Problem, u0: FloatArray | None) -> Answer:
        A, c = stack(systems, problem.equations)
        decomposition = svd(A)
        size = scale(A)
        u = self.policy.solve(decomposition, c, size)
        if u0 is not None:
            u = u + null_part(decomposition, round_off(A), u0)
        return Answer(u, self.policy.rank(decomposition.s, size) < min(A.shape))
