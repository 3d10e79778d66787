"""The broad phase: where all parts are, how fast they may come, and which pairs are worth a closer look.

Poses are (N, 12): a rotation row by row, then an origin. ``table`` holds for every part (see :mod:`arrangement`): its
joint, first and last point, whether it is a plane, its radius, the radius and half sides about its middle, the middle.
"""

from __future__ import annotations

from math import exp, inf, sqrt

from cartctl.checks import FloatArray, IntArray
from cartctl.kernels import kernel, part

JOINT, FIRST, LAST, PLANE, RADIUS, REACH, HALF, MIDDLE, WIDTH = 0, 1, 2, 3, 4, 5, 6, 9, 12


@kernel("void(matrix, matrix, matrix, out_matrix)", fast=True)
def place(joints: FloatArray, table: FloatArray, local: FloatArray, world: FloatArray) -> None:
    """``world = joint * local`` (N, 12) for every part."""
    for k in range(local.shape[0]):
        j = int(table[k, 0])
        for a in range(3):
            for b in range(3):
                s = 0.0
                for c in range(3):
                    s += joints[j, 3 * a + c] * local[k, 3 * c + b]
                world[k, 3 * a + b] = s
            t = joints[j, 9 + a]
            for c in range(3):
                t += joints[j, 3 * a + c] * local[k, 9 + c]
            world[k, 9 + a] = t


@kernel("void(matrix, matrix, matrix, matrix, matrix, float, out_matrix)", fast=True)
def haste(
    world: FloatArray,
    table: FloatArray,
    J: FloatArray,
    support: FloatArray,
    rates: FloatArray,
    dt: float,
    out: FloatArray,
) -> None:
    """(N, 3): no point of a part is faster than out[:, 0], m/s, nor are the rates of a step's bend above out[:, 2].

    out[:, 1] is what of that bend differs within the box of rates, m. rates: (2, nv), their centre and half-width.
    """
    for k in range(world.shape[0]):
        j = int(table[k, 0])
        c0, c1, c2 = middle_x(world, table, k, 0), middle_x(world, table, k, 1), middle_x(world, table, k, 2)
        v0, v1, v2, w0, w1, w2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        more, turning, all_turning, all_moving = 0.0, 0.0, 0.0, 0.0
        for i in range(J.shape[1]):
            if support[j, i] == 0.0:
                continue
            o0, o1, o2 = J[3, i], J[4, i], J[5, i]
            x0 = J[0, i] + o1 * c2 - o2 * c1
            x1 = J[1, i] + o2 * c0 - o0 * c2
            x2 = J[2, i] + o0 * c1 - o1 * c0
            u, r = rates[0, i], rates[1, i]
            v0, v1, v2 = v0 + u * x0, v1 + u * x1, v2 + u * x2
            w0, w1, w2 = w0 + u * o0, w1 + u * o1, w2 + u * o2
            turn = sqrt(o0 * o0 + o1 * o1 + o2 * o2)
            move = sqrt(x0 * x0 + x1 * x1 + x2 * x2) + turn * table[k, 5]
            more += r * move
            turning += r * turn
            all_turning += (abs(u) + r) * turn
            all_moving += (abs(u) + r) * move
        out[k, 0] = sqrt(v0 * v0 + v1 * v1 + v2 * v2) + sqrt(w0 * w0 + w1 * w1 + w2 * w2) * table[k, 5] + more
        rest = dt**3 / 6.0 * all_turning * all_turning * all_moving * exp(min(2.0 * all_turning * dt, 50.0))
        out[k, 1] = dt * dt * turning * more + rest
        out[k, 2] = 2.0 * dt * all_turning * all_moving + rest / dt


@part
def middle_x(world: FloatArray, table: FloatArray, k: int, a: int) -> float:
    """Coordinate a of the middle of part k in the world."""
    return float(
        world[k, 9 + a]
        + world[k, 3 * a] * table[k, 9]
        + world[k, 3 * a + 1] * table[k, 10]
        + world[k, 3 * a + 2] * table[k, 11]
    )


