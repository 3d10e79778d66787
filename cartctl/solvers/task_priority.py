"""Task priority, any number of tasks: u_k = u_{k-1} + (A_k P_{k-1})# (b_k - d_k - A_k u_{k-1}).

P_0 = I, u_0 = 0 and P_k projects onto the null space of all tasks down to k; the last null space is spent on u0
(Maciejewski & Klein 1985; Nakamura, Hanafusa & Yoshikawa 1987; Siciliano & Slotine 1991). P_k = Z_k Z_k^T with an
orthonormal basis Z_k, and (A_k P)# = Z (A_k Z)#: no projector is ever multiplied up, so none leaks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import numerical_rank, round_off, scale, svd
from cartctl.checks import FloatArray
from cartctl.solvers.base import Answer
from cartctl.solvers.policy import PolicySolver


@dataclass(frozen=True)
class TaskPriority(PolicySolver):
    """Strict priorities: each equation is met as well as the null space of those above it allows.

    policy: what becomes of small singular values; its cutoffs refer to each task's own matrix.
    """

    name: ClassVar[str] = "task-priority"
    honours: ClassVar[frozenset[str]] = frozenset({"reference"})

    def _impl(self, systems: list[tuple[FloatArray, FloatArray]], problem: Problem, u0: FloatArray | None) -> Answer:
        n = problem.n
        u = np.zeros(n)
        Z: FloatArray | None = None  # (n, r), None for the identity
        lost_rank = False
        for A, c in systems:
            AZ = A if Z is None else np.asfortranarray(A @ Z)
            free = AZ.shape[1]
            if free == 0:
                break
            decomposition = svd(AZ)
            size = scale(A)
            step = self.policy.solve(decomposition, c - A @ u, size)
            u = u + (step if Z is None else Z @ step)
            lost_rank |= self.policy.rank(decomposition.s, size) < min(AZ.shape)
            rest = decomposition.Vt[numerical_rank(decomposition.s, round_off(A)) :].T
            Z = rest if Z is None else Z @ rest
        if u0 is not None and (Z is None or Z.shape[1]):
            rest_of_u0 = u0 - u if Z is None else Z @ (Z.T @ (u0 - u))
            u = u + rest_of_u0
        return Answer(u, lost_rank)
