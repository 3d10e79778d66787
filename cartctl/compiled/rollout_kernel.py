"""The closed loop at the velocity level, start after start, in one compiled call.

One step is :meth:`cartctl.Controller.step` by the same kernels: kinematics, references, bounds, approach, solver,
clocks, and ``q <- q (+) u dt``. Every start begins with nothing remembered, so that no rollout depends on another.
"""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray, IntArray
from cartctl.compiled import store_kernel as at
from cartctl.compiled.answer_kernel import DLS, FAILED, RECOVERING, SNS, made
from cartctl.compiled.curve_kernel import curve_sample
from cartctl.compiled.look_kernel import RECOVERING as _RECOVERING
from cartctl.compiled.motion_kernel import integrate
from cartctl.compiled.path_table import follow
from cartctl.compiled.step_kernel import BITS, LEFT, step_dls, step_ranks, step_sns
from cartctl.compiled.store_kernel import Store, chain_in, forgotten, opened, own_times
from cartctl.kernels import kernel, lean_part

TASKS, ROWS, SOLVER, STEPS, LOOKS = at.TASKS, at.ROWS, at.SOLVER, at.STEPS, at.LOOKS
PATH, OWN, SCALE, ERROR, U, DT, START, SAMPLE = at.PATH, at.OWN, at.SCALE, at.ERROR, at.U, at.DT, at.START, at.SAMPLE


@lean_part
def _stepped(s: Store, ints: IntArray, floats: FloatArray, q: FloatArray, v: FloatArray, t: float) -> int:
    """The status of a step whose paths are sampled; u is in the store."""
    nothing = s.head[:0]
    if ints[SOLVER] == SNS:
        found = step_sns(ints, floats, q, v, t, nothing, nothing)
    elif ints[SOLVER] == DLS:
        found = step_dls(ints, floats, q, v, t, nothing, nothing)
    else:
        found = step_ranks(ints, floats, q, v, t, nothing, nothing)
    if found & LEFT != 0:
        for j in range(s.wide.shape[1]):
            s.wide[U, j] = 0.0
        for p in range(ints[TASKS]):
            s.each[SCALE, p] = 1.0
        made(s, t)
        return FAILED
    status = found & 15
    return RECOVERING if found & (BITS * _RECOVERING) != 0 and status != FAILED else status


@lean_part
def _roll_one(
    ints: IntArray,
    floats: FloatArray,
    nodes: FloatArray,
    begin: IntArray,
    cursor: IntArray,
    q0: FloatArray,
    v0: FloatArray,
    q: FloatArray,
    v: FloatArray,
    at_: int,
    q_end: FloatArray,
    v_end: FloatArray,
    error_end: FloatArray,
    least: FloatArray,
    counts: FloatArray,
    q_all: FloatArray,
    v_all: FloatArray,
    error_all: FloatArray,
    step_all: FloatArray,
) -> None:
    """One rollout; its history begins in row ``at_``."""
    s = opened(ints, floats)
    n, nq, p, steps, chain = v0.shape[0], q0.shape[0], s.ints[TASKS], s.ints[STEPS], chain_in(s)
    forgotten(s)
    for i in range(nq):
        q[i] = q0[i]
    for i in range(n):
        v[i] = v0[i]
    for i in range(p):
        least[i], cursor[i] = 1.0, 0
    for k in range(steps + 1):
        t = s.head[START] + k * s.head[DT]
        own_times(s, t)
        for i in range(p):
            table = int(s.each[PATH, i])
            if table >= 0:
                sample = s.samples[SAMPLE * i : SAMPLE * (i + 1)]
                if begin[table + 1] - begin[table] == 1:
                    curve_sample(nodes[begin[table], 1:], s.each[OWN, i], sample)
                else:
                    cursor[i] = follow(nodes[begin[table] : begin[table + 1]], cursor[i], s.each[OWN, i], sample)
        ints[LOOKS] = 1 if k == steps else 0
        status = _stepped(s, ints, floats, q, v, t)
        if q_all.shape[0] > 0:
            for i in range(nq):
                q_all[at_ + k, i] = q[i]
            for i in range(n):
                v_all[at_ + k, i] = v[i]
            for i in range(s.ints[ROWS]):
                error_all[at_ + k, i] = s.high[ERROR, i]
            for i in range(p):
                step_all[at_ + k, 1 + p + i] = s.each[OWN, i]
        if k == steps:
            break
        counts[status] += 1.0
        for i in range(p):
            least[i] = min(least[i], s.each[SCALE, i]) if s.each[SCALE, i] == s.each[SCALE, i] else 0.0
        if q_all.shape[0] > 0:
            step_all[at_ + k, 0] = float(status)
            for i in range(p):
                step_all[at_ + k, 1 + i] = s.each[SCALE, i]
        for i in range(n):
            v[i] = s.wide[U, i]
            s.wide[U, i] *= s.head[DT]
        integrate(chain, q, s.wide[U], q)
    for i in range(nq):
        q_end[i] = q[i]
    for i in range(n):
        v_end[i] = v[i]
    for i in range(s.ints[ROWS]):
        error_end[i] = s.high[ERROR, i]


@kernel(
    "void(ints, vector, matrix, ints, matrix, matrix, "
    "out_matrix, out_matrix, out_matrix, out_matrix, out_matrix, out_matrix, out_matrix, out_matrix, out_matrix)",
    fast=True,
    alone=True,
)
def roll(
    ints: IntArray,
    floats: FloatArray,
    nodes: FloatArray,
    begin: IntArray,
    q0: FloatArray,
    v0: FloatArray,
    q_end: FloatArray,
    v_end: FloatArray,
    error_end: FloatArray,
    least: FloatArray,
    counts: FloatArray,
    q_all: FloatArray,
    v_all: FloatArray,
    error_all: FloatArray,
    step_all: FloatArray,
) -> None:
    """Roll out every start q0 (B, nq), v0 (B, nv) by a store of its own, copied from the one that is given.

    nodes: the tables of all paths, each from begin[k] on; one of a single row is a curve. Fills the ends q_end, v_end
    and error_end (B, M), the least scale of every task least (B, p), and how often each status was met, counts (B, 10).
    With room for them, every step, (B (N + 1), ...): q, v, error, and step_all of status, scales (p,) and the tasks'
    own times (p,).
    """
    own = (ints.copy(), floats.copy(), np.ascontiguousarray(nodes), begin.copy(), np.zeros(ints[TASKS], np.int64))
    now = (np.empty(q0.shape[1]), np.empty(v0.shape[1]))
    for b in range(q0.shape[0]):
        ends = (q_end[b], v_end[b], error_end[b], least[b], counts[b])
        every = (q_all, v_all, error_all, step_all)
        _roll_one(*own, q0[b], v0[b], *now, b * (ints[STEPS] + 1), *ends, *every)