@part
def beyond_box(world: FloatArray, table: FloatArray, k: int, x: float, y: float, z: float) -> float:
    """How far a point is outside the box about part k; -inf inside, where the box says nothing."""
    d0, d1, d2 = x - world[k, 9], y - world[k, 10], z - world[k, 11]
    out = 0.0
    for b in range(3):
        local = world[k, b] * d0 + world[k, 3 + b] * d1 + world[k, 6 + b] * d2 - table[k, 9 + b]
        over = abs(local) - table[k, 6 + b]
        if over > 0.0:
            out += over * over
    return sqrt(out) if out > 0.0 else -inf


@part
def apart(world: FloatArray, table: FloatArray, i: int, j: int) -> float:
    """A lower bound of the distance of two parts, from the balls and boxes about them, m."""
    x, y, z = middle_x(world, table, i, 0), middle_x(world, table, i, 1), middle_x(world, table, i, 2)
    if table[j, 3] != 0.0:  # its z axis is the third column
        height = (x - world[j, 9]) * world[j, 2] + (y - world[j, 10]) * world[j, 5] + (z - world[j, 11]) * world[j, 8]
        return float(height - table[i, 5])
    a, b, c = middle_x(world, table, j, 0), middle_x(world, table, j, 1), middle_x(world, table, j, 2)
    balls = sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2) - table[i, 5] - table[j, 5]
    one = beyond_box(world, table, j, x, y, z) - table[i, 5]
    other = beyond_box(world, table, i, a, b, c) - table[j, 5]
    return float(max(balls, max(one, other)))


@kernel("void(matrix, matrix, ints, out_vector)", fast=True)
def bounds(world: FloatArray, table: FloatArray, pairs: IntArray, out: FloatArray) -> None:
    """Lower bounds (P,) of the distances of the pairs (2 P,), m."""
    for p in range(out.shape[0]):
        out[p] = apart(world, table, pairs[2 * p], pairs[2 * p + 1])


@kernel("void(matrix, ints, ints, matrix, matrix, matrix, matrix, matrix, out_matrix)", fast=True)
def gradients(
    table: FloatArray,
    pairs: IntArray,
    chosen: IntArray,
    normals: FloatArray,
    first: FloatArray,
    second: FloatArray,
    J: FloatArray,
    support: FloatArray,
    out: FloatArray,
) -> None:
    """``n^T (J_p1 - J_p2)`` (K, nv) of the chosen pairs: a force n at p1 and -n at p2, seen from the joints."""
    for k in range(chosen.shape[0]):
        one = int(table[pairs[2 * chosen[k]], 0])
        two = int(table[pairs[2 * chosen[k] + 1], 0])
        x, y, z = normals[k, 0], normals[k, 1], normals[k, 2]
        a, b, c = first[k, 0], first[k, 1], first[k, 2]
        d, e, f = second[k, 0], second[k, 1], second[k, 2]
        for i in range(J.shape[1]):
            o0, o1, o2 = J[3, i], J[4, i], J[5, i]
            linear = x * J[0, i] + y * J[1, i] + z * J[2, i]
            at_one = o0 * (b * z - c * y) + o1 * (c * x - a * z) + o2 * (a * y - b * x)
            at_two = o0 * (e * z - f * y) + o1 * (f * x - d * z) + o2 * (d * y - e * x)
            out[k, i] = support[one, i] * (linear + at_one) - support[two, i] * (linear + at_two)


@kernel("int(matrix, matrix, ints, matrix, float, float, float, float, float, out_ints)", fast=True)
def choose(
    world: FloatArray,
    table: FloatArray,
    pairs: IntArray,
    haste: FloatArray,
    margin: float,
    deceleration: float,
    dt: float,
    near: float,
    most_error: float,
    out: IntArray,
) -> int:
    """Fill ``out`` (P,) with the pairs that could come into the margin if they were not slowed; how many there are.

    That is from ``margin + s^2/(2 a) + 2 s dt`` on at the closing speed s, or from ``near`` beyond the margin.
    """
    count = 0
    for p in range(out.shape[0]):
        i, j = pairs[2 * p], pairs[2 * p + 1]
        s = haste[i, 0] + haste[j, 0]
        stray = 4.0 * min(haste[i, 1] + haste[j, 1], most_error)
        reach = margin + stray + min(s * (0.5 * s / deceleration + 2.0 * dt), near + s * dt)
        if apart(world, table, i, j) < reach:
            out[count] = p
            count += 1
    return count
