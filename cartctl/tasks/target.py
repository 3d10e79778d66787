"""Targets: a pose, a position, a rotation, or a path t -> pose, twist, acceleration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import TargetError
from cartctl.paths import Path
from cartctl.spatial.rotations import is_rotation, off_rotation


class Goal:
    """A constant target; position (3,) or rotation (3, 3) None where it is left open. At rest."""

    __slots__ = ("position", "rotation")
    twist: FloatArray | None = None
    acceleration: FloatArray | None = None

    def __init__(self, position: FloatArray | None, rotation: FloatArray | None) -> None:
        self.position = position
        self.rotation = rotation


def pose_target(value: Any, name: str) -> Goal | Callable[[float], Any]:
    """``value`` as a Goal or a path; raises TargetError, NonFiniteError.

    None holds the pose of the first step; SE3 or (4, 4) is a pose; (3,) a position; (3, 3) a rotation; a callable is a
    path.
    """
    if value is None:
        return Goal(None, None)
    if isinstance(value, pin.SE3):
        value = value.homogeneous
    if callable(value):
        return value  # type: ignore[no-any-return]
    shape = np.shape(value)
    if shape == (3,):
        return Goal(checks.vector(name, value, 3), None)
    if shape == (3, 3):
        return Goal(None, _rotation(checks.matrix(name, value), name))
    if shape == (4, 4):
        T = checks.matrix(name, value)
        if not np.array_equal(T[3], [0.0, 0.0, 0.0, 1.0]):
            raise TargetError(f"{name} has the last row {T[3]}; expected a pose with the last row 0 0 0 1")
        return Goal(np.array(T[:3, 3]), _rotation(np.array(T[:3, :3]), name))
    raise TargetError(
        f"{name} is a {type(value).__name__} of shape {shape}; expected a pose (pin.SE3 or 4x4), a position (3,), "
        "a rotation (3, 3), a path or None"
    )


class PointTarget(NamedTuple):
    """A constant (m,), or a path; both None where nothing is asked for."""

    point: FloatArray | None
    path: Callable[[float], Any] | None


def point_target(value: Any, name: str, size: int | None = None, *, in_space: bool = False) -> PointTarget:
    """``value`` as a (size,) array, a path or None; raises TargetError, NonFiniteError.

    in_space: whether a path may be one of :mod:`cartctl.paths`, which move in the world.
    """
    if isinstance(value, Path) and not in_space:
        raise TargetError(
            f"{name} is a {type(value).__name__}, a path in the world; "
            "expected t -> (value, rate, acceleration), each (m,)"
        )
    if value is None or callable(value):
        return PointTarget(None, value)
    if np.ndim(value) == 0:
        value = [value]
    if np.ndim(value) != 1 or (size is not None and len(value) != size):
        raise TargetError(f"{name} has shape {np.shape(value)}; expected ({'m' if size is None else size},) or a path")
    return PointTarget(checks.vector(name, value), None)


def _rotation(R: FloatArray, name: str) -> FloatArray:
    if not is_rotation(R):
        raise TargetError(
            f"{name}: its rotation is off R^T R = I, det R = 1 by {off_rotation(R):.2g}; expected a rotation matrix"
        )
    return np.array(R)


def read(sample: Any, name: str) -> Any:
    """A path's sample, refused in words where it is none."""
    try:
        sample.position, sample.rotation, sample.twist  # noqa: B018 - the attributes are what is asked for
    except AttributeError:
        raise TargetError(
            f"{name}: the path returned a {type(sample).__name__}; expected position, rotation, twist and acceleration "
            "(see cc.PathSample)"
        ) from None
    return sample
