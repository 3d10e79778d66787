"""Rows that keep two convex parts apart: one a pair of their points, along the normal between them.

n from coal separates the parts if anything does: with a over the points of the first and b over those of the second,
``gap = min n . a - max n . b - r_a - r_b`` is at most the distance d whatever n is, and equal to it for the right one.
So where every ``n . (a - b)`` stays above zero in a step, the parts do not meet in it, and the next distance is at
least the gap that is left: what the new normal sees can only be more. Each ``n . (a - b)`` is bounded as a frame's
position is (see :mod:`cartctl.constraints.position`, whose formulas these are, row by row). A row that no command in
the box can break is left out, which leaves those of the few points that are near.
"""

from __future__ import annotations

from math import copysign, exp, floor, inf, isfinite, sqrt

from cartctl.checks import FloatArray, IntArray
from cartctl.kernels import kernel, part

MOST_ERROR = 0.025  # m: as for a frame's position
BRAKE = 2.0  # times the deceleration planned with
REST = 2e-5  # m held free beside the margin, in which one may rest: a way back of nanometres moves joints by degrees
_SLOW = 0.1  # rad/s or m/s: so slow, the curvature of a motion counts as an error
_ANY_RATE = 10.0  # rad/s or m/s: a joint whose speed nothing limits, where it is asked what is near
SKIP = 1e-9  # m/s: what round-off may be of a row that no command can break


@part
def braked(distance: float, deceleration: float, dt: float) -> float:
    """The largest speed from which one stops within ``distance`` (:mod:`cartctl.braking`)."""
    step = deceleration * dt
    X = max(distance, 0.0) / (step * dt)
    k = floor(0.5 * (sqrt(1.0 + 8.0 * X) - 1.0))
    return float(step * (X + 0.5 * k * (k + 1.0)) / (k + 1.0))


@part
def approach_speed(room: float, error: float, factor: float, settings: FloatArray) -> float:
    """The largest closing speed with ``room`` left; negative: the way back."""
    dt, deceleration, recovery = settings[0], settings[1], settings[2]
    free = room - 2.0 * error
    if free >= 0.0:
        return float(braked(free, deceleration, dt))
    return float(min(max((room - error + REST) * (factor / dt), -max(recovery, error / dt)), 0.0))


@part
def mean_speed(room: float, error: float, closing: float, settings: FloatArray) -> float:
    """The largest mean closing speed of a step that begins at ``closing``."""
    dt = settings[0]
    end = approach_speed(room - 0.5 * dt * closing, error, 2.0, settings)
    return float(0.5 * (closing + max(end, closing - BRAKE * settings[1] * dt)))


@kernel("void(vector, vector, vector, vector, vector, vector, vector, float, out_matrix)")
def mean_rates(
    low: FloatArray,
    high: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    otherwise: FloatArray,
    base: FloatArray,
    v: FloatArray,
    share: float,
    rates: FloatArray,
) -> None:
    """Fill rates (4, nv): centre and half-width of ``base + share u`` in a step, the latter also of no limit, and v.

    u lies in low..high, where those say nothing in lower..upper, else at ``otherwise``. The centre is drawn towards
    zero by _SLOW, so that at rest a row is its tangent: curvature about a slow motion would let a task that a row stops
    go on by picometres, paid for with motions of the null space at full speed, to and fro.
    """
    for j in range(v.shape[0]):
        least, most = low[j], high[j]
        known = (isfinite(least) and isfinite(most)) or (isfinite(lower[j]) and isfinite(upper[j]))
        if not isfinite(least):
            least = lower[j]
        if not isfinite(most):
            most = upper[j]
        if not (isfinite(least) and isfinite(most)):
            least = most = otherwise[j]
        centre = base[j] + share * (0.5 * (least + most))
        drawn = copysign(max(abs(centre) - _SLOW, 0.0), centre)
        wide = share * (0.5 * max(most - least, 0.0)) + abs(centre - drawn)
        rates[0, j], rates[1, j] = drawn, wide
        rates[2, j] = wide if known else _ANY_RATE
        rates[3, j] = v[j]


@part
def height(world: FloatArray, points: FloatArray, k: int, p: int, x: float, y: float, z: float) -> float:
    """Of point p of part k along n = (x, y, z), m."""
    out = 0.0
    for a, n in ((0, x), (1, y), (2, z)):
        at = world[k, 9 + a]
        for b in range(3):
            at += world[k, 3 * a + b] * points[p, b]
        out += n * at
    return out


