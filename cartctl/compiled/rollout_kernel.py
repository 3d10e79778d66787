"""The closed loop at the velocity level, start after start, in one compiled call.

One step is :meth:`cartctl.Controller.step` on flat arrays: kinematics, references, bounds, approach, solver, clocks
and ``q <- q (+) u dt``. Every start begins with nothing remembered, so that no rollout depends on another.
"""

from __future__ import annotations

from math import inf, isfinite, pi, sqrt
from typing import NamedTuple

import numpy as np

from cartctl.braking import clamp
from cartctl.checks import FloatArray, IntArray
from cartctl.compiled.approach_kernel import Room, approached, calmed
from cartctl.compiled.motion_kernel import (
    Chain,
    chain_of,
    coordinates,
    error_between,
    forward,
    frame_jacobian,
    integrate,
    place_frame,
)
from cartctl.compiled.path_table import ROW, follow
from cartctl.compiled.plan_kernel import (
    COUNT,
    FITTED,
    FRAME,
    INDEX,
    KIND,
    OPEN_POSITION,
    OPEN_ROTATION,
    PATH,
    POINT,
    ROW_GAIN,
    TURNING,
    UNIT,
    WAITS,
    WEIGHT,
    WHOLE,
    Task,
)
from cartctl.compiled.solve_kernel import damped, least_above, met, ranked
from cartctl.kernels import kernel, lean_part, part
from cartctl.levels.approach_kernel import ROWS
from cartctl.levels.velocity_kernel import velocity_bounds
from cartctl.solvers.exact import kinds
from cartctl.solvers.exact.lexicographic import lexicographic

SNS, DLS, TASK_PRIORITY = 0, 1, 2
_SCALED, _FITTED = kinds.SCALED, kinds.FITTED
_EXTREME, _STUCK, _LOST = kinds.EXTREME, kinds.STUCK, kinds.LOST_RANK

# what a step may come to; :mod:`cartctl.compiled.plan` knows their names
OPTIMAL, SCALED, SKIPPED, SINGULAR, INEXACT, FAILED, RECOVERING, DAMPED, OVERDETERMINED = 0, 1, 2, 3, 4, 5, 6, 7, 8
STATUSES = 9
_STRAIGHT = 128  # steps
_SURE = 0.99  # of a threshold: what round-off cannot carry across


class Plan(NamedTuple):
    """What stays the same from step to step."""

    chain: Chain
    frames: FloatArray  # (p, 13)
    tasks: FloatArray  # (p, TASK_WIDTH)
    rows: FloatArray  # (M, ROW_WIDTH)
    first: IntArray  # (p + 1,) rows of each task
    dof: IntArray  # (M,) which of the six rows, or which tangent coordinate
    unit: FloatArray  # (M,)
    goals: FloatArray  # (p, 12)
    packed: FloatArray  # (11, nv) limits, or none
    joints: FloatArray  # (3, nv) of the approach, or none
    nodes: FloatArray  # all tables of paths
    begin: IntArray  # (P + 1,) where each begins
    sizes: IntArray
    fits: IntArray
    dt: float
    parameter: float  # damping, or cutoff
    solver: int
    last: bool  # whether the lowest task is the reference


class Now(NamedTuple):
    """One robot at one instant, and room to work in."""

    q: FloatArray
    v: FloatArray
    u: FloatArray
    at: FloatArray
    world: FloatArray
    poses: FloatArray  # (p, 12)
    anchors: FloatArray  # (p, 12)
    points: FloatArray  # (M,) targets of joints
    J: FloatArray  # (6, nv)
    A: FloatArray
    b: FloatArray
    asked: FloatArray  # (M,) b before it was held back
    error: FloatArray
    rate: FloatArray
    bend: FloatArray  # (M,) the targets' accelerations
    natural: FloatArray  # (p,)
    paces: FloatArray
    scales: FloatArray
    lower: FloatArray
    upper: FloatArray
    bent: FloatArray  # (p, nv + 1)
    turns: FloatArray  # (p, r, r)
    others: FloatArray  # (p, r, r)
    six: FloatArray
    sample: FloatArray
    active: IntArray
    cursor: IntArray
    delay: FloatArray
    share: FloatArray
    own: FloatArray  # (p,) each task's own time
    b_again: FloatArray  # (M,)
    d_again: FloatArray  # (M,)
    fits_again: IntArray  # (p,)
    nothing: FloatArray  # (0,)
    none: FloatArray  # (0, 0)
    room: Room


