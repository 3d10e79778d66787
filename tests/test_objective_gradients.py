"""Every gradient against finite differences: a thousand random states of each robot, a random direction at each."""

from __future__ import annotations

import numpy as np
import pytest

import cartctl as cc
from cartctl.model.state import State
from tests.objectives_for_tests import PLANE, SIX, objectives

STATES = 1000
H = 2e-4
CLEAR = 0.01  # of the largest singular value: how far values stay from each other and from 0, where measures have kinks
DIFFERENCE = 1e-7  # of 1 + |dH|: five points with step H are good to 1e-9 at distance CLEAR

every_robot = pytest.mark.parametrize("name", list(SIX))


def is_smooth(name: str, state: State) -> bool:
    """Whether no measure has a kink nearby: no singular values meet, no angle is half a turn from its target."""
    robot = state.robot
    for objective in objectives(name).values():
        if isinstance(objective, cc.Manipulability | cc.SmallestSingularValue):
            s = objective._spread(state).s
            if np.diff(np.append(s, 0.0)).max() > -CLEAR * s[0]:
                return False
        if isinstance(objective, cc.Posture):
            e = robot.difference(robot.home if objective.target is None else objective.target, state.q)
            turning = e[robot.continuous]
            if np.abs(turning).max(initial=0.0) > np.pi - 0.01:
                return False
    return True


@every_robot
def test_gradients(name: str) -> None:
    robot, rng = SIX[name](), np.random.default_rng(11)
    known, state, moved = objectives(name), State(robot), State(robot)
    tried, worst = 0, dict.fromkeys(known, 0.0)
    for _ in range(STATES):
        while True:
            tried += 1
            state.set(robot.random_configuration(rng), rng.normal(size=robot.nv))
            if is_smooth(name, state):
                break
        d = rng.normal(size=robot.nv)
        d /= np.linalg.norm(d)
        ends = []
        for k in (2.0, 1.0, -1.0, -2.0):
            moved.set(robot.integrate(state.q, k * H * d), state.v)
            ends.append([objective.value(moved) for objective in known.values()])
        slopes = np.array([-1.0, 8.0, -8.0, 1.0]) @ np.array(ends) / (12.0 * H)
        for (key, objective), slope in zip(known.items(), slopes, strict=True):
            gradient = objective.gradient(state)
            assert gradient.shape == (robot.nv,) and np.isfinite(gradient).all()
            worst[key] = max(worst[key], abs(gradient @ d - slope) / (1.0 + np.linalg.norm(gradient)))
    assert max(worst.values()) < DIFFERENCE, worst
    assert tried < 2.5 * STATES


@every_robot
def test_no_gradient_is_zero_by_accident(name: str) -> None:
    """A gradient that were zero everywhere would pass above where its value were constant."""
    robot, rng = SIX[name](), np.random.default_rng(3)
    states = [robot.state(robot.random_configuration(rng), rng.normal(size=robot.nv)) for _ in range(20)]
    for key, objective in objectives(name).items():
        slopes = [np.linalg.norm(objective.gradient(state)) for state in states]
        assert np.median(slopes) > 1e-4, key


@every_robot
def test_at_rest_and_anywhere_all_is_finite(name: str) -> None:
    """Neutral postures are singular for most of these arms, home may be, v is zero."""
    robot, rng = SIX[name](), np.random.default_rng(4)
    for q in (robot.neutral, robot.home, robot.integrate(robot.neutral, 1e-9 * rng.normal(size=robot.nv))):
        state = robot.state(q)
        for key, objective in objectives(name).items():
            gradient = objective.gradient(state)
            assert np.isfinite(objective.value(state)) and np.isfinite(gradient).all(), key
            assert np.linalg.norm(gradient) < 1e4, key
            objective.check(robot)


@every_robot
def test_the_order_of_asking_does_not_matter(name: str) -> None:
    """What one objective computes in the State leaves what another or a task asks for as it was."""
    robot, rng = SIX[name](), np.random.default_rng(6)
    q, v = robot.random_configuration(rng), rng.normal(size=robot.nv)
    state = robot.state(q, v)
    asked = {key: objective.gradient for key, objective in objectives(name).items()}
    asked |= {
        "drift": lambda s: s.drift(s.robot.tool),
        "h": lambda s: s.nonlinear_effects,
        "com": lambda s: s.com_drift,
    }
    fresh = {key: np.array(function(robot.state(q, v))) for key, function in asked.items()}
    for key in rng.permutation([*asked, *asked]):
        np.testing.assert_allclose(asked[key](state), fresh[key], rtol=1e-11, atol=1e-11, err_msg=key)


@pytest.mark.parametrize("name", ["planar3R", "panda", "rpr"])
def test_the_hessian_of_any_objective_by_differences(name: str) -> None:
    """What the extended Jacobian uses: symmetric where the tangent space is flat."""
    robot, rng = SIX[name](), np.random.default_rng(8)
    state = robot.state(robot.random_configuration(rng), rng.normal(size=robot.nv))
    for key, objective in objectives(name).items():
        hessian = objective.hessian(state)
        tolerance = 1e-3 if key == "function" else 1e-6  # differences of differences
        np.testing.assert_allclose(hessian, hessian.T, atol=tolerance * (1.0 + np.abs(hessian).max()), err_msg=key)


def test_six_robots_have_every_kind_of_joint() -> None:
    kinds = {joint.shortname() for robot in SIX.values() for joint in robot().model.joints}
    assert {"JointModelPX", "JointModelRUBZ", "JointModelPlanar", "JointModelFreeFlyer", "JointModelRZ"} <= kinds
    assert set(PLANE) < set(SIX)
