"""Inverse policies: what an SVD-based method does with small singular values.

A policy maps an SVD ``A = U diag(s) V^T`` and a right-hand side b to ``y = V diag(phi(s)) U^T b``; it is a
choice of the filter factors phi. Null-space projectors never use it: they are truncated at round-off
(:mod:`cartctl.algebra.nullspace`), for a damped projector leaks into the task.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from cartctl.algebra.svd import SVD
from cartctl.checks import FloatArray

_SQUARABLE = 1e150
NOISE = 1e-13  # singular values below this, relative to the task's own matrix, are round-off


class InversePolicy(ABC):
    """A choice of filter factors phi(sigma), applied to one right-hand side.

    damps: whether a policy holds back directions that it could invert. linear: whether its answer is linear in b.
    """

    damps: ClassVar[bool] = True
    linear: ClassVar[bool] = True
    sources: ClassVar[tuple[str, ...]] = ()  # what ``cc.cite`` prints: keys of its file, or BibTeX

    def prepare(self) -> None:
        """Compile what the first solve would otherwise wait for; nothing, unless a policy has a kernel."""
        return

    @abstractmethod
    def factors(self, s: FloatArray, scale: float) -> FloatArray:
        """phi(s), (k,), for singular values s (k,) descending.

        scale: the Frobenius norm of the task's own matrix, before any projection; relative cutoffs refer to it,
        so that a projected matrix that is zero up to round-off is never inverted.
        """

    @abstractmethod
    def rank(self, s: FloatArray, scale: float) -> int:
        """How many of the singular values s the policy inverts in earnest."""

    def solve(self, svd: SVD, b: FloatArray, scale: float) -> FloatArray:
        """``V diag(phi) U^T b``, (n,)."""
        k = svd.s.shape[0]
        return svd.Vt[:k].T @ (self.factors(svd.s, scale) * (svd.U.T @ b))  # type: ignore[no-any-return]


def damped_factors(s: FloatArray, squared: FloatArray | float, scale: float) -> FloatArray:
    """``sigma / (sigma^2 + squared)``, (k,); 0 where sigma is round-off of a matrix of norm ``scale``."""
    if s.shape[0] and s[-1] > NOISE * scale and s[0] < _SQUARABLE:
        return s / (s * s + squared)
    phi = np.zeros_like(s)
    kept = s > NOISE * scale
    with np.errstate(over="ignore"):
        phi[kept] = 1.0 / (s + np.divide(squared, s, out=np.zeros_like(s), where=kept))[kept]  # s * s may overflow
    return phi