@lean_part
def _reference(plan: Plan, now: Now, p: int, own: float, begins: bool) -> None:
    """Rows of A, error, b and rates of task p at its own time."""
    first, last = plan.first[p], plan.first[p + 1]
    if plan.tasks[p, KIND] != FRAME:
        for i in range(first, last):
            j = plan.dof[i]
            if begins:
                now.points[i] = now.at[j] if plan.tasks[p, OPEN_POSITION] != 0.0 else plan.rows[i, POINT]
                for k in range(now.A.shape[1]):
                    now.A[i, k] = 1.0 if k == j else 0.0
            gap = now.points[i] - now.at[j]
            if plan.rows[i, TURNING] != 0.0:
                gap = (gap + pi) % (2.0 * pi) - pi
            now.error[i] = gap
            now.b[i] = plan.rows[i, ROW_GAIN] * gap
        return
    pose, joint = now.poses[p], int(plan.frames[p, 0])
    place_frame(now.world, joint, plan.frames[p, 1:], pose)
    goal, table = now.anchors[p], int(plan.tasks[p, PATH])
    if begins:
        for k in range(12):
            left_open = plan.tasks[p, OPEN_ROTATION] if k < 9 else plan.tasks[p, OPEN_POSITION]
            goal[k] = pose[k] if left_open != 0.0 else plan.goals[p, k]
    if table >= 0:
        nodes = plan.nodes[plan.begin[table] : plan.begin[table + 1]]
        now.cursor[p] = follow(nodes, now.cursor[p], own, now.sample)
        for k in range(12):
            if k >= 9 or plan.tasks[p, OPEN_ROTATION] == 0.0:
                goal[k] = now.sample[1 + k]
    e = now.six
    error_between(pose, goal, e)
    frame_jacobian(plan.chain, now.world, joint, pose, now.J)
    n = now.A.shape[1]
    for i in range(first, last):
        r, unit = plan.dof[i], plan.unit[i]
        now.error[i] = e[r] * unit
        now.b[i] = plan.rows[i, ROW_GAIN] * now.error[i]
        if table >= 0:
            now.rate[i], now.bend[i] = now.sample[13 + r] * unit, now.sample[19 + r] * unit
            now.b[i] += now.rate[i]
        for k in range(n):
            now.A[i, k] = now.J[r, k] * unit
    if plan.tasks[p, WHOLE] == 0.0:
        total = 0.0
        for i in range(6):
            for k in range(n):
                total += now.J[i, k] * now.J[i, k]
        now.natural[p] = sqrt(total)


@lean_part
def _size(A: FloatArray) -> float:
    total = 0.0
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            total += A[i, k] * A[i, k]
    return sqrt(total)


@lean_part
def _task(plan: Plan, now: Now, p: int) -> Task:
    first, last = plan.first[p], plan.first[p + 1]
    kind, waits = int(plan.tasks[p, KIND]), plan.tasks[p, WAITS] != 0.0
    return Task(kind, int(plan.frames[p, 0]), waits, now.poses[p], plan.dof[first:last], plan.unit[first:last])


