"""Hard inequalities: a box on u and rows of C, each with a lower and an upper side.

Inequality i < n is joint i, i >= n is row i - n; code ``2 i`` is its lower side ``n . u >= c``, code ``2 i + 1`` its
upper one with the normal turned round. Normals are of unit length, so that one tolerance fits joints and rows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import part
from cartctl.solvers.exact.working_set import FIXED, WorkingSet, orthogonalise, remove

OUT, MEMBER, IMPLIED, EQUAL, SILENT = 0, 1, 2, 3, 4  # not in the set; in it; met with it; an equality; not yet in force

_MET = 1e-12  # relative: an inequality missed by less is met


class Inequalities(NamedTuple):
    """Bounds relative to the reference, the rows and their norms, and where each inequality stands."""

    lower: FloatArray  # (n,)
    upper: FloatArray  # (n,)
    C: FloatArray  # (r, n)
    c_lower: FloatArray  # (r,)
    c_upper: FloatArray  # (r,)
    norm: FloatArray  # (r,)
    unit: FloatArray  # (1,) the size of u that round-off is relative to
    state: NDArray[np.int64]  # (n + r,)


@part
def right_side(q: Inequalities, code: int) -> float:
    """C of the inequality ``n . u >= c``."""
    i, n = code >> 1, q.lower.shape[0]
    if i < n:
        return q.lower[i] if code & 1 == 0 else -q.upper[i]
    r = i - n
    return q.c_lower[r] / q.norm[r] if code & 1 == 0 else -q.c_upper[r] / q.norm[r]


@part
def normal_of(q: Inequalities, code: int, w: WorkingSet) -> float:
    """Make z the part of an inequality's unit normal orthogonal to the members, h its components; the norm of z."""
    i, n = code >> 1, q.lower.shape[0]
    sign = 1.0 if code & 1 == 0 else -1.0
    if i < n:
        for k in range(n):
            w.z[k] = 0.0
        w.z[i] = sign
    else:
        r = i - n
        sign /= q.norm[r]
        for k in range(n):
            w.z[k] = sign * q.C[r, k]
    return orthogonalise(w, 1.0)


@part
def most_violated(q: Inequalities, u: FloatArray) -> int:
    """The code of the inequality that u misses by most, -1 where all are met."""
    n = q.lower.shape[0]
    size = q.unit[0]
    for i in range(n):
        size = max(size, abs(u[i]))
    worst, code = 0.0, -1
    for i in range(n):
        if q.state[i] != OUT:
            continue
        below, above = q.lower[i] - u[i], u[i] - q.upper[i]
        if below > worst and below > _MET * max(size, abs(q.lower[i])):
            worst, code = below, 2 * i
        if above > worst and above > _MET * max(size, abs(q.upper[i])):
            worst, code = above, 2 * i + 1
    for r in range(q.norm.shape[0]):
        if q.state[n + r] != OUT:
            continue
        x = 0.0
        for k in range(n):
            x += q.C[r, k] * u[k]
        length = q.norm[r]
        below, above = (q.c_lower[r] - x) / length, (x - q.c_upper[r]) / length
        if below > worst and below > _MET * max(size, abs(q.c_lower[r]) / length):
            worst, code = below, 2 * (n + r)
        if above > worst and above > _MET * max(size, abs(q.c_upper[r]) / length):
            worst, code = above, 2 * (n + r) + 1
    return code


@part
def drop(q: Inequalities, w: WorkingSet, j: int) -> None:
    """Take member j, an inequality, out of the set."""
    q.state[w.who[j] >> 1] = OUT
    remove(w, j)


@part
def drop_all_free(q: Inequalities, w: WorkingSet) -> None:
    """Take out every member that is not an equality."""
    for j in range(w.num[0] - 1, -1, -1):
        if w.kind[j] != FIXED:
            drop(q, w, j)


@part
def row_norms(C: FloatArray, norm: FloatArray) -> None:
    """The Euclidean norm of each row; 1 for a row of zeros."""
    for r in range(C.shape[0]):
        t = 0.0
        for k in range(C.shape[1]):
            t += C[r, k] * C[r, k]
        norm[r] = math.sqrt(t) if t > 0.0 else 1.0
