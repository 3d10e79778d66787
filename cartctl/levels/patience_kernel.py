"""The arithmetic of :mod:`cartctl.levels.patience`, compiled.

What lasts is one array: seconds without getting nearer, the share of the speed limits that is left, seconds of
patience, then p each of the least miss, the way since, and the miss when the share was last whole.
"""

from __future__ import annotations

from math import exp, inf, isfinite, sqrt

from cartctl.checks import FloatArray
from cartctl.kernels import kernel
from cartctl.levels.approach_kernel import TOP_SPEED

IDLE, SHARE, PATIENCE, HEAD = 0, 1, 2, 3
_WORTH = 1e-3  # of a task's size times the way of the joints: what it has to come nearer for that
_MOVES = 1e-3  # of the speed limits: slower is standing
_MET = 1e-4  # of a task's size: a miss as small is none
_MOVED = 1e-2  # of a task's size: a miss that changes as much is somebody else's doing
_OWN = 2.0  # of the last step times the task's size: what of a change is the robot's own doing
_SLOWS = 0.1  # s in which the share falls to 1/e of itself
_RETURNS = 3.0  # s in which it rises to e times itself, while that leads nearer
_STRAIGHT = 0.05  # s: who came nearer as lately does so now
_LEAST = 1e-9  # the share of one who stands


@kernel("void(out_vector, float)")
def forget(state: FloatArray, patience: float) -> None:
    """As before the first step."""
    p = (state.shape[0] - HEAD) // 3
    state[IDLE], state[SHARE], state[PATIENCE] = 0.0, 1.0, patience
    for k in range(p):
        state[HEAD + k], state[HEAD + p + k], state[HEAD + 2 * p + k] = inf, 0.0, 0.0


@kernel("void(vector, vector, vector, matrix, float, out_vector)")
def look_on(
    missed: FloatArray, sizes: FloatArray, v: FloatArray, joints: FloatArray, dt: float, state: FloatArray
) -> None:
    """Take note of a step made at velocity v (nv,), the tasks missed (p,) by so much, their J as large as sizes."""
    p, n = missed.shape[0], v.shape[0]
    least, way, before = HEAD, HEAD + p, HEAD + 2 * p
    motion, share = 0.0, 0.0
    for j in range(n):
        motion += v[j] * v[j]
        top = joints[TOP_SPEED, j] if isfinite(joints[TOP_SPEED, j]) else 1.0
        share = max(share, abs(v[j]) / top if top > 0.0 else 0.0)
    step = sqrt(motion) * dt
    for k in range(p):
        if state[SHARE] < 1.0 and abs(missed[k] - state[before + k]) > (_MOVED + _OWN * step) * sizes[k]:
            forget(state, state[PATIENCE])
            return
    for k in range(p):
        state[way + k] += step
    if share > _MOVES or state[SHARE] < 1.0:
        state[IDLE] += dt
    for k in range(p):
        if missed[k] < state[least + k] - _WORTH * sizes[k] * state[way + k]:
            for i in range(k, p):
                state[least + i], state[way + i] = missed[i], 0.0
            state[IDLE] = 0.0
            break
    far = False
    for k in range(p):
        far = far or missed[k] > _MET * sizes[k]
    if state[IDLE] > state[PATIENCE] and far:
        at = state[SHARE] if state[SHARE] < 1.0 else min(1.0, share)
        state[SHARE] = max(at * exp(-dt / _SLOWS), _LEAST)
    elif state[SHARE] < 1.0 and state[IDLE] <= _STRAIGHT:
        state[SHARE] = min(1.0, state[SHARE] * exp(dt / _RETURNS))
    if state[SHARE] == 1.0 or state[IDLE] <= state[PATIENCE] + 10.0 * _SLOWS:
        for k in range(p):
            state[before + k] = missed[k]


@kernel("void(vector, matrix, float, float, bool, out_vector, out_vector)")
def slow_down(
    v: FloatArray,
    joints: FloatArray,
    share: float,
    dt: float,
    at_acceleration: bool,
    lower: FloatArray,
    upper: FloatArray,
) -> None:
    """Narrow the box (nv,) on the next velocity, or the acceleration, to a share of the speed limits, if it can be."""
    for j in range(v.shape[0]):
        top = joints[TOP_SPEED, j] if isfinite(joints[TOP_SPEED, j]) else 1.0
        low, high = -share * top, share * top
        if at_acceleration:
            low, high = (low - v[j]) / dt, (high - v[j]) / dt
        down, up = lower[j], upper[j]
        lower[j], upper[j] = max(down, min(low, up)), min(up, max(high, down))