@lean_part
def _approach(plan: Plan, now: Now) -> None:
    """Hold every task's command back where the robot could not stop."""
    calm, omega, above = inf, 0.0, 0
    for p in range(plan.sizes.shape[0]):
        first, last = plan.first[p], plan.first[p + 1]
        J, b, edge = now.A[first:last], now.b[first:last], inf
        now.paces[p] = 1.0
        if first == last:
            continue
        fitted, moving = plan.tasks[p, FITTED] != 0.0, plan.tasks[p, PATH] >= 0.0
        if not fitted:
            e, rate, bend = now.error[first:last], now.rate[first:last], now.bend[first:last]
            of, size = _task(plan, now, p), _size(J)
            bounds, memory = (
                (plan.joints, now.lower, now.upper, plan.dt, size),
                (now.bent[p], now.turns[p], now.others[p], now.room),
            )
            edge, now.paces[p], omega = approached(
                plan.chain, now.world, of, J, b, e, rate, bend, moving, *bounds, *memory
            )
        if calm < inf:
            # of a posture below one task, what is left to it is no more than ||b|| + ||J# b||
            easy = above == 1 and fitted and plan.tasks[p, KIND] != FRAME and plan.tasks[p, WHOLE] != 0.0
            if not (easy and sqrt(_length(b)) + omega <= _SURE * calm):
                calmed(now.A[:first], now.b[:first], J, b, calm)
        calm = min(calm, edge)
        above += 1


@lean_part
def _sns(plan: Plan, now: Now) -> int:
    """The exact optimum; how it went."""
    p = plan.sizes.shape[0] - (1 if plan.last else 0)
    M, n = plan.first[p], now.u.shape[0]
    nothing, none = now.nothing, now.none
    A, b, sizes, fits = now.A[:M], now.b[:M], plan.sizes[:p], plan.fits[:p]
    u0 = now.b[M:] if plan.last else nothing
    natural, scales = now.natural[:p], now.scales[:p]
    d, flags = nothing, 0
    for turn in range(2):
        arguments = (A, b, d, sizes, fits, natural, now.lower, now.upper, none, nothing, nothing, u0)
        flags = lexicographic(*arguments, now.active, now.u, scales, now.active, none)
        again = False
        for k in range(p):
            again = again or scales[k] != scales[k]
        if turn == 1 or not again or flags & _EXTREME != 0:
            break
        # a task with no feasible scale is slowed towards standing still
        for i in range(M):
            now.b_again[i], now.d_again[i] = b[i], 0.0
        for k in range(p):
            now.fits_again[k] = fits[k]
        b, d, fits = now.b_again[:M], now.d_again[:M], now.fits_again[:p]
        for k in range(p):
            if scales[k] != 1.0:
                _towards_rest(now, plan.first[k], plan.first[k + 1], k == 0, b, d)
                fits[k] = _SCALED if k == 0 else _FITTED
    if flags & _EXTREME != 0 or not isfinite(_length(now.u)):
        now.active[0] = 0
        for j in range(n):
            low = now.lower[j] if now.lower.shape[0] > 0 else -inf
            now.u[j] = clamp(0.0, low, now.upper[j] if now.upper.shape[0] > 0 else inf)
        for k in range(p):
            scales[k] = 1.0
        return FAILED
    if flags & _STUCK != 0:
        return FAILED
    return _graded(plan, now, A, b, d, fits, p, flags & _LOST != 0)


@lean_part
def _towards_rest(now: Now, first: int, last: int, highest: bool, b: FloatArray, d: FloatArray) -> None:
    """Ask rows first..last for ``A u = A u_b + s (b - A u_b)``, or below the highest task to stand: ``A u = A u_b``."""
    bounded = now.lower.shape[0] > 0
    for i in range(first, last):
        rest = 0.0
        for j in range(now.u.shape[0]):
            if bounded:
                rest += now.A[i, j] * clamp(0.0, now.lower[j], now.upper[j])
        b[i], d[i] = (b[i] - rest, -rest) if highest else (rest, 0.0)


@lean_part
def _length(u: FloatArray) -> float:
    total = 0.0
    for j in range(u.shape[0]):
        total += u[j] * u[j]
    return total


