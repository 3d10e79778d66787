"""How fast one may move at a distance from where one has to stand: the formula under all bounds on positions.

A joint that moves by ``q+ = q + u dt`` and slows down by at most ``c dt`` a step travels
``sum_j max(u - j c dt, 0) dt`` until it stands, u the speed of the first step. With ``w = u/(c dt)`` the sum has
``k + 1 = ceil(w)`` terms and stays within the distance d iff ``(k + 1) w - k (k + 1)/2 <= X``, ``X = d/(c dt^2)``. It
is the largest of these lines in w over all k, so the largest w is the smallest over k of
``(X + k (k + 1)/2)/(k + 1)``, taken at
``k = floor((sqrt(1 + 8 X) - 1)/2)``. After a step at that speed the formula, at the distance left, says ``u - c dt``:
it reaches the end exactly, at rest, after k + 1 steps, and a neighbouring k (round-off) gives the same to round-off.
(The usual sqrt(2 c d) is not viable in discrete time: it comes too late by up to a whole step.)

Where the speed changes within a step (acceleration commands), one from s to y covers ``(s + y) dt/2``: the same with
``d - s dt/2`` for d.
"""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.kernels import part


@part
def fastest(distance: float, rate: float, dt: float) -> float:
    """The largest speed that can stop within ``distance >= 0``, slowing down by ``rate dt`` a step from the second on.

    Any of the three may be a derivative higher: distance a speed, rate a jerk, the answer an acceleration.
    """
    if np.isinf(distance):
        return np.inf
    if np.isinf(rate):
        return distance / dt
    unit = rate * dt * dt
    k = np.floor((np.sqrt(1.0 + 8.0 * distance / unit) - 1.0) / 2.0)
    speed: float = (distance + 0.5 * k * (k + 1.0) * unit) / ((k + 1.0) * dt)
    return speed


@part
def approach(distance: float, slowing: float, returning: float, ceiling: float, dt: float) -> float:
    """The largest speed towards a limit at ``distance`` from it; negative, the speed back inside, if it is passed.

    slowing: how much a joint on its way to the limit can slow down, in 1/s^2; returning: one on its way back.
    ceiling: on the speed back.
    """
    if distance >= 0.0:
        return fastest(distance, slowing, dt)
    return -min(fastest(-distance, returning, dt), ceiling)


def allowed_speed(distance: FloatArray, deceleration: float, dt: float) -> FloatArray:
    """:func:`fastest` for each of ``distance`` (k,), m, negative ones as 0; inf where that is inf. (k,), m/s.

    Never above distance / dt, so that no step crosses, and falling by at most ``deceleration`` dt a step.
    """
    return np.array([fastest(max(d, 0.0), deceleration, dt) for d in distance.tolist()])


@part
def clamp(x: float, lower: float, upper: float) -> float:
    """The number in [lower, upper] nearest to x."""
    return min(max(x, lower), upper)
