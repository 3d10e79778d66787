"""Cross products and turns about an axis, checked; those of :mod:`cartctl.spatial.rotations` are not."""

from __future__ import annotations

from typing import Any

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.spatial import rotations

_UNIT = 1e-6
_LARGEST = 1e150  # products of two of them are numbers still


def skew(a: Any) -> FloatArray:
    """``S(a)``, (3, 3), with ``S(a) b = a x b``, for a (3,). Raises ShapeError, NonFiniteError."""
    return rotations.skew(checks.vector("a", a, 3))


def cross(a: Any, b: Any) -> FloatArray:
    """``a x b``, (3,), of vectors (3,). Raises ShapeError, NonFiniteError, ParameterError for entries beyond 1e150."""
    return rotations.cross(checks.vector("a", a, 3, largest=_LARGEST), checks.vector("b", b, 3, largest=_LARGEST))


def rotation_about(axis: Any, angle: float) -> FloatArray:
    """Rodrigues (1840): ``I + S(k) sin(angle) + S(k)^2 (1 - cos(angle))``, (3, 3), k a unit axis (3,), angle in rad.

    Raises ParameterError where the axis is no unit vector, ShapeError, NonFiniteError.
    """
    k = checks.vector("axis", axis, 3, largest=_LARGEST)
    length = float(k @ k) ** 0.5
    if abs(length - 1.0) > _UNIT:
        raise ParameterError(f"axis is {k}, of length {length:g}; expected a unit vector: divide it by its length")
    return rotations.rotation_about(k, checks.number("angle", angle))
