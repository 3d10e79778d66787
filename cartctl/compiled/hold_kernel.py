"""What of every task's command the robot can still stop: the approach, on one controller's store."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from cartctl.checks import FloatArray, IntArray
from cartctl.compiled import store_kernel as at
from cartctl.compiled.approach_kernel import approached, task_drift
from cartctl.compiled.plan_kernel import FRAME, Task
from cartctl.compiled.store_kernel import (
    Store,
    chain_in,
    index_in,
    room_in,
    straightened,
)
from cartctl.kernels import lean_part, part
from cartctl.levels.approach_kernel import ASKED, ROWS, is_beyond
from cartctl.levels.beneath_kernel import held_beneath, narrowed
from cartctl.levels.calming_kernel import calmed
from cartctl.levels.left_out import keep

NV, TASKS, LARGEST, COUNT, BOUNDED = at.NV, at.TASKS, at.LARGEST, at.COUNT, at.BOUNDED
A, JOINTS, LOWER, UPPER, UNIT, ERROR, RATE, BEND, B, GIVEN = (
    at.A, at.JOINTS, at.LOWER, at.UPPER, at.UNIT, at.ERROR, at.RATE, at.BEND, at.B, at.GIVEN,
)  # fmt: skip
KIND, FITTED, PATH, WAITS, WHOLE, PACE, CALM, PACED, BESIDE, DT = (
    at.KIND, at.FITTED, at.PATH, at.WAITS, at.WHOLE, at.PACE, at.CALM, at.PACED, at.BESIDE, at.DT,
)  # fmt: skip
_STRAIGHT = 128  # steps
_SURE = 0.99  # of a threshold: what round-off cannot carry across


@lean_part
def _size(J: FloatArray) -> float:
    total = 0.0
    for i in range(J.shape[0]):
        for k in range(J.shape[1]):
            total += J[i, k] * J[i, k]
    return sqrt(total)


@lean_part
def _length(b: FloatArray) -> float:
    total = 0.0
    for i in range(b.shape[0]):
        total += b[i] * b[i]
    return sqrt(total)


@lean_part
def _task(s: Store, p: int, first: int, last: int) -> Task:
    kind, waits = int(s.each[KIND, p]), s.each[WAITS, p] != 0.0
    pose = s.twelve[2 * s.ints[NV] + p]
    return Task(kind, index_in(s).joint[p], waits, pose, index_in(s).dof[first:last], s.high[UNIT, first:last])


@part
def _beneath(
    s: Store,
    firsts: IntArray,
    p: int,
    J: FloatArray,
    b: FloatArray,
    joints: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> float:
    """Hold b back before the edge of what the tasks above leave: :mod:`cartctl.levels.beneath`."""
    m, n = J.shape
    M, k, dt, size = firsts[p], min(J.shape), s.head[DT], _size(J)
    U, Vt, D, stood = np.empty((m, k)), np.empty((k, n)), np.empty((ROWS, k)), np.empty(n)
    back, base, rest = np.empty((m, M)), np.empty(m), np.empty(m)
    error = s.high[ERROR, firsts[p] : firsts[p + 1]]
    above, others_ask = s.wide[A : A + M], s.high[B, :M]
    narrowed(above, others_ask, J, b, error, joints, lower, upper, dt, size, False, U, Vt, D, back, base, rest, stood)
    q = 0
    for i in range(k):
        if D[ASKED, i] != 0.0:
            q += 1
    own, others, q = np.zeros((m, q)), np.zeros((M, q)), 0
    for i in range(k):
        if D[ASKED, i] != 0.0:
            for j in range(p + 1):
                _bends(s, j, Vt[i], own[:, q] if j == p else others[firsts[j] : firsts[j + 1], q])
            q += 1
    asked = b.copy()
    edge = held_beneath(error, base, rest, U, Vt, D, joints, back, own, others, dt, size, True, True, b)
    held, lost = False, is_beyond(inf, D, k, size)
    for i in range(m):
        held = held or (lost and b[i] != asked[i])
    for i in range(m):
        s.high[GIVEN, firsts[p] + i] = base[i] if held else 0.0
    return edge


@lean_part
def _bends(s: Store, p: int, v: FloatArray, out: FloatArray) -> None:
    """Fill out with ``J_dot(v) v`` of task p."""
    first, last = index_in(s).first[p], index_in(s).first[p + 1]
    if s.each[KIND, p] == FRAME and first < last:
        n = s.ints[NV]
        task_drift(chain_in(s), s.twelve[n : 2 * n], _task(s, p, first, last), v, room_in(s), last - first, out)


@lean_part
def hold_back(s: Store) -> None:
    """Hold every task's command back where the robot could not stop, highest priority first."""
    n, count, r = s.ints[NV], s.ints[TASKS], s.ints[LARGEST]
    if s.ints[COUNT] % _STRAIGHT == 0:
        straightened(s)
    firsts, room, chain, bounded = index_in(s).first, room_in(s), chain_in(s), s.ints[BOUNDED]
    joints, lower, upper = s.wide[JOINTS : JOINTS + 4], s.wide[LOWER, :bounded], s.wide[UPPER, :bounded]
    turns, others = 2 * r + BESIDE, 2 * r + BESIDE + count * r
    calm, omega, above = inf, 0.0, 0
    for p in range(count):
        first, last = firsts[p], firsts[p + 1]
        J, b, edge = s.wide[A + first : A + last], s.high[B, first:last], inf
        s.each[PACE, p], s.each[CALM, p] = 1.0, 0.0
        for i in range(first, last):
            s.high[GIVEN, i] = 0.0
        if first == last:
            continue
        fitted = s.each[FITTED, p] != 0.0
        if not fitted:
            asked = (s.high[ERROR, first:last], s.high[RATE, first:last], s.high[BEND, first:last])
            begin = turns + p * r
            memory = (
                s.bent[p * (n + 1) : (p + 1) * (n + 1)],
                s.square[begin : begin + r],
                s.square[others + p * r : others + p * r + r],
            )
            edge, s.each[PACE, p], omega = approached(
                chain, s.twelve[n : 2 * n], _task(s, p, first, last), J, b, *asked, s.each[PATH, p] >= 0.0,
                s.each[PACED, p], joints, lower, upper, s.head[DT], _size(J), *memory, room,
            )  # fmt: skip
            if above == 0 and bounded > 0:
                keep(room.stood, lower, upper)
            if above > 0 and s.each[PATH, p] < 0.0:
                edge = min(edge, _beneath(s, firsts, p, J, b, joints, lower, upper))
        if calm < inf:
            # of a posture below one task, what is left to it is no more than ||b|| + ||J# b||: calming it would
            # take from it what it cannot have anyway, which is done where somebody asks for its rows
            easy = above == 1 and fitted and s.each[KIND, p] != FRAME and s.each[WHOLE, p] != 0.0
            if easy and _length(b) + omega <= _SURE * calm:
                s.each[CALM, p] = calm
            else:
                calmed(s.wide[A : A + first], s.high[B, :first], J, calm, lower, upper, b)
        calm = min(calm, edge)
        above += 1
