"""Checks that all paths share: a value comes back in canonical form, or an error says what was expected.

Lengths, times and angles are confined to [1e-9, 1e9] (or +-1e9 where a sign makes sense), so that no square
of one can overflow into infinity or NaN later.
"""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cartctl.errors import NonFiniteError, ParameterError, PathError, ShapeError

Array = NDArray[np.float64]
SMALLEST, LARGEST = 1e-9, 1e9
ROTATION_TOLERANCE = 1e-6  # matrices typed with seven digits pass, and are then projected onto SO(3)


class Placement(NamedTuple):
    """A point, or a pose."""

    position: Array  # (3,) m
    rotation: Array | None  # (3, 3), None for a point


def number(name: str, value: Any) -> float:
    """Return a finite float; raises ParameterError (not a number), NonFiniteError."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
        raise ParameterError(f"{name} is {show(value)}: expected a number")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise NonFiniteError(f"{name} is {result}: expected a finite number")
    if abs(result) > LARGEST:
        raise ParameterError(f"{name} is {result:g}: expected at most {LARGEST:g} in absolute value")
    return result


def positive(name: str, value: Any, unit: str) -> float:
    """Return a float of at least 1e-9; raises as :func:`number`, and PathError."""
    result = number(name, value)
    if result < SMALLEST:
        raise PathError(f"{name} is {result:g} {unit}: expected a positive number (at least {SMALLEST:g} {unit})")
    return result


def count(name: str, value: Any, smallest: int = 1) -> int:
    """Return an integer from ``smallest`` to 10^6; raises ParameterError, PathError."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, Integral):
        raise ParameterError(f"{name} is {show(value)}: expected an integer")
    result = int(value)
    if not smallest <= result <= 10**6:
        raise PathError(f"{name} is {result}: expected an integer from {smallest} to 1000000")
    return result


def flag(name: str, value: Any) -> bool:
    """Return a bool; raises ParameterError, since a truthy string is most often a slipped argument."""
    if not isinstance(value, bool | np.bool_):
        raise ParameterError(f"{name} is {show(value)}: expected True or False")
    return bool(value)


def array(name: str, value: Any, shape: tuple[int | str, ...]) -> Array:
    """Return a read-only copy as float64 of the given shape (a string stands for any length).

    Raises ParameterError (not numbers), ShapeError, NonFiniteError.
    """
    try:
        raw = np.asarray(value)
    except ValueError:
        raise ShapeError(f"{name} is {show(value)}: expected rows of equal length, {_shape(shape)}") from None
    bools = isinstance(value, list | tuple) and any(
        isinstance(item, bool) for item in np.asarray(value, dtype=object).flat
    )
    if bools or raw.dtype.kind not in "iuf":
        raise ParameterError(f"{name} is {show(value)}: expected numbers of shape {_shape(shape)}")
    fits = raw.ndim == len(shape) and all(isinstance(s, str) or s == n for s, n in zip(shape, raw.shape, strict=True))
    if not fits:
        raise ShapeError(f"{name} has shape {raw.shape}: expected {_shape(shape)}")
    if not np.isfinite(raw).all():
        raise NonFiniteError(f"{name} is {show(value)}: expected finite numbers")
    if raw.size and np.abs(raw).max() > LARGEST:
        raise ParameterError(f"{name} is {show(value)}: expected at most {LARGEST:g} in absolute value")
    return frozen(raw)


def direction(name: str, value: Any) -> Array:
    """Return the unit vector along a (3,) direction; raises as :func:`array`, and PathError if zero."""
    vector = array(name, value, (3,))
    length = float(np.linalg.norm(vector))
    if length < SMALLEST:
        raise PathError(f"{name} is {show(value)}: expected a direction, not a zero vector")
    # A unit vector is kept to the last bit, so that a path rebuilt from its own fields is the same path.
    return vector if abs(length - 1.0) < 1e-15 else frozen(vector / length)


def rotation(name: str, value: Any) -> Array:
    """Return the nearest rotation to a (3, 3) within 1e-6 of one; raises as :func:`array`, and PathError."""
    matrix = array(name, value, (3, 3))
    gap = float(np.abs(matrix.T @ matrix - np.eye(3)).max())
    det = float(np.linalg.det(matrix))
    if gap > ROTATION_TOLERANCE or det < 0.0:
        raise PathError(
            f"{name} is not a rotation: max |R^T R - I| = {gap:.3g}, det R = {det:.3g}; "
            f"expected at most {ROTATION_TOLERANCE:g} and +1"
        )
    if gap < 1e-14:
        return matrix
    left, _, right = np.linalg.svd(matrix)
    return frozen(left @ right)


def point_or_pose(name: str, value: Any) -> Placement:
    """Split a (3,) point, a pin.SE3 or a (4, 4) homogeneous matrix; raises as :func:`rotation`."""
    if isinstance(value, pin.SE3):
        value = value.homogeneous
    try:
        shape = np.shape(value)
    except ValueError:
        shape = None  # ragged: the complaint is left to array()
    if shape is None or shape == (3,) or not shape:
        return Placement(array(name, value, (3,)), None)
    if shape != (4, 4):
        raise ShapeError(f"{name} has shape {shape}: expected a point (3,), a pin.SE3 or a (4, 4) matrix")
    matrix = array(name, value, (4, 4))
    if np.abs(matrix[3] - (0.0, 0.0, 0.0, 1.0)).max() > SMALLEST:
        raise PathError(f"{name} has the last row {show(matrix[3])}: a homogeneous matrix ends in 0 0 0 1")
    return Placement(frozen(matrix[:3, 3]), rotation(f"{name} rotation", matrix[:3, :3]))


def posed(position: Array, rotation: Array | None) -> Any:
    """Return what :func:`point_or_pose` reads back: the point, or a pin.SE3 of its own memory."""
    return position if rotation is None else pin.SE3(rotation, position)


def frozen(value: Any) -> Array:
    """Return a read-only C-ordered copy as float64."""
    copy = np.array(value, dtype=np.float64, order="C")
    copy.flags.writeable = False
    return copy


def show(value: Any) -> str:
    """Return a value on one line, shortened, for an error message."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else text[:77] + "..."


def _shape(shape: tuple[int | str, ...]) -> str:
    return "(" + ", ".join(map(str, shape)) + ("," if len(shape) == 1 else "") + ")"
