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
from cartctl.solvers.exact.working_set import (
    FIXED,
    FREE,
    KIND,
    NUM,
    WHO,
    WorkingSet,
    Z,
    append,
    largest_entry,
    orthogonalise,
    remove,
)

# Not in the set; in it; met with it; an equality; not yet in force; met with it up to round-off.
OUT, MEMBER, IMPLIED, EQUAL, SILENT, TOUCHED = 0, 1, 2, 3, 4, 5

_INDEPENDENT = 1e-9  # of a unit normal: what is left of one that was met with a member that has left
_MET = 1e-12  # relative: an inequality missed by less is met


class Inequalities(NamedTuple):
    """``B[0] <= [u; C u] <= B[1]``, relative to the reference; row norms; where each inequality stands."""

    B: FloatArray  # (2, n + r)
    C: FloatArray  # (r, n)
    norm: FloatArray  # (n + r + 1,) 1 for a joint; last, the size of u that round-off is relative to
    state: NDArray[np.int64]  # (n + r,)


@part
def right_side(q: Inequalities, code: int) -> float:
    """C of the inequality ``n . u >= c``."""
    i = code >> 1
    return q.B[0, i] / q.norm[i] if code & 1 == 0 else -q.B[1, i] / q.norm[i]  # type: ignore[no-any-return]


@part
def normal_of(q: Inequalities, code: int, w: WorkingSet) -> float:
    """Make z the part of an inequality's unit normal orthogonal to the members, h its components; the norm of z."""
    z, i, n = w.V[Z], code >> 1, w.Q.shape[1]
    sign = 1.0 if code & 1 == 0 else -1.0
    if i < n:
        for k in range(n):
            z[k] = 0.0
        z[i] = sign
    else:
        C = q.C
        sign /= q.norm[i]
        for k in range(n):
            z[k] = sign * C[i - n, k]
    return orthogonalise(w, 1.0)


@part
def most_violated(q: Inequalities, u: FloatArray) -> int:
    """The code of the inequality that u misses by most, -1 where all are met."""
    B, norm, state, n = q.B, q.norm, q.state, u.shape[0]
    size = max(norm[state.shape[0]], largest_entry(u))
    worst, code = 0.0, -1
    for i in range(state.shape[0]):
        if state[i] != OUT:
            continue
        if i < n:
            x, length = u[i], 1.0
        else:
            x, length = 0.0, norm[i]
            for k in range(n):
                x += q.C[i - n, k] * u[k]
        below, above = (B[0, i] - x) / length, (x - B[1, i]) / length
        if below > worst and below > _MET * max(size, abs(B[0, i]) / length):
            worst, code = below, 2 * i
        if above > worst and above > _MET * max(size, abs(B[1, i]) / length):
            worst, code = above, 2 * i + 1
    return code


@part
def take_in(q: Inequalities, w: WorkingSet, code: int, left: float, s: float) -> None:
    """Make an inequality, whose normal was just taken apart, a member that may leave."""
    append(w, code, left, right_side(q, code), 0.0, s)
    w.K[KIND, w.K[NUM, 0] - 1] = FREE
    q.state[code >> 1] = MEMBER


@part
def drop(q: Inequalities, w: WorkingSet, j: int) -> None:
    """Take member j, an inequality, out of the set."""
    q.state[w.K[WHO, j] >> 1] = OUT
    remove(w, j)


@part
def drop_all_free(q: Inequalities, w: WorkingSet) -> None:
    """Take out every member that is not an equality."""
    forget_touched(q)
    for j in range(w.K[NUM, 0] - 1, -1, -1):
        if w.K[KIND, j] != FIXED:
            drop(q, w, j)


@part
def forget_touched(q: Inequalities) -> None:
    """The members have changed: what was met with the former ones is looked at again."""
    for i in range(q.state.shape[0]):
        if q.state[i] == TOUCHED:
            q.state[i] = OUT


@part
def look_again(q: Inequalities, w: WorkingSet) -> None:
    """A member has left: what was met with it, and no longer depends on the members, is looked at again."""
    for i in range(q.state.shape[0]):
        if q.state[i] == TOUCHED and normal_of(q, 2 * i, w) > _INDEPENDENT:
            q.state[i] = OUT


@part
def row_norms(C: FloatArray, norm: FloatArray) -> None:
    """The norm of each row, behind those of the joints; 1 for a row of zeros."""
    n = C.shape[1]
    for i in range(n):
        norm[i] = 1.0
    for r in range(C.shape[0]):
        t = 0.0
        for k in range(n):
            t += C[r, k] * C[r, k]
        norm[n + r] = math.sqrt(t) if t > 0.0 else 1.0
