"""A random prioritised problem from (seed, index), as the engine's arrays.

It is built around a point inside the box and the rows: most commands are what that point delivers, at some scale.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cartctl.kernels import part
from cartctl.solvers.exact.disguise import Given
from cartctl.solvers.exact.kinds import FITTED, INTERVAL, SCALED
from soaking.bounds import box, intervals
from soaking.draws import between, chance, new_state, normal, power, share, whole
from soaking.matrices import fill, pick_kind


class Made(NamedTuple):
    """The engine's arguments, and random codes to start from, or none."""

    arrays: Given
    guess: NDArray[np.int64]


@part
def make(seed, index):
    """Problem ``index`` of a seed, its n, and whether it is grey: so near to singular that round-off decides."""
    state = new_state(seed, index)
    grey = chance(state, 0.1)
    x = share(state)
    n = 7 if x < 0.3 else whole(state, 1, 12) if x < 0.985 else whole(state, 13, 40)
    integers = chance(state, 0.15)
    unit = 1.0 if integers or chance(state, 0.8) else power(state, -6.0, 4.0)
    lower, upper, u = box(state, n, integers, unit)
    x = share(state)
    p = 1 if x < 0.35 else 2 if x < 0.75 else whole(state, 3, 4)
    fits, sizes = _levels(state, p, n)
    soft = 0
    for k in range(p):
        soft += sizes[k] if fits[k] == INTERVAL else 0
    hard = whole(state, 1, 4) if chance(state, 0.3) else 0
    M = sizes.sum() - soft
    A, b, d = np.empty((M, n)), np.empty(M), np.zeros(M)
    C, c_lower, c_upper = np.empty((hard + soft, n)), np.empty(hard + soft), np.empty(hard + soft)
    if hard > 0:
        fill(state, C, 0, hard, pick_kind(state, integers), grey)
        intervals(state, C, c_lower, c_upper, 0, hard, u, unit, integers, 3.0 if chance(state, 0.08) else 0.0)
    row, low = 0, hard
    for k in range(p):
        kind = pick_kind(state, integers)
        if fits[k] == INTERVAL:
            fill(state, C, low, low + sizes[k], kind, grey)
            miss = 3.0 if chance(state, 0.5) else 0.0
            intervals(state, C, c_lower, c_upper, low, low + sizes[k], u, unit, integers, miss)
            low += sizes[k]
        else:
            fill(state, A, row, row + sizes[k], kind, grey)
            if not integers and chance(state, 0.1):
                A[row : row + sizes[k]] *= power(state, -4.0, 4.0) if grey else power(state, -2.0, 2.0)
            _command(state, A, b, d, row, row + sizes[k], u, unit, fits[k], integers)
            row += sizes[k]
    reference = np.empty(n if chance(state, 0.3) else 0)
    for i in range(reference.shape[0]):
        reference[i] = float(whole(state, -2, 2)) if integers else unit * normal(state)
    guess = np.zeros(1 + n, np.int64)
    if chance(state, 0.3):
        guess[0] = whole(state, 1, n)
        for i in range(1, 1 + n):
            guess[i] = whole(state, 0, 2 * (n + hard + soft) - 1)
    natural = np.zeros(p)
    drift = d if np.abs(d).sum() > 0.0 else np.empty(0)
    arrays = Given(A, b, drift, sizes, fits, natural, lower, upper, C, c_lower, c_upper, reference)
    return Made(arrays, guess), n, grey


@part
def _levels(state, p, n):
    """Kind and rows of each level."""
    mode = share(state)
    fits, sizes = np.empty(p, np.int64), np.empty(p, np.int64)
    for k in range(p):
        x = share(state)
        fits[k] = SCALED if mode < 0.5 or (mode > 0.65 and x < 0.5) else FITTED if x < 0.8 or mode < 0.75 else INTERVAL
        sizes[k] = whole(state, 1, min(6, n + 1))
    return fits, sizes


@part
def _command(state, A, b, d, first, last, u, unit, fit, integers):
    """b and d of one task: met by u, at a scale, at rest, or not."""
    x = share(state)
    kind = 0 if x < 0.35 else 1 if x < 0.65 else 2 if x < 0.7 else 3
    if kind != 3 and fit != SCALED:
        kind = 0
    drifts = chance(state, 0.3)
    s = 0.5 if chance(state, 0.4) else between(state, 0.05, 1.0)
    far = 3.0 if chance(state, 0.7) else 0.0
    room = 1.0 if integers else unit * max(np.abs(A[first:last]).max(), 1e-3)
    for i in range(first, last):
        value = 0.0
        for k in range(u.shape[0]):
            value += A[i, k] * u[k]
        if drifts:
            d[i] = float(whole(state, -1, 1)) if integers else 0.3 * room * normal(state)
        b[i] = float(whole(state, -2, 2)) if integers else far * room * normal(state)
        if kind == 2:
            d[i] = -value
        elif kind != 3:
            b[i] = (value + d[i]) / (s if kind == 1 else 1.0)
