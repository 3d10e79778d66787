"""Six robots of every kind of joint, and every objective on each, with parameters that leave no term at zero."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin

import cartctl as cc
from tests import robots_for_tests


@cache
def rpr() -> cc.Robot:
    """Revolute, prismatic, revolute in a vertical plane, masses off their axes."""
    model = pin.Model()
    model.gravity = pin.Motion(np.array([0.0, -9.81, 0.0]), np.zeros(3))
    joints = (pin.JointModelRZ(), 0.0), (pin.JointModelPX(), 0.3), (pin.JointModelRZ(), 0.2)
    parent = 0
    for k, (joint, x) in enumerate(joints):
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array([x, 0.05, 0.0])), f"joint{k}")
        body = pin.Inertia(1.5 - 0.3 * k, np.array([0.1, 0.04, 0.0]), np.diag([0.02, 0.03, 0.04]))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    place = pin.SE3(np.eye(3), np.array([0.5, 0.1, 0.0]))
    model.addFrame(pin.Frame("tip", parent, place, pin.FrameType.OP_FRAME))
    model.lowerPositionLimit, model.upperPositionLimit = np.array([-2.5, -0.2, -2.0]), np.array([2.5, 0.6, 2.4])
    return cc.Robot(model, name="rpr", tool="tip")


@cache
def mobile() -> cc.Robot:
    """A Panda on a planar base."""
    return cc.load("panda", root_joint="planar")


SIX = {
    "planar3R": robots_for_tests.planar,
    "panda": robots_for_tests.panda,
    "kinova": robots_for_tests.kinova,
    "rpr": rpr,
    "mobile": mobile,
    "talos": robots_for_tests.talos,
}
PLANE = ("planar3R", "rpr")  # these move in x and y alone


@cache
def objectives(name: str) -> dict[str, cc.Objective]:
    """Every objective for the robot of that name, by a name of its own."""
    robot = SIX[name]()
    rng = np.random.default_rng(5)
    axes = "xy" if name in PLANE else "pose"
    rows = {"axes": axes, "length": 0.4}
    rates, torques = rng.uniform(0.3, 2.0, robot.nv), rng.uniform(0.02, 0.1, robot.nv)
    along = rng.normal(size=2 if axes == "xy" else 6)
    wrench = rng.normal(size=6) * [20.0, 20.0, 20.0, 2.0, 2.0, 2.0]
    rest = robot.random_configuration(rng)
    return {
        "joint-range": cc.JointRange(),
        "posture": cc.Posture(),
        "posture-weighed": cc.Posture(rest, rng.uniform(0.2, 2.0, robot.nv)),
        "manipulability": cc.Manipulability(axes=axes),
        "manipulability-scaled": cc.Manipulability(scale=rates, **rows),
        "smallest-singular-value": cc.SmallestSingularValue(scale=rates, **rows),
        "inverse-condition": cc.InverseCondition(scale=rates, **rows),
        "velocity-ratio": cc.VelocityRatio(scale=rates, along=along, **rows),
        "torque-per-force": cc.TorquePerForce(scale=torques, along=along, **rows),
        "kinetic-energy": cc.KineticEnergy(),
        "gravity-torque": cc.GravityTorque(scale=torques),
        "payload": cc.TorqueDistribution(payload=2.0, com=[0.05, -0.02, 0.1], scale=torques),
        "contact": cc.TorqueDistribution(wrench=wrench, scale=torques),
        "contact-in-the-hand": cc.TorqueDistribution(wrench=wrench, expressed_in="frame", payload=1.0, scale=torques),
        "sum": 0.5 * cc.Posture() - 2.0 * cc.Manipulability(axes=axes) + 0.01 * cc.GravityTorque(),
        "function": cc.FunctionObjective(lambda state: state.com @ [0.3, 1.0, -0.5], gain=2.0),
    }
