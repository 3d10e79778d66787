"""Joints, and rows of constraints, that their bounds keep from doing their part: left out of a task's Jacobian.

A joint that is wanted beyond a bound at which it stands gives its column to nothing; a row ``C u <= c`` that is wanted
beyond its bound takes its direction out of every row, ``A (I - c c^T / c^T c)``.
"""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.kernels import lean_part, part

_STILL = 2  # row of the joints' array: a bound this close to zero blocks
_AT_BOUND = 1e3  # times that: where a row of C blocks, for its bound moves with the configuration
_WANTED = 1e-3  # of the Jacobian's size: damping of the motion that says which joints are wanted
_DEPENDENT = 1e-9  # of a row of C: nothing is left of it beside joints and rows left out before


@part
def leave_out(
    A: FloatArray,
    left: FloatArray,
    s: FloatArray,
    right: FloatArray,
    b: FloatArray,
    joints: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    C: FloatArray,
    c_lower: FloatArray,
    c_upper: FloatArray,
    size: float,
    moving: bool,
) -> bool:
    """Change A (m, n); whether anything was left out."""
    n = A.shape[1]
    wanted = _wanted(left, s, right, b, size)
    found, out = False, np.zeros(n)
    for j in range(n):
        if stands(wanted[j], lower[j], upper[j], joints[_STILL, j], moving):
            A[:, j] = 0.0
            out[j] = 1.0
            found = True
    return _leave_rows_out(A, wanted, joints, out, C, c_lower, c_upper) or found


@lean_part
def stands(wanted: float, lower: float, upper: float, still: float, moving: bool) -> bool:
    """Whether a joint's bounds keep it from what is wanted of it.

    A joint on its way back, whose bounds do not even let it stop, counts like one that stands; not while the target
    moves: there, a motion of the null space would hold the hand back.
    """
    beyond = upper if wanted > 0.0 else -lower
    return wanted != 0.0 and beyond <= still and (beyond >= -still or not moving)


@part
def _wanted(left: FloatArray, s: FloatArray, right: FloatArray, b: FloatArray, size: float) -> FloatArray:
    """The motion (n,) that would deliver b, damped."""
    wanted = np.zeros(right.shape[1])
    for k in range(s.shape[0]):
        t = 0.0
        for i in range(b.shape[0]):
            t += left[i, k] * b[i]
        t *= s[k] / (s[k] * s[k] + (_WANTED * size) ** 2)
        for j in range(wanted.shape[0]):
            wanted[j] += right[k, j] * t
    return wanted


@part
def _leave_rows_out(
    A: FloatArray,
    wanted: FloatArray,
    joints: FloatArray,
    out: FloatArray,
    C: FloatArray,
    c_lower: FloatArray,
    c_upper: FloatArray,
) -> bool:
    """Take the directions of rows at their bound out of A; out: 1 for joints left out already."""
    m, n = A.shape
    basis, rank = np.empty((C.shape[0], n)), 0
    for r in range(C.shape[0]):
        asked, still, whole = 0.0, 0.0, 0.0
        for j in range(n):
            c = C[r, j]
            whole += c * c
            still += abs(c) * joints[_STILL, j]
            asked += c * wanted[j] * (1.0 - out[j])
            basis[rank, j] = c * (1.0 - out[j])
        still *= _AT_BOUND
        if not ((asked > still and c_upper[r] <= still) or (asked < -still and c_lower[r] >= -still)):
            continue
        for _ in range(2):  # twice is enough
            for k in range(rank):
                t = 0.0
                for j in range(n):
                    t += basis[k, j] * basis[rank, j]
                for j in range(n):
                    basis[rank, j] -= t * basis[k, j]
        length = 0.0
        for j in range(n):
            length += basis[rank, j] * basis[rank, j]
        if length <= _DEPENDENT**2 * whole:
            continue
        for j in range(n):
            basis[rank, j] /= np.sqrt(length)
        for i in range(m):
            t = 0.0
            for j in range(n):
                t += A[i, j] * basis[rank, j]
            for j in range(n):
                A[i, j] -= t * basis[rank, j]
        rank += 1
    return rank > 0
