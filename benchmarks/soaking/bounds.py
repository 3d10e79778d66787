"""The box and the intervals of a random problem, around a point that is inside."""

from __future__ import annotations

import numpy as np

from cartctl.kernels import part
from soaking.draws import between, chance, normal, share, whole


@part
def box(state, n, integers, unit):
    """Bounds (empty for none), and a point inside, some of it on them."""
    x = share(state)
    away, infinite, locked = x < 0.15, 0.15 <= x < 0.3, 0.3 <= x < 0.4
    size = 0 if x > 0.97 else n
    lower, upper, u = np.empty(size), np.empty(size), np.empty(n)
    equal = float(whole(state, 1, 3))
    for i in range(n):
        low = -equal if integers else unit * between(state, -2.0, -0.05)
        high = equal if integers else unit * between(state, 0.05, 2.0)
        if away and chance(state, 0.4):
            shift = float(whole(state, -4, 4)) if integers else unit * between(state, -4.0, 4.0)
            low, high = low + shift, high + shift
        where = share(state)
        share_of = 0.0 if where < 0.3 else 1.0 if where < 0.6 else share(state)
        u[i] = low + share_of * (high - low)
        if integers:
            u[i] = np.floor(u[i] + 0.5)
        if locked and chance(state, 0.3):
            low = high = u[i]
        if size > 0:
            lower[i] = -np.inf if infinite and chance(state, 0.4) else low
            upper[i] = np.inf if infinite and chance(state, 0.4) else high
    return lower, upper, u


@part
def intervals(state, C, low, high, first, last, u, unit, integers, miss):
    """Intervals that u respects or touches, or misses by ``miss`` units."""
    for i in range(first, last):
        x, length = 0.0, 0.0
        for k in range(u.shape[0]):
            x += C[i, k] * u[k]
            length = max(length, abs(C[i, k]))
        room = 1.0 if integers else unit * length
        x += miss * room * (float(whole(state, -1, 1)) if integers else normal(state))
        below = float(whole(state, 0, 1)) if integers else between(state, 0.0, 1.5) if chance(state, 0.7) else 0.0
        above = float(whole(state, 0, 1)) if integers else between(state, 0.0, 1.5) if chance(state, 0.7) else 0.0
        low[i] = -np.inf if chance(state, 0.3) else x - below * room
        high[i] = np.inf if chance(state, 0.3) else x + above * room
