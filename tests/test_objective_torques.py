"""Objectives of torques, energy and posture against other ways to the same numbers."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.errors import ConfigurationError, FrameNotFound, ParameterError, ShapeError
from tests.objectives_for_tests import SIX

every_robot = pytest.mark.parametrize("name", list(SIX))


def loaded(robot: cc.Robot, mass: float, com: list[float]) -> cc.Robot:
    """The robot with a point mass fixed to its tool."""
    model = robot.model.copy()
    frame = model.frames[robot.frame_id(robot.tool)]
    model.appendBodyToJoint(frame.parentJoint, pin.Inertia(mass, np.array(com), np.zeros((3, 3))), frame.placement)
    return cc.Robot(model, tool=robot.tool)


@every_robot
def test_a_payload_is_a_body_more(name: str) -> None:
    """The torques of g + J^T w are the gravity torques of a robot that holds the mass; so are their slopes."""
    robot, rng = SIX[name](), np.random.default_rng(1)
    com = [0.1, -0.05, 0.2]
    heavier, objective = loaded(robot, 3.0, com), cc.TorqueDistribution(payload=3.0, com=com)
    for _ in range(10):
        q = robot.random_configuration(rng)
        state, other = robot.state(q), heavier.state(q)
        size = 1.0 + np.abs(other.gravity).max()
        np.testing.assert_allclose(objective.torques(state), other.gravity, atol=1e-12 * size)
        np.testing.assert_allclose(objective.torques_gradient(state), other.gravity_gradient, atol=1e-10 * size)
        np.testing.assert_allclose(
            objective.gradient(state), cc.GravityTorque().gradient(other), atol=1e-10 * size * size
        )


@every_robot
def test_contact_torques_do_the_work_of_the_wrench(name: str) -> None:
    """What pressing adds, tau . v, is the power w . xi at the hand; in the hand's axes, with both turned."""
    robot, rng = SIX[name](), np.random.default_rng(2)
    w = rng.normal(size=6) * 10.0
    for axes in ("world", "frame"):
        pressing = cc.TorqueDistribution(wrench=w, expressed_in=axes)
        state = robot.state(robot.random_configuration(rng), rng.normal(size=robot.nv))
        power = (pressing.torques(state) - state.gravity) @ state.v
        twist = state.twist(robot.tool)
        if axes == "frame":
            R = state.rotation(robot.tool)
            twist = np.concatenate([R.T @ twist[:3], R.T @ twist[3:]])
        assert power == pytest.approx(w @ twist, abs=1e-9 * np.linalg.norm(w))


def test_a_scale_counts_shares_of_the_limits() -> None:
    robot = SIX["panda"]()
    state = robot.state(robot.random_configuration(np.random.default_rng(3)))
    shares = state.gravity / robot.limits.torque_upper
    assert cc.GravityTorque(scale="limits").value(state) == pytest.approx(0.5 * shares @ shares)
    slope = cc.GravityTorque(scale=1.0 / robot.limits.torque_upper).gradient(state)
    np.testing.assert_allclose(cc.GravityTorque(scale="limits").gradient(state), slope, rtol=1e-12)


def test_a_base_carries_for_free_unless_told() -> None:
    robot = SIX["talos"]()
    state = robot.state(robot.random_configuration(np.random.default_rng(4)))
    g = state.gravity
    assert cc.GravityTorque().value(state) == pytest.approx(0.5 * g[6:] @ g[6:])
    assert cc.GravityTorque(scale=np.ones(robot.nv)).value(state) == pytest.approx(0.5 * g @ g)


@every_robot
def test_kinetic_energy(name: str) -> None:
    """Against the sum over bodies; doubling v makes it four times as much, and standing still nothing."""
    robot, rng = SIX[name](), np.random.default_rng(5)
    energy = cc.KineticEnergy()
    state = robot.state(robot.random_configuration(rng), rng.normal(size=robot.nv))
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, state.q, state.v)
    bodies = sum(
        0.5 * data.v[j].vector @ (robot.model.inertias[j].matrix() @ data.v[j].vector)
        for j in range(robot.model.njoints)
    )
    assert energy.value(state) == pytest.approx(bodies, rel=1e-10)
    faster = robot.state(state.q, 2.0 * state.v)
    np.testing.assert_allclose(energy.gradient(faster), 4.0 * energy.gradient(state), rtol=1e-9, atol=1e-11)
    assert not energy.gradient(robot.state(state.q)).any()
    held = cc.KineticEnergy(velocity=state.v)
    np.testing.assert_allclose(held.gradient(robot.state(state.q)), energy.gradient(state), rtol=1e-12)


