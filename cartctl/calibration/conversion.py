"""Denavit-Hartenberg chains to Pinocchio models, and serial chains of Pinocchio models to tables."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from cartctl.calibration.dh_chain import DHChain
from cartctl.calibration.frames import table_of_axes
from cartctl.calibration.motions import Fixed, Motion, Step, placed
from cartctl.checks import FloatArray
from cartctl.dynamics.dh_model import serial_model
from cartctl.errors import ParameterError, UnsupportedJoint
from cartctl.model.robot import Robot

RESERVED = ("base", "tool", "placements", "offsets")  # groups of parameters, not joints


class PathJoint(NamedTuple):
    """A joint on the way to a frame. number: in the model. turns: or slides. axis: (3,) unit, in the joint's frame."""

    name: str
    number: int
    turns: bool
    axis: FloatArray

    @property
    def label(self) -> str:
        """The joint's name, unless that is one of a group of parameters."""
        return f"{self.name}_joint" if self.name in RESERVED else self.name


def as_robot(value: Any) -> Robot:
    """A Robot, of a Robot or a pin.Model; raises ParameterError."""
    if isinstance(value, Robot):
        return value
    if isinstance(value, pin.Model):
        return Robot(value)
    raise ParameterError(
        f"chain_or_robot is a {type(value).__name__}; expected a cc.DHChain, a cc.Robot or a pinocchio.Model"
    )


def joints_to(robot: Robot, frame: str) -> list[PathJoint]:
    """The joints between the base and ``frame``, in order; raises UnsupportedJoint, FrameNotFound.

    Each must turn about, or slide along, one axis; one that mimics another, or a moving base, has no such row.
    """
    model = robot.model
    number, found = model.frames[robot.frame_id(frame)].parentJoint, list[PathJoint]()
    mimics = set(model.mimicking_joints)
    while number > 0:
        joint, name = model.joints[number], model.names[number]
        advice = f"expected joints of one axis each on the way to {frame!r}"
        if joint.nv != 1 or number in mimics:
            what = "mimics another joint" if number in mimics else f"has {joint.nv} degrees of freedom"
            raise UnsupportedJoint(f"joint {name!r} {what}; {advice}, and root_joint='fixed'")
        data = joint.createData()
        joint.calc(data, np.array(robot.neutral))
        S = np.array(data.S).reshape(6)
        if np.any(S[:3]) and np.any(S[3:]):
            raise UnsupportedJoint(f"joint {name!r} turns and slides at once; {advice}")
        turns = bool(np.any(S[3:]))
        found.append(PathJoint(name, number, turns, S[3:] if turns else S[:3]))
        number = model.parents[number]
    if not found:
        raise UnsupportedJoint(f"no joint moves frame {frame!r} of {robot.name!r}; expected a frame behind a joint")
    return found[::-1]


def dh_of_robot(source: Any, frame: str | None, convention: str, hayati: bool) -> DHChain:
    """The table of the chain to ``frame``; see :meth:`cartctl.DHChain.of_robot`."""
    robot = as_robot(source)
    frame = robot.tool if frame is None else frame
    path = joints_to(robot, frame)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.array(robot.neutral))
    poses = [data.oMi[joint.number] for joint in path]
    return table_of_axes(
        [pose.translation for pose in poses],
        [pose.rotation @ joint.axis for pose, joint in zip(poses, path, strict=True)],
        "".join("R" if joint.turns else "P" for joint in path),
        tool=data.oMf[robot.frame_id(frame)],
        convention=convention,
        hayati=hayati,
        name=robot.name,
    )


class Segments(NamedTuple):
    """before: (n, 4, 4) poses of joint i in what joint i - 1 carries. after: of frame i in what joint i carries."""

    before: list[FloatArray]
    after: list[FloatArray]
    tool: FloatArray


def segments(chain: DHChain) -> Segments:
    """What lies between the joints of a table; the constant of a joint's own row commutes with it, and comes after."""
    before, after, carried = [], [], chain.base
    for i in range(chain.n):
        steps = chain.row(i)
        at = next(k for k, step in enumerate(steps) if isinstance(step, Motion) and step.joint == i)
        before.append(carried @ _constant(steps[:at]))
        carried = _constant(steps[at:])
        after.append(carried)
    return Segments(before, after, carried @ chain.tool)


def pinocchio_chain(chain: DHChain) -> pin.Model:
    """See :meth:`cartctl.DHChain.model`."""
    parts = segments(chain)
    model = serial_model(
        chain.joints or "", [_se3(T) for T in parts.before], [_se3(T) for T in parts.after], chain.name
    )
    model.addFrame(pin.Frame("tool", chain.n, _se3(parts.tool), pin.FrameType.OP_FRAME))
    return model


def _constant(steps: list[Step]) -> FloatArray:
    T = np.eye(4)
    for step in steps:
        T = T @ (step.pose if isinstance(step, Fixed) else placed(step.turns, step.axis, step.value))
    return T


def _se3(T: FloatArray) -> pin.SE3:
    return pin.SE3(T[:3, :3], T[:3, 3])
