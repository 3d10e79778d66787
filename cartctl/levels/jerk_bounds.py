"""The kernel behind velocity and acceleration bounds with jerk limits: a stopping manoeuvre must always be left.

In the next acceleration ``a+``, ``v+ = v + a+ dt``, ``p+ = p + v+ dt`` (p as in ``velocity_kernel``). An a+ within
``a + [j_min, j_max] dt`` and the acceleration limits is admissible iff the stopping manoeuvre after it (see
``jerk_manoeuvre``) keeps position and velocity limits. The manoeuvre's own next step is admissible again, so the bounds
contain it and are never empty; those for the lower and for the upper limits are one end each.

The bounds are an inner approximation: a joint may not count on bouncing back to save itself, as in
``acceleration_bounds``. A state without an admissible a+ gets the manoeuvre itself. Outside a position limit, the bound
that forces the joint back is the largest a+ whose manoeuvre ends there.
"""

from __future__ import annotations

from cartctl.braking import clamp
from cartctl.checks import FloatArray
from cartctl.kernels import kernel
from cartctl.levels.jerk_manoeuvre import furthest, headroom, stopping
from cartctl.levels.velocity_kernel import SLACK


@kernel("bool(vector, vector, vector, matrix, float, bool, out_vector, out_vector)")
def jerk_bounds(
    q: FloatArray,
    v: FloatArray,
    before: FloatArray,
    limits: FloatArray,
    dt: float,
    at_acceleration: bool,
    lower: FloatArray,
    upper: FloatArray,
) -> bool:
    """Fill the bounds; limits holds the rows of ``bounds._packed``. Whether some joint is recovering."""
    recovering = False
    for i in range(q.shape[0]):
        x = v[i]
        p = q[i] + 0.5 * dt * x if at_acceleration else q[i]
        p_min, p_max, v_min, v_max, a_min, a_max, j_min, j_max = limits[:8, i]
        a = (x - before[i]) / dt
        least, most = a + j_min * dt, a + j_max * dt
        first = clamp(stopping(x, dt, j_min, j_max, a_min, a_max), least, most)
        low, high = first, first
        if limits[10, i] == 0.0:
            least, most = clamp(a_min, least, most), clamp(a_max, least, most)
            high = furthest(p, x, first, most, dt, j_min, j_max, a_min, a_max, v_max, p_max)
            low = -furthest(-p, -x, -first, -least, dt, -j_max, -j_min, -a_max, -a_min, -v_min, -p_min)
            room = min(
                headroom(p, x, first, dt, j_min, j_max, a_min, a_max, v_max, p_max),
                headroom(-p, -x, -first, dt, -j_max, -j_min, -a_max, -a_min, -v_min, -p_min),
            )
            slack = SLACK * (1.0 + abs(x))
            outside = min(p, q[i]) < p_min - SLACK or max(p, q[i]) > p_max + SLACK
            if outside or room < -slack or x < v_min - slack or x > v_max + slack:
                recovering = True
            if p < p_min:
                back = furthest(p, x, first, most, dt, j_min, j_max, a_min, a_max, limits[9, i], p_min)
                low = min(max(low, back), high)
            elif p > p_max:
                back = furthest(-p, -x, -first, -least, dt, -j_max, -j_min, -a_max, -a_min, -limits[8, i], -p_max)
                high = max(min(high, -back), low)
        if at_acceleration:
            lower[i], upper[i] = low, high
        else:
            lower[i], upper[i] = x + low * dt, x + high * dt
    return recovering
