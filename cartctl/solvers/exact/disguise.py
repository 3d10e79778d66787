"""The same problem with its joints and rows in another order and u in another unit: another way to the same optimum.

The last of the ways give the inequalities a little room, less than anyone would call a violation, so that what is
feasible at one point only is not taken for impossible.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import part
from cartctl.solvers.exact.kinds import INTERVAL

_UNIT = 1.2345  # no power of two: it changes every last digit
_CLOSE = 8  # the first way that gives room
_ROOM = 1e-12  # relative


class Given(NamedTuple):
    """The engine's arguments up to the reference."""

    A: FloatArray
    b: FloatArray
    d: FloatArray
    sizes: NDArray[np.int64]
    fits: NDArray[np.int64]
    natural: FloatArray
    lower: FloatArray
    upper: FloatArray
    C: FloatArray
    c_lower: FloatArray
    c_upper: FloatArray
    reference: FloatArray


class Order(NamedTuple):
    """Which joint, equation row and row of C stands where, the unit of u, the room given."""

    joints: NDArray[np.int64]
    rows: NDArray[np.int64]
    others: NDArray[np.int64]
    unit: float
    room: float


@part
def order_of(m: Given, n: int, way: int) -> Order:
    """The order of a way, always the same one; of way -1 the given order."""
    joints, rows, others = np.arange(n), np.arange(m.A.shape[0]), np.arange(m.C.shape[0])
    if way < 0:
        return Order(joints, rows, others, 1.0, 0.0)
    state = 7919 * (way + 1)
    state = _shuffle(joints, 0, n, state)
    hard = m.C.shape[0]
    for k in range(m.sizes.shape[0]):
        hard -= m.sizes[k] if m.fits[k] == INTERVAL else 0
    state = _shuffle(others, 0, hard, state)
    row, soft = 0, hard
    for k in range(m.sizes.shape[0]):
        if m.fits[k] == INTERVAL:
            state = _shuffle(others, soft, soft + m.sizes[k], state)
            soft += m.sizes[k]
        else:
            state = _shuffle(rows, row, row + m.sizes[k], state)
            row += m.sizes[k]
    return Order(joints, rows, others, _UNIT if way % 2 == 1 else 1.0, _ROOM if way >= _CLOSE else 0.0)


@part
def _shuffle(order: NDArray[np.int64], first: int, last: int, state: int) -> int:
    """Fisher & Yates on entries first..last, by a linear congruence."""
    for i in range(last - 1, first, -1):
        state = (1103515245 * state + 12345) % 2147483648
        j = first + (state >> 8) % (i - first + 1)
        order[i], order[j] = order[j], order[i]
    return state


@part
def disguised(m: Given, order: Order) -> Given:
    """The problem in that order, of ``u / unit``."""
    joints, rows, others, unit, room = order
    M, r, n = m.A.shape[0], m.C.shape[0], joints.shape[0]
    A, C = np.empty((M, n)), np.empty((r, n))
    b, d = np.empty(M), np.empty(M if m.d.shape[0] > 0 else 0)
    c_lower, c_upper = np.empty(r), np.empty(r)
    lower, upper = np.empty(m.lower.shape[0]), np.empty(m.upper.shape[0])
    reference = np.empty(m.reference.shape[0])
    for i in range(M):
        for k in range(n):
            A[i, k] = m.A[rows[i], joints[k]]
        b[i] = m.b[rows[i]] / unit
        if d.shape[0] > 0:
            d[i] = m.d[rows[i]] / unit
    for i in range(r):
        for k in range(n):
            C[i, k] = m.C[others[i], joints[k]]
        c_lower[i], c_upper[i] = _sides(m.c_lower[others[i]], m.c_upper[others[i]], unit, room)
    for k in range(n):
        low = m.lower[joints[k]] if lower.shape[0] > 0 else -np.inf
        high = m.upper[joints[k]] if upper.shape[0] > 0 else np.inf
        low, high = _sides(low, high, unit, room)
        if lower.shape[0] > 0:
            lower[k] = low
        if upper.shape[0] > 0:
            upper[k] = high
        if reference.shape[0] > 0:
            reference[k] = m.reference[joints[k]] / unit
    return Given(A, b, d, m.sizes, m.fits, m.natural, lower, upper, C, c_lower, c_upper, reference)


@part
def _sides(low: float, high: float, unit: float, room: float) -> tuple[float, float]:
    """An interval in that unit, with room; one of a single value keeps it."""
    if low == high or room == 0.0:  # and 0 times infinity is no number
        return low / unit, high / unit
    return (low - room * abs(low)) / unit, (high + room * abs(high)) / unit


@part
def unveiled(m: Given, order: Order, u: FloatArray, active: NDArray[np.int64], proofs: FloatArray) -> None:
    """The answer to the disguised problem in the order and unit of the given one, in place."""
    joints, rows, others, unit, _ = order
    M, n = m.A.shape[0], u.shape[0]
    v, z = u.copy(), proofs.copy()
    for k in range(n):
        x = unit * v[k]
        if m.lower.shape[0] > 0:
            x = max(x, m.lower[joints[k]])
        if m.upper.shape[0] > 0:
            x = min(x, m.upper[joints[k]])
        u[joints[k]] = x
    for k in range(proofs.shape[0]):
        for i in range(M):
            proofs[k, rows[i]] = unit * z[k, i]
        for i in range(n):
            proofs[k, M + joints[i]] = unit * z[k, M + i]
        for i in range(others.shape[0]):
            proofs[k, M + n + others[i]] = unit * z[k, M + n + i]
    for k in range(1, 1 + active[0]):
        i = active[k] >> 1
        at = joints[i] if i < n else n + others[i - n]
        active[k] = 2 * at + (active[k] & 1)
