"""Arms generated at random: any chain of one-dof joints, and one joint of any kind between two revolute ones."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import cartctl as cc

PLAIN = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelPX, pin.JointModelPZ, pin.JointModelRUBY)


def placement(rng: np.random.Generator, reach: float = 0.5) -> pin.SE3:
    quaternion = rng.normal(size=4)
    R = pin.Quaternion(quaternion / np.linalg.norm(quaternion)).toRotationMatrix()
    return pin.SE3(R, rng.uniform(-reach, reach, 3))


def body(rng: np.random.Generator) -> pin.Inertia:
    """A mass between 0.5 and 3 kg, a uniform box's inertia about any axes, off the joint."""
    x, y, z = rng.uniform(0.05, 0.4, 3) ** 2
    mass, R = rng.uniform(0.5, 3.0), placement(rng).rotation
    return pin.Inertia(mass, rng.uniform(-0.2, 0.2, 3), R @ np.diag(mass / 12 * np.array([y + z, x + z, x + y])) @ R.T)


def chain(rng: np.random.Generator, joints: list) -> cc.Robot:
    model, parent = pin.Model(), 0
    for i, joint in enumerate(joints):
        parent = model.addJoint(parent, joint, placement(rng), f"joint{i}")
        model.appendBodyToJoint(parent, body(rng), pin.SE3.Identity())
    model.addFrame(pin.Frame("tool", parent, placement(rng), pin.FrameType.OP_FRAME))
    model.name, model.gravity = f"chain{model.nv}", pin.Motion(rng.normal(size=3) * 9.81, np.zeros(3))
    return cc.Robot(model, tool="tool")


def generated(seed: int, n: int = 12) -> cc.Robot:
    """A chain of n one-dof joints: revolute, prismatic and continuous."""
    rng = np.random.default_rng(seed)
    return chain(rng, [PLAIN[int(rng.integers(len(PLAIN)))]() for _ in range(n)])


def with_joint(joint, seed: int = 0) -> cc.Robot:
    """Revolute, the given joint, revolute."""
    return chain(np.random.default_rng(seed), [pin.JointModelRY(), joint, pin.JointModelRZ()])