@lean_part
def _graded(
    plan: Plan, now: Now, A: FloatArray, b: FloatArray, d: FloatArray, fits: IntArray, p: int, lost: bool
) -> int:
    least = 1.0
    for k in range(p):
        if now.scales[k] != now.scales[k]:
            return SKIPPED
        least = min(least, now.scales[k])
    if lost:
        return SINGULAR
    if least < 1.0:
        return SCALED
    for k in range(p):
        if fits[k] == _SCALED and plan.tasks[k, WEIGHT] > 0.0:
            if not met(A, b, d, plan.first[k], plan.first[k + 1], now.scales[k], now.u):
                return INEXACT
    return OPTIMAL


@part
def _dls(plan: Plan, now: Now) -> int:
    """Damped least squares over all tasks, rows weighed by the root of their weight."""
    M, n, p, kept = now.A.shape[0], now.u.shape[0], plan.sizes.shape[0], 0
    A, b = np.empty((M, n)), np.empty(M)
    for k in range(p):
        weight = plan.tasks[k, WEIGHT]
        if weight == 0.0 and p > 1:
            continue
        root = 1.0 if p == 1 and weight == 1.0 else sqrt(weight)
        for i in range(plan.first[k], plan.first[k + 1]):
            for j in range(n):
                A[kept, j] = root * now.A[i, j]
            b[kept] = root * now.b[i]
            kept += 1
    A, b = A[:kept], b[:kept]
    damped(A, b, plan.parameter * plan.parameter, now.u)
    if kept > 0 and not least_above(A, plan.parameter):
        return SINGULAR
    if _all_met(plan, now):
        return OPTIMAL
    return OVERDETERMINED if p > 1 and M > n else DAMPED


@lean_part
def _all_met(plan: Plan, now: Now) -> bool:
    nothing = now.nothing
    for k in range(plan.sizes.shape[0]):
        if plan.tasks[k, WEIGHT] > 0.0:
            if not met(now.A, now.b, nothing, plan.first[k], plan.first[k + 1], 1.0, now.u):
                return False
    return True


@lean_part
def _solved(plan: Plan, now: Now) -> int:
    for k in range(plan.sizes.shape[0]):
        now.scales[k] = 1.0
    if not isfinite(_length(now.b)):
        for j in range(now.u.shape[0]):
            now.u[j] = 0.0
        return FAILED
    if plan.solver == SNS:
        return _sns(plan, now)
    if plan.solver == DLS:
        return _dls(plan, now)
    lost = ranked(now.A, now.b, plan.sizes, now.natural, plan.parameter, now.u)
    if lost:
        return SINGULAR
    return OPTIMAL if _all_met(plan, now) else INEXACT


@lean_part
def _tick(plan: Plan, now: Now, t: float, p: int, own: float) -> None:
    """What task p was delivered of its command: the clock of its path goes on by that share."""
    first, last = plan.first[p], plan.first[p + 1]
    asked, moved = 0.0, 0.0
    for i in range(first, last):
        asked += now.b[i] * now.b[i]
        for j in range(now.u.shape[0]):
            moved += now.b[i] * now.A[i, j] * now.u[j]
    now.delay[p] = t - own
    now.share[p] = now.paces[p] * (clamp(moved / asked, 0.0, 1.0) if asked != 0.0 else 1.0)


