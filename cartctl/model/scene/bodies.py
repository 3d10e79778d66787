"""A robot's links, and a scene's obstacles, as convex parts that hang on joints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.model.robot import Robot
from cartctl.model.scene.enclosing import enclosed, fitted_capsule
from cartctl.model.scene.obstacles import Obstacle, names
from cartctl.model.scene.shapes import Shape, of_coal, sphere

_THICK = 0.06  # of the mean distance between joints: the radius of a link of which no shape is known
_known: WeakKeyDictionary[Robot, tuple[Part, ...]] = WeakKeyDictionary()


class Part(NamedTuple):
    """A shape on a joint (0 is the world). name: of its link, frame or obstacle; obstacle: None for the robot's."""

    name: str
    joint: int
    pose: pin.SE3
    shape: Shape
    obstacle: Obstacle | None = None


def robot_parts(robot: Robot) -> tuple[Part, ...]:
    """The robot's links, from its collision shapes, else its visual ones, else capsules from joint to joint.

    Boxes, spheres, capsules and cylinders are taken as they are, meshes wrapped (:mod:`enclosing`); once a robot.
    """
    if robot not in _known:
        parts = _shaped(robot, robot.collision_model) or _shaped(robot, robot.visual_model) or _skeleton(robot)
        _known[robot] = tuple(parts)
    return _known[robot]


def point_parts(robot: Robot, points: Any) -> tuple[Part, ...]:
    """Balls about the origins of frames: names, or a mapping of names to radii in m; raises FrameNotFound."""
    given: Mapping[str, Any] = points if isinstance(points, Mapping) else dict.fromkeys(names("points", points), 0.0)
    return tuple(
        Part(frame, *_carried(robot, frame), sphere(checks.number(f"the radius of {frame!r}", radius, low=0.0)))
        for frame, radius in given.items()
    )


def obstacle_parts(robot: Robot, obstacles: Iterable[Obstacle]) -> tuple[Part, ...]:
    """Every part of every obstacle; raises FrameNotFound for one on a frame that is not there."""
    parts = []
    for obstacle in obstacles:
        joint, to_frame = (0, pin.SE3.Identity()) if obstacle.frame is None else _carried(robot, obstacle.frame)
        pose = to_frame * obstacle.pose(0.0)
        parts += [Part(obstacle.name, joint, pose, shape, obstacle) for shape in obstacle.parts]
    return tuple(parts)


def _carried(robot: Robot, frame: str) -> tuple[int, pin.SE3]:
    found = robot.model.frames[robot.frame_id(frame)]
    return int(found.parentJoint), found.placement


def _shaped(robot: Robot, model: pin.GeometryModel) -> list[Part]:
    parts = []
    for geometry in model.geometryObjects:
        link = robot.model.frames[geometry.parentFrame].name
        shape = of_coal(geometry.geometry, enclosed)
        if shape is not None:
            parts.append(Part(link, int(geometry.parentJoint), geometry.placement, shape))
    return parts


def _skeleton(robot: Robot) -> list[Part]:
    """A capsule from each joint to each that follows, and to the tool; 6 % of their mean distance in radius."""
    model = robot.model
    ends = [(int(model.parents[j]), model.jointPlacements[j].translation) for j in range(1, model.njoints)]
    tool = model.frames[robot.frame_id(robot.tool)]
    ends.append((int(tool.parentJoint), tool.placement.translation))
    ends = [(joint, end) for joint, end in ends if np.linalg.norm(end) > 0.0]
    radius = _THICK * float(np.mean([np.linalg.norm(end) for _, end in ends])) if ends else 0.0
    parts = []
    for joint, end in ends:
        shape, rotation, middle = fitted_capsule(np.zeros(3), end, radius)
        parts.append(Part(model.names[joint], joint, pin.SE3(rotation, middle), shape))
    return parts
