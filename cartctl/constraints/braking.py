"""How fast one may approach a bound and still stop before it, in steps of dt.

From speed s = a dt (k + f), k whole and 0 <= f < 1, stopping with at most a takes ``D(s) = a dt^2 (k^2/2 + f (k +
1/2))`` where speed changes within a step (acceleration commands): k steps at full deceleration, the rest in one more.
A step that ends at speed y, begun at s, covers ``(s + y) dt/2``, so that ``(s + y) dt/2 + D(y) <= d`` keeps all that
follows possible. With ``X = (d - s dt/2)/(a dt^2)`` that is ``y <= a dt (X + k (k + 1)/2)/(k + 1)``, ``k = floor((
sqrt(1 + 8 X) - 1)/2)``. Velocity commands move by y dt: the same with X = d/(a dt^2). (The usual sqrt(2 a d) is not
viable in discrete time: it comes too late by up to a whole step.)
"""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray


def allowed_speed(distance: FloatArray, deceleration: float, dt: float) -> FloatArray:
    """The largest speed y (k,), m/s, from ``distance`` (k,) >= 0 in m; inf where that is inf.

    Never above distance / dt, so that no step crosses, and falling by at most ``deceleration`` dt a step.
    """
    step = deceleration * dt
    X = np.maximum(distance, 0.0) / (step * dt)
    k = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * X) - 1.0))
    near = np.isfinite(k)
    k = np.where(near, k, 0.0)
    return np.where(near, step * (X + 0.5 * k * (k + 1.0)) / (k + 1.0), np.inf)
