"""The answer to what a store holds, by ``sns``, ``dls`` or ``task-priority``, and what is kept of a step once made."""

from __future__ import annotations

from math import isfinite, sqrt

import numpy as np

from cartctl.braking import clamp
from cartctl.checks import FloatArray, IntArray
from cartctl.compiled import store_kernel as at
from cartctl.compiled.solve_kernel import damped, least_above, met, ranked
from cartctl.compiled.store_kernel import Store, index_in
from cartctl.kernels import lean_part, part
from cartctl.levels.patience_kernel import PATIENCE, forget, look_on
from cartctl.solvers.exact import kinds
from cartctl.solvers.exact.lexicographic import lexicographic

_SCALED, _FITTED = kinds.SCALED, kinds.FITTED
_EXTREME, _STUCK, _LOST, _UNPROVEN = kinds.EXTREME, kinds.STUCK, kinds.LOST_RANK, kinds.UNPROVEN

# what a step may come to; :mod:`cartctl.compiled.plan` knows their names
OPTIMAL, SCALED, SKIPPED, SINGULAR, INEXACT, FAILED, RECOVERING, DAMPED, OVERDETERMINED = 0, 1, 2, 3, 4, 5, 6, 7, 8
UNPROVEN, STATUSES = 9, 10
SNS, DLS, TASK_PRIORITY = 0, 1, 2  # solvers
AGAIN_BIT, LOST_BIT = 16, 32  # beside the status: a task was asked again for something else; one lost rank
_BEYOND = 1e-6  # of a command: a part as large that cannot be obeyed

NV, TASKS, ROWS, BOUNDED, HELD, LAST, BEGINS, COUNT = (
    at.NV, at.TASKS, at.ROWS, at.BOUNDED, at.HELD, at.LAST, at.BEGINS, at.COUNT,
)  # fmt: skip
A, U, AT, X, JOINTS, LOWER, UPPER, B, B_AGAIN, D_AGAIN, GIVEN, HIGH, ERROR, RATE, BEND = (
    at.A, at.U, at.AT, at.X, at.JOINTS, at.LOWER, at.UPPER, at.B, at.B_AGAIN, at.D_AGAIN, at.GIVEN, at.HIGH, at.ERROR,
    at.RATE, at.BEND,
)  # fmt: skip
WEIGHT, FITTED, WAITS, NATURAL, PACE, SCALE, DELAY, SHARE, OWN, AGAIN, MADE, PATH, CALM, PACED, MISSED, SIZE = (
    at.WEIGHT, at.FITTED, at.WAITS, at.NATURAL, at.PACE, at.SCALE, at.DELAY, at.SHARE, at.OWN, at.AGAIN, at.MADE,
    at.PATH, at.CALM, at.PACED, at.MISSED, at.SIZE,
)  # fmt: skip
BEFORE, BEGAN, PARAMETER, DT = at.BEFORE, at.BEGAN, at.PARAMETER, at.DT


@lean_part
def _squared(u: FloatArray) -> float:
    total = 0.0
    for j in range(u.shape[0]):
        total += u[j] * u[j]
    return total


@lean_part
def _slowed(s: Store, k: int, b: FloatArray, d: FloatArray) -> None:
    """Ask task k for ``A u = A u_b + s (b - A u_b)``, or below the highest to stand: :mod:`cartctl.motion.fallback`."""
    first, bounded = index_in(s).first, s.ints[BOUNDED]
    for i in range(first[k], first[k + 1]):
        rest = 0.0
        for j in range(bounded):
            rest += s.wide[A + i, j] * clamp(0.0, s.wide[LOWER, j], s.wide[UPPER, j])
        b[i], d[i] = (b[i] - rest, -rest) if k == 0 else (rest, 0.0)


@lean_part
def _beyond_reach(s: Store) -> bool:
    """Whether the highest task's command cannot be obeyed as it is; what of it can is then in B_AGAIN."""
    index, nothing, none = index_in(s), s.head[:0], s.square[:0, :0]
    m, x, active, fits = index.first[1], s.wide[X], index.active, index.again
    rows, b, again = s.wide[A : A + m], s.high[B, :m], s.high[B_AGAIN]
    active[0], fits[0] = 0, _FITTED
    lexicographic(
        rows, b, nothing, index.counts[:1], fits[:1], s.each[NATURAL, :1], nothing, nothing, none, nothing, nothing,
        nothing, active, x, s.each[AGAIN, :1], active, none,
    )  # fmt: skip
    active[0] = 0
    missed, asked = 0.0, 0.0
    for i in range(m):
        along = 0.0
        for j in range(x.shape[0]):
            along += rows[i, j] * x[j]
        again[i] = along
        missed += (b[i] - along) * (b[i] - along)
        asked += b[i] * b[i]
    return missed > _BEYOND * _BEYOND * asked and isfinite(missed)


