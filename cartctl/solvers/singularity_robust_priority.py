"""Singularity-robust task priority: u = A_1# c_1 + P_1 A_2# c_2 + P_12 A_3# c_3 + ... + P u0, c_k = b_k - d_k.

Each task is solved on its own and then projected onto the null space of all tasks above it, stacked (Chiaverini 1997):
no algorithmic singularities, at the price that a lower task is met only approximately wherever it is not orthogonal to
those above.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cartctl.algebra.nullspace import NullSpace
from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import round_off, scale, svd
from cartctl.checks import FloatArray
from cartctl.solvers.base import Answer, System
from cartctl.solvers.policy import PolicySolver


@dataclass(frozen=True)
class SingularityRobustPriority(PolicySolver):
    """Each task solved on its own, then projected onto the null space of those above it.

    policy: what becomes of small singular values of each task's own matrix.
    """

    name: ClassVar[str] = "singularity-robust-priority"
    sources: ClassVar[tuple[str, ...]] = ("chiaverini1997",)
    honours: ClassVar[frozenset[str]] = frozenset({"reference"})

    def _impl(self, systems: list[System], problem: Problem, u0: FloatArray | None) -> Answer:
        u = np.zeros(problem.n)
        free = NullSpace(problem.n)
        lost_rank = False
        for A, c, ratio in systems:
            own = svd(A)
            size = ratio * scale(A)
            u = u + free.project(self.policy.solve(own, c, size))
            lost_rank |= self.policy.rank(own.s, size) < min(A.shape)
            free.narrow(svd(free.restrict(A)), ratio * round_off(A))
        return Answer(u if u0 is None else u + free.project(u0), lost_rank)
