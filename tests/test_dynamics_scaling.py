"""Uniform time scaling: against a dense grid of factors, the motion run at the new speed, and the definition."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.errors import ParameterError, ShapeError
from tests.robots_for_tests import panda

scale = cc.dynamics.time_scaling


def within(torque, static, viscous, low, high, k):
    """What the bounds leave at factor k (>= 0 is feasible)."""
    tau = static + viscous / k + (torque - static - viscous) / k**2
    return min((high - tau).min(), (tau - low).min())


@pytest.mark.parametrize("seed", range(60))
def test_the_factor_is_the_smallest_of_a_dense_grid(seed):
    rng = np.random.default_rng(seed)
    N, n = int(rng.integers(1, 6)), int(rng.integers(1, 4))
    torque, static = 3 * rng.normal(size=(N, n)), rng.normal(size=(N, n)) * rng.choice([0.3, 1.2])
    viscous = rng.normal(size=(N, n)) * (seed % 2)
    high, low = rng.uniform(0.5, 3.0, n), -rng.uniform(0.5, 3.0, n)
    found = scale(torque, static, high, low, viscous)
    grid = np.geomspace(1e-3, 1e3, 40001)
    feasible = np.array([within(torque, static, viscous, low, high, k) >= 0.0 for k in grid])
    if not found.feasible:
        assert not feasible.any() and np.isnan(found.torque).all()
        return
    smallest = grid[int(feasible.argmax())]
    assert feasible.any() and smallest / 1.001 < found.factor <= smallest * (1 + 1e-9)
    slack = within(torque, static, viscous, low, high, found.factor)
    assert abs(slack) < 1e-12 * max(1.0, np.abs(found.torque).max())  # on the bound, not beyond it
    i, j = found.sample, found.joint
    assert min(abs(found.torque[i, j] - high[j]), abs(found.torque[i, j] - low[j])) < 1e-11


def test_speeding_up_and_slowing_down():
    slow = scale([[8.0]], [[2.0]], [3.0])
    assert slow.factor == pytest.approx(math.sqrt(6.0)) and slow.slows_down and "slow down" in str(slow)
    np.testing.assert_allclose(slow.torque, [[3.0]])
    fast = scale([[3.0]], [[2.0]], [6.0])
    assert fast.factor == pytest.approx(0.5) and not fast.slows_down and "speed up" in str(fast)
    kept = scale([[3.0]], [[2.0]], [6.0], at_least=1.0)
    assert kept.factor == 1.0 and kept.sample is None
    np.testing.assert_allclose(kept.torque, [[3.0]])


def test_gravity_beyond_the_bound():
    assert not scale([[5.0]], [[4.0]], [3.0]).feasible  # slower only makes it 4
    swing = scale([[1.0]], [[4.0]], [3.0], [-5.0])  # falling fast enough takes the load off
    assert swing.factor == pytest.approx(1 / math.sqrt(3.0)) and swing.torque[0, 0] == pytest.approx(-5.0)
    never = scale([[1.0], [1.0]], [[4.0], [1.0]], [3.0], [-5.0], at_least=3.0)
    assert not never.feasible and (never.sample, never.joint) == (0, 0) and "slow enough" in str(never)


def test_nothing_in_the_way():
    free = scale([[5.0, 1.0]], [[0.0, 1.0]], [math.inf, 2.0])
    assert free.factor == 0.0 and free.joint is None and "nothing" in str(free)
    np.testing.assert_array_equal(free.torque, [[0.0, 1.0]])


def test_a_pandas_swing_at_the_new_speed_meets_its_bound():
    """The motion itself, run k times slower through Newton-Euler, has the torques promised."""
    robot, rng = panda(), np.random.default_rng(0)
    start, goal = robot.random_configuration(rng), robot.random_configuration(rng)
    s = np.linspace(0, 1, 201)[:, None]
    law = (10 * s**3 - 15 * s**4 + 6 * s**5, 30 * s**2 - 60 * s**3 + 30 * s**4, 60 * s - 180 * s**2 + 120 * s**3)

    def motion(T):
        return start + law[0] * (goal - start), law[1] * (goal - start) / T, law[2] * (goal - start) / T**2

    for T in (0.3, 5.0):
        torque, static = cc.dynamics.motion_torques(robot, *motion(T))
        found = scale(torque, static, robot.limits.torque_upper, robot.limits.torque_lower)
        assert found.slows_down == (T == 0.3)
        again, still = cc.dynamics.motion_torques(robot, *motion(T * found.factor))
        np.testing.assert_allclose(still, static)
        np.testing.assert_allclose(again, found.torque, atol=1e-9 * np.abs(again).max())
        assert (np.abs(again) <= robot.limits.torque_upper * (1 + 1e-9)).all()
        assert np.abs(again / robot.limits.torque_upper).max() == pytest.approx(1.0)
    q, v, a = motion(1.0)
    data = robot.model.createData()
    np.testing.assert_allclose(
        cc.dynamics.motion_torques(robot, q, v, a)[0][70], pin.rnea(robot.model, data, q[70], v[70], a[70])
    )


def test_misuse_is_named():
    for bad, error, text in (
        (lambda: scale([[1.0, 2.0]], [[1.0]], [1.0, 1.0]), ShapeError, "static"),
        (lambda: scale([[1.0]], [[1.0]], [1.0, 1.0]), ShapeError, "upper"),
        (lambda: scale([[1.0]], [[1.0]], [1.0], [2.0]), ParameterError, r"lower\[0\] is 2"),
        (lambda: scale([[1.0]], [[1.0]], [1.0], at_least=-1), ParameterError, "at_least"),
        (lambda: scale([[1e308]], [[-1e308]], [1.0]), ParameterError, "beyond the largest number"),
        (lambda: cc.dynamics.motion_torques("panda", [[0.0]], [[0.0]], [[0.0]]), ParameterError, "robot is a str"),
    ):
        with pytest.raises(error, match=text):
            bad()
