"""The compiled tree against Pinocchio: every robot of the library at random states, and every kind of joint."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.compiled.motion_kernel import frame_motion, frame_poses, moved
from cartctl.compiled.tree import tree_of

AGREE = 1e-12
KINDS = {
    "revolute": pin.JointModelRevoluteUnaligned(np.array([0.36, -0.48, 0.8])),
    "backwards": pin.JointModelRevoluteUnaligned(np.array([0.0, 0.0, -1.0])),
    "prismatic": pin.JointModelPrismaticUnaligned(np.array([-0.6, 0.0, 0.8])),
    "continuous": pin.JointModelRUBY(),
    "z": pin.JointModelRUBZ(),
    "slide": pin.JointModelPY(),
    "y": pin.JointModelRY(),
}
REFUSED = {
    "Spherical": pin.JointModelSpherical(),
    "Planar": pin.JointModelPlanar(),
    "FreeFlyer": pin.JointModelFreeFlyer(),
    "Helical": pin.JointModelHelicalUnaligned(np.array([0.0, 0.0, 1.0]), 0.1),
    "Translation": pin.JointModelTranslation(),
}


def branching() -> cc.Robot:
    """A tree of all kinds of joints that the arrays hold, two or three on each, anywhere in space."""
    pin.seed(2)
    model = pin.Model()
    model.name = "branching"
    for i, (name, joint) in enumerate(KINDS.items()):
        added = model.addJoint([0, 1, 1, 2, 4, 4, 3][i], joint, pin.SE3.Random(), name)
        model.addJointFrame(added)
        model.appendBodyToJoint(added, pin.Inertia.Random(), pin.SE3.Identity())
        model.addFrame(pin.Frame(f"end of {name}", added, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    model.addFrame(pin.Frame("nailed", 0, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    return cc.Robot(model)


def motion(robot: cc.Robot, frame: str, q: np.ndarray, v: np.ndarray):
    tree = tree_of(robot)
    pose, J, drift = np.empty(12), np.empty((6, robot.nv)), np.empty(6)
    frame_motion(tree.joints, tree.frame(frame), q, v, pose, J, drift)
    return pose, J, drift


def agrees(robot: cc.Robot, frames: list[str], seed: int, states: int = 5) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(states):
        q, v = robot.random_configuration(rng), rng.normal(size=robot.nv)
        state = robot.state(q, v)
        for frame in frames:
            pose, J, drift = motion(robot, frame, q, v)
            np.testing.assert_allclose(pose[:9].reshape(3, 3), state.rotation(frame), atol=AGREE)
            np.testing.assert_allclose(pose[9:], state.position(frame), atol=AGREE)
            np.testing.assert_allclose(J, state.jacobian(frame), atol=AGREE)
            np.testing.assert_allclose(drift, state.drift(frame), atol=10 * AGREE, rtol=AGREE)
        out, at = np.empty(robot.nq), np.empty(robot.nv)
        moved(tree_of(robot).joints, q, v, out, at)
        there = robot.integrate(q, v)
        np.testing.assert_allclose(out, there, atol=AGREE)
        gap = at - robot.coordinates(there)
        # Pinocchio takes an angle from its cosine, which near pi leaves half the digits
        np.testing.assert_allclose(np.where(robot.continuous, np.sin(gap), gap), 0.0, atol=1e-7)
        np.testing.assert_allclose(gap[~robot.continuous], 0.0, atol=AGREE)


@pytest.mark.parametrize("name", cc.robots())
def test_library_robots(name):
    robot = cc.load(name)
    rng = np.random.default_rng(7)
    frames = {robot.tool, *rng.choice(robot.frame_names, size=min(6, len(robot.frame_names)), replace=False).tolist()}
    agrees(robot, sorted(frames), seed=11)


def test_a_tree_of_all_kinds_of_joints():
    robot = branching()
    agrees(robot, list(robot.frame_names), seed=3)


def test_a_continuous_joint_about_any_axis(tmp_path):
    urdf = tmp_path / "odd.urdf"
    urdf.write_text(
        """<robot name="odd"><link name="a"/><link name="b"/><link name="c"/>
        <joint name="j" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.1 0.2 0.3" rpy="1 2 3"/>
        <axis xyz="0.36 -0.48 0.8"/></joint>
        <joint name="k" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0.1 0.2 0.3" rpy="3 2 1"/>
        <axis xyz="0.6 0 -0.8"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
    )
    robot = cc.load(urdf)
    assert robot.nq == robot.nv + 1
    agrees(robot, list(robot.frame_names), seed=5)


def test_poses_of_many_configurations():
    robot = branching()
    rng = np.random.default_rng(4)
    q = np.array([robot.random_configuration(rng) for _ in range(9)])
    tree, poses = tree_of(robot), np.empty((9, 12))
    frame_poses(tree.joints, tree.frame("end of slide"), q, poses)
    for row, pose in zip(q, poses, strict=True):
        placed = robot.state(row).placement("end of slide")
        np.testing.assert_allclose(pose, [*placed.rotation.ravel(), *placed.translation], atol=AGREE)


def test_a_pair_off_the_circle_is_brought_back():
    """A (cos, sin) pair keeps unit norm over a million small steps' worth of round-off: its error is not carried on."""
    robot = branching()
    q = robot.random_configuration(np.random.default_rng(5))
    off = q.copy()
    at = next(j.idx_q for j in robot.model.joints if j.shortname() == "JointModelRUBZ")
    off[at : at + 2] *= 1.0 + 1e-5
    out, seen = np.empty(robot.nq), np.empty(robot.nv)
    moved(tree_of(robot).joints, off, np.ones(robot.nv), out, seen)
    assert abs(np.linalg.norm(out[at : at + 2]) - 1.0) < 1e-9


@pytest.mark.parametrize("kind", REFUSED)
def test_what_it_cannot_express_is_refused_by_name(kind):
    model = pin.Model()
    model.addJoint(
        model.addJoint(0, pin.JointModelRZ(), pin.SE3.Random(), "fine"), REFUSED[kind], pin.SE3.Random(), "odd"
    )
    robot = cc.Robot(model)
    with pytest.raises(cc.errors.UnsupportedJoint, match=f"'odd' is a {kind}.*turn about or slide along one axis"):
        tree_of(robot)


def test_mimicking_joints_are_refused_by_name():
    model = pin.Model()
    first = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "first")
    model.addJoint(first, pin.JointModelRX(), pin.SE3.Random(), "second")
    robot = cc.Robot(pin.transformJointIntoMimic(model, first, 2, 0.5, 0.1))
    with pytest.raises(cc.errors.UnsupportedJoint, match="joint 'second' mimics another joint"):
        tree_of(robot)


def test_interpreted_and_compiled_agree():
    code = """
import numpy as np, tests.test_compiled_kinematics as t, cartctl as cc
robot, rng = cc.load("kinova"), np.random.default_rng(1)
q, v = robot.random_configuration(rng), rng.normal(size=robot.nv)
print(repr([x.tolist() for x in t.motion(robot, robot.tool, q, v)]))
"""
    answers = []
    for off in ("0", "1"):
        env = {**os.environ, "NUMBA_DISABLE_JIT": off, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
        answers.append(eval(done.stdout))  # noqa: S307 - printed above
    for compiled, interpreted in zip(*answers, strict=True):
        np.testing.assert_allclose(compiled, interpreted, atol=AGREE)