@part
def _plan(
    joints: FloatArray,
    frames: FloatArray,
    tasks: FloatArray,
    rows: FloatArray,
    goals: FloatArray,
    packed: FloatArray,
    braking: FloatArray,
    nodes: FloatArray,
    begin: IntArray,
    numbers: FloatArray,
    choices: IntArray,
) -> Plan:
    p, M = tasks.shape[0], rows.shape[0]
    first, index, unit = np.zeros(p + 1, np.int64), np.empty(M, np.int64), np.empty(M)
    sizes, fits = np.empty(p, np.int64), np.empty(p, np.int64)
    for k in range(p):
        sizes[k] = int(tasks[k, COUNT])
        fits[k] = _FITTED if tasks[k, FITTED] != 0.0 else _SCALED
        first[k + 1] = first[k] + sizes[k]
    for i in range(M):
        index[i], unit[i] = int(rows[i, INDEX]), rows[i, UNIT]
    return Plan(
        chain_of(joints),
        frames.copy(),
        tasks.copy(),
        rows.copy(),
        first,
        index,
        unit,
        goals.copy(),
        packed.copy(),
        braking.copy(),
        np.ascontiguousarray(nodes),
        begin.copy(),
        sizes,
        fits,
        numbers[1],
        numbers[2],
        int(choices[0]),
        choices[2] != 0,
    )


@part
def _now(plan: Plan, nq: int) -> Now:
    n, p, M = plan.chain.parent.shape[0], plan.sizes.shape[0], plan.first[-1]
    bounded, r = n if plan.packed.shape[0] > 0 else 0, 6
    for k in range(p):
        r = max(r, plan.sizes[k])
    return Now(
        np.empty(nq),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty((n, 12)),
        np.empty((p, 12)),
        np.empty((p, 12)),
        np.empty(M),
        np.empty((6, n)),
        np.empty((M, n)),
        np.empty(M),
        np.empty(M),
        np.empty(M),
        np.zeros(M),
        np.zeros(M),
        np.zeros(p),
        np.ones(p),
        np.ones(p),
        np.empty(bounded),
        np.empty(bounded),
        np.zeros((p, n + 1)),
        np.empty((p, r, r)),
        np.empty((p, r, r)),
        np.empty(6),
        np.empty(ROW),
        np.zeros(n + 2, np.int64),
        np.zeros(p, np.int64),
        np.zeros(p),
        np.ones(p),
        np.zeros(p),
        np.empty(M),
        np.zeros(M),
        np.zeros(p, np.int64),
        np.empty(0),
        np.empty((0, 0)),
        Room(
            np.empty(n, np.int64),
            np.empty(6),
            np.empty(r),
            np.empty((r, r)),
            np.empty((r, n)),
            np.empty((r, r)),
            np.empty((r, n)),
            np.empty((ROWS, r)),
            np.empty(r),
            np.empty(r),
            np.empty(n),
            np.empty(n),
            np.empty((r, n)),
            np.empty(0),
            np.empty((0, n)),
        ),
    )


@lean_part
def _forget(now: Now) -> None:
    """As before the first step."""
    now.active[0] = 0
    for k in range(now.delay.shape[0]):
        now.delay[k], now.share[k], now.cursor[k], now.paces[k] = 0.0, 1.0, 0, 1.0
        for j in range(now.bent.shape[1]):
            now.bent[k, j] = 0.0
    _straighten(now)


@lean_part
def _straighten(now: Now) -> None:
    """Begin anew with singular vectors that were turned from step to step, before round-off has bent them."""
    for k in range(now.turns.shape[0]):
        for i in range(now.turns.shape[1]):
            for j in range(now.turns.shape[1]):
                now.turns[k, i, j] = 1.0 if i == j else 0.0
                now.others[k, i, j] = now.turns[k, i, j]


@lean_part
def _step(plan: Plan, now: Now) -> int:
    """Bounds, approach and solver at the state whose references are filled: u, and how it went."""
    recovering = False
    if plan.packed.shape[0] > 0:
        recovering = velocity_bounds(now.at, now.v, plan.packed, plan.dt, False, now.lower, now.upper)
        if plan.joints.shape[0] > 0:
            _approach(plan, now)
    outcome = _solved(plan, now)
    return RECOVERING if recovering and outcome != FAILED else outcome


