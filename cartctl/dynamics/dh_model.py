"""The Pinocchio model of an arm given by its Denavit-Hartenberg table."""

from __future__ import annotations

import math

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
    model, parent, placement = pin.Model(), 0, pin.SE3.Identity()
    model.name = name
    rotors = []
    for i, link in enumerate(arm.links, start=1):
        kind = pin.JointModelRZ() if link.joint == "R" else pin.JointModelPZ()
        parent = model.addJoint(parent, kind, placement, f"joint{i}")
        placement = link_placement(link)  # frame i in the moving frame of joint i
        body = pin.Inertia(float(link.mass), np.array(link.com, float), np.array(link.inertia_matrix, float))
        model.appendBodyToJoint(parent, body, placement)
        model.addFrame(pin.Frame(f"link{i}", parent, placement, pin.FrameType.OP_FRAME))
        rotors.append(float(link.rotor))
    model.armature = np.array(rotors)
    model.gravity = pin.Motion(np.array(arm.gravity, float), np.zeros(3))
    return model


def link_placement(link: DHLink) -> pin.SE3:
    """``Rz(theta) Tz(d) Tx(a) Rx(alpha)`` of numbers, without the joint's coordinate."""
    theta, alpha, a, d = (float(x) for x in (link.theta, link.alpha, link.a, link.d))
    c, s = math.cos(theta), math.sin(theta)
    ca, sa = math.cos(alpha), math.sin(alpha)
    R = np.array([[c, -s * ca, s * sa], [s, c * ca, -c * sa], [0.0, sa, ca]])
    return pin.SE3(R, np.array([a * c, a * s, d]))