@part
def highest(
    world: FloatArray, table: FloatArray, points: FloatArray, k: int, x: float, y: float, z: float, sign: float
) -> float:
    """The largest ``sign n . p`` of part k's points."""
    most = -inf
    for p in range(int(table[k, 1]), int(table[k, 2])):
        most = max(most, sign * height(world, points, k, p, x, y, z))
    return most


@part
def add_slope(
    world: FloatArray,
    table: FloatArray,
    points: FloatArray,
    k: int,
    p: int,
    n: FloatArray,
    sign: float,
    J: FloatArray,
    support: FloatArray,
    row: FloatArray,
    V: FloatArray,
) -> None:
    """Add ``sign n^T V`` of a point to row (nv,), its velocities V (3, nv) are kept."""
    j = int(table[k, 0])
    x = world[k, 9] + world[k, 0] * points[p, 0] + world[k, 1] * points[p, 1] + world[k, 2] * points[p, 2]
    y = world[k, 10] + world[k, 3] * points[p, 0] + world[k, 4] * points[p, 1] + world[k, 5] * points[p, 2]
    z = world[k, 11] + world[k, 6] * points[p, 0] + world[k, 7] * points[p, 1] + world[k, 8] * points[p, 2]
    for i in range(J.shape[1]):
        on = support[j, i]
        V[0, i] = on * (J[0, i] + J[4, i] * z - J[5, i] * y)
        V[1, i] = on * (J[1, i] + J[5, i] * x - J[3, i] * z)
        V[2, i] = on * (J[2, i] + J[3, i] * y - J[4, i] * x)
        row[i] += sign * (n[0] * V[0, i] + n[1] * V[1, i] + n[2] * V[2, i])


@part
def add_curvature(
    joint: int,
    n: FloatArray,
    sign: float,
    J: FloatArray,
    support: FloatArray,
    order: FloatArray,
    V: FloatArray,
    H: FloatArray,
    rates: FloatArray,
    dt: float,
) -> float:
    """Add a point's ``sign n . (omega_m x v_i)`` to H (nv, nv), m nearer to the root; a bound of third order, m."""
    turning, moving = 0.0, 0.0
    for i in range(J.shape[1]):
        if support[joint, i] == 0.0:
            continue
        rate = abs(rates[0, i]) + rates[1, i]
        turning += rate * sqrt(J[3, i] ** 2 + J[4, i] ** 2 + J[5, i] ** 2)
        moving += rate * sqrt(V[0, i] ** 2 + V[1, i] ** 2 + V[2, i] ** 2)
        q0 = sign * (n[1] * J[5, i] - n[2] * J[4, i])  # (n x omega) . v = n . (omega x v)
        q1 = sign * (n[2] * J[3, i] - n[0] * J[5, i])
        q2 = sign * (n[0] * J[4, i] - n[1] * J[3, i])
        for m in range(J.shape[1]):
            if order[i, m] != 0.0:
                bend = order[i, m] * (q0 * V[0, m] + q1 * V[1, m] + q2 * V[2, m])
                H[i, m] += bend
                H[m, i] += bend
    return dt**3 / 6.0 * turning * turning * moving * exp(min(2.0 * turning * dt, 50.0))


@part
def wanted_rate(room: float, error: float, closing: float, settings: FloatArray) -> float:
    """The least rate of the gap, m/s: of the next step, or its mean where the speed changes within."""
    if settings[4] != 0.0:
        return -mean_speed(room, error, closing, settings)
    return -approach_speed(room, error, 1.0, settings)


@part
def shortfall(H: FloatArray, radius: FloatArray) -> float:
    """An upper bound of ``-w^T H w`` over ``|w_i| <= radius_i``."""
    out = 0.0
    for i in range(H.shape[0]):
        across = 0.0
        for m in range(H.shape[0]):
            across += abs(H[i, m]) * radius[m]
        out += radius[i] * across - max(H[i, i], 0.0) * radius[i] * radius[i]
    return out


