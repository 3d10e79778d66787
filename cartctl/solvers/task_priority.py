"""Task priority, any number of tasks: u_k = u_{k-1} + (A_k P_{k-1})# (b_k - d_k - A_k u_{k-1}).

P_0 = I, u_0 = 0 and P_k projects onto the null space of all tasks down to k; the last null space is spent on u0
(Maciejewski & Klein 1985; Nakamura, Hanafusa & Yoshikawa 1987; Siciliano & Slotine 1991). P_k = Z_k Z_k^T with an
orthonormal basis Z_k, and (A_k P)# = Z (A_k Z)#: no projector is ever multiplied up, so none leaks.
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
class TaskPriority(PolicySolver):
    """Strict priorities: each equation is met as well as the null space of those above it allows.

    policy: what becomes of small singular values; its cutoffs refer to each task's own matrix.

    >>> import cartctl as cc
    >>> first, second = ([[1.0, 0.0, 0.0]], [1.0]), ([[1.0, 1.0, 0.0]], [0.0])
    >>> print(cc.solve(cc.Problem([first, second]), "task-priority").u)
    [ 1. -1.  0.]
    """

    name: ClassVar[str] = "task-priority"
    sources: ClassVar[tuple[str, ...]] = ("maciejewski1985", "nakamura1987", "siciliano1991")
    honours: ClassVar[frozenset[str]] = frozenset({"reference"})

    def _impl(self, systems: list[System], problem: Problem, u0: FloatArray | None) -> Answer:
        u = np.zeros(problem.n)
        free = NullSpace(problem.n)
        lost_rank = False
        for A, c, ratio in systems:
            if free.dimension == 0:
                break
            restricted = svd(free.restrict(A))
            size = ratio * scale(A)
            u = u + self.policy.solve(free.lift(restricted), c - A @ u, size)
            lost_rank |= self.policy.rank(restricted.s, size) < min(A.shape[0], free.dimension)
            free.narrow(restricted, ratio * round_off(A))
        return Answer(u if u0 is None else u + free.project(u0 - u), lost_rank)
