"""Euler angles: rotations, rate matrices and gimbal locks of all twelve sequences.

A sequence names its axes in capitals, in the order of its angles phi = (phi_1, phi_2, phi_3). about="moving": each turn
is about an axis carried along by those before it (intrinsic), ``R = R_1(phi_1) R_2(phi_2) R_3(phi_3)``. about="fixed":
about axes that stay (extrinsic), ``R = R_3(phi_3) R_2(phi_2) R_1(phi_1)``; roll, pitch and yaw, as in a URDF's rpy, are
"XYZ" about fixed axes.
"""

from __future__ import annotations

import math
import warnings
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.spatial.rotations import checked_rotation, cross

EULER_SEQUENCES = tuple("".join(s) for s in product("XYZ", repeat=3) if s[0] != s[1] and s[1] != s[2])

_UNITS = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
_NUMBERS = {sequence: tuple("XYZ".index(letter) for letter in sequence) for sequence in EULER_SEQUENCES}


class EulerLock(NamedTuple):
    """How far Euler angles are from the gimbal lock where ``omega = T phi_dot`` cannot be solved; :func:`euler_lock`.

    lost: to turn at 1 rad/s about it takes 1/|determinant| rad/s of one angle, phi_3 about moving axes and phi_1 about
    fixed ones; at a lock no rates do.
    """

    determinant: float  # det T(phi), in [-1, 1]
    distance: float  # of phi_2 from the nearest lock, rad
    lost: FloatArray  # (3,), unit, base axes


def euler_rotation(sequence: str, phi: Any, about: str = "moving") -> FloatArray:
    """The rotation R (3, 3) of the angles phi (3,), rad; its columns are the turned axes.

    Raises ParameterError for an unknown sequence or option, ShapeError, NonFiniteError.
    """
    (i, j, k), (a, b, c) = _ordered(sequence, phi, about)
    R: FloatArray = np.array([_turn(i, a, _turn(j, b, _turn(k, c, unit))) for unit in _UNITS]).T
    return R


def euler_angles(sequence: str, R: FloatArray, about: str = "moving") -> FloatArray:
    """The angles phi (3,) of rotation R (3, 3); at a gimbal lock one of the many, with the third angle zero.

    phi_2 lies in [0, pi] for sequences like ZYZ and in [-pi/2, pi/2] for sequences like XYZ, the others in [-pi, pi].
    Errors as of :func:`euler_rotation`; ParameterError where R is no rotation.
    """
    checks.choice("sequence", sequence, EULER_SEQUENCES)
    name = sequence if checks.choice("about", about, _ABOUT) == "moving" else sequence.lower()
    R = checked_rotation("R", R)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the lock is reported by euler_lock
        return Rotation.from_matrix(R).as_euler(name)  # type: ignore[no-any-return]


def euler_rates(sequence: str, phi: Any, about: str = "moving", axes: str = "base") -> FloatArray:
    """``T(phi)`` (3, 3) with ``omega = T(phi) phi_dot``.

    axes: whether omega is in the base's axes or the body's; ``T_body = R^T T_base``. Column k is axis k as the
    rotations leave it, so det T = 0 is a gimbal lock: sin(phi_2) = 0 for sequences like ZYZ, cos(phi_2) = 0 for
    sequences like XYZ. Errors as of :func:`euler_rotation`.
    """
    (i, j, k), (a, b, c) = _ordered(sequence, phi, about)
    if checks.choice("axes", axes, _AXES) == "base":
        columns = [_UNITS[i], _turn(i, a, _UNITS[j]), _turn(i, a, _turn(j, b, _UNITS[k]))]
    else:
        columns = [_turn(k, -c, _turn(j, -b, _UNITS[i])), _turn(k, -c, _UNITS[j]), _UNITS[k]]
    T: FloatArray = np.array(columns if about == "moving" else columns[::-1]).T
    return T


def euler_lock(sequence: str, phi: Any, about: str = "moving") -> EulerLock:
    """Where phi (3,) stands to the gimbal locks of its sequence.

    About moving axes det T = -sin(phi_2) for sequences like ZYZ, cos(phi_2) for XYZ, YZX and ZXY, -cos(phi_2) for XZY,
    YXZ and ZYX; about fixed axes sin(phi_2) and, again, cos(phi_2) and -cos(phi_2). The body's axes change nothing.
    Errors as of :func:`euler_rotation`.
    """
    (i, j, k), (a, b, _) = _ordered(sequence, phi, about)
    if i == k:
        determinant = -math.sin(b) if about == "moving" else math.sin(b)
        distance = abs(math.remainder(b, math.pi))
    else:
        cyclic = (j - i) % 3 == 1
        determinant = math.cos(b) if cyclic == (about == "moving") else -math.cos(b)
        distance = abs(math.remainder(b - 0.5 * math.pi, math.pi))
    return EulerLock(determinant, distance, cross(np.array(_UNITS[i]), np.array(_turn(i, a, _UNITS[j]))))


_ABOUT = ("moving", "fixed")
_AXES = ("base", "body")


def _ordered(sequence: str, phi: Any, about: str) -> tuple[tuple[int, ...], list[float]]:
    """Axes and angles of the same rotation about moving axes: about fixed ones, the last turn is the outermost."""
    checks.choice("sequence", sequence, EULER_SEQUENCES)
    numbers, angles = _NUMBERS[sequence], checks.vector("phi", phi, 3).tolist()
    if checks.choice("about", about, _ABOUT) == "moving":
        return numbers, angles
    return numbers[::-1], angles[::-1]


def _turn(axis: int, angle: float, vector: list[float]) -> list[float]:
    """A (3,) vector turned about coordinate axis 0, 1 or 2."""
    turned = list(vector)
    u, w = (axis + 1) % 3, (axis + 2) % 3
    c, s = math.cos(angle), math.sin(angle)
    turned[u], turned[w] = c * vector[u] - s * vector[w], s * vector[u] + c * vector[w]
    return turned
