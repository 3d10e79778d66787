"""Selectively damped: each singular direction is clamped by how far it would move the joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cartctl import checks
from cartctl.algebra.inverses.base import InversePolicy
from cartctl.algebra.svd import SVD, numerical_rank
from cartctl.checks import FloatArray


@dataclass(frozen=True, slots=True)
class SelectivelyDamped(InversePolicy):
    """``y = clamp(sum_i clamp(v_i (u_i^T b) / sigma_i, gamma_i), limit)`` (Buss & Kim 2005).

    ``gamma_i = limit min(1, N_i / M_i)`` with ``M_i = sum_j |v_ji| ||a_j|| / sigma_i``, a_j the columns of A: how much
    the joints would move the task if each moved by itself, over how much direction i moves it, N_i = ||u_i|| = 1.
    ``clamp(x, g)`` shortens x until its largest entry is g. The right-hand side decides: a command that asks nothing of
    a small direction is not damped.

    limit: gamma_max > 0, the largest entry of the answer, in its units (rad/s at the velocity level).
    """

    limit: float = np.pi

    def __post_init__(self) -> None:
        object.__setattr__(self, "limit", checks.number("limit", self.limit, low=0.0, strict=True))

    def factors(self, s: FloatArray, scale: float) -> FloatArray:
        """1/sigma, 0 for a zero; the clamping depends on the right-hand side and is in :meth:`solve`."""
        return np.divide(1.0, s, out=np.zeros_like(s), where=s > self._floor(scale))

    def rank(self, s: FloatArray, scale: float) -> int:
        """How many singular values are above round-off."""
        return numerical_rank(s, self._floor(scale))

    def solve(self, svd: SVD, b: FloatArray, scale: float) -> FloatArray:
        """The clamped sum, (n,)."""
        U, s, Vt = svd
        k = s.shape[0]
        n = Vt.shape[1]
        rows = Vt[:k]
        kept = s > self._floor(scale)
        if not kept.any():
            return np.zeros(n)
        U, s, rows = U[:, kept], s[kept], rows[kept]
        columns = np.sqrt(((s[:, None] * rows) ** 2).sum(axis=0))  # ||a_j||
        reach = np.abs(rows) @ columns / s  # M_i >= 1
        gamma = self.limit * np.minimum(1.0, 1.0 / reach)
        steps = ((U.T @ b) / s)[:, None] * rows
        largest = np.abs(steps).max(axis=1)
        shortened = np.minimum(1.0, np.divide(gamma, largest, out=np.ones_like(gamma), where=largest > 0.0))
        total = shortened @ steps
        peak = float(np.abs(total).max())
        return total if peak <= self.limit else total * (self.limit / peak)  # type: ignore[no-any-return]

    @staticmethod
    def _floor(scale: float) -> float:
        return 1e-13 * scale
