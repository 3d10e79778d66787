"""Configurations for poses: a damped Gauss-Newton descent inside the joint limits, from one start after another.

With the error e (6,), m and rad, each step solves

    min over d of  ||J d - e||^2 + lambda ||d||^2,   lower <= q + d <= upper,   lambda = ||e||^2 / 2

(the damping of Chan & Lawrence 1988), the limits by an active set: joints whose step would leave their limits are
moved to them, and what is left of e is asked of the others, until none would. A descent that no longer comes nearer is
given up. Starts are taken from a table of poses known by forward kinematics, nearest first.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray, IntArray
from cartctl.compiled.motion_kernel import (
    CONTINUOUS,
    Chain,
    chain_of,
    coordinates,
    error_between,
    forward,
    frame_jacobian,
    integrate,
    place_frame,
)
from cartctl.kernels import kernel, lean_part

_LEAST = 1e-10  # of the damping, relative to the Jacobian's size squared: what keeps a singular system solvable
_LONGEST = 1.0  # rad or m: a step's largest entry
_PATIENCE = 4  # steps in which the error must have fallen
_FALLEN = 0.7  # to this share
NEAREST = 8  # starts taken by nearness; the next ones come in the table's own order


class Arm(NamedTuple):
    """What stays the same from target to target: the tree, the frame on it, and the limits (2, nv)."""

    chain: Chain
    joint: int
    place: FloatArray
    limits: FloatArray


class Bench(NamedTuple):
    """Room to work in."""

    world: FloatArray  # (nv, 12)
    pose: FloatArray  # (12,)
    J: FloatArray  # (6, nv)
    e: FloatArray  # (6,)
    G: FloatArray  # (6, 6)
    y: FloatArray  # (6,)
    d: FloatArray  # (nv,)
    x: FloatArray  # (nv,)
    fixed: IntArray  # (nv,)
    q: FloatArray  # (nq,)
    rest: FloatArray  # (6,)
    behind: FloatArray  # errors of the last steps


@lean_part
def look(arm: Arm, w: Bench, target: FloatArray) -> tuple[float, float]:
    """Where w.q puts the frame, and the error there: of position, m, and of orientation, rad."""
    forward(arm.chain, w.q, w.world)
    place_frame(w.world, arm.joint, arm.place, w.pose)
    error_between(w.pose, target, w.e)
    e = w.e
    return sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]), sqrt(e[3] * e[3] + e[4] * e[4] + e[5] * e[5])


@lean_part
def _solve(w: Bench, damping: float, rest: FloatArray) -> None:
    """``d = J^T (J J^T + damping I)^-1 rest`` over the joints that are not fixed, by Cholesky."""
    G, y, J, n = w.G, w.y, w.J, w.d.shape[0]
    for i in range(6):
        for j in range(i + 1):
            total = damping if i == j else 0.0
            for k in range(n):
                if w.fixed[k] == 0:
                    total += J[i, k] * J[j, k]
            for k in range(j):
                total -= G[i, k] * G[j, k]
            G[i, j] = sqrt(max(total, 0.5 * damping)) if i == j else total / G[j, j]
        total = rest[i]
        for k in range(i):
            total -= G[i, k] * y[k]
        y[i] = total / G[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            y[i] -= G[k, i] * y[k]
        y[i] /= G[i, i]
    for k in range(n):
        if w.fixed[k] == 0:
            total = 0.0
            for i in range(6):
                total += J[i, k] * y[i]
            w.d[k] = total


@lean_part
def _step(arm: Arm, w: Bench, rest: FloatArray) -> None:
    """Fill w.d with the step of w.e under the limits; w.x: the coordinates."""
    n, size, squared = w.d.shape[0], 0.0, 0.0
    for i in range(6):
        squared += w.e[i] * w.e[i]
        rest[i] = w.e[i]
        for k in range(n):
            size += w.J[i, k] * w.J[i, k]
    for k in range(n):
        w.fixed[k] = 0
    damping = 0.5 * squared + _LEAST * size + 1e-300
    for _ in range(n):
        _solve(w, damping, rest)
        more = False
        for k in range(n):
            if w.fixed[k] != 0:
                continue
            to = w.x[k] + w.d[k]
            if to < arm.limits[0, k] or to > arm.limits[1, k]:
                w.d[k] = (arm.limits[0, k] if to < arm.limits[0, k] else arm.limits[1, k]) - w.x[k]
                w.fixed[k] = 1
                more = True
                for i in range(6):
                    rest[i] -= w.J[i, k] * w.d[k]
        if not more:
            break
    longest = 0.0
    for k in range(n):
        longest = max(longest, abs(w.d[k]))
    if longest > _LONGEST:
        for k in range(n):
            w.d[k] *= _LONGEST / longest


@lean_part
def _into(arm: Arm, q: FloatArray) -> None:
    """Limits are kept to the last digit."""
    for k in range(arm.limits.shape[1]):
        if arm.chain.kind[k] != CONTINUOUS:
            at = arm.chain.at[k]
            q[at] = min(max(q[at], arm.limits[0, k]), arm.limits[1, k])


@lean_part
def descend(
    arm: Arm, w: Bench, target: FloatArray, near: float, aligned: float, most: int
) -> tuple[bool, float, float, int]:
    """Move w.q until the pose is within ``near`` m and ``aligned`` rad: whether it is, both errors, steps made."""
    rest, behind = w.rest, w.behind
    for k in range(_PATIENCE):
        behind[k] = inf
    away, turned = look(arm, w, target)
    steps = 0
    while not (away <= near and turned <= aligned):
        error = sqrt(away * away + turned * turned)
        if steps >= most or not error < _FALLEN * behind[steps % _PATIENCE]:
            return False, away, turned, steps
        behind[steps % _PATIENCE] = error
        frame_jacobian(arm.chain, w.world, arm.joint, w.pose, w.J)
        coordinates(arm.chain, w.q, w.x)
        _step(arm, w, rest)
        integrate(arm.chain, w.q, w.d, w.q)
        _into(arm, w.q)
        away, turned = look(arm, w, target)
        steps += 1
    return True, away, turned, steps


@lean_part
def _nearest(table: FloatArray, target: FloatArray, span: float, ranked: IntArray, far: FloatArray) -> None:
    """Fill ranked with the rows of the table nearest to the target; span: m that count as much as a radian."""
    count = ranked.shape[0]
    for k in range(count):
        far[k], ranked[k] = inf, 0
    per = 1.0 / (span * span)
    for i in range(table.shape[0]):
        x, y, z = table[i, 9] - target[9], table[i, 10] - target[10], table[i, 11] - target[11]
        apart = (x * x + y * y + z * z) * per
        turn = 3.0  # 2 (1 - cos angle) is 3 - trace(R^T R_d)
        for k in range(9):
            turn -= table[i, k] * target[k]
        apart += turn
        if apart < far[count - 1]:
            k = count - 1
            while k > 0 and far[k - 1] > apart:
                far[k], ranked[k] = far[k - 1], ranked[k - 1]
                k -= 1
            far[k], ranked[k] = apart, i


@kernel(
    "void(matrix, vector, matrix, matrix, matrix, matrix, matrix, float, float, float, int, int, "
    "out_matrix, out_matrix)",
    fast=True,
    alone=True,
)
def reach(
    joints: FloatArray,
    frame: FloatArray,
    limits: FloatArray,
    starts: FloatArray,
    table: FloatArray,
    first: FloatArray,
    targets: FloatArray,
    near: float,
    aligned: float,
    span: float,
    restarts: int,
    most: int,
    found: FloatArray,
    said: FloatArray,
) -> None:
    """For every target (12,), fill its rows of found and said.

    starts (K, nq) and table (K, 12): configurations and the poses they put the frame at. first: (0, nq), (1, nq) or
    (N, nq), where the first attempt begins. found (N c, nq): c answers a target, or its best attempt in all; said
    (N c, 5): whether it is an answer, error of position and orientation, steps and restarts so far.
    """
    chain, n, nq, count = chain_of(joints), joints.shape[0], found.shape[1], found.shape[0] // max(1, targets.shape[0])
    bounds = np.empty((2, n))
    for j in range(n):
        bounds[0, j], bounds[1, j] = limits[0, j], limits[1, j]
    arm = Arm(chain, int(frame[0]), np.ascontiguousarray(frame[1:]), bounds)
    known, q = np.ascontiguousarray(table), np.empty(nq)
    w = Bench(
        np.empty((n, 12)),
        np.empty(12),
        np.empty((6, n)),
        np.empty(6),
        np.empty((6, 6)),
        np.empty(6),
        np.empty(n),
        np.empty(n),
        np.empty(n, np.int64),
        q,
        np.empty(6),
        np.empty(_PATIENCE),
    )
    carrying = np.zeros(n, np.int64)
    j = arm.joint
    while j >= 0:
        carrying[j] = 1
        j = chain.parent[j]
    ranked, far = np.empty(min(NEAREST, known.shape[0]), np.int64), np.empty(NEAREST)
    target = np.empty(12)
    for i in range(targets.shape[0]):
        for k in range(12):
            target[k] = targets[i, k]
        answers, best, all_steps, looked, attempt = 0, inf, 0, False, 0
        while attempt <= restarts and answers < count:
            if first.shape[0] > 0:
                row = i if first.shape[0] > 1 else 0
                for k in range(nq):
                    q[k] = first[row, k]
                _into(arm, q)
            if attempt > 0 or first.shape[0] == 0:
                if not looked:
                    _nearest(known, target, span, ranked, far)
                    looked = True
                k = attempt - (1 if first.shape[0] > 0 else 0)
                row = ranked[k] if k < ranked.shape[0] else k % known.shape[0]
                for j in range(n):  # joints that do not move the frame stay where the first attempt has them
                    if carrying[j] != 0 or first.shape[0] == 0:
                        for k in range(chain.at[j], chain.at[j] + (2 if chain.kind[j] == CONTINUOUS else 1)):
                            q[k] = starts[row, k]
            done, away, turned, steps = descend(arm, w, target, near, aligned, most)
            all_steps += steps
            error = away / near + turned / aligned
            if done or (answers == 0 and error < best):
                at = i * count + answers
                best = error
                for k in range(nq):
                    found[at, k] = q[k]
                said[at, 0], said[at, 1], said[at, 2] = 1.0 if done else 0.0, away, turned
                said[at, 3], said[at, 4] = float(all_steps), float(attempt)
            answers += 1 if done else 0
            attempt += 1
        for k in range(max(answers, 1), count):
            said[i * count + k, 0] = 0.0
        if answers == 0:
            said[i * count, 3], said[i * count, 4] = float(all_steps), float(attempt - 1)
