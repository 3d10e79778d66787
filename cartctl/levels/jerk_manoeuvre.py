"""The stopping manoeuvre of a joint with jerk limits, and the furthest step after which it still saves the joint.

It takes ``a+ = clamp(g(v), a + j_min dt, a + j_max dt)``, g the acceleration that reaches v = 0 soonest without passing
it (the formula of ``braking`` one derivative higher, within the acceleration limits), and moves by ``v+ = v + a+ dt``,
``p+ = p + v+ dt``: to rest as soon as can be.

Its positions and velocities, sample by sample, do not fall as its first a+ rises. (g falls with v, ``v + g(v) dt`` does
not, and along a = g(v) the jerk limits hold; so a manoeuvre above that curve stays above it, one below stays below,
and two on one side keep their order.) So the a+ that keep the upper limits are a half-line, and its end can be
searched for; lower limits are those of the mirrored joint.
"""

from __future__ import annotations

import numpy as np

from cartctl.braking import clamp, fastest
from cartctl.kernels import part

_STANDS = 1e-16  # rad/s or m/s; below any round-off that matters
_LONGEST = 1_000_000  # samples of one manoeuvre: an end to the loop for a state that is not finite
_TRIALS = 100
_NARROW = 1e-13  # of a bracket, relative
_ROUND_OFF = 1e-15  # of the room, relative: no more of it can be told from none


@part
def stopping(v: float, dt: float, j_min: float, j_max: float, a_min: float, a_max: float) -> float:
    """``g(v)``: the acceleration that brings v to zero soonest and without passing it."""
    if v > 0.0:
        return max(-fastest(v, j_max, dt), a_min)
    return min(fastest(-v, -j_min, dt), a_max)


@part
def headroom(
    p: float,
    v: float,
    a: float,
    dt: float,
    j_min: float,
    j_max: float,
    a_min: float,
    a_max: float,
    v_max: float,
    p_max: float,
) -> float:
    """What the step ``a`` from (p, v) and the stopping manoeuvre after it leave below v_max and p_max, the smaller."""
    if np.isinf(v_max) and np.isinf(p_max):
        return np.inf
    v += a * dt
    p += v * dt
    v_top, p_top = v, p
    for _ in range(_LONGEST):
        wanted = stopping(v, dt, j_min, j_max, a_min, a_max)
        if v <= _STANDS and wanted >= a + j_min * dt:  # on or below the curve a = g(v): v stays below zero
            return min(v_max - v_top, p_max - p_top)
        a = clamp(wanted, a + j_min * dt, a + j_max * dt)
        v += a * dt
        p += v * dt
        v_top, p_top = max(v_top, v), max(p_top, p)
        if a == a_min and v > 0.0:  # constant braking, in one go: down to a bit above where g(v) leaves a_min
            n = np.floor((v - a * a / (2.0 * j_max) + a * dt) / (-a * dt))
            if n >= 2.0:
                p += n * (v + 0.5 * (n + 1.0) * a * dt) * dt
                v += n * a * dt
    return -np.inf


@part
def furthest(
    p: float,
    v: float,
    first: float,
    top: float,
    dt: float,
    j_min: float,
    j_max: float,
    a_min: float,
    a_max: float,
    v_max: float,
    p_max: float,
) -> float:
    """The largest admissible acceleration in [first, top] for the upper limits v_max, p_max; first if there is none."""
    if np.isinf(v_max) and np.isinf(p_max):
        return top
    good, bad = first, max(first, min(top, (min(v_max, (p_max - p) / dt) - v) / dt))
    room = headroom(p, v, good, dt, j_min, j_max, a_min, a_max, v_max, p_max)
    used_up = _ROUND_OFF * (1.0 + abs(p) + abs(v))
    if room <= used_up:
        return first
    excess = headroom(p, v, bad, dt, j_min, j_max, a_min, a_max, v_max, p_max)
    if excess >= -used_up:
        return bad
    side = 0
    for trial in range(_TRIALS):
        if bad - good <= _NARROW * (abs(good) + abs(bad)):
            break
        # false position, halving the end that stays (Dowell & Jarratt's Illinois rule), with a bisection now and then
        share = 0.5 if trial % 4 == 3 else clamp(room / (room - excess), _NARROW, 1.0 - _NARROW)
        a = good + (bad - good) * share
        left = headroom(p, v, a, dt, j_min, j_max, a_min, a_max, v_max, p_max)
        if abs(left) <= used_up:
            return a
        if left > 0.0:
            good, room = a, left
            excess *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            bad, excess = a, left
            room *= 0.5 if side == -1 else 1.0
            side = -1
    return good
