"""A point that runs round an ellipse by one of this package's laws of time: its pose and rates, inside a kernel."""

from __future__ import annotations

from math import cos, sin

from cartctl.checks import FloatArray
from cartctl.kernels import lean_part

# a curve: centre and two axes, the rotation held, then these
START_ANGLE, PHASE, DURATION, RAMP, LENGTH = 18, 19, 20, 21, 22


@lean_part
def _ramp(ramp: float, tau: float) -> tuple[float, float, float]:
    cruise, x = 1.0 / (1.0 - ramp), tau / ramp
    return (
        cruise * ramp * x * x * x * (1.0 - 0.5 * x),
        cruise * x * x * (3.0 - 2.0 * x),
        cruise / ramp * 6.0 * x * (1.0 - x),
    )


@lean_part
def _progress(ramp: float, tau: float) -> tuple[float, float, float]:
    """How far, and the two rates: by :class:`SmoothTrapezoid`, or without a ramp by :class:`Quintic`."""
    rest = 1.0 - tau
    if ramp == 0.0:
        return (
            tau * tau * tau * (10.0 + tau * (6.0 * tau - 15.0)),
            30.0 * tau * tau * rest * rest,
            60.0 * tau * rest * (1.0 - 2.0 * tau),
        )
    if tau > 1.0 - ramp:
        s, s_dot, s_ddot = _ramp(ramp, rest)
        return 1.0 - s, s_dot, -s_ddot
    if tau < ramp:
        return _ramp(ramp, tau)
    cruise = 1.0 / (1.0 - ramp)
    return cruise * (tau - 0.5 * ramp), cruise, 0.0


@lean_part
def curve_sample(curve: FloatArray, t: float, out: FloatArray) -> None:
    """Fill out (25,) with the time, pose, twist and acceleration of :meth:`PlaneLoop._sample`."""
    rate = 1.0 / curve[DURATION]
    s, s_dot, s_ddot = 1.0 if t > 0.0 else 0.0, 0.0, 0.0
    if 0.0 < t < curve[DURATION]:
        s, s_dot, s_ddot = _progress(curve[RAMP], t / curve[DURATION])
    whole = curve[PHASE]
    angle, speed, change = whole * s + curve[START_ANGLE], whole * s_dot * rate, whole * s_ddot * rate * rate
    c, d = cos(angle), sin(angle)
    out[0] = t
    for k in range(9):
        out[1 + k] = curve[9 + k]
    for k in range(3):
        r, tangent = curve[3 + k] * c + curve[6 + k] * d, curve[6 + k] * c - curve[3 + k] * d
        out[10 + k] = curve[k] + r
        out[13 + k], out[16 + k] = speed * tangent, 0.0
        out[19 + k], out[22 + k] = change * tangent - speed * speed * r, 0.0
