"""What stands, moves or hangs around a robot."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.errors import ParameterError, UrdfError
from cartctl.model.console import console_of_c
from cartctl.model.scene import shapes
from cartctl.model.scene.enclosing import enclosed, fitted_capsule
from cartctl.model.scene.obstacles import Obstacle, fixed_pose, names, triangles
from cartctl.model.scene.shapes import Shape

_MOST_TRIANGLES = 5000


class Scene:
    """Obstacles by name: ``scene.sphere("ball", 0.1, at=[0.5, 0.0, 0.4])``; every method returns the scene.

    In all of them at is where the shape's origin is: a position (3,), a pin.SE3, a (4, 4), or a path t -> pose such as
    ``cc.Line(...)``, by which it moves whatever the robot does. frame: the robot's frame it is attached to, where at is
    seen from; None is the world. ignore: patterns of links that may touch it (a table and the arm's foot). Lengths in
    m. Distances are to the shapes as :mod:`cartctl.model.scene.shapes` says. A scene knows no robot; adding to it
    afterwards counts from the next step on.

    Raises ParameterError, ShapeError, NonFiniteError, TargetError; FrameNotFound where it meets a robot.

    >>> import cartctl as cc
    >>> scene = cc.Scene().sphere("ball", 0.1, at=[0.5, 0.0, 0.4]).box("table", [1.0, 1.0, 0.05], at=[0.5, 0.0, 0.1])
    >>> robot = cc.load("panda")
    >>> avoid = cc.Avoid(scene, margin=0.01)
    >>> avoid.closest(robot.state(robot.home)).distance > 0.0
    True
    """

    def __init__(self) -> None:
        self._obstacles: dict[str, Obstacle] = {}
        self.version = 0  # counts changes, for those who keep what they worked out

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """All of them, in the order they came."""
        return tuple(self._obstacles.values())

    def sphere(self, name: str, radius: float, at: Any, *, frame: str | None = None, ignore: Any = ()) -> Scene:
        """A ball about its origin."""
        return self._add(name, [shapes.sphere(_length("radius", radius))], at, frame, ignore)

    def box(self, name: str, size: Any, at: Any, *, frame: str | None = None, ignore: Any = ()) -> Scene:
        """size: (3,), the whole sides along its axes, about its origin."""
        sides = checks.vector("size", size, 3)
        if (sides <= 0.0).any():
            raise ParameterError(f"size is {sides}; expected three lengths above 0")
        return self._add(name, [shapes.box(sides)], at, frame, ignore)

    def capsule(
        self, name: str, radius: float, length: float, at: Any, *, frame: str | None = None, ignore: Any = ()
    ) -> Scene:
        """Along its z axis, about its origin; length is that of the cylinder, without the caps."""
        shape = shapes.capsule(_length("radius", radius), _length("length", length))
        return self._add(name, [shape], at, frame, ignore)

    def cylinder(
        self, name: str, radius: float, length: float, at: Any, *, frame: str | None = None, ignore: Any = ()
    ) -> Scene:
        """Along its z axis, about its origin."""
        shape = shapes.cylinder(_length("radius", radius), _length("length", length))
        return self._add(name, [shape], at, frame, ignore)

    def plane(self, name: str, normal: Any, offset: float = 0.0, *, ignore: Any = ()) -> Scene:
        """All where ``n . p <= offset`` is solid, n (3,) in the world and of any length: offset goes with it."""
        n = checks.vector("normal", normal, 3)
        size = float(np.linalg.norm(n))
        if not size > 0.0:
            raise ParameterError(f"normal is {n}; expected a direction")
        along = fitted_capsule(np.zeros(3), n / size, 0.0)[1]
        at = pin.SE3(along, n * (checks.number("offset", offset) / size**2))
        return self._add(name, [shapes.plane()], at, None, ignore)

    def mesh(
        self,
        name: str,
        source: Any,
        at: Any,
        *,
        faces: Any = None,
        scale: float = 1.0,
        convex: bool = True,
        frame: str | None = None,
        ignore: Any = (),
    ) -> Scene:
        """A mesh file (.stl, .obj, .dae), or vertices (k, 3) with faces (f, 3).

        convex: its hull, wrapped in at most 32 corners. Else each of its triangles, at most 5000: exact for a surface,
        but a body that is all inside is seen as outside.
        """
        scale = _length("scale", scale)
        if isinstance(source, (str, os.PathLike)):
            model = _read(os.fspath(source))
            points = scale * np.array(model.vertices())
            index: Any = [[t[0], t[1], t[2]] for t in map(model.tri_indices, range(model.num_tris))]
        else:
            points, index = scale * checks.matrix("vertices", source, columns=3), faces
        if not len(points):
            raise ParameterError(f"mesh {name!r} has no vertices; expected at least one")
        if convex:
            return self._add(name, [enclosed(points)], at, frame, ignore)
        if index is None:
            raise ParameterError(f"mesh {name!r}: faces is None; expected (f, 3) with convex=False")
        found = triangles(points, index)
        if len(found) > _MOST_TRIANGLES:
            raise ParameterError(f"mesh {name!r} has {len(found)} triangles; expected at most {_MOST_TRIANGLES}")
        return self._add(name, [shapes.polytope(corners) for corners in found], at, frame, ignore)

    def move(self, name: str, at: Any) -> Scene:
        """Put an obstacle elsewhere, as a sensor says, or on another path; raises ParameterError, TargetError."""
        old = self._known(name)
        self._obstacles[name] = Obstacle(name, old.parts, _place(at, name), old.frame, old.ignore)
        self.version += 1
        return self

    def remove(self, name: str) -> Scene:
        """Take an obstacle away; raises ParameterError."""
        self._known(name)
        del self._obstacles[name]
        self.version += 1
        return self

    def _known(self, name: str) -> Obstacle:
        if name not in self._obstacles:
            raise ParameterError(f"there is no obstacle {name!r}; expected one of {list(self._obstacles)}")
        return self._obstacles[name]

    def _add(self, name: str, parts: Sequence[Shape], at: Any, frame: str | None, ignore: Any) -> Scene:
        if not isinstance(name, str) or not name:
            raise ParameterError(f"name is {name!r}; expected a text")
        if name in self._obstacles:
            raise ParameterError(f"there is an obstacle {name!r} already; expected another name, or use move()")
        if frame is not None and not isinstance(frame, str):
            raise ParameterError(f"frame is {frame!r}; expected the name of a frame, or None for the world")
        place = _place(at, name)
        if frame is not None and not isinstance(place, pin.SE3):
            raise ParameterError(f"obstacle {name!r} has a path and is attached to {frame!r}; expected one of them")
        self._obstacles[name] = Obstacle(name, tuple(parts), place, frame, names("ignore", ignore))
        self.version += 1
        return self

    def __repr__(self) -> str:
        return f"Scene({', '.join(self._obstacles)})"


def _place(at: Any, name: str) -> Any:
    return at if callable(at) and not isinstance(at, pin.SE3) else fixed_pose(at, f"obstacle {name!r}: at")


def _length(name: str, value: Any) -> float:
    return checks.number(name, value, low=0.0, strict=True)


def _read(path: str) -> Any:
    try:
        with console_of_c([]):
            return coal.MeshLoader().load(path, np.ones(3))
    except (ValueError, RuntimeError, MemoryError) as error:
        why = " ".join(str(error).split())[:120]
        raise UrdfError(f"mesh {path!r} cannot be read: {why}; expected an .stl, .obj or .dae file") from None
