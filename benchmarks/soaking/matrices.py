"""Task matrices of every kind that has given trouble, or might."""

from __future__ import annotations

import math

import numpy as np

from cartctl.kernels import part
from soaking.draws import between, chance, normal, power, share, whole

PLAIN, WHOLE, JOINTS, DEFICIENT, NEAR, REPEATS, NEARLY_REPEATS, GAPS, ARM = 0, 1, 2, 3, 4, 5, 6, 7, 8


@part
def pick_kind(state, integers):
    """A kind of matrix; of integers, where there are ties wherever one looks."""
    if integers:
        return WHOLE if chance(state, 0.7) else JOINTS
    x = share(state)
    if x < 0.3:
        return PLAIN
    if x < 0.65:
        return ARM
    return whole(state, JOINTS, GAPS)


@part
def fill(state, A, first, last, kind, grey):
    """Rows first..last of A, which may depend on the rows above; grey: by how much is open to round-off."""
    n = A.shape[1]
    least = -12.0 if grey else -5.0
    if kind == ARM:
        _arm(state, A, first, last, grey)
        return
    for i in range(first, last):
        joint, factor = whole(state, 0, n - 1), float(whole(state, 1, 2)) * (1.0 if chance(state, 0.7) else -1.0)
        for k in range(n):
            if kind == WHOLE:
                A[i, k] = float(whole(state, -1, 1))
            elif kind == JOINTS:
                A[i, k] = factor if k == joint else 0.0
            else:
                A[i, k] = normal(state)
    if kind == DEFICIENT:
        keep = whole(state, 0, last - first - 1)
        for i in range(first + keep, last):
            _combine(state, A, i, first, first + keep, 0.0)
    elif kind == NEAR:
        _combine(state, A, last - 1, first, last - 1, power(state, least, -2.0))
    elif kind == REPEATS or kind == NEARLY_REPEATS:
        rest = power(state, least, -2.0) if kind == NEARLY_REPEATS else 0.0
        for i in range(first, last):
            if first > 0 and chance(state, 0.6):
                _combine(state, A, i, 0, first, rest)
    elif kind == GAPS:
        column, row = whole(state, 0, n - 1), whole(state, first, last - 1)
        for i in range(first, last):
            A[i, column] = 0.0
        if chance(state, 0.5):
            for k in range(n):
                A[row, k] = 0.0


@part
def _combine(state, A, i, first, last, rest):
    """Make row i a combination of rows first..last, and ``rest`` of what it was."""
    for k in range(A.shape[1]):
        A[i, k] *= rest
    for j in range(first, last):
        t = normal(state)
        for k in range(A.shape[1]):
            A[i, k] += t * A[j, k]


@part
def _arm(state, A, first, last, grey):
    """The Jacobian of a random chain of revolute joints, planar or not, often near a singular posture."""
    n, m = A.shape[1], last - first
    R, p = np.eye(3), np.zeros(3)
    axes, places = np.empty((n, 3)), np.empty((n, 3))
    spread = 3.0
    if chance(state, 0.3):
        spread = power(state, -7.0, 0.0) if grey else 0.0
    planar = m <= 3 and chance(state, 0.3)
    for k in range(n):
        axis = 2 if planar else (2 if k % 2 == 0 else 1)
        for c in range(3):
            axes[k, c], places[k, c] = R[c, axis], p[c]
        angle = spread * between(state, -1.0, 1.0)
        _turn(R, axis, angle)
        for c in range(3):
            p[c] += 0.3 * R[c, 0 if planar or k % 2 == 0 else 2]
    if chance(state, 0.1):
        p[:] = 0.0  # the point is on the first axis
    for k in range(n):
        x, y, z = p[0] - places[k, 0], p[1] - places[k, 1], p[2] - places[k, 2]
        a, b, c = axes[k, 0], axes[k, 1], axes[k, 2]
        column = (b * z - c * y, c * x - a * z, a * y - b * x, a, b, c)
        for i in range(m):
            A[first + i, k] = column[5 if planar and i == 2 else i % 6]


@part
def _turn(R, axis, angle):
    """R times a rotation about its own axis 1 or 2."""
    cos, sin = math.cos(angle), math.sin(angle)
    i, j = (0, 1) if axis == 2 else (2, 0)
    for c in range(3):
        a, b = R[c, i], R[c, j]
        R[c, i], R[c, j] = cos * a + sin * b, cos * b - sin * a
