"""The kernel behind velocity and acceleration bounds without jerk limits.

Both are bounds on the next velocity y, and move a control point by ``p+ = p + y dt``: the joint itself at the velocity
level (y = u), ``p = q + v dt/2`` at the acceleration level (y = v + u dt). See the modules of the two levels.
"""

from __future__ import annotations

from cartctl.braking import approach, clamp
from cartctl.checks import FloatArray
from cartctl.kernels import kernel

SLACK = 1e-9  # rad, m and per s: what counts as outside; far above round-off, far below what matters


@kernel("bool(vector, vector, matrix, float, bool, out_vector, out_vector)")
def velocity_bounds(
    q: FloatArray,
    v: FloatArray,
    limits: FloatArray,
    dt: float,
    at_acceleration: bool,
    lower: FloatArray,
    upper: FloatArray,
) -> bool:
    """Fill the bounds; limits holds the rows of ``bounds._packed``. Whether some joint is recovering."""
    recovering = False
    for i in range(q.shape[0]):
        speed = v[i]
        p = q[i] + 0.5 * dt * speed if at_acceleration else q[i]
        v_min, v_max, a_min, a_max = limits[2, i], limits[3, i], limits[4, i], limits[5, i]
        low, high = 0.0, 0.0
        if limits[10, i] == 0.0:
            high = approach(limits[1, i] - p, -a_min, a_max, -limits[8, i], dt)
            low = min(-approach(p - limits[0, i], a_max, -a_min, limits[9, i], dt), high)
            slack = SLACK * (1.0 + abs(speed))
            if (
                min(p, q[i]) < limits[0, i] - SLACK
                or max(p, q[i]) > limits[1, i] + SLACK
                or max(low, v_min) > speed + a_max * dt + slack
                or min(high, v_max) < speed + a_min * dt - slack
                or speed < v_min - slack
                or speed > v_max + slack
            ):
                recovering = True
            low, high = clamp(low, v_min, v_max), clamp(high, v_min, v_max)
        # an interval of lower rank is projected onto that of a higher one: the intersection, where there is any
        if at_acceleration:
            lower[i] = clamp((low - speed) / dt, a_min, a_max)
            upper[i] = clamp((high - speed) / dt, a_min, a_max)
        else:
            lower[i] = clamp(low, speed + a_min * dt, speed + a_max * dt)
            upper[i] = clamp(high, speed + a_min * dt, speed + a_max * dt)
    return recovering
