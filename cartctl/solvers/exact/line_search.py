"""How far to go along a step: to the first inequality in the way, or to the lowest point of the misses."""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.kernels import part
from cartctl.solvers.exact.inequalities import OUT, Inequalities
from cartctl.solvers.exact.working_set import largest_entry

_ROUND_OFF = 1e-13  # of what a row's rate could be: entries of a step are no surer than its largest
_ALONG = 1e-12  # of the step: a component this small does not approach an inequality


@part
def blocked_at(q: Inequalities, u: FloatArray, p: FloatArray) -> tuple[float, int]:
    """The largest share of step p that keeps every inequality, and the code of the one that ends it (-1: none)."""
    n = u.shape[0]
    size = largest_entry(p)
    far, code = np.inf, -1
    for i in range(q.state.shape[0]):
        if q.state[i] != OUT:
            continue
        if i < n:
            x, dx = u[i], p[i]
        else:
            x, dx = 0.0, 0.0
            for k in range(n):
                x += q.C[i - n, k] * u[k]
                dx += q.C[i - n, k] * p[k]
        low, high, length = q.B[0, i], q.B[1, i], q.norm[i]
        if dx < -_ALONG * size * length and (low - x) / dx < far:
            far, code = max((low - x) / dx, 0.0), 2 * i
        elif dx > _ALONG * size * length and (high - x) / dx < far:
            far, code = max((high - x) / dx, 0.0), 2 * i + 1
    return far, code


@part
def lowest_at(rows: FloatArray, low: FloatArray, high: FloatArray, u: FloatArray, p: FloatArray, most: float) -> float:
    """Where the sum of squared misses is least along u + far p, far in [0, most]."""
    m, n = rows.shape
    start, rate = np.zeros(m), np.zeros(m)
    longest, pieces = largest_entry(p), False
    for i in range(m):
        terms = 0.0
        for k in range(n):
            start[i] += rows[i, k] * u[k]
            rate[i] += rows[i, k] * p[k]
            terms += abs(rows[i, k]) * longest
        if abs(rate[i]) <= _ROUND_OFF * terms:
            rate[i] = 0.0  # or a row that cannot move would decide over steps of any length
        pieces = pieces or low[i] != high[i]
    if not pieces:
        return min(1.0, most)
    here = 0.0
    for _ in range(2 * m + 2):
        slope, bend, following = _piece(start, rate, low, high, here)
        if slope >= 0.0:
            return min(here, most)
        if bend > 0.0 and here - slope / bend <= following:
            return min(here - slope / bend, most)
        if not following < most:
            return min(most, following) if most < np.inf else here
        here = following
    return min(here, most)


@part
def _piece(
    start: FloatArray, rate: FloatArray, low: FloatArray, high: FloatArray, here: float
) -> tuple[float, float, float]:
    """Slope and bend of half the sum just after ``here``, and where this piece ends."""
    slope, bend, following = 0.0, 0.0, np.inf
    for i in range(start.shape[0]):
        r = rate[i]
        if r == 0.0:
            continue
        # by where the ends of its interval are crossed, never by where it is: the same number on both sides of an end
        enters = ((low[i] if r > 0.0 else high[i]) - start[i]) / r
        leaves = ((high[i] if r > 0.0 else low[i]) - start[i]) / r
        if here < enters:
            slope += (here - enters) * r * r
            bend += r * r
            following = min(following, enters)
        elif here >= leaves:
            slope += (here - leaves) * r * r
            bend += r * r
        else:
            following = min(following, leaves)
    return slope, bend, following