@lean_part
def _set_apart(s: Store, m: int) -> bool:
    """Set what the motion above does to a task apart from what is its own, in D_AGAIN and B_AGAIN: whether there is."""
    apart = False
    for i in range(m):
        given = s.high[GIVEN, i]
        s.high[B_AGAIN, i], s.high[D_AGAIN, i] = s.high[B, i] - given, -given
        apart = apart or given != 0.0
    return apart


@lean_part
def exact(s: Store) -> int:
    """The exact optimum: how it went, and the bits."""
    p = s.ints[TASKS] - s.ints[LAST]
    firsts, bounded = index_in(s).first, s.ints[BOUNDED]
    m, active = firsts[p], index_in(s).active
    nothing, none = s.head[:0], s.square[:0, :0]
    rows, u, lower, upper = s.wide[A : A + m], s.wide[U], s.wide[LOWER, :bounded], s.wide[UPPER, :bounded]
    b, d, sizes, fits = s.high[B, :m], nothing, index_in(s).counts[:p], index_in(s).fits[:p]
    u0 = s.high[B, m:] if s.ints[LAST] != 0 else nothing
    natural, scales = s.each[NATURAL, :p], s.each[SCALE, :p]
    flags, bits, slowed = 0, 0, False
    if s.ints[HELD] != 0 and _set_apart(s, m):
        b, d = s.high[B_AGAIN, :m], s.high[D_AGAIN, :m]
    for turn in range(3):
        flags = lexicographic(
            rows, b, d, sizes, fits, natural, lower, upper, none, nothing, nothing, u0, active, u, scales, active, none,
        )  # fmt: skip
        again = False
        for k in range(p):
            again = again or scales[k] != scales[k]
        if slowed or flags & _EXTREME != 0:
            break
        if turn == 0 and flags & _LOST != 0 and fits[0] == _SCALED and not scales[0] > 0.0:
            # no more than the part of the command that the robot can obey here
            beyond = _beyond_reach(s)
            s.each[AGAIN, 0] = 0.0
            if beyond:
                bits, s.each[AGAIN, 0] = AGAIN_BIT, 1.0
                for i in range(m):
                    s.high[D_AGAIN, i] = d[i] if d.shape[0] > 0 else 0.0
                    if i >= firsts[1]:
                        s.high[B_AGAIN, i] = b[i]
                b, d = s.high[B_AGAIN, :m], s.high[D_AGAIN, :m]
                continue
        if not again:
            break
        # a task with no feasible scale is slowed
        bits, again_fits, slowed = AGAIN_BIT, index_in(s).again, True
        for i in range(m):
            s.high[B_AGAIN, i], s.high[D_AGAIN, i] = b[i], d[i] if d.shape[0] > 0 else 0.0
        b, d = s.high[B_AGAIN, :m], s.high[D_AGAIN, :m]
        for k in range(p):
            again_fits[k] = fits[k]
            s.each[AGAIN, k] = 1.0 if scales[k] != 1.0 else s.each[AGAIN, k]
            if scales[k] != 1.0:
                _slowed(s, k, b, d)
                again_fits[k] = _SCALED if k == 0 else _FITTED
        fits = again_fits[:p]
    if flags & (_EXTREME | _STUCK) != 0 or not isfinite(_squared(u)):
        active[0] = 0
        for j in range(u.shape[0]):
            u[j] = clamp(0.0, lower[j], upper[j]) if bounded > 0 else 0.0
        for k in range(p):
            scales[k] = 1.0
        return FAILED
    lost = flags & _LOST != 0
    bits |= LOST_BIT if lost else 0
    return bits | (UNPROVEN if flags & _UNPROVEN != 0 else _graded(s, b, d, fits, p, lost))


@lean_part
def _graded(s: Store, b: FloatArray, d: FloatArray, fits: IntArray, p: int, lost: bool) -> int:
    least, first = 1.0, index_in(s).first
    for k in range(p):
        if s.each[SCALE, k] != s.each[SCALE, k]:
            return SKIPPED
        least = min(least, s.each[SCALE, k])
    if lost:
        return SINGULAR
    if least < 1.0:
        return SCALED
    for k in range(p):
        if fits[k] == _SCALED and s.each[WEIGHT, k] > 0.0:
            rows = s.wide[A : A + first[p]]
            if not met(rows, b, d, first[k], first[k + 1], s.each[SCALE, k], s.wide[U]):
                return INEXACT
    return OPTIMAL


@part
def least_squares(s: Store, firsts: IntArray) -> int:
    """Damped least squares over all tasks, rows weighed by the root of their weight."""
    n, p, kept, damping = s.ints[NV], s.ints[TASKS], 0, s.head[PARAMETER]
    rows, b = np.empty((s.ints[ROWS], n)), np.empty(s.ints[ROWS])
    for k in range(p):
        weight = s.each[WEIGHT, k]
        if weight == 0.0:
            continue
        root = 1.0 if p == 1 and weight == 1.0 else sqrt(weight)
        for i in range(firsts[k], firsts[k + 1]):
            for j in range(n):
                rows[kept, j] = root * s.wide[A + i, j]
            b[kept] = root * s.high[B, i]
            kept += 1
    rows, b = rows[:kept], b[:kept]
    damped(rows, b, damping * damping, s.wide[U])
    if kept > 0 and not least_above(rows, damping):
        return SINGULAR
    if _all_met(s):
        return OPTIMAL
    return OVERDETERMINED if p > 1 and s.ints[ROWS] > n else DAMPED


