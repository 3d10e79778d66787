"""The arithmetic of :mod:`cartctl.levels.approach` and :mod:`cartctl.levels.calming` inside a rollout.

The kernels are the same; here are the parts that call them there from Python.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray, IntArray
from cartctl.compiled.motion_kernel import Chain, frame_drift
from cartctl.compiled.plan_kernel import FRAME, Task
from cartctl.kernels import lean_part, part
from cartctl.levels.approach_kernel import (
    ASKED,
    AVAILABLE,
    BEND,
    ERROR,
    FEEDBACK,
    FORWARD,
    NEXT,
    PULL,
    ROWS,
    SIGMA,
    SLOWING,
    SPEED,
    STILL,
    TOP_SPEED,
    WHOLE,
    directions,
    hold,
    is_beyond,
    matters,
)
from cartctl.levels.left_out import is_pressed, level_of, stands

_BENT, _THROUGH, _BENDS, _RISES, _CLEAR = 1e-3, 0.1, 0.5, 0.2, 1e-2  # as in levels.approach
_WANTED = 1e-3  # as in levels.left_out
_SWEEPS = 12
_LEVEL = 2e-16  # of the Jacobian's size squared: the round-off in its squares
_SLIGHT = 5e-5  # radians: below this, what series leave out is less than round-off
_SQUARED = 4e-4  # of the Jacobian's size squared: below this, squares would lose too many digits


class Room(NamedTuple):
    """Room to work in, for the largest task."""

    order: IntArray  # (nv,)
    six: FloatArray  # (6,)
    s: FloatArray  # (r,)
    G: FloatArray  # (r, r)
    W: FloatArray  # (r, nv)
    U: FloatArray  # (r, r)
    Vt: FloatArray  # (r, nv)
    D: FloatArray  # (ROWS, r)
    out: FloatArray  # (r,)
    h: FloatArray  # (r,)
    x: FloatArray  # (nv,)
    stood: FloatArray  # (nv,) the way each joint that was left out is wanted, 0 for others
    A: FloatArray  # (r, nv)
    nothing: FloatArray  # (0,)
    none: FloatArray  # (0, nv)


@lean_part
def task_drift(chain: Chain, world: FloatArray, task: Task, v: FloatArray, room: Room, m: int, out: FloatArray) -> None:
    """Fill out (m,) with ``J_dot v`` of a frame task's rows."""
    frame_drift(chain, world, task.joint, task.pose, v, room.order, room.six)
    for i in range(m):
        out[i] = room.six[task.row[i]] * task.unit[i]


@lean_part
def _turned(J: FloatArray, turn: FloatArray, room: Room) -> bool:
    """Fill room.s (m,), descending, with the singular values of J, and turn ``turn`` to its left singular vectors.

    Jacobi rotations of ``U^T J J^T U``, from the U of the step before: two sweeps, mostly. False where that squares
    away too much (near a singularity) or does not settle.
    """
    m, n = J.shape
    G, W, s, size = room.G, room.W, room.s, 0.0
    _times(J, turn, W)
    for i in range(m):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += W[i, k] * W[j, k]
            G[i, j] = total
            G[j, i] = total
        size += G[i, i]
    settled = False
    for _ in range(_SWEEPS):
        settled = True
        for p in range(m - 1):
            for q in range(p + 1, m):
                g = G[p, q]
                if abs(g) <= _LEVEL * size:
                    continue
                settled = False
                apart = G[q, q] - G[p, p]
                if abs(g) < _SLIGHT * abs(apart):  # as nearly always: the tangent's and the cosine's series
                    x = g / apart
                    t = x * (1.0 - x * x)
                    c = 1.0 - 0.5 * t * t
                else:
                    tau = 0.5 * apart / g
                    t = (1.0 if tau >= 0.0 else -1.0) / (abs(tau) + sqrt(1.0 + tau * tau))
                    c = 1.0 / sqrt(1.0 + t * t)
                d = t * c
                G[p, p] -= t * g
                G[q, q] += t * g
                G[p, q] = 0.0
                G[q, p] = 0.0
                for k in range(m):
                    if k != p and k != q:
                        x, y = G[p, k], G[q, k]
                        G[p, k] = c * x - d * y
                        G[k, p] = G[p, k]
                        G[q, k] = d * x + c * y
                        G[k, q] = G[q, k]
                    x, y = turn[k, p], turn[k, q]
                    turn[k, p], turn[k, q] = c * x - d * y, d * x + c * y
        if settled:
            break
    for i in range(m):
        if not G[i, i] > _SQUARED * size:
            return False
        s[i] = sqrt(G[i, i])
    for i in range(m):  # largest first, as everybody expects
        best = i
        for j in range(i + 1, m):
            if s[j] > s[best]:
                best = j
        if best != i:
            s[i], s[best] = s[best], s[i]
            for k in range(m):
                turn[k, i], turn[k, best] = turn[k, best], turn[k, i]
    _times(J, turn, W)
    return settled


