"""Every Jacobian and drift by finite differences at random, non-zero states, in any order of asking."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from tests.robots_for_tests import ROBOTS, along, random_state

STEP = 1e-6
pytestmark = pytest.mark.parametrize("name", list(ROBOTS))


def twist_between(a: pin.SE3, b: pin.SE3, h: float) -> np.ndarray:
    """The LOCAL_WORLD_ALIGNED twist that leads from a to b in time h."""
    return np.concatenate([b.translation - a.translation, pin.log3(b.rotation @ a.rotation.T)]) / h


@pytest.mark.parametrize("seed", range(3))
def test_frame_jacobian(name: str, seed: int) -> None:
    robot, rng = ROBOTS[name](), np.random.default_rng(seed)
    state = random_state(robot, rng)
    for frame in {robot.tool, *rng.choice(robot.frame_names[1:], 2)}:
        J = state.jacobian(frame)
        for i, e in enumerate(STEP * np.eye(robot.nv)):
            column = twist_between(
                along(robot, state, -e).placement(frame), along(robot, state, e).placement(frame), 2 * STEP
            )
            np.testing.assert_allclose(J[:, i], column, atol=2e-8)
        np.testing.assert_allclose(state.twist(frame), J @ state.v, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_frame_drift_is_the_classical_acceleration(name: str, seed: int) -> None:
    robot, rng = ROBOTS[name](), np.random.default_rng(seed)
    state = random_state(robot, rng)
    ahead, behind = (along(robot, state, s * STEP * state.v) for s in (1, -1))
    difference = (ahead.jacobian(robot.tool) - behind.jacobian(robot.tool)) @ state.v / (2 * STEP)
    np.testing.assert_allclose(state.drift(robot.tool), difference, atol=1e-6 * (1 + state.v @ state.v))
    assert np.linalg.norm(state.drift(robot.tool)[:3]) > 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_frame_drift_is_pinocchios(name: str, seed: int) -> None:
    """Which gets there by its recursion over the bodies, and not from the columns of the Jacobian."""
    robot, rng = ROBOTS[name](), np.random.default_rng(10 + seed)
    state, data = random_state(robot, rng), robot.model.createData()
    pin.forwardKinematics(robot.model, data, state.q, state.v, np.zeros(robot.nv))
    for frame in robot.frame_names:
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        theirs = pin.getFrameClassicalAcceleration(robot.model, data, robot.frame_id(frame), world).vector
        np.testing.assert_allclose(state.drift(frame), theirs, atol=1e-12 * (1 + state.v @ state.v))


def test_another_velocity_at_the_same_place(name: str) -> None:
    """What depends on v is worked out anew, what does not is kept."""
    robot, rng = ROBOTS[name](), np.random.default_rng(11)
    state, other = random_state(robot, rng), rng.normal(size=robot.nv)
    J, M = state.jacobian(robot.tool), state.mass_matrix
    looked_at = ("nonlinear_effects", "com_drift")
    for quantity in looked_at:
        getattr(state, quantity)
    state.drift(robot.tool)
    state.turn(other)
    fresh = robot.state(state.q, other)
    for quantity in looked_at:
        np.testing.assert_allclose(getattr(state, quantity), getattr(fresh, quantity), atol=1e-12 * (1 + other @ other))
    np.testing.assert_array_equal(state.drift(robot.tool), fresh.drift(robot.tool))
    np.testing.assert_allclose(state.twist(robot.tool), J @ other, atol=1e-12)
    assert state.jacobian(robot.tool) is J and state.mass_matrix is M


@pytest.mark.parametrize("seed", range(3))
def test_kinematic_hessian(name: str, seed: int) -> None:
    """By differences, and against the drift: J_dot v = (H v) v."""
    robot, rng = ROBOTS[name](), np.random.default_rng(seed)
    state = random_state(robot, rng)
    for frame in {robot.tool, *rng.choice(robot.frame_names[1:], 2)}:
        H = state.hessian(frame)
        assert H.shape == (6, robot.nv, robot.nv) and not H.flags.writeable
        for i, e in enumerate(STEP * np.eye(robot.nv)):
            slope = (along(robot, state, e).jacobian(frame) - along(robot, state, -e).jacobian(frame)) / (2 * STEP)
            np.testing.assert_allclose(H[:, :, i], slope, atol=2e-8)
        np.testing.assert_allclose(H @ state.v @ state.v, state.drift(frame), atol=1e-11 * (1 + state.v @ state.v))


def test_gravity_and_inertia_gradients(name: str) -> None:
    robot, rng = ROBOTS[name](), np.random.default_rng(6)
    state, a = random_state(robot, rng), rng.normal(size=robot.nv)
    for quantity, slopes in (
        (lambda s: s.gravity, state.gravity_gradient),
        (lambda s: s.mass_matrix @ a, state.inertia_gradient(a)),
    ):
        size = 1 + np.abs(slopes).max()
        for i, e in enumerate(STEP * np.eye(robot.nv)):
            slope = (quantity(along(robot, state, e)) - quantity(along(robot, state, -e))) / (2 * STEP)
            np.testing.assert_allclose(slopes[:, i], slope, atol=1e-8 * size)


def test_centre_of_mass(name: str) -> None:
    robot = ROBOTS[name]()
    state = random_state(robot, np.random.default_rng(7))
    for i, e in enumerate(STEP * np.eye(robot.nv)):
        column = (along(robot, state, e).com - along(robot, state, -e).com) / (2 * STEP)
        np.testing.assert_allclose(state.com_jacobian[:, i], column, atol=2e-8)
    ahead, behind = (along(robot, state, s * STEP * state.v) for s in (1, -1))
    difference = (ahead.com_jacobian - behind.com_jacobian) @ state.v / (2 * STEP)
    np.testing.assert_allclose(state.com_drift, difference, atol=1e-6 * (1 + state.v @ state.v))


def test_dynamics_quantities_agree_with_newton_euler(name: str) -> None:
    robot = ROBOTS[name]()
    rng = np.random.default_rng(5)
    state = random_state(robot, rng)
    a = rng.normal(size=robot.nv)
    data = robot.model.createData()
    scale = np.abs(state.mass_matrix).max() * 10
    torque = pin.rnea(robot.model, data, state.q, state.v, a)
    np.testing.assert_allclose(state.mass_matrix @ a + state.nonlinear_effects, torque, atol=1e-11 * scale)
    np.testing.assert_allclose(state.gravity, robot.state(state.q).nonlinear_effects, atol=1e-11 * scale)


QUANTITIES = {
    "placement": lambda s, f: s.placement(f).homogeneous,
    "jacobian": lambda s, f: s.jacobian(f),
    "twist": lambda s, f: s.twist(f),
    "drift": lambda s, f: s.drift(f),
    "hessian": lambda s, f: s.hessian(f),
    "gravity_gradient": lambda s, f: s.gravity_gradient,
    "inertia_gradient": lambda s, f: s.inertia_gradient(np.arange(1.0, s.robot.nv + 1.0)),
    "mass_matrix": lambda s, f: s.mass_matrix,
    "nonlinear_effects": lambda s, f: s.nonlinear_effects,
    "gravity": lambda s, f: s.gravity,
    "com": lambda s, f: s.com,
    "com_jacobian": lambda s, f: s.com_jacobian,
    "com_drift": lambda s, f: s.com_drift,
}


@pytest.mark.parametrize("seed", range(6))
def test_the_order_of_asking_does_not_matter(name: str, seed: int) -> None:
    robot, rng = ROBOTS[name](), np.random.default_rng(seed)
    state = random_state(robot, rng)
    for key in rng.permutation([*QUANTITIES, *QUANTITIES]):
        fresh = QUANTITIES[key](robot.state(state.q, state.v), robot.tool)
        np.testing.assert_allclose(QUANTITIES[key](state, robot.tool), fresh, rtol=1e-12, atol=1e-12, err_msg=key)


def test_each_thing_is_computed_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from cartctl.model import state as module

    robot = ROBOTS[name]()
    calls: list[str] = []
    for function in ("_joint_jacobians", "_frame_jacobian", "_place_frame"):
        original = getattr(module, function)
        monkeypatch.setattr(module, function, lambda *a, f=function, o=original: (calls.append(f), o(*a))[1])
    state = random_state(robot, np.random.default_rng(2))
    for _ in range(3):
        (
            state.placement(robot.tool),
            state.jacobian(robot.tool),
            state.twist(robot.tool),
            state.position(robot.tool),
        )
    assert sorted(calls) == ["_frame_jacobian", "_joint_jacobians", "_place_frame"]


def test_what_was_handed_out_stays_valid(name: str) -> None:
    robot = ROBOTS[name]()
    rng = np.random.default_rng(4)
    controller = cc.Controller(robot, cc.FrameTask(robot.tool), limits=None)
    state = controller.observe(robot.random_configuration(rng))
    kept = [f(state, robot.tool) for f in QUANTITIES.values()]
    copies = [np.array(k) for k in kept]
    controller.observe(robot.random_configuration(rng))
    [f(state, robot.tool) for f in QUANTITIES.values()]
    for a, b in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(a, b)
    with pytest.raises(ValueError, match="read-only"):
        state.jacobian(robot.tool)[0, 0] = 1.0