@lean_part
def _all_met(s: Store) -> bool:
    first, m = index_in(s).first, s.ints[ROWS]
    for k in range(s.ints[TASKS]):
        if s.each[WEIGHT, k] > 0.0:
            if not met(s.wide[A : A + m], s.high[B], s.head[:0], first[k], first[k + 1], 1.0, s.wide[U]):
                return False
    return True


@lean_part
def by_ranks(s: Store) -> int:
    """Task priority with truncated inverses."""
    m, sizes, natural = s.ints[ROWS], index_in(s).counts, s.each[NATURAL]
    if ranked(s.wide[A : A + m], s.high[B], sizes, natural, s.head[PARAMETER], s.wide[U]):
        return SINGULAR | LOST_BIT
    return OPTIMAL if _all_met(s) else INEXACT


@lean_part
def made(s: Store, t: float) -> None:
    """Keep what lasts of a step made at time t; the clock of a path goes on by the share that was delivered."""
    count, first = s.ints[TASKS], index_in(s).first
    half = s.bent.shape[0] // 2
    for p in range(count):
        s.each[MADE, p], s.each[PACED, p] = s.each[OWN, p], s.each[PACE, p]
        if s.each[WAITS, p] == 0.0:
            continue
        s.each[DELAY, p] = t - s.each[OWN, p]
        if s.each[PATH, p] < 0.0:
            s.each[SHARE, p] = 1.0
            continue
        asked, moved = 0.0, 0.0
        for i in range(first[p], first[p + 1]):
            along = 0.0
            for j in range(s.ints[NV]):
                along += s.wide[A + i, j] * s.wide[U, j]
            asked += s.high[B, i] * s.high[B, i]
            moved += s.high[B, i] * along
        s.each[SHARE, p] = s.each[PACE, p] * (clamp(moved / asked, 0.0, 1.0) if asked != 0.0 else 1.0)
    for i in range(half):
        s.bent[half + i] = s.bent[i]
    if s.ints[HELD] != 0:
        _looked_on(s)
    s.head[BEFORE] = t
    if s.ints[BEGINS] != 0:
        s.ints[BEGINS], s.head[BEGAN] = 0, t
    s.ints[COUNT] += 1


@lean_part
def _looked_on(s: Store) -> None:
    """Whether tasks come nearer: :mod:`cartctl.levels.patience`."""
    first, waits = index_in(s).first, False
    for p in range(s.ints[TASKS]):
        waits = waits or s.each[PATH, p] >= 0.0
        missed, size = 0.0, 0.0
        for i in range(first[p], first[p + 1]):
            missed += s.high[ERROR, i] * s.high[ERROR, i]
            size += _squared(s.wide[A + i])
        s.each[MISSED, p], s.each[SIZE, p] = sqrt(missed), max(s.each[NATURAL, p], sqrt(size))
    if waits:
        forget(s.patience, s.ints[TASKS], s.patience[PATIENCE])
        return
    for j in range(s.ints[NV]):
        s.wide[X, j] = s.head[DT] * s.wide[U, j]
    joints = s.wide[JOINTS : JOINTS + 4]
    look_on(s.each[MISSED], s.each[SIZE], s.wide[AT], s.wide[X], joints, s.head[DT], s.patience)


@lean_part
def told(s: Store, u: FloatArray, out: FloatArray) -> None:
    """Copy u, and for whoever looks at the step later: bounds, five of ``each``, seven of ``high``, A."""
    n, p, m = s.ints[NV], s.ints[TASKS], s.ints[ROWS]
    for j in range(n):
        u[j] = s.wide[U, j]
        out[j] = s.wide[LOWER, j]
        out[n + j] = s.wide[UPPER, j]
    a = 2 * n
    for k in range(p):
        out[a + k] = s.each[SCALE, k]
        out[a + p + k] = s.each[NATURAL, k]
        out[a + 2 * p + k] = s.each[PACE, k]
        out[a + 3 * p + k] = s.each[AGAIN, k]
        out[a + 4 * p + k] = s.each[CALM, k]
    a += 5 * p
    for i in range(m):
        out[a + i] = s.high[ERROR, i]
        out[a + m + i] = s.high[RATE, i]
        out[a + 2 * m + i] = s.high[BEND, i]
        out[a + 3 * m + i] = s.high[B, i]
        out[a + 4 * m + i] = s.high[B_AGAIN, i]
        out[a + 5 * m + i] = s.high[D_AGAIN, i]
        out[a + 6 * m + i] = s.high[GIVEN, i]
    a += 7 * m
    for i in range(m):
        for j in range(n):
            out[a + i * n + j] = s.wide[A + i, j]


def told_size(n: int, p: int, m: int) -> int:
    """How much room a copy of a step takes."""
    return 2 * n + 5 * p + 7 * m + m * n
