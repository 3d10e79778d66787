"""The Pinocchio model of an arm given by its Denavit-Hartenberg table."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from cartctl.dynamics.dh import DHArm, DHLink
from cartctl.errors import ParameterError


def pinocchio_model(arm: DHArm, name: str = "dh") -> pin.Model:
    """Joints ``joint1``, ..., frames ``link1``, ... at the table's frames, body i in frame i, rotors as armature.

    Raises ParameterError where the table still holds names: ``arm.with_values(...)`` first.
    """
    if arm.names:
        raise ParameterError(f"the table holds the names {sorted(arm.names)}; give them values by arm.with_values(...)")
    arm = arm.with_values()  # what is left of formulas, such as "pi/2"
    frames = [link_placement(link) for link in arm.links]
    model = serial_model("".join(link.joint for link in arm.links), [pin.SE3.Identity(), *frames[:-1]], frames, name)
    for i, link in enumerate(arm.links, start=1):
        body = pin.Inertia(float(link.mass), np.array(link.com, float), np.array(link.inertia_matrix, float))
        model.appendBodyToJoint(i, body, frames[i - 1])
    model.armature = np.array([float(link.rotor) for link in arm.links])
    model.gravity = pin.Motion(np.array(arm.gravity, float), np.zeros(3))
    return model


def serial_model(joints: str, before: Sequence[pin.SE3], after: Sequence[pin.SE3], name: str) -> pin.Model:
    """A chain without bodies: joints ``joint1``, ..., R or P about their z axes, and a frame ``link1``, ... on each.

    before: where joint i sits in what joint i - 1 moves. after: where frame i sits in what joint i moves.
    """
    model, parent = pin.Model(), 0
    model.name = name
    for i, (letter, place, frame) in enumerate(zip(joints, before, after, strict=True), start=1):
        kind = pin.JointModelRZ() if letter == "R" else pin.JointModelPZ()
        parent = model.addJoint(parent, kind, place, f"joint{i}")
        model.addFrame(pin.Frame(f"link{i}", parent, frame, pin.FrameType.OP_FRAME))
    return model


def link_placement(link: DHLink) -> pin.SE3:
    """``Rz(theta) Tz(d) Tx(a) Rx(alpha)`` of numbers, without the joint's coordinate."""
    theta, alpha, a, d = (float(x) for x in (link.theta, link.alpha, link.a, link.d))
    c, s = math.cos(theta), math.sin(theta)
    ca, sa = math.cos(alpha), math.sin(alpha)
    R = np.array([[c, -s * ca, s * sa], [s, c * ca, -c * sa], [0.0, sa, ca]])
    return pin.SE3(R, np.array([a * c, a * s, d]))
