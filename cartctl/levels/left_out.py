"""Joints, and rows of constraints, that their bounds keep from doing their part: left out of a task's Jacobian.

A joint that is wanted beyond a bound at which it stands gives its column to nothing; a row ``C u <= c`` that is wanted
beyond its bound takes its direction out of every row, ``A (I - c c^T / c^T c)``.

What a joint is wanted to do: before a target at rest, to go down the slope of the miss, the sign of ``A^T b``. With the
joints at their bounds chosen by that sign and held there, the step of the others still leads downhill, whatever their
scaling; chosen by the sign of the step ``A# b`` alone it need not, and joints take turns at their bounds for ever
(Bertsekas 1982, "Projected Newton methods for optimization problems with simple constraints", SIAM J. Control Optim.
20(2)). A joint that the step wants beyond its bound is left out as well: it could not do its part, and the others would
use any speed of the null space for what little of the step is left without it (not where there are constraints, and
joints are not kept). A target that moves asks for ``A# b`` exactly, and so it counts there; before rows of constraints,
too, whose part in a step the slope knows nothing of.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from cartctl.checks import FloatArray
from cartctl.kernels import lean_part, part

_STILL, _WHOLE = 2, 3  # rows of the joints' array: a bound this close to zero blocks; the box of accelerations alone
_NEARLY = 0.999  # of that
_AT_BOUND = 1e3  # times that: a noticeable speed, and where a row of C blocks, whose bound moves as the arm does
_WANTED = 1e-3  # of the Jacobian's size: damping of the motion that says which joints are wanted
_FLAT = 1e-9  # of the Jacobian's size: a column as small along b leads nowhere
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
    fenced: bool,
    stood: FloatArray,
) -> bool:
    """Change A (m, n); whether anything was left out.

    stood (n,): which way each joint that was left out is wanted, 0 where that is hardly so, as at the target. fenced:
    whether there are constraints, which may have rows or none: joints are not kept at their bounds then.
    """
    m, n = A.shape
    wanted, found, walled = _wanted(left, s, right, b, size), False, C.shape[0] > 0
    flat = level_of(b, size)
    stood[:] = 0.0
    for j in range(n):
        by = wanted[j]
        if not (moving or walled):
            by = 0.0
            for i in range(m):
                by += A[i, j] * b[i]
            by = by if abs(by) > flat else 0.0
        still, whole = joints[_STILL, j], np.inf if fenced else joints[_WHOLE, j]
        if not (moving or fenced) and not stands(by, lower[j], upper[j], still, whole, False):
            by = wanted[j]
        if stands(by, lower[j], upper[j], still, whole, walled and not moving):
            A[:, j] = 0.0
            if walled or is_pressed(wanted[j], still):
                stood[j] = 1.0 if by > 0.0 else -1.0
            found = True
    return _leave_rows_out(A, wanted, joints, stood, C, c_lower, c_upper) or found


@lean_part
def level_of(b: FloatArray, size: float) -> float:
    """What of a slope ``A^T b`` is none."""
    total = 0.0
    for i in range(b.shape[0]):
        total += b[i] * b[i]
    return _FLAT * size * sqrt(total)


@lean_part
def stands(wanted: float, lower: float, upper: float, still: float, whole: float, returning: bool) -> bool:
    """Whether a joint's bounds keep it from what is wanted of it.

    whole: the width of a box that is all due to accelerations, which holds nobody back for longer than a step.

    returning: whether a joint on its way back, whose bounds do not even let it stop, counts like one that stands. Where
    it soon can do its part again, leaving it out turns the edge of the workspace, and others are sent to and fro.
    """
    beyond = upper if wanted > 0.0 else -lower
    if whole < np.inf and upper - lower >= _NEARLY * whole:
        return False
    return wanted != 0.0 and beyond <= still and (beyond >= -still or returning)


@lean_part
def is_pressed(wanted: float, still: float) -> bool:
    """Whether a joint at its bound is wanted to move noticeably."""
    return abs(wanted) > _AT_BOUND * still


@lean_part
def keep(stood: FloatArray, lower: FloatArray, upper: FloatArray) -> None:
    """Keep the joints that were left out at the bounds they stand at: the box (n,) each is made so narrow.

    Else a solver would send them back where that costs it least, only to have them wanted at their bounds again.
    """
    for j in range(stood.shape[0]):
        if stood[j] > 0.0:
            lower[j] = upper[j]
        elif stood[j] < 0.0:
            upper[j] = lower[j]


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
    stood: FloatArray,
    C: FloatArray,
    c_lower: FloatArray,
    c_upper: FloatArray,
) -> bool:
    """Take the directions of rows at their bound out of A; stood: not 0 for joints left out already."""
    m, n = A.shape
    basis, rank = np.empty((C.shape[0], n)), 0
    for r in range(C.shape[0]):
        asked, still, whole = 0.0, 0.0, 0.0
        for j in range(n):
            c = C[r, j]
            whole += c * c
            still += abs(c) * joints[_STILL, j]
            left = c if stood[j] == 0.0 else 0.0
            asked += left * wanted[j]
            basis[rank, j] = left
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
