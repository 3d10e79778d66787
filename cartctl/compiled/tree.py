"""A robot's kinematic tree as flat arrays, read from its Pinocchio model.

Every joint turns about, or slides along, the z axis of a frame of its own: a joint whose axis is another gets the
rotation that takes z there, and its children the inverse. Row i of the table is tangent coordinate i, parents first.
"""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from cartctl.checks import FloatArray
from cartctl.compiled.motion_kernel import CONTINUOUS, PRISMATIC
from cartctl.errors import UnsupportedJoint
from cartctl.model.robot import Robot

PARENT, KIND, AT, PLACE = 0, 1, 2, 3  # columns of the table: PLACE holds a rotation row by row, then an origin
WIDTH = PLACE + 12
REVOLUTE = 0

_known: WeakKeyDictionary[Robot, Tree] = WeakKeyDictionary()


class Tree:
    """The tree of one robot.

    joints: (nv, 15) the parent's row (-1: the world), the kind, where in q it begins, and its place in the parent's
    frame. Raises UnsupportedJoint, naming the joint, for a spherical, planar, free-flying, helical, mimicking or
    composite joint: its motion is not one turn about, or slide along, a fixed axis by a coordinate of its own.
    """

    def __init__(self, robot: Robot) -> None:
        model = robot.model
        self.nq, self.nv = robot.nq, robot.nv
        self.joints = np.zeros((robot.nv, WIDTH))
        self._row: dict[int, int] = {0: -1}
        self._turned: dict[int, Any] = {0: pin.SE3.Identity()}
        self._model, self._robot = model, robot
        mimicking = set(model.mimicking_joints)
        for i in range(1, model.njoints):
            joint = model.joints[i]
            if i in mimicking or "Mimic" in joint.shortname():
                raise UnsupportedJoint(_refusal(model.names[i], "mimics another joint"))
            kind, axis = _kind_and_axis(model, i)
            parent = model.parents[i]
            turned = pin.SE3(_from_z(axis), np.zeros(3))
            place = self._turned[parent].actInv(model.jointPlacements[i]) * turned
            row = self.joints[joint.idx_v]
            row[PARENT], row[KIND], row[AT] = self._row[parent], kind, joint.idx_q
            row[PLACE:] = packed(place)
            self._row[i], self._turned[i] = joint.idx_v, turned

    def frame(self, name: str) -> FloatArray:
        """(13,) the row of the joint that carries a frame, and the frame's place in that; raises FrameNotFound."""
        frame = self._model.frames[self._robot.frame_id(name)]
        joint = frame.parentJoint
        place = self._turned[joint].actInv(frame.placement)
        return np.concatenate([[self._row[joint]], packed(place)])


def tree_of(robot: Robot) -> Tree:
    """The tree of a robot, read once; raises UnsupportedJoint."""
    tree = _known.get(robot)
    if tree is None:
        tree = _known[robot] = Tree(robot)
    return tree


def packed(pose: Any) -> FloatArray:
    """(12,) the rotation row by row, then the origin."""
    return np.concatenate([np.asarray(pose.rotation).ravel(), pose.translation])


def _kind_and_axis(model: Any, i: int) -> tuple[int, FloatArray]:
    joint = model.joints[i]
    name = joint.shortname().removeprefix("JointModel")
    if joint.nv == 1 and name.startswith(("R", "P")):  # a helical one would do both at once
        twist = np.asarray(joint.createData().S, dtype=np.float64).ravel()
        if name.startswith("P"):
            return PRISMATIC, twist[:3]
        return (CONTINUOUS if joint.nq == 2 else REVOLUTE), twist[3:]
    raise UnsupportedJoint(_refusal(model.names[i], f"is a {name}"))


def _refusal(joint: str, what: str) -> str:
    return (
        f"joint {joint!r} {what}; compiled kinematics knows joints that turn about or slide along one axis each, "
        "by a coordinate of their own"
    )


def _from_z(axis: FloatArray) -> FloatArray:
    """A rotation whose third column is ``axis``; for x and y a permutation, free of round-off."""
    k = int(np.argmax(np.abs(axis)))
    first = np.eye(3)[(k + 1) % 3]
    first = first - axis * (axis @ first)
    first /= np.linalg.norm(first)
    second = np.array(np.cross(axis, first))
    return np.column_stack([first, second, axis])
