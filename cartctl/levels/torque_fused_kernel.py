"""The torque level and the exact engine in one call: the level's kernel, u0, the engine, and whether its rows hold.

Crossing from Python into compiled code costs as much for each array as a row of arithmetic, and the general way crosses
three times with some thirty of them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import kernel, part
from cartctl.levels.midway import NEAR, near
from cartctl.levels.torque_kernel import through_inertia
from cartctl.levels.torque_reference import FIRM, STIFF, STIFFEST
from cartctl.levels.yielding import misses
from cartctl.solvers.exact.kinds import LOST_RANK
from cartctl.solvers.exact.lexicographic import lexicographic

LEFT = 1 << 20  # beside the engine's flags: the answer is left to the general way
CLOSE = 1 << 21  # near a bound on an acceleration
_LARGE = 1e150  # squares of what is below are finite


@part
def _by_nature(
    J: FloatArray, A: FloatArray, levels: NDArray[np.int64], natural: FloatArray, through: FloatArray
) -> None:
    """The norms by nature of ``A = J M^-1``: those of J, times how much larger A is."""
    row = 0
    for k in range(natural.shape[0]):
        before = after = 0.0
        for i in range(row, row + levels[k]):
            for j in range(J.shape[1]):
                before += J[i, j] * J[i, j]
                after += A[i, j] * A[i, j]
        row += levels[k]
        through[k] = natural[k] * math.sqrt(after / before) if before > 0.0 else natural[k]


@kernel(
    "int(matrix, vector, vector, matrix, vector, vector, vector, vector, vector, ints, vector, vector, vector, matrix, "
    "bool, vector, vector, matrix, ints, out_matrix, out_matrix, out_ints)",
    fast=True,
)
def torque_sns(
    M: FloatArray,
    h: FloatArray,
    v: FloatArray,
    J: FloatArray,
    drift: FloatArray,
    error: FloatArray,
    rate: FloatArray,
    acceleration: FloatArray,
    gains: FloatArray,
    levels: NDArray[np.int64],
    natural: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    torque: FloatArray,
    drawn: bool,
    damping: FloatArray,
    pull: FloatArray,
    none: FloatArray,
    start: NDArray[np.int64],
    rows: FloatArray,
    sides: FloatArray,
    active: NDArray[np.int64],
) -> int:
    """The engine's flags, CLOSE among them, or LEFT where something is out of the ordinary.

    gains: k, (1,) or of each row. levels: (2 p,), the rows of each task, then their kinds. natural: (p,), the norm of
    each task's J by nature, 0 where it speaks for itself. torque: the box (2, n), or (2, 0). drawn: whether there is a
    u0 = h - D v + pull; damping: D, or empty for that of the inertia; pull: (n,), or empty. none: (1, 0).
    rows: (m + r + 2, n), those of :func:`through_inertia`, u0, u. sides: (4, m + r), its sides, the scales, the norms
    of ``J M^-1`` by nature.
    """
    m, n = J.shape
    p, r = natural.shape[0], lower.shape[0]
    A, C = rows[:m], rows[m : m + r]
    gain = gains[0] if gains.shape[0] == 1 else 0.0
    each = gains if gains.shape[0] > 1 else none[0]
    known = (lower, upper, rows[: m + r], sides[:2])
    if not through_inertia(M, h, v, J, drift, error, rate, acceleration, gain, each, *known):
        return LEFT
    u0, u = rows[m + r], rows[m + r + 1]
    total = 0.0
    for i in range(m):
        total += sides[0, i] * sides[0, i] + sides[1, i] * sides[1, i]
    if drawn:
        for i in range(n):
            if damping.shape[0] > 0:
                D = damping[i]
            else:
                D = min(FIRM + STIFF * M[i, i], STIFFEST * M[i, i])
            u0[i] = D * -v[i]
            if pull.shape[0] > 0:
                u0[i] += pull[i]
            u0[i] += h[i]
            total += abs(u0[i])
    if not total < _LARGE:  # the general way says what it is that is not finite
        return LEFT
    _by_nature(J, A, levels, natural, sides[3])
    flags = lexicographic(
        A,
        sides[0, :m],
        sides[1, :m],
        levels[:p],
        levels[p:],
        sides[3, :p],
        torque[0],
        torque[1],
        C,
        sides[0, m : m + r],
        sides[1, m : m + r],
        u0 if drawn else none[0],
        start,
        u,
        sides[2, :p],
        active,
        sides[:0, :0],
    )
    if flags & ~LOST_RANK:
        return LEFT
    for k in range(p):
        if not sides[2, k] >= 0.0:  # a task with no feasible scale
            return LEFT
    for j in range(n):
        if not abs(u[j]) < _LARGE:
            return LEFT
    if r > 0 and misses(C, sides[0, m : m + r], sides[1, m : m + r], u):
        return LEFT
    if r > 0 and near(C, sides[0, m : m + r], sides[1, m : m + r], u, r, NEAR):
        return flags | CLOSE
    return flags
