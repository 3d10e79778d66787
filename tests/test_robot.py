"""Robots: active joints, root joints, continuous and mimic joints, gravity, homes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.errors import (
    ConfigurationError,
    FrameNotFound,
    JointNotFound,
    NonFiniteError,
    ShapeError,
    UrdfError,
)
from tests.test_urdf_input import JOINT, LINK, arm, write

FINGERS = (
    LINK.format("left", "")
    + LINK.format("right", "")
    + JOINT.format("finger", "lower", "left", "prismatic", "")
    + JOINT.format("follower", "lower", "right", "prismatic", '<mimic joint="finger" multiplier="-0.7" offset="0.1"/>')
)


def test_locked_joints_stand_at_home(tmp_path: Path) -> None:
    path = write(tmp_path / "arm.urdf", arm())
    whole = cc.load(path)
    reduced = cc.load(path, active_joints=["elbow"], home={"shoulder": 0.7})
    assert reduced.joint_names == ("elbow",) and reduced.nv == 1
    expected = whole.state([0.7, -0.4]).placement("lower")
    assert reduced.state([-0.4]).placement("lower").isApprox(expected, 1e-12)


@pytest.mark.parametrize(("root", "nq", "nv"), [("fixed", 2, 2), ("planar", 6, 5), ("free_flyer", 9, 8)])
def test_root_joints(tmp_path: Path, root: str, nq: int, nv: int) -> None:
    robot = cc.load(write(tmp_path / "arm.urdf", arm()), root_joint=root)
    assert (robot.nq, robot.nv, len(robot.dof_names)) == (nq, nv, nv)
    assert np.isinf(robot.limits.position_lower[: nv - 2]).all()
    assert robot.dof_names[-2:] == ["shoulder", "elbow"]
    q = robot.random_configuration(np.random.default_rng(3))
    assert pin.isNormalized(robot.model, q)
    with pytest.raises(NonFiniteError):
        robot.state(np.full(nq, np.nan))
    if nq != nv:
        with pytest.raises(ConfigurationError, match="normalize"):
            robot.state(1.5 * q)


def test_continuous_joints_have_one_velocity_and_no_position_limit(tmp_path: Path) -> None:
    robot = cc.load(write(tmp_path / "arm.urdf", arm(kind="continuous")))
    assert (robot.nq, robot.nv) == (4, 2)
    assert np.isinf(robot.limits.position_upper).all() and robot.continuous.all()
    np.testing.assert_allclose(robot.limits.velocity_upper, 3.0)
    q = robot.configuration({"shoulder": 0.4, "elbow": -2.9})
    np.testing.assert_allclose(robot.coordinates(q), [0.4, -2.9], atol=1e-12)
    np.testing.assert_allclose(
        robot.coordinates(robot.integrate(q, np.array([0.0, -0.5]))), [0.4, 2 * np.pi - 3.4], atol=1e-12
    )


def test_mimic_joints_follow_their_master(tmp_path: Path) -> None:
    path = write(tmp_path / "arm.urdf", arm(FINGERS))
    robot = cc.load(path)
    assert robot.joint_names == ("shoulder", "elbow", "finger")
    rng = np.random.default_rng(1)
    for _ in range(5):
        q = robot.random_configuration(rng)
        state = robot.state(q)
        left, right = (state.placement("lower").actInv(state.placement(f)).translation[1] for f in ("left", "right"))
        assert left == pytest.approx(q[2], abs=1e-12)
        assert right == pytest.approx(0.1 - 0.7 * q[2], abs=1e-12)
        h = 1e-6
        for frame in ("left", "right"):
            ends = [robot.state(robot.integrate(q, s * h * np.eye(3)[2])).position(frame) for s in (1, -1)]
            np.testing.assert_allclose(state.jacobian(frame)[:3, 2], (ends[0] - ends[1]) / (2 * h), atol=1e-8)


def test_locked_mimic_joints_agree_with_their_master(tmp_path: Path) -> None:
    path = write(tmp_path / "arm.urdf", arm(FINGERS))
    robot = cc.load(path, active_joints=["shoulder", "elbow"], home={"finger": 0.3})
    assert robot.nv == 2
    state = robot.state([0.2, 0.4])
    assert state.placement("lower").actInv(state.placement("right")).translation[1] == pytest.approx(0.1 - 0.21)
    with pytest.raises(UrdfError, match="mimics 'finger'"):
        cc.load(path, active_joints=["shoulder", "follower"])


def test_gravity_is_settable_and_the_callers_model_untouched(tmp_path: Path) -> None:
    path = write(tmp_path / "arm.urdf", arm())
    q = np.array([0.3, 0.5])
    heavy, none, sideways = (cc.load(path, gravity=g) for g in ((0, 0, -9.81), (0, 0, 0), (-2.0, 1.0, 4.0)))
    np.testing.assert_allclose(none.state(q).gravity, 0.0)
    h = 1e-6
    for robot in (heavy, sideways):

        def potential(q: np.ndarray, robot: cc.Robot = robot) -> float:
            return -float(sum(i.mass for i in list(robot.model.inertias)[1:])) * float(
                robot.gravity @ robot.state(q).com
            )

        slope = [(potential(q + h * e) - potential(q - h * e)) / (2 * h) for e in np.eye(2)]
        np.testing.assert_allclose(robot.state(q).gravity, slope, atol=1e-6)
    model = pin.buildModelFromXML(arm())
    mine = cc.Robot(model)
    mine.model.gravity = pin.Motion.Zero()
    assert model.gravity.linear[2] == -9.81


def test_names_that_do_not_exist_offer_the_closest(tmp_path: Path) -> None:
    robot = cc.load(write(tmp_path / "arm.urdf", arm()))
    with pytest.raises(FrameNotFound, match="'lower'"):
        robot.frame_id("lowr")
    with pytest.raises(JointNotFound, match="'elbow'"):
        robot.dof("elbw")
    with pytest.raises(ShapeError, match=r"expected \(2,\)"):
        robot.state([1.0])
    with pytest.raises(ShapeError, match="v has shape"):
        robot.state([1.0, 2.0], [0.0])


def test_random_configurations_fill_the_limits() -> None:
    robot = cc.load("panda")
    rng = np.random.default_rng(0)
    q = np.array([robot.random_configuration(rng) for _ in range(400)])
    low, high = robot.limits.position_lower, robot.limits.position_upper
    assert (q >= low).all() and (q <= high).all()
    assert (q.min(0) < low + 0.1 * (high - low)).all() and (q.max(0) > high - 0.1 * (high - low)).all()


@pytest.mark.parametrize("name", sorted(cc.robots()))
def test_every_robot_of_the_library_loads_and_stands_inside_its_limits(name: str) -> None:
    robot = cc.load(name)
    position = robot.coordinates(robot.home)
    assert (position >= robot.limits.position_lower - 1e-9).all()
    assert (position <= robot.limits.position_upper + 1e-9).all()
    assert robot.tool in robot.frame_names
    state = robot.state(robot.home, 0.1 * np.ones(robot.nv))
    M = state.mass_matrix
    np.testing.assert_allclose(M, M.T)
    assert np.linalg.eigvalsh(M)[0] > 0.0
    assert np.isfinite(state.jacobian(robot.tool)).all()
    again = cc.load(**robot.spec)
    np.testing.assert_array_equal(again.home, robot.home)
    assert again.dof_names == robot.dof_names


@pytest.mark.parametrize("name", sorted(cc.robots()))
def test_fingers_work_when_asked_for_or_are_refused_in_words(name: str) -> None:
    try:
        robot = cc.load(name, fingers=True)
    except UrdfError as error:
        assert "mimic" in str(error) and "\n" not in str(error)
        return
    assert robot.nv >= cc.load(name).nv
    state = robot.state(robot.home, np.ones(robot.nv))
    assert np.linalg.eigvalsh(state.mass_matrix)[0] > 0.0


def test_the_pandas_fingers_move_together() -> None:
    robot = cc.load("panda", fingers=True)
    assert robot.nv == 8 and robot.joint_names[-1] == "panda_finger_joint1"
    state = robot.state(robot.configuration({"panda_finger_joint1": 0.03}, robot.home))
    left, right = (
        state.placement("panda_hand").actInv(state.placement(f)).translation
        for f in ("panda_leftfinger", "panda_rightfinger")
    )
    assert left[1] == pytest.approx(0.03) and right[1] == pytest.approx(-0.03)


def test_the_icub_stands_upright_in_its_meshes() -> None:
    """Its Collada files are Y_UP, which the mesh loader ignores; as loaded it lies in pieces, twice as deep as high."""
    robot = cc.load("icub")
    shapes = {g.name: g for g in robot.visual_model.geometryObjects}
    data, visual = robot.model.createData(), robot.visual_model
    pin.forwardKinematics(robot.model, data, np.array(robot.home))
    placements = visual.createData()
    pin.updateGeometryPlacements(robot.model, data, visual, placements)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for i, shape in enumerate(visual.geometryObjects):
        box = shape.geometry
        box.computeLocalAABB()
        corners = np.array(
            [
                [a, b, c]
                for a in (box.aabb_local.min_[0], box.aabb_local.max_[0])
                for b in (box.aabb_local.min_[1], box.aabb_local.max_[1])
                for c in (box.aabb_local.min_[2], box.aabb_local.max_[2])
            ]
        )
        world = corners @ placements.oMg[i].rotation.T + placements.oMg[i].translation
        low, high = np.minimum(low, world.min(0)), np.maximum(high, world.max(0))
    size = high - low
    assert shapes and 0.85 < size[2] < 1.25 and size[2] > 1.3 * size[0]
