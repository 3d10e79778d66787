"""Rotations and twists: skew matrices, the velocity conversion between frames, Euler-angle rates.

Twists are ordered linear part first. Euler sequences are intrinsic, written in capitals ("ZYZ": about z, then the new
y, then the new z).
"""

from __future__ import annotations

import math
import warnings
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.kernels import kernel

EULER_SEQUENCES = tuple("".join(s) for s in product("XYZ", repeat=3) if s[0] != s[1] and s[1] != s[2])

_ORIGIN, _EYE = np.zeros(3), np.eye(3)
_AXES = {"X": np.array([1.0, 0.0, 0.0]), "Y": np.array([0.0, 1.0, 0.0]), "Z": np.array([0.0, 0.0, 1.0])}


def skew(a: FloatArray) -> FloatArray:
    """``S(a)``, (3, 3), with ``S(a) b = a x b``."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """``a x b`` of two (3,) vectors, in a tenth of the time ``np.cross`` takes."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def velocity_conversion(R: FloatArray, p: FloatArray) -> FloatArray:
    """``V`` (6, 6): the twist of frame B in B's axes = V times the twist of frame A in A's axes, one rigid body.

    R (3, 3), p (3,): the pose of B in A, ``^A T_B``. ``V = [[R^T, -R^T S(p)], [0, R^T]]``. Column j of a Jacobian in
    tool axes is the column of V from joint frame j that belongs to the joint's axis: 5 for a revolute joint about z,
    2 for a prismatic one along z, 3 + i and i for the axes x, y.
    """
    V = np.zeros((6, 6))
    V[:3, :3] = V[3:, 3:] = R.T
    V[:3, 3:] = -R.T @ skew(p)
    return V


def euler_angles(sequence: str, R: FloatArray) -> FloatArray:
    """The angles phi (3,) of rotation R (3, 3); at a gimbal lock one of the many, with the third angle zero."""
    checks.choice("sequence", sequence, EULER_SEQUENCES)
    R = checks.matrix("R", R, 3, 3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the lock is reported by euler_rates' determinant
        return Rotation.from_matrix(R).as_euler(sequence)  # type: ignore[no-any-return]


def euler_rates(sequence: str, phi: FloatArray) -> FloatArray:
    """``T(phi)`` (3, 3) with ``omega = T(phi) phi_dot``, omega in the base axes.

    Column k is axis k turned by the rotations before it. det T = 0 is a gimbal lock: sin(phi_2) = 0 for sequences like
    ZYZ, cos(phi_2) = 0 for sequences like XYZ.
    """
    checks.choice("sequence", sequence, EULER_SEQUENCES)
    phi = checks.vector("phi", phi, 3)
    R = np.eye(3)
    T = np.empty((3, 3))
    for k, (axis, angle) in enumerate(zip(sequence, phi, strict=True)):
        T[:, k] = R @ _AXES[axis]
        R = R @ rotation_about(_AXES[axis], float(angle))
    return T


def rotation_about(axis: FloatArray, angle: float) -> FloatArray:
    """Rodrigues: ``I + S(k) sin(angle) + S(k)^2 (1 - cos(angle))``, k a unit axis (3,)."""
    K = skew(axis)
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * (K @ K)


def log3(R: FloatArray) -> FloatArray:
    """The angle-axis vector of a rotation R (3, 3), (3,), rad, of length at most pi; exact at 0 and at pi."""
    error = np.empty(6)
    pose_error(_ORIGIN, _EYE, _ORIGIN, checks.matrix("R", R, 3, 3), error)
    return error[3:]


@kernel("void(vector, matrix, vector, matrix, out_vector)")
def pose_error(p: FloatArray, R: FloatArray, p_d: FloatArray, R_d: FloatArray, error: FloatArray) -> None:
    """Fill error (6,) with ``[p_d - p; log3(R_d R^T)]``.

    The logarithm goes through the quaternion (w, x, y, z) with the largest component first (Shepperd 1978), which is
    as exact at a half turn as near the identity.
    """
    E = np.empty((3, 3))
    for i in range(3):
        error[i] = p_d[i] - p[i]
        for j in range(3):
            E[i, j] = R_d[i, 0] * R[j, 0] + R_d[i, 1] * R[j, 1] + R_d[i, 2] * R[j, 2]
    trace = E[0, 0] + E[1, 1] + E[2, 2]
    if trace >= E[0, 0] and trace >= E[1, 1] and trace >= E[2, 2]:
        w, x, y, z = 1.0 + trace, E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]
    elif E[0, 0] >= E[1, 1] and E[0, 0] >= E[2, 2]:
        w, x = E[2, 1] - E[1, 2], 1.0 + E[0, 0] - E[1, 1] - E[2, 2]
        y, z = E[0, 1] + E[1, 0], E[0, 2] + E[2, 0]
    elif E[1, 1] >= E[2, 2]:
        w, y = E[0, 2] - E[2, 0], 1.0 - E[0, 0] + E[1, 1] - E[2, 2]
        x, z = E[0, 1] + E[1, 0], E[1, 2] + E[2, 1]
    else:
        w, z = E[1, 0] - E[0, 1], 1.0 - E[0, 0] - E[1, 1] + E[2, 2]
        x, y = E[0, 2] + E[2, 0], E[1, 2] + E[2, 1]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    factor = 2.0 / w if sine < 1e-9 * w else 2.0 * np.arctan2(sine, w) / sine
    error[3] = factor * x
    error[4] = factor * y
    error[5] = factor * z
