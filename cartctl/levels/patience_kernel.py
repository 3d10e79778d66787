"""The arithmetic of :mod:`cartctl.levels.patience`, compiled.

What lasts is one array: a head, then p each of the least miss, the way since, and the miss of the step before, then n
of where the robot was told to be by now.
"""

from __future__ import annotations

from math import exp, inf, isfinite, pi, sqrt

from cartctl.checks import FloatArray
from cartctl.kernels import kernel
from cartctl.levels.approach_kernel import TOP_SPEED

# The head: seconds without coming nearer; the share of the speed limits that is left; seconds of patience; the length
# of the step told, -1 before the first one; the share from which on it is seen anew whether a task comes nearer, 0
# where it was whole until now.
IDLE, SHARE, PATIENCE, STEP, TRIES, HEAD = 0, 1, 2, 3, 4, 5
_WORTH = 1e-3  # of a task's size times the way of the joints: what it has to come nearer for that
_MOVES = 1e-3  # of the speed limits: slower is standing
_MET = 1e-4  # of a task's size: a miss as small is none
_MOVED = 1e-3  # of a task's size: a miss that changes as much is somebody else's doing
_OWN = 2.0  # of the last step times the task's size: what of a change is the robot's own doing
_FOLLOWS = 0.3  # of the last step: who ends farther from where it was told to has somebody else to do with
_MAKES_UP = 5.0  # s of idleness that a second of coming nearer makes up for
_AT_MOST = 0.2  # s beyond patience that are counted
_AGAIN = 1.0  # s: the patience with one who has been slowed down already
_SLOWS, _ANEW = 0.1, 0.4  # s in which the share falls to 1/e of itself; of the share, where it is seen anew
_RETURNS, _WORTHWHILE, _SOON = 3.0, 0.05, 0.5  # s in which it rises to e times itself, sooner where that much is won
_STRAIGHT = 0.05  # s: who was not idle for longer comes nearer now
_LEAST = 5e-7  # the share of one who stands
_STANDS = 1e-4  # a share as small: what happens now is somebody else's doing


@kernel("void(out_vector, int, float)")
def forget(state: FloatArray, p: int, patience: float) -> None:
    """As before the first step of p tasks."""
    state[IDLE], state[SHARE], state[PATIENCE], state[STEP], state[TRIES] = 0.0, 1.0, patience, -1.0, 0.0
    for k in range(p):
        state[HEAD + k], state[HEAD + p + k], state[HEAD + 2 * p + k] = inf, 0.0, 0.0


@kernel("void(vector, vector, vector, vector, matrix, float, out_vector)")
def look_on(
    missed: FloatArray,
    sizes: FloatArray,
    x: FloatArray,
    step: FloatArray,
    joints: FloatArray,
    dt: float,
    state: FloatArray,
) -> None:
    """Take note of a step at coordinates x (nv,), told to be ``x + step`` at the next one.

    missed, sizes (p,): how far each task is from its target, and how large its J is.
    """
    p, n, told = missed.shape[0], x.shape[0], state[STEP]
    least, way, before, ahead = HEAD, HEAD + p, HEAD + 2 * p, HEAD + 3 * p
    off, length, share = 0.0, 0.0, 0.0
    for j in range(n):
        gap = (x[j] - state[ahead + j] + pi) % (2.0 * pi) - pi
        off += gap * gap
        length += step[j] * step[j]
        top = joints[TOP_SPEED, j] if isfinite(joints[TOP_SPEED, j]) else 1.0
        share = max(share, abs(step[j]) / (top * dt) if top > 0.0 else 0.0)
        state[ahead + j] = x[j] + step[j]
    state[STEP] = sqrt(length)
    if told >= 0.0:
        for k in range(p):
            if abs(missed[k] - state[before + k]) > (_MOVED + _OWN * told) * sizes[k]:
                forget(state, p, state[PATIENCE])
                told = -1.0
                break
    if told < 0.0:
        for k in range(p):
            state[least + k], state[before + k] = missed[k], missed[k]
        return
    if state[SHARE] == 1.0 and sqrt(off) > _FOLLOWS * told:
        state[IDLE], state[TRIES] = 0.0, 0.0
    won, patience = -1.0, state[PATIENCE] if state[SHARE] == 1.0 else _AGAIN
    for k in range(p):
        state[way + k] += told
    for k in range(p):
        if missed[k] < state[least + k] - _WORTH * sizes[k] * state[way + k]:
            won = (state[least + k] - missed[k]) / (sizes[k] * state[way + k]) if state[way + k] > 0.0 else 0.0
            for i in range(k, p):
                state[least + i], state[way + i] = missed[i], 0.0
            break
    far = False
    for k in range(p):
        far = far or missed[k] > _MET * sizes[k]
    if won >= 0.0:
        state[IDLE] = max(0.0, state[IDLE] - _MAKES_UP * dt)
    elif share > _MOVES or state[SHARE] < 1.0:
        state[IDLE] = min(state[IDLE] + dt, patience + _AT_MOST)
    if state[IDLE] == 0.0:
        state[TRIES] = 0.0
    if state[IDLE] > patience and far:
        at = state[SHARE] if state[SHARE] < 1.0 else min(1.0, share)
        if state[TRIES] == 0.0 or at < _ANEW * state[TRIES]:  # it may have been nearer before, in longer steps
            state[TRIES] = at
            for k in range(p):
                state[least + k], state[way + k] = missed[k], 0.0
        state[SHARE] = max(at * exp(-dt / _SLOWS), _LEAST)
    elif state[SHARE] < 1.0 and won >= 0.0 and state[IDLE] <= _STRAIGHT:
        state[SHARE] = min(1.0, state[SHARE] * exp(dt / (_SOON if won > _WORTHWHILE else _RETURNS)))
    if state[SHARE] > _STANDS:
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
