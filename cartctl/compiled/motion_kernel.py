"""Forward kinematics, frame Jacobians and their drift, and integration, on the arrays of :mod:`compiled.tree`.

Poses are rows of 12: a rotation row by row, then an origin. World axes; twists are linear first, at the frame's origin.
"""

from __future__ import annotations

from math import atan2, cos, sin
from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray, IntArray
from cartctl.kernels import kernel, lean_part, part
from cartctl.spatial.pose_error import logarithm

PRISMATIC, CONTINUOUS = 1, 2  # kinds of joints; 0 is a revolute one


class Chain(NamedTuple):
    """The tree as the loops read it: parents, kinds, places in q (nv,), places in the parent (nv, 12)."""

    parent: IntArray
    kind: IntArray
    at: IntArray
    place: FloatArray


@part
def chain_of(joints: FloatArray) -> Chain:
    """Contiguous copies of the columns."""
    n = joints.shape[0]
    numbers, place = np.empty((3, n), np.int64), np.empty((n, 12))
    for i in range(n):
        for k in range(3):
            numbers[k, i] = int(joints[i, k])
        for k in range(12):
            place[i, k] = joints[i, 3 + k]
    return Chain(numbers[0], numbers[1], numbers[2], place)


@lean_part
def compose(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    """``out = a * b`` of poses (12,)."""
    for i in range(3):
        x, y, z = a[3 * i], a[3 * i + 1], a[3 * i + 2]
        out[3 * i] = x * b[0] + y * b[3] + z * b[6]
        out[3 * i + 1] = x * b[1] + y * b[4] + z * b[7]
        out[3 * i + 2] = x * b[2] + y * b[5] + z * b[8]
        out[9 + i] = x * b[9] + y * b[10] + z * b[11] + a[9 + i]


@lean_part
def forward(chain: Chain, q: FloatArray, world: FloatArray) -> None:
    """Fill world (nv, 12): the pose of every joint's frame after its own motion; the axis is its third column."""
    for i in range(chain.parent.shape[0]):
        at, pose, up = chain.at[i], world[i], chain.parent[i]
        if up < 0:
            for k in range(12):
                pose[k] = chain.place[i, k]
        else:
            compose(world[up], chain.place[i], pose)
        if chain.kind[i] == PRISMATIC:
            for k in range(3):
                pose[9 + k] += q[at] * pose[3 * k + 2]
            continue
        if chain.kind[i] == CONTINUOUS:
            c, s = q[at], q[at + 1]
        else:
            c, s = cos(q[at]), sin(q[at])
        for k in range(3):
            x, y = pose[3 * k], pose[3 * k + 1]
            pose[3 * k] = c * x + s * y
            pose[3 * k + 1] = c * y - s * x


@lean_part
def place_frame(world: FloatArray, joint: int, place: FloatArray, pose: FloatArray) -> None:
    """Fill pose (12,) of a frame that hangs on a joint (-1: on the world) at ``place``."""
    if joint < 0:
        for k in range(12):
            pose[k] = place[k]
    else:
        compose(world[joint], place, pose)


@lean_part
def frame_jacobian(chain: Chain, world: FloatArray, joint: int, pose: FloatArray, J: FloatArray) -> None:
    """Fill J (6, nv), LOCAL_WORLD_ALIGNED, of a frame at ``pose`` on ``joint``: ``[z x (p - o); z]``, or ``[z; 0]``."""
    for a in range(6):
        for j in range(J.shape[1]):
            J[a, j] = 0.0
    j = joint
    while j >= 0:
        x, y, z = world[j, 2], world[j, 5], world[j, 8]
        if chain.kind[j] == PRISMATIC:
            J[0, j], J[1, j], J[2, j] = x, y, z
        else:
            a, b, c = pose[9] - world[j, 9], pose[10] - world[j, 10], pose[11] - world[j, 11]
            J[0, j], J[1, j], J[2, j] = y * c - z * b, z * a - x * c, x * b - y * a
            J[3, j], J[4, j], J[5, j] = x, y, z
        j = chain.parent[j]


@lean_part
def frame_drift(
    chain: Chain, world: FloatArray, joint: int, pose: FloatArray, v: FloatArray, order: IntArray, out: FloatArray
) -> None:
    """Fill out (6,) with ``J_dot v``: the classical acceleration of the frame where no joint accelerates; order: room.

    From the world to the frame: with w, a, p_dot, p_ddot of the joint before, the next origin moves by
    ``p_dot + w x r`` and ``p_ddot + a x r + w x (w x r)``, and its own rate v adds ``w x z v`` to a, or ``2 w x z v``
    to p_ddot where it slides.
    """
    count, j = 0, joint
    while j >= 0:
        order[count] = j
        count += 1
        j = chain.parent[j]
    wx, wy, wz, ax, ay, az, lx, ly, lz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    ox, oy, oz = 0.0, 0.0, 0.0
    for k in range(count - 1, -2, -1):
        j = order[k] if k >= 0 else 0
        px, py, pz = pose[9], pose[10], pose[11]
        if k >= 0:
            px, py, pz = world[j, 9], world[j, 10], world[j, 11]
        rx, ry, rz = px - ox, py - oy, pz - oz
        ux, uy, uz = wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx
        lx += ay * rz - az * ry + wy * uz - wz * uy
        ly += az * rx - ax * rz + wz * ux - wx * uz
        lz += ax * ry - ay * rx + wx * uy - wy * ux
        ox, oy, oz = px, py, pz
        if k < 0:
            break
        zx, zy, zz = v[j] * world[j, 2], v[j] * world[j, 5], v[j] * world[j, 8]
        cx, cy, cz = wy * zz - wz * zy, wz * zx - wx * zz, wx * zy - wy * zx
        if chain.kind[j] == PRISMATIC:
            lx += 2.0 * cx
            ly += 2.0 * cy
            lz += 2.0 * cz
        else:
            ax += cx
            ay += cy
            az += cz
            wx += zx
            wy += zy
            wz += zz
    out[0], out[1], out[2], out[3], out[4], out[5] = lx, ly, lz, ax, ay, az


@lean_part
def integrate(chain: Chain, q: FloatArray, step: FloatArray, out: FloatArray) -> None:
    """Fill out (nq,) with ``q (+) step``; a (cos, sin) pair is turned, and brought back to unit norm to first order."""
    for i in range(chain.parent.shape[0]):
        at = chain.at[i]
        if chain.kind[i] == CONTINUOUS:
            c, s = cos(step[i]), sin(step[i])
            x, y = c * q[at] - s * q[at + 1], s * q[at] + c * q[at + 1]
            unit = 0.5 * (3.0 - (x * x + y * y))
            out[at], out[at + 1] = x * unit, y * unit
        else:
            out[at] = q[at] + step[i]


@lean_part
def coordinates(chain: Chain, q: FloatArray, out: FloatArray) -> None:
    """Fill out (nv,) with the joints' coordinates; of continuous ones the angle in [-pi, pi]."""
    for i in range(chain.parent.shape[0]):
        at = chain.at[i]
        out[i] = atan2(q[at + 1], q[at]) if chain.kind[i] == CONTINUOUS else q[at]


@lean_part
def error_between(pose: FloatArray, goal: FloatArray, error: FloatArray) -> None:
    """Fill error (6,) with ``[p_d - p; log3(R_d R^T)]`` of poses (12,)."""
    for i in range(3):
        error[i] = goal[9 + i] - pose[9 + i]
    error[3], error[4], error[5] = logarithm(
        goal[0] * pose[0] + goal[1] * pose[1] + goal[2] * pose[2],
        goal[0] * pose[3] + goal[1] * pose[4] + goal[2] * pose[5],
        goal[0] * pose[6] + goal[1] * pose[7] + goal[2] * pose[8],
        goal[3] * pose[0] + goal[4] * pose[1] + goal[5] * pose[2],
        goal[3] * pose[3] + goal[4] * pose[4] + goal[5] * pose[5],
        goal[3] * pose[6] + goal[4] * pose[7] + goal[5] * pose[8],
        goal[6] * pose[0] + goal[7] * pose[1] + goal[8] * pose[2],
        goal[6] * pose[3] + goal[7] * pose[4] + goal[8] * pose[5],
        goal[6] * pose[6] + goal[7] * pose[7] + goal[8] * pose[8],
    )


@kernel("void(matrix, vector, vector, vector, out_vector, out_matrix, out_vector)", fast=True)
def frame_motion(
    joints: FloatArray,
    frame: FloatArray,
    q: FloatArray,
    v: FloatArray,
    pose: FloatArray,
    J: FloatArray,
    drift: FloatArray,
) -> None:
    """Fill pose (12,), J (6, nv) and drift (6,) of one frame (13,) at q (nq,), v (nv,)."""
    chain = chain_of(joints)
    world, at, jacobian, bend = (
        np.empty((joints.shape[0], 12)),
        np.empty(12),
        np.empty((6, joints.shape[0])),
        np.empty(6),
    )
    forward(chain, np.ascontiguousarray(q), world)
    place_frame(world, int(frame[0]), np.ascontiguousarray(frame[1:]), at)
    frame_jacobian(chain, world, int(frame[0]), at, jacobian)
    frame_drift(chain, world, int(frame[0]), at, np.ascontiguousarray(v), np.empty(joints.shape[0], np.int64), bend)
    for k in range(12):
        pose[k] = at[k]
    for a in range(6):
        drift[a] = bend[a]
        for j in range(J.shape[1]):
            J[a, j] = jacobian[a, j]


@kernel("void(matrix, vector, vector, out_vector, out_vector)", fast=True)
def moved(joints: FloatArray, q: FloatArray, step: FloatArray, out: FloatArray, at: FloatArray) -> None:
    """Fill out (nq,) with ``q (+) step``, and at (nv,) with the joints' coordinates there."""
    chain = chain_of(joints)
    integrate(chain, q, step, out)
    coordinates(chain, out, at)


@kernel("void(matrix, vector, matrix, out_matrix)", fast=True, alone=True)
def frame_poses(joints: FloatArray, frame: FloatArray, q: FloatArray, poses: FloatArray) -> None:
    """Fill poses (N, 12) of one frame (13,) at the configurations q (N, nq)."""
    chain, place = chain_of(joints), np.ascontiguousarray(frame[1:])
    world, pose = np.empty((joints.shape[0], 12)), np.empty(12)
    for k in range(q.shape[0]):
        forward(chain, q[k], world)
        place_frame(world, int(frame[0]), place, pose)
        for a in range(12):
            poses[k, a] = pose[a]