@lean_part
def _look(plan: Plan, now: Now, t: float, before: float, k: int) -> None:
    """Kinematics and references of step k."""
    forward(plan.chain, now.q, now.world)
    coordinates(plan.chain, now.q, now.at)
    for i in range(plan.sizes.shape[0]):
        now.own[i] = t
        if k > 0 and plan.tasks[i, PATH] >= 0.0 and plan.tasks[i, WAITS] != 0.0:
            now.own[i] = t - now.delay[i] - (1.0 - now.share[i]) * max(t - before, 0.0)
        _reference(plan, now, i, now.own[i], k == 0)


@lean_part
def _roll_one(
    plan: Plan,
    now: Now,
    q0: FloatArray,
    v0: FloatArray,
    t0: float,
    steps: int,
    at: int,
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
    """One rollout; its history begins in row ``at``."""
    n, nq, p, before = v0.shape[0], q0.shape[0], plan.sizes.shape[0], 0.0
    _forget(now)
    for i in range(nq):
        now.q[i] = q0[i]
    for i in range(n):
        now.v[i] = v0[i]
    for i in range(p):
        least[i] = 1.0
    for k in range(steps + 1):
        t = t0 + k * plan.dt
        _look(plan, now, t, before, k)
        if q_all.shape[0] > 0:
            for i in range(nq):
                q_all[at + k, i] = now.q[i]
            for i in range(n):
                v_all[at + k, i] = now.v[i]
            for i in range(now.error.shape[0]):
                error_all[at + k, i] = now.error[i]
            for i in range(p):
                step_all[at + k, 1 + p + i] = now.own[i]
        if k == steps:
            break
        if k % _STRAIGHT == 0:
            _straighten(now)
        status = _step(plan, now)
        counts[status] += 1.0
        for i in range(p):
            least[i] = min(least[i], now.scales[i]) if now.scales[i] == now.scales[i] else 0.0
            if plan.tasks[i, PATH] >= 0.0 and plan.tasks[i, WAITS] != 0.0:
                _tick(plan, now, t, i, now.own[i])
        if q_all.shape[0] > 0:
            step_all[at + k, 0] = float(status)
            for i in range(p):
                step_all[at + k, 1 + i] = now.scales[i]
        before = t
        for i in range(n):
            now.v[i] = now.u[i]
            now.u[i] *= plan.dt
        integrate(plan.chain, now.q, now.u, now.q)
    for i in range(nq):
        q_end[i] = now.q[i]
    for i in range(n):
        v_end[i] = now.v[i]
    for i in range(now.error.shape[0]):
        error_end[i] = now.error[i]


@kernel(
    "void(matrix, matrix, matrix, matrix, matrix, matrix, matrix, matrix, ints, vector, ints, matrix, matrix, "
    "out_matrix, out_matrix, out_matrix, out_matrix, out_matrix, out_matrix, out_matrix, out_matrix, out_matrix)",
    fast=True,
    alone=True,
)
def roll(
    joints: FloatArray,
    frames: FloatArray,
    tasks: FloatArray,
    rows: FloatArray,
    goals: FloatArray,
    packed: FloatArray,
    braking: FloatArray,
    nodes: FloatArray,
    begin: IntArray,
    numbers: FloatArray,
    choices: IntArray,
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
    """Roll out every start q0 (B, nq), v0 (B, nv) by choices[1] steps.

    Fills the ends q_end, v_end and error_end (B, M), the least scale of every task least (B, p), and how often each
    status was met, counts (B, 9). With room for them, every step, (B (N + 1), ...): q, v, error, and step_all of
    status, scales (p,) and the tasks' own times (p,).
    """
    plan = _plan(joints, frames, tasks, rows, goals, packed, braking, nodes, begin, numbers, choices)
    now = _now(plan, q0.shape[1])
    for b in range(q0.shape[0]):
        ends = (q_end[b], v_end[b], error_end[b], least[b], counts[b])
        every = (q_all, v_all, error_all, step_all)
        _roll_one(plan, now, q0[b], v0[b], numbers[0], choices[1], b * (choices[1] + 1), *ends, *every)