@lean_part
def _times(J: FloatArray, turn: FloatArray, W: FloatArray) -> None:
    """Fill W (m, n) with ``U^T J``."""
    m, n = J.shape
    for i in range(m):
        for k in range(n):
            W[i, k] = turn[0, i] * J[0, k]
        for a in range(1, m):
            share = turn[a, i]
            for k in range(n):
                W[i, k] += share * J[a, k]


@lean_part
def _directions(
    J: FloatArray,
    b: FloatArray,
    rate: FloatArray,
    error: FloatArray,
    joints: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    dt: float,
    size: float,
    turn: FloatArray,
    other: FloatArray,
    room: Room,
) -> bool:
    """What :func:`levels.approach_kernel.directions` fills, by rotations; whether it did."""
    m, n = J.shape
    if m > n or m > turn.shape[0]:
        return False
    if not _turned(J, turn, room):
        _straight(turn)
        return False
    if not _left_out(J, b, joints, lower, upper, size, rate.shape[0] > 0, turn, room):
        _fill(J, b, rate, error, joints, dt, size, turn, room)
        return True
    if not _turned(room.A[:m], other, room):
        _straight(other)
        return False
    _fill(room.A[:m], b, rate, error, joints, dt, size, other, room)
    return True


@lean_part
def _straight(turn: FloatArray) -> None:
    for i in range(turn.shape[0]):
        for j in range(turn.shape[1]):
            turn[i, j] = 1.0 if i == j else 0.0


@lean_part
def _left_out(
    J: FloatArray,
    b: FloatArray,
    joints: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    size: float,
    moving: bool,
    turn: FloatArray,
    room: Room,
) -> bool:
    """Fill room.A with J less the joints that :mod:`cartctl.levels.left_out` leaves out: whether there is any."""
    (m, n), s, W, wanted, stood, found = J.shape, room.s, room.W, room.x, room.stood, False
    for j in range(n):
        wanted[j] = 0.0
        stood[j] = 0.0
    if lower.shape[0] == 0:
        return False
    for k in range(m):
        total = 0.0
        for i in range(m):
            total += turn[i, k] * b[i]
        damped = total / (s[k] * s[k] + (_WANTED * size) ** 2)
        for j in range(n):
            wanted[j] += W[k, j] * damped
            stood[j] += W[k, j] * total
    flat = level_of(b, size)
    for j in range(n):
        still, whole, by = joints[STILL, j], joints[WHOLE, j], wanted[j]
        if not moving:
            by = stood[j] if abs(stood[j]) > flat else 0.0
        stood[j] = 0.0
        if not (moving or stands(by, lower[j], upper[j], still, whole, False)):
            by = wanted[j]
        if not stands(by, lower[j], upper[j], still, whole, False):
            continue
        if is_pressed(wanted[j], still):
            stood[j] = 1.0 if by > 0.0 else -1.0
        if not found:
            found = True
            for i in range(m):
                for k in range(n):
                    room.A[i, k] = J[i, k]
        for i in range(m):
            room.A[i, j] = 0.0
    return found


