"""Joint limits as bounds on u = a, for a robot that moves by ``q+ = q + v dt + u dt^2/2``, ``v+ = v + u dt``.

With the control point ``p = q + v dt/2`` and the next velocity ``y = v + u dt``, ``p+ = q+ + y dt/2 = p + y dt``: the
control point moves as a robot at the velocity level does. So y gets the bounds of that level at p, and

``lower = max(a_min, (v_min - v)/dt, (-f(p - q_min, a_max) - v)/dt)``, upper likewise, f as in ``velocity_bounds``.

What holds: q(t) is a quadratic B-spline with control points p, within one step the parabola over q, p, q+ (Bezier). It
lies in their convex hull, so position limits hold at the samples *and between them*; v(t) is piecewise linear, so do
velocity limits. That costs at most a_max dt^2/8 of room: the stopping distance behind f, v^2/2a interpolated linearly
between multiples of a dt, is that of a joint that stops in whole steps and then stands. A joint that came nearer would
have to bounce back at full acceleration (the viable set of Del Prete 2018, "Joint position and velocity bounds in
discrete-time acceleration/torque control of robot arms", RA-L 3(1), needs that, and room for it: it can be empty where
the range or v_max is smaller than a bounce; this one never is). The bound ``2 (q_min - q - v dt)/dt^2`` alone is not
viable.

A state from which a joint cannot stop in whole steps (p outside, q still inside) counts as recovering.
Units: rad or m, s. Arrays (nv,).
"""

from __future__ import annotations

from typing import ClassVar

from cartctl.levels.bounds import JointBounds


class AccelerationBounds(JointBounds):
    """Bounds on the acceleration of the next step; ``q`` and ``v`` are those at its beginning."""

    at_acceleration: ClassVar[bool] = True
