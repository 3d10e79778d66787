"""Checking multipliers against a claim, by nothing but sums over the problem's own rows.

Every level of a prioritised problem has a vector z over its equation rows, joints and constraint rows for which
``sum_r z_r a_r + z_box + C^T z_C`` cancels (at the last level: equals W (u - u0)). With z_i >= 0 only where a lower
bound is attained and z_i <= 0 only at an upper one, any feasible u', s' obeys

    h(s') = sum_r z_r rhs_r(s') + sum_i z_i bound_i <= 0,    rhs = s b - d,

which is Farkas' lemma: with slope h1 > 0 no s can exceed -h0 / h1, and where h > 0 on all of [0, 1] none is feasible.
Of a fitted level z holds minus the misses on its own rows, and the same cancellation is its stationarity.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import kernel, part

SCALED, FITTED, INTERVAL = 0, 1, 2
PRIMAL, DUAL, GAP = 0, 1, 2

_NOISE = 1e-12  # of the largest multiplier
_CLEAR = 1e-14  # of the terms of h: a sum this small has no sign
_MISSED = 1e-10  # relative: an interval missed by less is met
_TINY = 1e-290  # numbers below this have too few digits left to be judged by
_LAST_BITS = 1e-14  # relative: a miss this small is round-off
_GROUND = 1e-5  # of the largest bound: a u smaller than this is judged as if it were this large
_COARSE = 1e-4  # of u and u0: steps below this are judged as if they were this large
_SUGGESTED = 1e-5  # of the size that commands alone suggest: the round-off of those that cancel is relative to it
_MET = 1e-3  # of the rows of a fitted level: misses below this, too


@kernel(
    "void(matrix, vector, vector, ints, ints, vector, vector, vector, matrix, vector, vector, vector, float, float, "
    "vector, vector, out_matrix, out_matrix)",
    fast=True,
)
def check_proofs(
    A: FloatArray,
    b: FloatArray,
    d: FloatArray,
    sizes: NDArray[np.int64],
    fits: NDArray[np.int64],
    natural: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    C: FloatArray,
    c_lower: FloatArray,
    c_upper: FloatArray,
    force: FloatArray,
    pull: float,
    reach: float,
    u: FloatArray,
    scales: FloatArray,
    z: FloatArray,
    residuals: FloatArray,
) -> None:
    """Fill residuals (p + 1, 3) with primal, dual and gap of every level, from multipliers z (p + 1, M + n + r).

    force: W (u - u0), (n,); pull, reach: the size of the terms in it, and of u and u0. Bounds may be empty. z is
    completed by the misses and by earlier levels: a multiple of what cancels anyway turns the sign of an inequality
    that such a level made an equality. Rows of later and of skipped levels prove nothing.
    """
    n, M, r, p = u.shape[0], A.shape[0], C.shape[0], sizes.shape[0]
    x, low, high, span = np.empty(M + n + r), np.empty(M + n + r), np.empty(M + n + r), np.ones(M + n + r)
    given, missed = np.zeros(M + n + r), np.zeros(M + n + r)
    level = np.empty(M + n + r, np.int64)
    holder = np.full(M + n + r, p)  # the first level whose proof needs a row
    rows = (A, b, d, sizes, fits, natural, lower, upper, C, c_lower, c_upper)
    ground = _GROUND * max(_farthest(lower), _farthest(upper), _farthest_row(C, c_lower, c_upper))
    least = ground * (pull / reach if reach > 0.0 else 1.0)  # forces below this are none
    if 0.0 < reach < ground:
        pull, reach = least, ground
    size = _rows(*rows, u, reach, scales, x, low, high, span, level, missed)
    for i in range(M):
        given[i] = abs(b[i]) + (abs(d[i]) if d.shape[0] > 0 else 0.0)
    for k in range(p + 1):
        own = z[k]
        for i in range(M + n + r):
            at = level[i]
            if at > k or (0 <= at < k and scales[at] != scales[at]):
                own[i] = 0.0
        if k < p and fits[k] != SCALED:
            for i in range(M + n + r):
                if level[i] == k:
                    own[i] -= missed[i]
        if k < p and scales[k] == scales[k]:
            weight = _weight(x, low, high, span, level, k, size) if fits[k] != SCALED else 0.0
            _hold(own, holder, k, span, weight)
        added = 0.0
        for j in range(k - 1, -1, -1):
            if scales[j] == scales[j]:
                added = max(added, _turn(own, z[j], x, low, high, level, holder, j, span))
        rest, terms = _stationarity(A, C, own, span, n, force, k == p)
        terms = max(terms, added)
        slack, value, slope, total, unsure = _value(own, x, low, high, level, fits, b, k, span)
        if k == p:
            terms = max(terms, _COARSE * pull, least, _SUGGESTED * size * (pull / reach if reach > 0.0 else 1.0))
        elif fits[k] != SCALED:
            terms = max(terms, _MET * _weight(x, low, high, span, level, k, size))
        residuals[k, DUAL] = rest / terms if terms > _TINY else 0.0
        residuals[k, PRIMAL] = 0.0  # a fitted or skipped level promises nothing of its own rows
        if k == p or (fits[k] == SCALED and scales[k] == scales[k]):
            residuals[k, PRIMAL] = _primal(x, low, high, span, level, given, k, p, size)
        residuals[k, GAP] = 0.0
        if k == p or fits[k] != SCALED:
            residuals[k, GAP] = slack / (terms * size) if terms * size > 0.0 else 0.0
        elif scales[k] != scales[k]:
            at_zero = value - slope
            margin = min(value, at_zero)
            residuals[k, GAP] = 0.0 if margin > _CLEAR * total + unsure else 1.0
        elif scales[k] < 1.0:
            # h is known no better than what does not cancel, times u
            residuals[k, GAP] = max(abs(value) - n * rest * size, 0.0) / slope if slope > 0.0 else np.inf


@part
def _farthest(bounds: FloatArray) -> float:
    """The largest finite bound."""
    largest = 0.0
    for i in range(bounds.shape[0]):
        if abs(bounds[i]) < np.inf:
            largest = max(largest, abs(bounds[i]))
    return largest


@part
def _farthest_row(C: FloatArray, c_lower: FloatArray, c_upper: FloatArray) -> float:
    """The largest finite bound of a row, in units of u."""
    largest = 0.0
    for i in range(C.shape[0]):
        norm = np.sqrt(np.sum(C[i] ** 2))
        for side in (c_lower[i], c_upper[i]):
            if norm > 0.0 and abs(side) < np.inf:
                largest = max(largest, abs(side) / norm)
    return largest


@part
def _rows(
    A: FloatArray,
    b: FloatArray,
    d: FloatArray,
    sizes: NDArray[np.int64],
    fits: NDArray[np.int64],
    natural: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    C: FloatArray,
    c_lower: FloatArray,
    c_upper: FloatArray,
    u: FloatArray,
    size: float,
    scales: FloatArray,
    x: FloatArray,
    low: FloatArray,
    high: FloatArray,
    span: FloatArray,
    level: NDArray[np.int64],
    missed: FloatArray,
) -> float:
    """Value, interval, span, level (-1: hard) and miss of every row; the size of u, at least the given one.

    A skipped level asks for what it asks at s = 1. The span of a row is its norm, of an equation the largest of its
    task: a row that is nothing beside the others is zero.
    """
    n, M, r, p = u.shape[0], A.shape[0], C.shape[0], sizes.shape[0]
    for i in range(n):
        x[M + i], level[M + i] = u[i], -1
        low[M + i] = lower[i] if lower.shape[0] > 0 else -np.inf
        high[M + i] = upper[i] if upper.shape[0] > 0 else np.inf
    for i in range(M + r):
        t, length = 0.0, 0.0
        for k in range(n):
            entry = A[i, k] if i < M else C[i - M, k]
            t += entry * u[k]
            length += entry * entry
        at = i if i < M else i + n
        x[at], span[at], level[at] = t, np.sqrt(length), -1
        if i >= M:
            low[at], high[at] = c_lower[i - M], c_upper[i - M]
    rest = 0
    for k in range(p):
        rest += sizes[k] if fits[k] == INTERVAL else 0
    row, soft = 0, M + n + r - rest
    for k in range(p):
        if fits[k] == INTERVAL:
            for i in range(soft, soft + sizes[k]):
                level[i] = k
            soft += sizes[k]
            continue
        s = 1.0 if fits[k] == FITTED or scales[k] != scales[k] else scales[k]
        widest, command = natural[k], 0.0
        for i in range(row, row + sizes[k]):
            level[i] = k
            low[i] = s * b[i] - (d[i] if d.shape[0] > 0 else 0.0)
            high[i] = low[i]
            widest, command = max(widest, span[i]), max(command, abs(b[i]), abs(low[i]))
        for i in range(row, row + sizes[k]):
            span[i] = widest
        if widest > 0.0:
            size = max(size, 1e-2 * command / widest)
        row += sizes[k]
    for i in range(M + n + r):
        missed[i] = min(x[i] - low[i], 0.0) + max(x[i] - high[i], 0.0)
        if abs(missed[i]) <= _LAST_BITS * (span[i] * size + abs(x[i])):
            missed[i] = 0.0
    for i in range(M + n + r - rest, M + n + r):
        miss = _MISSED * (span[i] * size + abs(x[i]))
        if low[i] - miss <= x[i] <= high[i] + miss:
            low[i], high[i] = min(low[i], x[i]), max(high[i], x[i])
    return size


@part
def _equality(level: int, k: int, x: float, low: float, high: float) -> bool:
    """Whether a row is an equality for level k: of a level above that is one, or that could not be met."""
    return low == high or (0 <= level < k and (x < low or x > high))


@part
def _turn(
    own: FloatArray,
    earlier: FloatArray,
    x: FloatArray,
    low: FloatArray,
    high: FloatArray,
    level: NDArray[np.int64],
    holder: NDArray[np.int64],
    j: int,
    span: FloatArray,
) -> float:
    """Add so much of what cancels at level j that the inequalities it holds have the sign of the bound they are at.

    The largest term of what was added to: sums of it cancel no further than to its round-off.
    """
    share, most = 0.0, _largest(own, span)
    for i in range(x.shape[0]):
        if holder[i] != j or abs(own[i]) * span[i] <= _NOISE * most:
            continue
        if _equality(level[i], j, x[i], low[i], high[i]):
            continue
        sign = 1.0 if x[i] - low[i] < high[i] - x[i] else -1.0
        if sign * own[i] < 0.0 and sign * earlier[i] > 0.0:
            share = max(share, -own[i] / earlier[i])
    if share == 0.0:
        return 0.0
    for i in range(x.shape[0]):
        own[i] += share * earlier[i]
    return most


@part
def _hold(own: FloatArray, holder: NDArray[np.int64], k: int, span: FloatArray, weight: float) -> None:
    """Level k holds what its proof needs, by more than round-off, and no level above it does."""
    most = max(_largest(own, span), weight)
    for i in range(own.shape[0]):
        if holder[i] > k and abs(own[i]) * span[i] > _NOISE * most:
            holder[i] = k


@part
def _largest(z: FloatArray, span: FloatArray) -> float:
    """The largest term of a sum."""
    largest = 0.0
    for i in range(z.shape[0]):
        largest = max(largest, abs(z[i]) * span[i])
    return largest


@part
def _stationarity(
    A: FloatArray, C: FloatArray, own: FloatArray, span: FloatArray, n: int, force: FloatArray, last: bool
) -> tuple[float, float]:
    """What does not cancel, and the size of the terms."""
    M = A.shape[0]
    rest, terms = 0.0, 0.0
    for k in range(n):
        t = own[M + k]
        for i in range(M):
            t += own[i] * A[i, k]
        for i in range(C.shape[0]):
            t += own[M + n + i] * C[i, k]
        if last:
            t -= force[k]
            terms = max(terms, abs(force[k]))
        rest = max(rest, abs(t))
    return rest, max(terms, _largest(own, span))


@part
def _weight(
    x: FloatArray, low: FloatArray, high: FloatArray, span: FloatArray, level: NDArray[np.int64], k: int, size: float
) -> float:
    """The size of the gradient's terms if a level's rows were missed by all they are."""
    largest = 0.0
    for i in range(x.shape[0]):
        if level[i] == k:
            largest = max(largest, span[i] * max(abs(x[i]), span[i] * size))
            for side in (low[i], high[i]):
                if abs(side) < np.inf:
                    largest = max(largest, span[i] * abs(side))
    return largest


@part
def _value(
    own: FloatArray,
    x: FloatArray,
    low: FloatArray,
    high: FloatArray,
    level: NDArray[np.int64],
    fits: NDArray[np.int64],
    b: FloatArray,
    k: int,
    span: FloatArray,
) -> tuple[float, float, float, float, float]:
    """Complementarity ``sum |z_i| slack_i``, h at the present scale (1 if skipped), its slope and terms.

    Last, what of h is due to rows of scaled levels above that are met only so well.
    """
    slack, value, slope, total, unsure, most = 0.0, 0.0, 0.0, 0.0, 0.0, _largest(own, span)
    for i in range(x.shape[0]):
        if own[i] == 0.0:
            continue
        if level[i] == k and i < b.shape[0]:
            slope += own[i] * b[i]
            value += own[i] * low[i]
            total += abs(own[i]) * max(abs(b[i]), abs(low[i]))
            continue
        if _equality(level[i], k, x[i], low[i], high[i]):
            side = low[i] if level[i] < 0 else x[i]
            value += own[i] * side
            total += abs(own[i] * side)
            if level[i] >= 0 and fits[level[i]] == SCALED:
                unsure += abs(own[i] * (x[i] - low[i]))
            continue
        if level[i] == k:
            continue
        bound = low[i] if own[i] > 0.0 else high[i]
        if abs(bound) == np.inf:
            if abs(own[i]) * span[i] > _NOISE * most:
                slack, value = np.inf, -np.inf
            continue
        slack += abs(own[i] * (x[i] - bound))
        value += own[i] * bound
        total += abs(own[i] * bound)
    return slack, value, slope, total, unsure


@part
def _primal(
    x: FloatArray,
    low: FloatArray,
    high: FloatArray,
    span: FloatArray,
    level: NDArray[np.int64],
    given: FloatArray,
    k: int,
    p: int,
    size: float,
) -> float:
    """What the rows of level k miss (at the last level the hard ones), relative to their size."""
    worst = 0.0
    wanted = -1 if k == p else k
    for i in range(x.shape[0]):
        if level[i] == wanted:
            miss = max(max(low[i] - x[i], x[i] - high[i]), 0.0)
            if miss > 0.0:
                worst = max(worst, miss / (span[i] * size + abs(x[i]) + given[i]))
    return worst