@lean_part
def _fill(
    J: FloatArray,
    b: FloatArray,
    rate: FloatArray,
    error: FloatArray,
    joints: FloatArray,
    dt: float,
    size: float,
    turn: FloatArray,
    room: Room,
) -> None:
    """U, Vt and D of J, whose left singular vectors U and values are known, and ``U^T J``."""
    (m, n), s, W, U, Vt, D, far = J.shape, room.s, room.W, room.U, room.Vt, room.D, 0.0
    for i in range(m):
        far += error[i] * error[i]
    far = sqrt(far)
    for k in range(m):
        forward, total, e = 0.0, 0.0, 0.0
        for i in range(m):
            U[i, k] = turn[i, k]
            forward += turn[i, k] * rate[i] if rate.shape[0] > 0 else 0.0
            total += turn[i, k] * b[i]
            e += turn[i, k] * error[i]
        available, speed, inverse = inf, inf, 1.0 / s[k]
        for j in range(n):
            Vt[k, j] = W[k, j] * inverse
            share = abs(Vt[k, j])
            if share > 0.0:
                available = min(available, joints[SLOWING, j] / share)
                speed = min(speed, joints[TOP_SPEED, j] / share if joints[TOP_SPEED, j] > 0.0 else inf)
        D[SIGMA, k], D[FORWARD, k], D[FEEDBACK, k], D[ERROR, k] = s[k], forward, total - forward, abs(e)
        D[AVAILABLE, k], D[SPEED, k], D[BEND, k], D[PULL, k], D[NEXT, k] = available, speed, 0.0, 0.0, 0.0
        D[ASKED, k] = 1.0 if matters(D[:, k], total - forward, far, size, dt) else 0.0


@lean_part
def approached(
    chain: Chain,
    world: FloatArray,
    task: Task,
    J: FloatArray,
    b: FloatArray,
    error: FloatArray,
    rate: FloatArray,
    acceleration: FloatArray,
    moving: bool,
    paced: float,
    joints: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    dt: float,
    size: float,
    bent: FloatArray,
    turn: FloatArray,
    other: FloatArray,
    room: Room,
) -> tuple[float, float, float]:
    """Change b (m,) to what of it the robot can still stop: the calm left below, the pace of its path, ``||J# b||``.

    bent (nv + 1,): the motion inwards when the arm was last clear, and 1 once it is known. turn, other (r, r): the
    left singular vectors of the step before, of J and of what was left of it without joints at their bounds.
    paced: the pace of the step before.
    room.stood (nv,): which way joints are pressed against bounds that they are to be kept at, 0 for others.
    """
    m, n = J.shape
    k = min(m, n)
    U, Vt, D, h, out = room.U, room.Vt, room.D, room.h, room.out
    given = rate if moving else room.nothing
    if not _directions(J, b, given, error, joints, lower, upper, dt, size, turn, other, room):
        _exactly(J, b, given, error, joints, lower, upper, dt, size, k, room)
    for i in range(k):
        if D[ASKED, i] != 0.0:
            along, pulled = 0.0, 0.0
            if task.kind == FRAME:
                task_drift(chain, world, task, Vt[i], room, m, h)
                for a in range(m):
                    along += U[a, i] * h[a]
                    pulled += error[a] * h[a]
            D[BEND, i], D[PULL, i] = along, max(0.0, -pulled)
    pace = 1.0
    if moving and task.waits and size > 0.0:
        pace = _pace_of(chain, world, task, m, k, rate, acceleration, paced, joints, dt, size, room)
        for a in range(m):
            b[a] -= (1.0 - pace) * rate[a]
        for i in range(k):
            D[FORWARD, i] *= pace
    edge = hold(b, U[:m, :k], Vt[:k], D[:, :k], joints, dt, size, True, not moving, out[:m])
    if moving or not is_beyond(edge, D, k, size):
        for j in range(n):
            room.stood[j] = 0.0
    if k > 0 and D[BEND, k - 1] != 0.0:
        _bend_as_before(U, Vt, D, k - 1, m, size, dt, out, bent)
    for a in range(m):
        b[a] = out[a]
    moves = 0.0
    for i in range(k):
        t = 0.0
        for a in range(m):
            t += U[a, i] * b[a]
        moves += (t / D[SIGMA, i]) ** 2 if D[SIGMA, i] > 0.0 else inf
    return edge, pace, sqrt(moves)


