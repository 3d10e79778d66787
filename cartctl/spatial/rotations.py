"""Rotations: cross matrices, Rodrigues' formula, the exponential and the logarithm."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.spatial.pose_error import pose_error

_ORIGIN, _EYE = np.zeros(3), np.eye(3)
_ORTHONORMAL = 1e-6


def skew(a: FloatArray) -> FloatArray:
    """``S(a)``, (3, 3), with ``S(a) b = a x b``."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """``a x b`` of two (3,) vectors, in a tenth of the time ``np.cross`` takes."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def rotation_about(axis: FloatArray, angle: float) -> FloatArray:
    """Rodrigues: ``I + S(k) sin(angle) + S(k)^2 (1 - cos(angle))``, k a unit axis (3,)."""
    K = skew(axis)
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * (K @ K)


def exp3(phi: Any) -> FloatArray:
    """The rotation (3, 3) by the angle |phi| about phi (3,), rad: ``e^S(phi)``, undone by :func:`log3` up to pi.

    Raises ShapeError, NonFiniteError, ParameterError beyond 1e9 rad.
    """
    phi = checks.vector("phi", phi, 3, largest=checks.LARGEST)
    a, b, _ = series(math.hypot(*phi.tolist()))
    K = skew(phi)
    return np.eye(3) + a * K + b * (K @ K)


def log3(R: FloatArray) -> FloatArray:
    """The angle-axis vector of a rotation R (3, 3), (3,), rad, of length at most pi; exact at 0 and at pi.

    Raises ParameterError where R is no rotation, ShapeError, NonFiniteError.
    """
    error = np.empty(6)
    pose_error(_ORIGIN, _EYE, _ORIGIN, checked_rotation("R", R), error)
    return error[3:]


def off_rotation(R: FloatArray) -> float:
    """By how much R (3, 3) misses ``R^T R = I``, entry by entry; at least 1 for a reflection."""
    error = float(np.abs(R.T @ R - np.eye(3)).max())
    return max(error, 1.0) if np.linalg.det(R) < 0.0 else error


def is_rotation(R: FloatArray) -> bool:
    """Whether R (3, 3) is a rotation up to 1e-6."""
    return off_rotation(R) <= _ORTHONORMAL


def checked_rotation(name: str, value: Any) -> FloatArray:
    """``value`` as a rotation (3, 3); raises ParameterError where it is none, ShapeError, NonFiniteError."""
    R = checks.matrix(name, value, 3, 3)
    if not is_rotation(R):
        raise ParameterError(
            f"{name}: its rotation is off R^T R = I, det R = 1 by {off_rotation(R):.2g}; expected a rotation matrix"
        )
    return R


# sum_k (-1)^k x^2k / (2k + 3)!, highest power first: (x - sin x)/x^3 loses its digits near zero
_C = [(-1) ** k / math.factorial(2 * k + 3) for k in reversed(range(11))]


def series(x: float) -> tuple[float, float, float]:
    """``sin(x)/x``, ``(1 - cos x)/x^2`` and ``(x - sin x)/x^3`` at x >= 0, each to round-off."""
    square = x * x
    if square < 1e-300:
        return 1.0, 0.5, 1.0 / 6.0
    half = math.sin(0.5 * x) / x
    c = (x - math.sin(x)) / (square * x)
    if x < 1.0:
        c = 0.0
        for coefficient in _C:
            c = c * square + coefficient
    return math.sin(x) / x, 2.0 * half * half, c
