"""The kinematic Hessian of joints that only a model of one's own or a mimic joint brings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.model.differences import central

BODY = (
    '<link name="{}"><inertial><origin xyz="0.2 0.05 0"/><mass value="1.2"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/></inertial></link>'
)
HINGE = (
    '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><origin xyz="0.5 0 0.1"/><axis xyz="{}"/>'
    '<limit lower="-3" upper="3" velocity="1" effort="10"/>{}</joint>'
)
MIMIC = (
    '<robot name="follower"><link name="base"/><link name="tip"/>'
    + "".join(BODY.format(f"link{k}") for k in (1, 2, 3))
    + HINGE.format("one", "base", "link1", "0 0 1", "")
    + HINGE.format("two", "link1", "link2", "0 1 0", "")
    + HINGE.format("three", "link2", "link3", "1 0 0", '<mimic joint="one" multiplier="0.5" offset="0.1"/>')
    + '<joint name="fixed" type="fixed"><parent link="link3"/><child link="tip"/><origin xyz="0.5 0.2 0.1"/></joint>'
    + "</robot>"
)


def chain(*joints: pin.JointModel) -> cc.Robot:
    """A serial chain of any joints, skew in space."""
    model, parent, rng = pin.Model(), 0, np.random.default_rng(2)
    for k, joint in enumerate(joints):
        axis = rng.normal(size=3)
        place = pin.SE3(pin.exp3(axis), rng.normal(size=3))
        parent = model.addJoint(parent, joint, place, f"joint{k}")
        model.appendBodyToJoint(parent, pin.Inertia(1.0 + k, rng.normal(size=3), np.eye(3)), pin.SE3.Identity())
    place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    model.addFrame(pin.Frame("tip", parent, place, pin.FrameType.OP_FRAME))
    return cc.Robot(model, tool="tip")


CHAINS = {
    "spherical": lambda: chain(pin.JointModelRX(), pin.JointModelSpherical(), pin.JointModelPY()),
    "zyx": lambda: chain(pin.JointModelSphericalZYX(), pin.JointModelRY()),
    "translation": lambda: chain(pin.JointModelRZ(), pin.JointModelTranslation(), pin.JointModelRX()),
    "planar in the middle": lambda: chain(pin.JointModelRX(), pin.JointModelPlanar(), pin.JointModelRUBY()),
    "free in the middle": lambda: chain(pin.JointModelPZ(), pin.JointModelFreeFlyer(), pin.JointModelRX()),
    "helical": lambda: chain(pin.JointModelRX(), pin.JointModelHZ(0.3), pin.JointModelRevoluteUnaligned(0.6, 0.8, 0)),
}


@pytest.mark.parametrize("kind", list(CHAINS))
def test_kinematic_hessian(kind: str) -> None:
    robot, rng = CHAINS[kind](), np.random.default_rng(1)
    for _ in range(5):
        q = pin.integrate(robot.model, robot.neutral, rng.normal(size=robot.nv))
        state = robot.state(q, rng.normal(size=robot.nv))
        H = state.hessian("tip")
        np.testing.assert_allclose(H, central(state, lambda s: s.jacobian("tip")), atol=1e-8)
        np.testing.assert_allclose(H @ state.v @ state.v, state.drift("tip"), atol=1e-10)


def test_mimic_joints_are_differenced(tmp_path: Path) -> None:
    """Pinocchio's derivatives know no mimic joints; against the drift, and a larger step."""
    path = tmp_path / "arm.urdf"
    path.write_text(MIMIC)
    robot, rng = cc.load(path), np.random.default_rng(3)
    assert robot.mimics and robot.nv == 2
    state = robot.state(rng.normal(size=2), rng.normal(size=2))
    H = state.hessian("tip")
    np.testing.assert_allclose(H, central(state, lambda s: s.jacobian("tip"), 1e-4), atol=1e-8)
    np.testing.assert_allclose(H @ state.v @ state.v, state.drift("tip"), atol=1e-8)
    energy = cc.KineticEnergy()
    for objective in (
        energy,
        cc.GravityTorque(),
        cc.Manipulability(axes="position"),
        cc.TorqueDistribution(payload=1.0),
    ):
        np.testing.assert_allclose(
            objective.gradient(state), central(state, objective.value, 1e-4), rtol=1e-6, atol=1e-7
        )
    assert np.linalg.norm(energy.gradient(state)) > 1e-3
