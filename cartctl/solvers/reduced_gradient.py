"""Reduced gradient: u = [A_a^-1; 0] (b - d) + [-A_a^-1 A_b; I] [-(A_a^-1 A_b)^T  I] u0, in permuted order.

The columns are split so that A_a is the m x m minor with the largest |det|; the other joints descend the objective
restricted to the task (De Luca & Oriolo 1991). The minor is found by trying all where there are few, beyond that by
QR with column pivoting: another minor, but one that is nonsingular whenever rank A = m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from math import comb
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from cartctl.algebra.inverses import Truncated
from cartctl.algebra.nullspace import null_part
from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import round_off, scale, svd
from cartctl.checks import FloatArray
from cartctl.solvers.base import Answer, EquationSolver, System, stack

_SINGULAR = 1e-10  # relative to the task's own matrix, as the truncated inverse has it
_FEW = 210  # minors worth trying one by one: all of n <= 9


@dataclass(frozen=True)
class ReducedGradient(EquationSolver):
    """m joints do the task, the other n - m descend the objective, with the gradient reduced to the task.

    Stacks all equations; takes no metric, for its split of the joints has none. Where rank A < m the answer is the
    projected gradient's and the status SINGULAR.
    """

    stacks: ClassVar[bool] = True
    name: ClassVar[str] = "reduced-gradient"
    sources: ClassVar[tuple[str, ...]] = ("deluca1991",)
    honours: ClassVar[frozenset[str]] = frozenset({"reference"})

    @property
    def takes_metric(self) -> bool:
        """No: the split of the joints has none."""
        return False

    def _impl(self, systems: list[System], problem: Problem, u0: FloatArray | None) -> Answer:
        A, c, ratio = stack(systems, problem.equations)
        m, n = A.shape
        if m == 0:
            return Answer(np.zeros(n) if u0 is None else u0.copy(), False)
        chosen = best_minor(A, max(ratio * round_off(A), _SINGULAR * ratio * scale(A))) if m <= n else None
        if chosen is None:
            return self._without_minor(System(A, c, ratio), u0)
        others = np.ones(n, dtype=bool)
        others[chosen] = False
        rest = np.flatnonzero(others)
        factor, pivots, _ = lapack.dgetrf(A[:, chosen])
        u = np.zeros(n)
        if u0 is None or rest.shape[0] == 0:
            u[chosen] = lapack.dgetrs(factor, pivots, c)[0]
            return Answer(u, False)
        slope = lapack.dgetrs(factor, pivots, A[:, rest])[0]  # A_a^-1 A_b
        u[rest] = u0[rest] - slope.T @ u0[chosen]
        u[chosen] = lapack.dgetrs(factor, pivots, c)[0] - slope @ u[rest]
        return Answer(u, False)

    @staticmethod
    def _without_minor(system: System, u0: FloatArray | None) -> Answer:
        A, c, ratio = system
        decomposition = svd(A)
        u = Truncated().solve(decomposition, c, ratio * scale(A))
        if u0 is not None:
            u = u + null_part(decomposition, ratio * round_off(A), u0)
        return Answer(u, Truncated().rank(decomposition.s, ratio * scale(A)) < min(A.shape))


def best_minor(A: FloatArray, floor: float | None = None) -> NDArray[np.intp] | None:
    """The m columns of A (m, n) whose minor has the largest |det|, sorted; None where rank A < m.

    floor: what counts as zero; round-off if None.
    """
    m, n = A.shape
    factor, pivots, _, _, info = lapack.dgeqp3(A)
    diagonal = np.abs(factor.diagonal()[:m])
    if info != 0 or not diagonal[-1] > (round_off(A) if floor is None else floor):
        return None
    if n == m + 1:  # the minor without joint j is proportional to entry j of the null vector
        along, _ = lapack.dtrtrs(factor[:, :m], factor[:, m:])
        left_out = m if float(np.abs(along).max()) <= 1.0 else int(np.abs(along).argmax())
        return np.sort(np.delete(pivots, left_out) - 1).astype(np.intp)
    if comb(n, m) > _FEW:
        return np.sort(pivots[:m] - 1).astype(np.intp)
    choices = _choices(n, m)
    determinants = np.abs(np.linalg.det(A[:, choices].transpose(1, 0, 2) / scale(A)))
    return choices[int(np.argmax(determinants))]  # type: ignore[no-any-return]


@lru_cache(maxsize=64)
def _choices(n: int, m: int) -> NDArray[np.intp]:
    return np.array(list(combinations(range(n), m)), dtype=np.intp)