def test_the_kinetic_energy_slope_is_lagranges_term() -> None:
    """``dT/dq = M_dot v - (h - g)``."""
    robot, rng = SIX["panda"](), np.random.default_rng(6)
    state = robot.state(robot.random_configuration(rng), rng.normal(size=7))
    ahead, behind = (robot.state(robot.integrate(state.q, s * 1e-5 * state.v)).mass_matrix for s in (1.0, -1.0))
    M_dot = (ahead - behind) / 2e-5
    expected = M_dot @ state.v - (state.nonlinear_effects - state.gravity)
    np.testing.assert_allclose(cc.KineticEnergy().gradient(state), expected, atol=1e-7 * np.abs(expected).max())


# ---------------------------------------------------------------- posture


@every_robot
def test_posture(name: str) -> None:
    """Zero at the posture; near it the weighed square of the way there; descending it ends there."""
    robot, rng = SIX[name](), np.random.default_rng(7)
    weights, rest = rng.uniform(0.2, 2.0, robot.nv), robot.random_configuration(rng)
    posture = cc.Posture(rest, weights)
    at_rest = robot.state(rest)
    assert posture.value(at_rest) < 1e-20 and np.linalg.norm(posture.gradient(at_rest)) < 1e-10
    away = 0.3 * rng.normal(size=robot.nv)
    away[~robot.single] *= 0.1
    state = robot.state(robot.integrate(rest, away))
    assert posture.value(state) == pytest.approx(0.5 * away @ (weights * away), rel=1e-8)
    q = state.q
    for _ in range(200):
        q = robot.integrate(q, -0.3 * posture.gradient(robot.state(q)))
    assert np.linalg.norm(robot.difference(rest, q)) < 1e-3


def test_a_continuous_joint_takes_the_short_way() -> None:
    robot = SIX["kinova"]()
    i = int(robot.continuous.argmax())
    turned = np.zeros(robot.nv)
    turned[i] = 1.9 * np.pi
    state = robot.state(robot.integrate(robot.home, turned))
    assert cc.Posture().gradient(state)[i] == pytest.approx(-0.1 * np.pi)


def test_home_and_a_base_left_out_by_default() -> None:
    robot = SIX["mobile"]()
    rng = np.random.default_rng(8)
    q = robot.random_configuration(rng)
    gradient = cc.Posture().gradient(robot.state(q))
    assert not gradient[:3].any()
    np.testing.assert_allclose(gradient[3:], robot.difference(robot.home, q)[3:], atol=1e-12)


# ---------------------------------------------------------------- misuse


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: cc.Posture(weights=[-1.0, 1.0]), "at least 0"),
        (lambda: cc.Posture(gain=0.0), "gain is 0"),
        (lambda: cc.KineticEnergy(gain=0.0), "gain is 0"),
        (lambda: cc.GravityTorque(scale="limit"), "scale is 'limit'"),
        (lambda: cc.GravityTorque(scale=[0.0, 0.0]), "not all 0"),
        (lambda: cc.TorqueDistribution(payload=-1.0), "payload is -1"),
        (
            lambda: cc.TorqueDistribution(expressed_in="tool"),
            "expressed_in is 'tool'; expected one of 'world', 'frame'",
        ),
    ],
)
def test_misuse(make, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        make()


@pytest.mark.parametrize(
    ("objective", "error", "words"),
    [
        (cc.Posture(np.zeros(6)), ShapeError, r"target has shape \(6,\); expected \(9,\)"),
        (cc.Posture(np.zeros(9)), ConfigurationError, "target: the .* has norm 0"),
        (cc.Posture(weights=np.ones(9)), ShapeError, r"weights has shape \(9,\); expected \(6,\)"),
        (cc.KineticEnergy(np.ones(9)), ShapeError, r"velocity has shape \(9,\); expected \(6,\)"),
        (cc.GravityTorque(scale=np.ones(9)), ShapeError, r"scale has shape \(9,\); expected \(6,\)"),
        (cc.TorqueDistribution(frame="gripper"), FrameNotFound, "gripper"),
    ],
)
def test_what_does_not_fit_the_robot_is_refused_at_once(objective, error, words: str) -> None:
    robot = SIX["kinova"]()
    with pytest.raises(error, match=words):
        cc.Controller(robot, cc.FrameTask(robot.tool), "projected-gradient", objective=objective, limits=None)
