"""The kernel of the torque level: everything that passes through ``M^-1``, by one Cholesky factor.

``M a + h = tau`` turns ``J a + J_dot v = s b`` into ``J M^-1 tau + (J_dot v - J M^-1 h) = s b`` and the bounds
``l <= a <= u`` into the rows ``l + M^-1 h <= M^-1 tau <= u + M^-1 h``.
"""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.kernels import kernel, part

_SINGULAR = 1e-15  # of a diagonal entry of M: a pivot that is round-off


@part
def factor(M: FloatArray, L: FloatArray) -> bool:
    """``M = L L^T``, L lower triangular with the inverse of each pivot in its place; whether M is definite."""
    n = M.shape[0]
    for j in range(n):
        pivot = M[j, j]
        for k in range(j):
            pivot -= L[j, k] * L[j, k]
        if not pivot > _SINGULAR * M[j, j]:
            return False
        inverse = 1.0 / np.sqrt(pivot)
        L[j, j] = inverse
        for i in range(j + 1, n):
            entry = M[i, j]
            for k in range(j):
                entry -= L[i, k] * L[j, k]
            L[i, j] = entry * inverse
    return True


@part
def solve(L: FloatArray, rows: FloatArray, i: int, first: int) -> None:
    """Replace row i by the x with ``L L^T x = row``; the row is zero before its entry ``first``."""
    n = L.shape[0]
    for j in range(first, n):
        entry = rows[i, j]
        for k in range(first, j):
            entry -= L[j, k] * rows[i, k]
        rows[i, j] = entry * L[j, j]
    for j in range(n - 1, -1, -1):
        entry = rows[i, j]
        for k in range(j + 1, n):
            entry -= L[k, j] * rows[i, k]
        rows[i, j] = entry * L[j, j]


@kernel(
    "bool(matrix, vector, vector, matrix, vector, vector, vector, vector, float, vector, vector, vector, out_matrix, "
    "out_matrix)",
    fast=True,
)
def through_inertia(
    M: FloatArray,
    h: FloatArray,
    v: FloatArray,
    J: FloatArray,
    drift: FloatArray,
    error: FloatArray,
    rate: FloatArray,
    acceleration: FloatArray,
    gain: float,
    gains: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    rows: FloatArray,
    sides: FloatArray,
) -> bool:
    """Fill rows (m + r, n) with ``J M^-1`` and, where there are bounds (r = n, else 0), ``M^-1``; sides (2, m + r).

    sides: of a task's row ``b = r_ddot + 2 k (r_dot - J v) + k^2 e`` and its drift, of a bound's row its two ends.
    rate, acceleration: (m,), or empty for zero. gains: k of each row, or empty where it is ``gain``. Whether M is
    definite.
    """
    m, n = J.shape
    L = np.empty((n, n))
    if not factor(M, L):
        return False
    for i in range(m):
        speed = 0.0
        for j in range(n):
            rows[i, j] = J[i, j]
            speed += J[i, j] * v[j]
        solve(L, rows, i, 0)
        known = 0.0
        for j in range(n):
            known += rows[i, j] * h[j]
        k = gains[i] if gains.shape[0] else gain
        asked = rate[i] if rate.shape[0] else 0.0
        b = k * (2.0 * (asked - speed) + k * error[i])
        sides[0, i] = b + acceleration[i] if acceleration.shape[0] else b
        sides[1, i] = drift[i] - known
    for i in range(rows.shape[0] - m):
        for j in range(n):
            rows[m + i, j] = 1.0 if i == j else 0.0
        solve(L, rows, m + i, i)
        known = 0.0
        for j in range(n):
            known += rows[m + i, j] * h[j]
        sides[0, m + i] = lower[i] + known
        sides[1, m + i] = upper[i] + known
    return True