@kernel(
    "int(matrix, matrix, matrix, matrix, ints, ints, matrix, matrix, matrix, matrix, matrix, matrix, vector, "
    "out_matrix, out_vector, out_vector, out_matrix, out_matrix)",
    fast=True,
)
def clearance_rows(
    world: FloatArray,
    ahead: FloatArray,
    table: FloatArray,
    points: FloatArray,
    pairs: IntArray,
    chosen: IntArray,
    normals: FloatArray,
    J: FloatArray,
    support: FloatArray,
    order: FloatArray,
    rates: FloatArray,
    haste: FloatArray,
    settings: FloatArray,
    C: FloatArray,
    lower: FloatArray,
    row: FloatArray,
    V: FloatArray,
    H: FloatArray,
) -> int:
    """Fill ``C u >= lower``; how many rows there are, which may be more than C holds: call again with more.

    rates: (4, nv) centre and half-width of the mean joint rates that errors count on, the half-width that commands may
    use, and the present rates. settings: dt, deceleration, recovery speed, margin, 1 at the acceleration level, and how
    far from the margin rows begin, m.
    """
    dt, margin, accelerating = settings[0], settings[3], settings[4] != 0.0
    nv, count = J.shape[1], 0
    for k in range(chosen.shape[0]):
        i, j = pairs[2 * chosen[k]], pairs[2 * chosen[k] + 1]
        n = normals[k]
        x, y, z = n[0], n[1], n[2]
        top = highest(world, table, points, j, x, y, z, 1.0)
        coming = (highest(ahead, table, points, j, x, y, z, 1.0) - top) / dt if table[j, 0] == 0.0 else 0.0
        used = table[i, 4] + table[j, 4] + margin
        quick, stray = haste[i, 0] + haste[j, 0], min(haste[i, 1] + haste[j, 1], MOST_ERROR)
        sway = haste[i, 2] + haste[j, 2]
        bottom = -highest(world, table, points, i, x, y, z, -1.0)
        for a in range(int(table[i, 1]), int(table[i, 2])):
            at_a = height(world, points, i, a, x, y, z)
            if far(at_a - top - used, quick, stray, at_a == bottom, settings):
                continue
            done = False
            for b in range(int(table[j, 1]), int(table[j, 2])):
                at_b = height(world, points, j, b, x, y, z) if table[j, 0] != 0.0 else top
                room = at_a - at_b - used
                if done or far(room, quick, stray, at_a == bottom and at_b == top, settings):
                    continue
                done = table[j, 0] == 0.0  # what does not hang on the robot counts as a plane
                row[:] = 0.0
                add_slope(world, table, points, i, a, n, 1.0, J, support, row, V[:3])
                if not done:
                    add_slope(world, table, points, j, b, n, -1.0, J, support, row, V[3:])
                closing, least = coming, 0.0
                for c in range(nv):
                    closing -= row[c] * rates[3, c]
                    least += row[c] * rates[0, c] - abs(row[c]) * rates[2, c]
                if least - sway >= coming + wanted_rate(room, stray, closing, settings) + SKIP:
                    continue  # no command can break it, whatever its curvature
                H[:] = 0.0
                error = add_curvature(int(table[i, 0]), n, 1.0, J, support, order, V[:3], H, rates, dt)
                if not done:
                    error += add_curvature(int(table[j, 0]), n, -1.0, J, support, order, V[3:], H, rates, dt)
                error = min(error + 0.5 * dt * dt * shortfall(H, rates[1]), MOST_ERROR)
                offset, least, most, now = 0.0, 0.0, 0.0, 0.0
                for c in range(nv):
                    bend = 0.0
                    for m in range(nv):
                        bend += H[c, m] * rates[0, m]
                    row[c] += dt * bend
                    offset += 0.5 * dt * bend * rates[0, c]
                    least += row[c] * rates[0, c] - abs(row[c]) * rates[2, c]
                    most += row[c] * rates[0, c] + abs(row[c]) * rates[2, c]
                    now += row[c] * rates[3, c]
                wanted = offset + coming + wanted_rate(room, error, closing, settings)
                if room < error - REST:
                    wanted = min(wanted, most - SKIP)  # on the way back, no more than the joints can give
                if least >= wanted + SKIP:
                    continue
                if count < C.shape[0]:
                    for c in range(nv):
                        C[count, c] = row[c]
                    lower[count] = (wanted - now) * (2.0 / dt) if accelerating else wanted
                count += 1
    return count


@part
def far(room: float, quick: float, stray: float, nearest: bool, settings: FloatArray) -> bool:
    """Whether no command at all, at most ``quick``, is faster than what is allowed with ``room`` left.

    Where joints can stop within a step, points behind the nearest ones need a row only when one step takes them in.
    """
    dt = settings[0]
    left = room - 2.0 * stray - (0.5 * dt * quick if settings[4] != 0.0 else 0.0)
    if left > quick * dt and settings[5] < inf and (not nearest or left > settings[5] + quick * dt):
        return True
    return left > 0.0 and braked(left, settings[1], dt) >= quick + stray / dt
