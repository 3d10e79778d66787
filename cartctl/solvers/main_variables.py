"""Main variables: u = A_r# (b - d)_r with r a largest set of independent rows; the others are dropped.

The elimination of a lecture's "main variables": where the rows of A depend on each other, keep rank(A) of them, chosen
by QR with pivoting (Businger & Golub 1965), and take their pseudo-inverse. On a consistent command the dropped rows
hold by themselves and the answer is the pseudo-inverse's; otherwise they are missed by what the residuals say, while
the kept ones are met.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import round_off, scale, svd
from cartctl.checks import FloatArray
from cartctl.solvers.base import Answer, System, stack
from cartctl.solvers.policy import PolicySolver

_DEPENDENT = 1e-10  # relative to the task's own matrix: a row that adds less than this depends on the others


@dataclass(frozen=True)
class MainVariables(PolicySolver):
    """The pseudo-inverse of a largest set of independent rows of all equations stacked.

    policy: what becomes of small singular values of the kept rows.
    """

    stacks: ClassVar[bool] = True
    name: ClassVar[str] = "main-variables"
    sources: ClassVar[tuple[str, ...]] = ("businger1965",)

    def _impl(self, systems: list[System], problem: Problem, u0: FloatArray | None) -> Answer:
        A, c, ratio = stack(systems, problem.equations)
        rows = main_rows(A, max(ratio * round_off(A), _DEPENDENT * ratio * scale(A)))
        kept = np.asfortranarray(A[rows])
        decomposition, size = svd(kept), ratio * scale(A)
        u = self.policy.solve(decomposition, c[rows], size)
        return Answer(u, self.policy.rank(decomposition.s, size) < min(A.shape))


def main_rows(A: FloatArray, floor: float | None = None) -> NDArray[np.intp]:
    """The numbers of rank(A) independent rows of A (m, n), ascending; below ``floor`` (round-off) they depend."""
    m, n = A.shape
    if m == 0 or n == 0:
        return np.zeros(0, dtype=np.intp)
    factor, pivots, _, _, _ = lapack.dgeqp3(A.T)
    rank = int((np.abs(factor.diagonal()) > (round_off(A) if floor is None else floor)).sum())
    return np.sort(pivots[:rank] - 1).astype(np.intp)
