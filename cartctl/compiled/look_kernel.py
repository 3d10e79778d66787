"""What a step begins with: forward kinematics, every task's rows, error and command, and the bounds on u."""

from __future__ import annotations

from math import isfinite, pi, sqrt

from cartctl.checks import LARGEST as FAR
from cartctl.checks import FloatArray
from cartctl.compiled import store_kernel as at
from cartctl.compiled.curve_kernel import curve_sample
from cartctl.compiled.motion_kernel import (
    CONTINUOUS,
    coordinates,
    error_between,
    forward,
    frame_jacobian,
    place_frame,
)
from cartctl.compiled.plan_kernel import FRAME
from cartctl.compiled.store_kernel import Store, chain_in, index_in, own_times
from cartctl.kernels import lean_part
from cartctl.levels.velocity_kernel import velocity_bounds

REFUSED, ASTRAY, RECOVERING = 1, 2, 4  # bits of what looking may come to
_UNIT = 0.99e-6  # how far a (cos, sin) pair may be from unit norm; a little less than what a robot accepts

(NV, TASKS, ROWS, BOUNDED, BEGINS, AT, J, A, LIMITS, LOWER, UPPER) = (
    at.NV, at.TASKS, at.ROWS, at.BOUNDED, at.BEGINS, at.AT, at.J, at.A, at.LIMITS, at.LOWER, at.UPPER,
)  # fmt: skip
(POINT, FOUND, GAIN, UNIT, TURNING, ERROR, RATE, BEND, B) = (
    at.POINT, at.FOUND, at.GAIN, at.UNIT, at.TURNING, at.ERROR, at.RATE, at.BEND, at.B,
)  # fmt: skip
KIND, OPEN_POSITION, OPEN_ROTATION, PATH, WHOLE, NATURAL, OWN = (
    at.KIND, at.OPEN_POSITION, at.OPEN_ROTATION, at.PATH, at.WHOLE, at.NATURAL, at.OWN,
)  # fmt: skip
SAMPLE, CURVE, CURVED, DT, SIX, HEAD = at.SAMPLE, at.CURVE, at.CURVED, at.DT, at.SIX, at.HEAD


@lean_part
def _sound(s: Store, q: FloatArray, v: FloatArray, t: float) -> bool:
    """Whether a state is one; who is in doubt asks a Robot."""
    far, fast = 0.0, 0.0
    for i in range(q.shape[0]):
        far += q[i] * q[i]
    for i in range(v.shape[0]):
        fast += v[i] * v[i]
    if not (far <= FAR * FAR and fast <= FAR * FAR and isfinite(t)):
        return False
    chain = chain_in(s)
    for i in range(v.shape[0]):
        if chain.kind[i] == CONTINUOUS:
            x, y = q[chain.at[i]], q[chain.at[i] + 1]
            if not abs(sqrt(x * x + y * y) - 1.0) < _UNIT:
                return False
    return True


@lean_part
def _joints(s: Store, p: int, first: int, last: int) -> None:
    """Error and command of a task on joints; its rows of the identity are there already."""
    dof = index_in(s).dof
    for i in range(first, last):
        here = s.wide[AT, dof[i]]
        if s.ints[BEGINS] != 0:
            s.high[FOUND, i] = here
        gap = (s.high[FOUND, i] if s.each[OPEN_POSITION, p] != 0.0 else s.high[POINT, i]) - here
        if s.high[TURNING, i] != 0.0:
            gap = (gap + pi) % (2.0 * pi) - pi
        s.high[ERROR, i] = gap
        s.high[B, i] = s.high[GAIN, i] * gap


@lean_part
def _frame(s: Store, p: int, first: int, last: int) -> None:
    """Rows, error and command of a frame task."""
    n, count = s.ints[NV], s.ints[TASKS]
    chain, world, joint, dof = chain_in(s), s.twelve[n : 2 * n], index_in(s).joint[p], index_in(s).dof
    a = 2 * n + p
    pose, found, goal, wanted = s.twelve[a], s.twelve[a + count], s.twelve[a + 2 * count], s.twelve[2 * n + 4 * count]
    place_frame(world, joint, s.twelve[a + 3 * count], pose)
    moving, sample = s.each[PATH, p] >= 0.0, s.samples[SAMPLE * p : SAMPLE * (p + 1)]
    if s.each[CURVED, p] != 0.0:
        curve_sample(s.curves[CURVE * p : CURVE * (p + 1)], s.each[OWN, p], sample)
    for k in range(12):
        if s.ints[BEGINS] != 0:
            found[k] = pose[k]
        left_open = s.each[OPEN_ROTATION, p] if k < 9 else s.each[OPEN_POSITION, p]
        wanted[k] = found[k] if left_open != 0.0 else sample[1 + k] if moving else goal[k]
    e, jacobian = s.head[SIX:HEAD], s.wide[J : J + 6]
    error_between(pose, wanted, e)
    frame_jacobian(chain, world, joint, pose, jacobian)
    for i in range(first, last):
        r, unit = dof[i], s.high[UNIT, i]
        s.high[ERROR, i] = e[r] * unit
        s.high[B, i] = s.high[GAIN, i] * s.high[ERROR, i]
        if moving:
            s.high[RATE, i], s.high[BEND, i] = sample[13 + r] * unit, sample[19 + r] * unit
            s.high[B, i] += s.high[RATE, i]
        for k in range(n):
            s.wide[A + i, k] = jacobian[r, k] * unit
    if s.each[WHOLE, p] == 0.0:
        total = 0.0
        for i in range(6):
            for k in range(n):
                total += jacobian[i, k] * jacobian[i, k]
        s.each[NATURAL, p] = sqrt(total)


@lean_part
def look(s: Store, q: FloatArray, v: FloatArray, t: float) -> int:
    """Fill the store with what the state q (nq,), v (nv,) at time t asks: RECOVERING, or why it cannot be answered.

    Paths have been sampled at the tasks' own times.
    """
    if not _sound(s, q, v, t):
        return REFUSED
    n, first = s.ints[NV], index_in(s).first
    forward(chain_in(s), q, s.twelve[n : 2 * n])
    coordinates(chain_in(s), q, s.wide[AT])
    own_times(s, t)
    for p in range(s.ints[TASKS]):
        if s.each[KIND, p] == FRAME:
            _frame(s, p, first[p], first[p + 1])
        else:
            _joints(s, p, first[p], first[p + 1])
    total = 0.0
    for i in range(s.ints[ROWS]):
        total += s.high[B, i] * s.high[B, i]
    if not isfinite(total):
        return ASTRAY
    if s.ints[BOUNDED] != 0:
        limits = s.wide[LIMITS : LIMITS + 11]
        if velocity_bounds(s.wide[AT], v, limits, s.head[DT], False, s.wide[LOWER], s.wide[UPPER]):
            return RECOVERING
    return 0
