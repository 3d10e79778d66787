"""One obstacle: its convex parts, and where they are: fixed, on a path, or carried by a frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError, ShapeError, TargetError
from cartctl.model.scene.shapes import Shape
from cartctl.spatial.rotations import is_rotation


@dataclass(frozen=True, eq=False)
class Obstacle:
    """parts: shapes in the obstacle's axes. at: its pose, in the world or in ``frame``, or a path t -> pose.

    ignore: patterns of links it has nothing to do with.
    """

    name: str
    parts: tuple[Shape, ...]
    at: pin.SE3 | Callable[[float], Any]
    frame: str | None
    ignore: tuple[str, ...]

    @property
    def moves(self) -> bool:
        """Whether it is on a path."""
        return not isinstance(self.at, pin.SE3)

    def pose(self, t: float) -> pin.SE3:
        """Where it is at t, in the world (or its frame); raises TargetError, NonFiniteError."""
        if isinstance(self.at, pin.SE3):
            return self.at
        sample = self.at(t)
        if hasattr(sample, "position"):
            rotation = np.eye(3) if sample.rotation is None else np.asarray(sample.rotation)
            return pin.SE3(rotation, np.asarray(sample.position, dtype=np.float64))
        return fixed_pose(sample, f"the path of obstacle {self.name!r}")


def fixed_pose(value: Any, name: str) -> pin.SE3:
    """``value`` as a pose: a pin.SE3, a (4, 4) or a position (3,); raises TargetError, NonFiniteError."""
    if isinstance(value, pin.SE3):
        value = value.homogeneous
    try:
        shape = np.shape(value)
    except ValueError:
        shape = None
    if shape == (3,):
        return pin.SE3(np.eye(3), np.array(checks.vector(name, value, 3)))
    if shape != (4, 4):
        raise TargetError(f"{name} is {_brief(value)}; expected a position (3,), a pin.SE3, a 4x4 pose or a path")
    T = checks.matrix(name, value, 4, 4)
    if not (np.array_equal(T[3], [0.0, 0.0, 0.0, 1.0]) and is_rotation(T[:3, :3])):
        raise TargetError(f"{name} is {T.tolist()}; expected a rotation, a position and a last row 0 0 0 1")
    return pin.SE3(np.array(T[:3, :3]), np.array(T[:3, 3]))


def names(name: str, value: Any) -> tuple[str, ...]:
    """``value`` as a tuple of names: one, or a list of them; raises ParameterError."""
    value = (value,) if isinstance(value, str) else value
    try:
        found = tuple(value)
    except TypeError:
        found = (None,)
    if not all(isinstance(x, str) for x in found):
        raise ParameterError(f"{name} is {_brief(value)}; expected a name or a list of names")
    return found


def triangles(vertices: Any, faces: Any) -> FloatArray:
    """(k, 3, 3) the corners of every face; raises ShapeError, NonFiniteError, ParameterError."""
    points = checks.matrix("vertices", vertices, columns=3)
    index = checks.matrix("faces", faces, columns=3)
    rounded = index.astype(np.int64)
    if (rounded != index).any() or (rounded < 0).any() or (rounded >= len(points)).any():
        raise ParameterError(f"faces hold numbers that are no index; expected whole numbers in [0, {len(points) - 1}]")
    if not len(rounded):
        raise ShapeError("faces is empty; expected at least one triangle")
    corners: FloatArray = points[rounded]
    return corners


def _brief(value: Any) -> str:
    text = repr(value).replace("\n", " ")
    return f"a {type(value).__name__}, {text[:50]}"
