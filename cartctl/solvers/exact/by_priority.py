"""The levels in order of priority, and then the point of least norm.

Problem: rows ``A u + d = s b`` (scaled), ``A u + d = b`` (fitted) or ``c_lower <= C u <= c_upper`` at a level of their
own (missed by as little as possible), a box, hard rows C, and the reference u0 from which the norm is measured.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import part
from cartctl.solvers.exact.by_levels import by_levels
from cartctl.solvers.exact.inequalities import Inequalities, most_violated, row_norms
from cartctl.solvers.exact.kinds import DOUBT, EXTREME, INTERVAL, SCALED
from cartctl.solvers.exact.proof import write_multipliers
from cartctl.solvers.exact.rows import Equations, Levels, level_table, take_apart, task_size
from cartctl.solvers.exact.working_set import (
    LAM,
    NEARLY,
    NUM,
    WHO,
    G,
    WorkingSet,
    append,
    combine,
    new_working_set,
    place,
)

_HUGE, _TINY = 1e120, 1e-120  # entries beyond these are left to the caller to scale
_LOST = 1e12  # times what the box allows: a command as large is left to the caller, too
_UNEVEN = 1e-3  # of the largest row: one as small is hidden
_COARSE = 1e-2  # of the size that commands alone suggest for u: what round-off in them is relative to


@part
def by_priority(
    A_: FloatArray,
    b: FloatArray,
    d: FloatArray,
    sizes: NDArray[np.int64],
    fits: NDArray[np.int64],
    scale: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    C_: FloatArray,
    c_lower: FloatArray,
    c_upper: FloatArray,
    reference: FloatArray,
    start: NDArray[np.int64],
    out: FloatArray,
    scales: FloatArray,
    active: NDArray[np.int64],
    out_proofs: FloatArray,
    surely: float,
) -> int:
    """Fill out (n,), scales (p,), active (count, then codes) and, if it has columns, out_proofs (p + 1, M + n + r).

    sizes, fits, scale: rows, kind and natural norm (0: that of A) of each level. d, reference, lower and upper may be
    empty. Rows of interval levels are the last ones of C, in order. start: a guess of the active inequalities, as
    ``active`` is. surely: times what round-off may leave of a normal that depends on others, which near singularities
    magnify: as much is nothing. DOUBT among the flags: something was decided by little more than round-off, or proven
    impossible.
    """
    n, M, p = out.shape[0], A_.shape[0], sizes.shape[0]
    w, u = new_working_set(n, surely), np.empty(n)
    proofs = np.zeros((p + 1, out_proofs.shape[1]))
    levels = level_table(sizes, fits, scale, C_.shape[0])
    e, q = _arrays(A_, b, d, levels, lower, upper, C_, c_lower, c_upper, reference, n)
    if _extreme(e, q.C, q.norm) or _out_of_proportion(e, q, levels, n):
        return EXTREME
    most = 50 + 10 * (M + q.state.shape[0])
    flags = 0
    members = 0
    done = False
    if levels.hard == C_.shape[0] and M <= n:
        done, members = _all_at_once(w, q, e, levels, u, proofs)
        for k in range(p):
            scales[k] = 1.0
    if not done:
        flags = by_levels(w, q, e, levels, members, start, u, scales, proofs, most)
    if w.K[NEARLY, 0] > 0 or _uneven(e, q, levels):
        flags |= DOUBT
    active[0] = 0
    for j in range(w.K[NUM, 0]):
        if w.K[WHO, j] >= 0:
            active[0] += 1
            active[active[0]] = w.K[WHO, j]
    for i in range(n):
        x = min(max(u[i], q.B[0, i]), q.B[1, i])
        if reference.shape[0] > 0:
            x += reference[i]
            if lower.shape[0] > 0:
                x = max(x, lower[i])
            if upper.shape[0] > 0:
                x = min(x, upper[i])
        out[i] = x
    for k in range(out_proofs.shape[0]):
        for i in range(out_proofs.shape[1]):
            out_proofs[k, i] = proofs[k, i]
    return flags


@part
def _uneven(e: Equations, q: Inequalities, levels: Levels) -> bool:
    """Whether rows of one level that is fitted differ so much in size that round-off in one hides another."""
    n = q.B.shape[1] - q.C.shape[0]
    for k in range(levels.sizes.shape[0]):
        least, most = math.inf, 0.0
        if levels.fits[k] == SCALED:
            continue
        for i in range(levels.begin[k], levels.begin[k] + levels.sizes[k]):
            norm = q.norm[n + i] if levels.fits[k] == INTERVAL else e.norm[i]
            most = max(most, norm)
            if norm > 0.0:
                least = min(least, norm)
        if least < _UNEVEN * most:
            return True
    return False


@part
def _extreme(e: Equations, C: FloatArray, c_norm: FloatArray) -> bool:
    """Whether squares of a row over- or underflow, so that its norm means nothing."""
    M, n = e.A.shape
    for i in range(M + C.shape[0]):
        norm = e.norm[i] if i < M else c_norm[n + i - M]
        if norm > _TINY and norm < _HUGE and norm != 1.0:
            continue
        for k in range(n):
            x = abs(e.A[i, k] if i < M else C[i - M, k])
            if x > _HUGE or 0.0 < x < _TINY:
                return True
    return False


@part
def _out_of_proportion(e: Equations, q: Inequalities, levels: Levels, n: int) -> bool:
    """Whether a command is so far beyond what the box allows that its scale is lost in round-off."""
    reach = 0.0
    for k in range(n):
        reach = max(reach, -q.B[0, k], q.B[1, k])
    if not 0.0 < reach < np.inf:
        return False
    for k in range(levels.sizes.shape[0]):
        if levels.fits[k] != SCALED:
            continue
        size, largest = levels.natural[k], 0.0
        for i in range(levels.begin[k], levels.begin[k] + levels.sizes[k]):
            size, largest = max(size, e.norm[i]), max(largest, abs(e.slope[i]))
        if largest > _LOST * size * reach and size > 0.0:
            return True
    return False


@part
def _arrays(
    A_: FloatArray,
    b: FloatArray,
    d: FloatArray,
    levels: Levels,
    lower: FloatArray,
    upper: FloatArray,
    C_: FloatArray,
    c_lower: FloatArray,
    c_upper: FloatArray,
    reference: FloatArray,
    n: int,
) -> tuple[Equations, Inequalities]:
    """Contiguous copies, relative to the reference, with their norms."""
    M, r = A_.shape[0], C_.shape[0]
    block = np.empty((M + r, n))
    lines, B, c_norm = np.zeros((3, M)), np.empty((2, n + r)), np.zeros(n + r + 1)
    A, C = block[:M], block[M:]
    norm, base, slope = lines[0], lines[1], lines[2]
    shifted = reference.shape[0] > 0
    unit = 0.0
    sizes, fits, begin = levels.sizes, levels.fits, levels.begin
    for k in range(sizes.shape[0]):
        if fits[k] == INTERVAL:
            continue
        for i in range(begin[k], begin[k] + sizes[k]):
            base[i] = -d[i] if d.shape[0] > 0 else 0.0
            if fits[k] == SCALED:
                slope[i] = b[i]
            else:
                base[i] += b[i]
    for i in range(M):
        t = 0.0
        for k in range(n):
            x = A_[i, k]
            A[i, k] = x
            t += x * x
            if shifted:
                base[i] -= x * reference[k]
        norm[i] = math.sqrt(t)
    for k in range(n):
        B[0, k] = lower[k] if lower.shape[0] > 0 else -np.inf
        B[1, k] = upper[k] if upper.shape[0] > 0 else np.inf
        if shifted:
            B[0, k] -= reference[k]
            B[1, k] -= reference[k]
            unit = max(unit, abs(reference[k]))
        unit = max(unit, max(B[0, k] if B[0, k] < np.inf else 0.0, -B[1, k] if B[1, k] > -np.inf else 0.0))
    for i in range(r):
        t = 0.0
        for k in range(n):
            C[i, k] = C_[i, k]
            if shifted:
                t += C[i, k] * reference[k]
        B[0, n + i], B[1, n + i] = c_lower[i] - t, c_upper[i] - t
    row_norms(C, c_norm)
    for k in range(sizes.shape[0]):
        if fits[k] == INTERVAL:
            continue
        size, largest = 0.0, 0.0
        for i in range(begin[k], begin[k] + sizes[k]):
            size = max(size, norm[i])
            largest = max(largest, abs(base[i]) + abs(slope[i]))
        if size > 0.0:
            unit = max(unit, _COARSE * largest / size)
    c_norm[n + r] = unit
    return Equations(A, norm, base, slope), Inequalities(B, C, c_norm, np.zeros(n + r, np.int64))


@part
def _all_at_once(
    w: WorkingSet,
    q: Inequalities,
    e: Equations,
    levels: Levels,
    u: FloatArray,
    proofs: FloatArray,
) -> tuple[bool, int]:
    """The least norm on all equations at s = 1, if they are independent and it is inside: done, rows in the set."""
    for i in range(u.shape[0]):
        if q.B[0, i] == q.B[1, i]:
            return False, 0
    for k in range(levels.sizes.shape[0]):
        first, last = levels.begin[k], levels.begin[k] + levels.sizes[k]
        size = task_size(e, first, last, levels.natural[k])
        for i in range(first, last):
            left, norm = take_apart(w, e, i, size), e.norm[i]
            if not left > 0.0:
                return False, w.K[NUM, 0]
            append(w, -1 - i, left, e.base[i] / norm, e.slope[i] / norm, 1.0)
    place(w, u)
    if most_violated(q, u) >= 0:
        return False, w.K[NUM, 0]
    if proofs.shape[1] > 0:
        combine(w, w.V[G], w.V[LAM])
        write_multipliers(w, q, e.norm, proofs[levels.sizes.shape[0]])
    return True, w.K[NUM, 0]
