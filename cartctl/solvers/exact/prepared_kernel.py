"""The engine on one store: two arrays cost a tenth of what seventeen do on the way from Python."""

from __future__ import annotations

from math import isfinite

import numpy as np

from cartctl.checks import FloatArray, IntArray
from cartctl.kernels import kernel
from cartctl.solvers.exact.kinds import EXTREME, STUCK
from cartctl.solvers.exact.lexicographic import lexicographic

SLOWED, MISSING = 64, 128  # beside the engine's flags: a scale below 1; one that is nan
REFUSED = -1  # a number that is none, or bounds that leave no room
# ints: these, then the rows and the kind of each level, then the active set, (n + 2,), and a guess without members
N, ROWS, LEVELS, HARD, BOUNDED, DRIFTING, REFERRED, WARM, HEAD = range(9)


@kernel("int(out_int_store, out_store)", fast=True)
def solve_prepared(ints: IntArray, floats: FloatArray) -> int:
    """Solve what ``floats`` holds into its end: the engine's flags and ours, or REFUSED where it is no problem.

    floats: A (M, n), C (r, n), b, drift, reference, natural sizes, c_lower, c_upper, lower, upper, of no length where
    ``ints`` says there is none; then u (n,) and scales (p,).
    """
    n, M, p, r = int(ints[N]), int(ints[ROWS]), int(ints[LEVELS]), int(ints[HARD])
    k = n * int(ints[BOUNDED])
    a = M * n
    c = a + r * n
    b = c + M
    d = b + M * int(ints[DRIFTING])
    e = d + n * int(ints[REFERRED])
    s = e + p
    g = s + r
    h = g + r
    for i in range(s):
        if not isfinite(floats[i]) or (i >= e and floats[i] < 0.0):
            return REFUSED
    for i in range(r):
        if not (floats[s + i] <= floats[g + i] and floats[s + i] < np.inf and floats[g + i] > -np.inf):
            return REFUSED
    for i in range(k):
        if not (floats[h + i] <= floats[h + k + i] and floats[h + i] < np.inf and floats[h + k + i] > -np.inf):
            return REFUSED
    z = h + 2 * k
    active, nobody = ints[HEAD + 2 * p : HEAD + 2 * p + n + 2], ints[HEAD + 2 * p + n + 2 :]
    lower, upper, u = floats[h : h + k], floats[h + k : z], floats[z : z + n]
    flags = lexicographic(
        floats[:a].reshape((M, n)), floats[c:b], floats[b:d], ints[HEAD : HEAD + p], ints[HEAD + p : HEAD + 2 * p],
        floats[e:s], lower, upper, floats[a:c].reshape((r, n)), floats[s:g], floats[g:h], floats[d:e],
        active if ints[WARM] != 0 else nobody, u, floats[z + n : z + n + p], active, np.empty((0, 0)),
    )  # fmt: skip
    if flags & STUCK != 0:
        active[0] = 0
        for i in range(n):
            u[i] = min(max(0.0, lower[i]), upper[i]) if k > 0 else 0.0
        floats[z + n : z + n + p] = 1.0
    for i in range(n):
        if not isfinite(u[i]):
            flags |= EXTREME
    for i in range(z + n, z + n + p):
        if not floats[i] >= 1.0:
            flags |= SLOWED if floats[i] >= 0.0 else MISSING
    return flags
