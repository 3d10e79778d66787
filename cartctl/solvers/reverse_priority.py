"""Reverse priority: from the lowest task up, u_k = u_{k+1} + T_k (A_k T_k)# (b_k - d_k - A_k u_{k+1}).

T_k are the first m_k columns of pinv([A_k; ...; A_p]): corrections along them meet task k and disturb those below as
little as can be; u_{p+1} = 0, and u0 fills the null space of all tasks (Flacco & De Luca 2014). The task of highest
priority is corrected last, so it is met exactly wherever it can be, and an algorithmic singularity between lower tasks
does not touch it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cartctl.algebra.inverses import Truncated
from cartctl.algebra.nullspace import null_part
from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import ROUND_OFF, SVD, round_off, scale, singular_values, svd
from cartctl.checks import FloatArray
from cartctl.solvers.base import Answer, EquationSolver, System

_EXACT = Truncated(1e-13)


@dataclass(frozen=True)
class ReversePriority(EquationSolver):
    """The lowest task first; each higher one corrects it along directions that disturb those below least.

    cutoff: relative size below which singular values of the stacked tasks are left out, in [1e-13, 1).
    """

    name: ClassVar[str] = "reverse-priority"
    sources: ClassVar[tuple[str, ...]] = ("flacco2014",)
    honours: ClassVar[frozenset[str]] = frozenset({"reference"})
    cutoff: float = 1e-10

    def __post_init__(self) -> None:
        object.__setattr__(self, "cutoff", Truncated(self.cutoff).cutoff)

    def _impl(self, systems: list[System], problem: Problem, u0: FloatArray | None) -> Answer:
        n = problem.n
        policy = Truncated(self.cutoff)
        u = np.zeros(n)
        below = np.zeros((0, n))
        size = 0.0
        lost_rank = False
        for A, c, ratio in reversed(systems):
            m = A.shape[0]
            below = np.asfortranarray(np.concatenate([A, below]))
            if m == 0:
                continue
            own = singular_values(np.asfortranarray(A))
            lost_rank |= policy.rank(own, ratio * scale(A)) < min(A.shape)
            stacked = svd(below)
            size = max(size, ratio * scale(A), scale(below))
            T = _first_columns(stacked, m, policy.factors(stacked.s, size))
            # the round-off of A T is that of its factors, whatever their units
            correction = _EXACT.solve(svd(np.asfortranarray(A @ T)), c - A @ u, scale(A) * scale(T))
            u = u + T @ correction
        if u0 is not None:
            u = u + null_part(svd(below), max(round_off(below), ROUND_OFF * n * size), u0)
        return Answer(u, lost_rank)


def _first_columns(decomposition: SVD, m: int, phi: FloatArray) -> FloatArray:
    """The first m columns of the inverse with filter factors phi, (n, m)."""
    k = phi.shape[0]
    return (decomposition.Vt[:k].T * phi) @ decomposition.U[:m].T  # type: ignore[no-any-return]
