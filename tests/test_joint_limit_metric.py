"""Weights that hold joints off their limits (Chan & Dubey): formula, direction, edges, and the closed loop."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cartctl as cc
from cartctl.errors import CartctlError
from tests import oracles
from tests.robots_for_tests import ROBOTS, panda, random_state

LIMITED = st.sampled_from(["pendulum", "planar", "panda", "talos"])


def barrier(robot, q):
    """H = sum 1/4 (max - min)^2 / ((max - q)(q - min)) over joints with two limits."""
    low, high = robot.limits.position_lower, robot.limits.position_upper
    both = np.isfinite(low) & np.isfinite(high)
    x = robot.coordinates(q)
    return sum(
        0.25 * (h - a) ** 2 / ((h - v) * (v - a)) for a, h, v in zip(low[both], high[both], x[both], strict=True)
    )


def towards(robot, q, rng, sign):
    """Velocities that all move towards (+1) or away from (-1) the nearer limit."""
    low, high = robot.limits.position_lower, robot.limits.position_upper
    limited = np.isfinite(low) & np.isfinite(high)
    middle = np.zeros(robot.nv)
    middle[limited] = 0.5 * (low[limited] + high[limited])
    return sign * np.sign(robot.coordinates(q) - middle) * rng.uniform(0.1, 1.0, robot.nv)


@given(LIMITED, oracles.SEEDS, st.sampled_from([1.0, 0.3, 5.0]))
def test_weights_are_the_slope_of_the_barrier(name, seed, gain):
    robot, rng = ROBOTS[name](), np.random.default_rng(seed)
    q = random_state(robot, rng).q
    metric, h = cc.JointLimitMetric(gain=gain), 1e-7
    weights = metric(robot.state(q, towards(robot, q, rng, 1.0)))
    limited = np.isfinite(robot.limits.position_lower) & np.isfinite(robot.limits.position_upper)
    assert weights.shape == (robot.nv,) and (weights[~limited] == 1.0).all()
    for i in np.flatnonzero(limited)[:12]:
        e = h * np.eye(robot.nv)[i]
        slope = (barrier(robot, robot.integrate(q, e)) - barrier(robot, robot.integrate(q, -e))) / (2 * h)
        assert weights[i] == pytest.approx(1.0 + gain * abs(slope), rel=1e-4, abs=1e-5 * gain)


@given(LIMITED, oracles.SEEDS)
def test_away_from_the_limit_and_at_rest(name, seed):
    """1 while a joint moves away; standing still counts as towards, joint by joint."""
    robot, rng = ROBOTS[name](), np.random.default_rng(seed)
    q, metric = random_state(robot, rng).q, cc.JointLimitMetric()
    away, still = towards(robot, q, rng, -1.0), np.zeros(robot.nv)
    full = metric(robot.state(q, towards(robot, q, rng, 1.0)))
    np.testing.assert_array_equal(metric(robot.state(q, away)), 1.0)
    np.testing.assert_allclose(metric(robot.state(q, still)), full)
    mixed = np.where(rng.random(robot.nv) < 0.5, away, -away)
    np.testing.assert_allclose(metric(robot.state(q, mixed)), np.where(mixed == away, 1.0, full))


@pytest.mark.parametrize("beyond", [-1e-3, -1e-12, 0.0, 1e-12, 1e-3, 1.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_at_and_beyond_a_limit(side, beyond):
    """Finite, huge on the way out, 1 on the way back, growing up to the limit."""
    robot, metric = panda(), cc.JointLimitMetric()
    limit = robot.limits.position_upper if side > 0 else robot.limits.position_lower
    q = limit + side * beyond
    out, back = (metric(robot.state(q, s * side * np.ones(7))) for s in (1.0, -1.0))
    assert np.isfinite(out).all() and (out > 1e4).all() and (back == 1.0).all()
    assert (out >= metric(robot.state(limit - side * 0.01, side * np.ones(7)))).all()
    controller = cc.Controller(robot, cc.FrameTask(robot.tool), metric=metric, limits=None)
    target = robot.state(q).placement(robot.tool)
    target.translation = target.translation + [0.01, 0.02, -0.01]
    controller.tasks[0].target = target
    assert np.isfinite(controller.step(q, side * np.ones(7)).velocity).all()


def test_joints_without_limits_weigh_one():
    robot, metric = ROBOTS["kinova"](), cc.JointLimitMetric()
    limited = np.isfinite(robot.limits.position_lower)
    assert 0 < limited.sum() < robot.nv
    weights = metric(random_state(robot, np.random.default_rng(0)))
    assert (weights[~limited] == 1.0).all() and weights.shape == (robot.nv,)


def test_zero_gain_is_the_identity_and_other_limits_are_taken():
    robot = panda()
    state = robot.state(random_state(robot, np.random.default_rng(1)).q)
    np.testing.assert_array_equal(cc.JointLimitMetric(gain=0.0)(state), 1.0)
    wide = robot.limits.replace(position_lower=-50.0, position_upper=50.0)
    expected = 1.0 + np.abs(100.0**2 * 2.0 * state.q / (4.0 * (2500.0 - state.q**2) ** 2))
    np.testing.assert_allclose(cc.JointLimitMetric(limits=wide)(state), expected, rtol=1e-12)


@pytest.mark.parametrize("gain", [-1.0, float("nan"), "much", None])
def test_bad_gains_are_named(gain):
    with pytest.raises(CartctlError, match="gain"):
        cc.JointLimitMetric(gain=gain)


def test_by_name_and_by_instance():
    robot = panda()
    q, v = robot.home + 0.2, 0.3 * np.ones(7)
    task = cc.FrameTask(robot.tool, target=robot.state(robot.home).placement(robot.tool))
    by_name, by_instance, by_array = (
        cc.Controller(robot, task, metric=metric, limits=None).step(q, v).velocity
        for metric in ("joint-limits", cc.JointLimitMetric(), cc.JointLimitMetric()(robot.state(q, v)))
    )
    np.testing.assert_array_equal(by_name, by_instance)
    np.testing.assert_allclose(by_name, by_array, rtol=1e-12)
    J, W = robot.state(q).jacobian(robot.tool), cc.JointLimitMetric()(robot.state(q, v))
    expected = oracles.constrained_minimum(J, J @ by_name, W)
    np.testing.assert_allclose(by_name, expected, atol=1e-8)
    plain = cc.Controller(robot, task, limits=None).step(q, v).velocity
    assert np.linalg.norm(plain - by_name) > 1e-3


def excursion(metric):
    """A Panda whose hand is drawn in and down: the least margin of any joint, relative to its range."""
    robot = panda()
    start = robot.state(robot.home).position(robot.tool)
    path = cc.Line(start, start + np.array([-0.22, 0.0, -0.34]), duration=3.0)
    task = cc.FrameTask(robot.tool, "position", target=path)
    controller = cc.Controller(robot, task, metric=metric, limits=None, dt=2e-3)
    run = cc.simulate(controller, robot.home, 3.0)
    low, high = robot.limits.position_lower, robot.limits.position_upper
    margin = np.minimum(run.q - low, high - run.q) / (high - low)
    return margin.min(), np.linalg.norm(run.tasks[0].error, axis=1).max(), run


def test_the_closed_loop_keeps_joints_off_their_limits():
    plain, weighted = excursion(None), excursion("joint-limits")
    assert max(plain[1], weighted[1]) < 2e-3  # the same hand path
    assert weighted[0] > plain[0] + 0.05 and weighted[0] > 0.05
    assert np.isfinite(weighted[2].q).all()