@part
def _exactly(
    J: FloatArray,
    b: FloatArray,
    rate: FloatArray,
    error: FloatArray,
    joints: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    dt: float,
    size: float,
    k: int,
    room: Room,
) -> None:
    """The same by :func:`levels.approach_kernel.directions` itself."""
    m, n = J.shape
    U, Vt, D, nothing = np.empty((m, k)), np.empty((k, n)), np.empty((ROWS, k)), room.nothing
    walls = (lower, upper, room.none, nothing, nothing)
    directions(J, b, nothing, rate, error, joints, *walls, dt, size, lower.shape[0] > 0, False, U, Vt, D, room.stood)
    for i in range(k):
        for a in range(m):
            room.U[a, i] = U[a, i]
        for j in range(n):
            room.Vt[i, j] = Vt[i, j]
        for a in range(ROWS):
            room.D[a, i] = D[a, i]


@lean_part
def _pace_of(
    chain: Chain,
    world: FloatArray,
    task: Task,
    m: int,
    k: int,
    rate: FloatArray,
    acceleration: FloatArray,
    paced: float,
    joints: FloatArray,
    dt: float,
    size: float,
    room: Room,
) -> float:
    """The share of its speed at which the joints' accelerations can follow the path's bends."""
    n, x, bend, rises = world.shape[0], room.x, room.h, inf
    U, Vt, D = room.U, room.Vt, room.D
    for turn in range(2):
        for j in range(n):
            x[j] = 0.0
        for i in range(k):
            t, s = 0.0, D[SIGMA, i]
            for a in range(m):
                t += U[a, i] * (rate[a] if turn == 0 else bend[a])
            t *= s / (s * s + (_CLEAR * size) ** 2)
            for j in range(n):
                x[j] += Vt[i, j] * t
        if turn == 0:
            rises = _least_share(joints[SLOWING], x, n)
            task_drift(chain, world, task, x, room, m, bend)
            for a in range(m):
                bend[a] = acceleration[a] - bend[a]
    pace = min(1.0, sqrt(_BENDS * _least_share(joints[SLOWING], x, n)))
    return min(pace, paced + _RISES * rises * dt)


@lean_part
def _least_share(available: FloatArray, x: FloatArray, n: int) -> float:
    """How many times x the joints can bring about."""
    least = inf
    for j in range(n):
        if x[j] != 0.0:
            least = min(least, available[j] / abs(x[j]))
    return least


@lean_part
def _bend_as_before(
    U: FloatArray,
    Vt: FloatArray,
    D: FloatArray,
    i: int,
    m: int,
    size: float,
    dt: float,
    out: FloatArray,
    bent: FloatArray,
) -> None:
    """Send an arm that is asked back from the edge through the singular configuration, if it has come out wrong."""
    n, side = Vt.shape[1], 1.0 if D[BEND, i] > 0.0 else -1.0
    if D[SIGMA, i] > _BENT * size:
        bent[n] = 1.0
        for j in range(n):
            bent[j] = side * Vt[i, j]
        return
    asked, before = 0.0, 0.0
    for a in range(m):
        asked += U[a, i] * out[a]
    for j in range(n):
        before += bent[j] * side * Vt[i, j]
    near = D[SIGMA, i] <= _THROUGH * abs(D[BEND, i])
    if near and bent[n] != 0.0 and asked * D[BEND, i] > 0.0 and before < 0.0:
        through = 2.0 * D[SIGMA, i] * D[SIGMA, i] / (abs(D[BEND, i]) * dt)
        for a in range(m):
            out[a] -= U[a, i] * (asked + (through if asked >= 0.0 else -through))
