"""Selectively damped: each singular direction is clamped by how far it would move the joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cartctl import checks
from cartctl.algebra.inverses.base import InversePolicy
from cartctl.algebra.svd import SVD, numerical_rank
from cartctl.checks import FloatArray
from cartctl.kernels import kernel


@dataclass(frozen=True, slots=True)
class SelectivelyDamped(InversePolicy):
    """``y = clamp(sum_i clamp(v_i (u_i^T b) / sigma_i, gamma_i), limit)`` (Buss & Kim 2005).

    ``gamma_i = limit min(1, N_i / M_i)`` with ``M_i = sum_j |v_ji| ||a_j|| / sigma_i``, a_j the columns of A: how much
    the joints would move the task if each moved by itself, over how much direction i moves it, N_i = ||u_i|| = 1.
    ``clamp(x, g)`` shortens x until its largest entry is g. The right-hand side decides: a command that asks nothing of
    a small direction is not damped.

    limit: gamma_max > 0, the largest entry of the answer, in its units (rad/s at the velocity level); where the problem
    has a metric W = L L^T, of L^T u.
    """

    sources: ClassVar[tuple[str, ...]] = ("buss2005",)
    linear: ClassVar[bool] = False
    limit: float = np.pi

    def prepare(self) -> None:
        """Compile the clamped sum, or fetch it from its cache."""
        _ = clamped_sum.compiled

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
        y = np.empty(svd.Vt.shape[1])
        clamped_sum.compiled(svd.U, svd.s, svd.Vt, b, self.limit, self._floor(scale), y)
        return y

    @staticmethod
    def _floor(scale: float) -> float:
        return 1e-13 * scale


@kernel("void(matrix, vector, matrix, vector, float, float, out_vector)")
def clamped_sum(
    U: FloatArray, s: FloatArray, Vt: FloatArray, b: FloatArray, limit: float, floor: float, y: FloatArray
) -> None:
    """Fill y (n,) with the clamped sum of :class:`SelectivelyDamped`; singular values below ``floor`` are left out."""
    k, n = s.shape[0], Vt.shape[1]
    columns = np.zeros(n)  # ||a_j|| / sigma_1, whose squares neither over- nor underflow
    if k == 0 or not s[0] > floor:
        y[:] = 0.0
        return
    for j in range(n):
        y[j] = 0.0
        total = 0.0
        for i in range(k):
            total += (s[i] / s[0] * Vt[i, j]) ** 2
        columns[j] = np.sqrt(total)
    for i in range(k):
        if not s[i] > floor:
            continue
        reach, largest, along = 0.0, 0.0, 0.0
        for j in range(n):
            reach += abs(Vt[i, j]) * columns[j]
            largest = max(largest, abs(Vt[i, j]))
        for r in range(b.shape[0]):
            along += U[r, i] * b[r]
        along /= s[i]
        gamma = limit * min(1.0, s[i] / s[0] / reach)
        if abs(along) * largest > gamma:
            along *= gamma / (abs(along) * largest)
        for j in range(n):
            y[j] += along * Vt[i, j]
    peak = 0.0
    for j in range(n):
        peak = max(peak, abs(y[j]))
    if peak > limit:
        for j in range(n):
            y[j] *= limit / peak
