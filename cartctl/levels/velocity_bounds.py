"""Joint limits as bounds on u = v, for a robot that moves by ``q+ = q + u dt``.

``lower = max(v_min, v + a_min dt, -f(q - q_min, a_max))``, ``upper = min(v_max, v + a_max dt, f(q_max - q, -a_min))``
with ``f(d, c) = c dt (X + k (k + 1)/2)/(k + 1)``, ``X = d/(c dt^2)``, ``k = floor((sqrt(1 + 8 X) - 1)/2)``: the largest
speed that full braking c, from the next step on, brings to rest within d (derived in ``braking``). Braking before
the *lower* limit takes the *upper* acceleration limit. c = inf leaves ``f = d/dt``; d = inf leaves no bound.

Why that is viable: u keeps ``-f(q - q_min, a_max) <= u`` iff full braking after it stops in time, and full braking from
the next step on is then inside the bounds of that step: they are never empty, whatever u was taken. No u outside them
can be followed by motion within the limits, so the bounds are as wide as they can be. The ramp
``-sqrt(2 a_max (q - q_min))`` is not viable: braking along it takes up to nearly twice a_max.

Outside (q < q_min), the lower bound becomes ``+f(q_min - q, -a_min)``, the fastest approach that comes to rest at the
limit, so that the way back takes a finite number of steps. Units: rad or m, s. Arrays (nv,).
"""

from __future__ import annotations

from typing import ClassVar

from cartctl.levels.bounds import JointBounds


class VelocityBounds(JointBounds):
    """Bounds on the velocity of the next step; ``v`` is the velocity of the last one."""

    at_acceleration: ClassVar[bool] = False
