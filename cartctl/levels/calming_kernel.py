"""The arithmetic of :mod:`cartctl.levels.calming`, compiled."""

from __future__ import annotations

from math import sqrt

import numpy as np

from cartctl.checks import FloatArray
from cartctl.kernels import kernel, part

_NO_FREEDOM = 1e-9  # of the largest: singular values of the tasks above below this leave a motion free
_CLOSE = 1e-12  # relative: a motion as much faster than calm is not
_MOST = 60  # Newton steps, of which a handful are made


@kernel("void(matrix, vector, matrix, float, vector, vector, out_vector)")
def calmed(
    above: FloatArray,
    asked: FloatArray,
    J: FloatArray,
    calm: float,
    lower: FloatArray,
    upper: FloatArray,
    b: FloatArray,
) -> None:
    """Slow b (m,) down until the motion that the tasks above leave to it is no faster than calm.

    above (M, n), asked (M,): the rows of the tasks above, and what they ask. lower, upper (n,), or empty: the box;
    joints it leaves one value do not move.
    """
    m, n = J.shape
    rows, own = np.empty(above.shape), np.empty((m, n))
    for j in range(n):
        moves = 0.0 if lower.shape[0] > 0 and lower[j] == upper[j] else 1.0
        for i in range(above.shape[0]):
            rows[i, j] = moves * above[i, j]
        for i in range(m):
            own[i, j] = moves * J[i, j]
    U, s, Vt = np.linalg.svd(rows, full_matrices=True)
    rank = 0
    while rank < s.shape[0] and s[rank] > _NO_FREEDOM * s[0]:
        rank += 1
    given = np.zeros(n)
    for i in range(rank):
        t = 0.0
        for a in range(asked.shape[0]):
            t += U[a, i] * asked[a]
        t /= s[i]
        for j in range(n):
            given[j] += Vt[i, j] * t
    free = n - rank
    base, reduced = np.zeros(m), np.zeros((m, free))
    for i in range(m):
        for j in range(n):
            base[i] += own[i, j] * given[j]
            for k in range(free):
                reduced[i, k] += own[i, j] * Vt[rank + k, j]
    if free == 0:
        for i in range(m):
            b[i] = base[i]
        return
    L, t_, _ = np.linalg.svd(reduced, full_matrices=False)
    left = np.zeros(t_.shape[0])
    for k in range(t_.shape[0]):
        for i in range(m):
            left[k] += L[i, k] * (b[i] - base[i])
    _within(t_, left, calm)
    for i in range(m):
        total = base[i]
        for k in range(t_.shape[0]):
            total += L[i, k] * t_[k] * left[k]
        b[i] = total


@part
def _within(t: FloatArray, c: FloatArray, calm: float) -> None:
    """Replace c by the w that minimises ``||diag(t) w - c||`` with ``||w|| <= calm``.

    ``w_i = t_i c_i / (t_i^2 + damping)``, and the damping by Newton's method on ``1 / ||w||``, which comes to it from
    below (Hebden 1973; More & Sorensen 1983, "Computing a trust region step").
    """
    w, damping, size = np.zeros(c.shape[0]), 0.0, 0.0
    for _ in range(_MOST if calm > 0.0 else 0):
        total, bent = 0.0, 0.0
        for k in range(c.shape[0]):
            d = t[k] * t[k] + damping
            w[k] = t[k] * c[k] / d if d > 0.0 else 0.0
            total += w[k] * w[k]
            bent += w[k] * w[k] / d if d > 0.0 else 0.0
        size = sqrt(total)
        if size <= (1.0 + _CLOSE) * calm:
            break
        damping += (size / calm - 1.0) * total / bent
    share = calm / size if size > calm else 1.0
    for k in range(c.shape[0]):
        c[k] = w[k] * share
