"""Torques held over a step: bounds on accelerations hold for what the step comes to, not for its first instant."""

from __future__ import annotations

import numpy as np
import pytest

import cartctl as cc
from cartctl.levels.midway import KEEPS, KEPT, LEAVES, accelerations, near
from cartctl.motion.forward import Work, rk4
from tests.robots_for_tests import kinova, panda, random_state

DT = 5e-3
CAREFUL = 8  # steps of the plant to one of the controller


def limits_of(robot, a=15.0):
    own = robot.limits
    return own.replace(acceleration_lower=np.full(robot.nv, -a), acceleration_upper=np.full(robot.nv, a))


def controller_of(robot, solver="sns", looks_ahead=True, **options):
    hand = cc.FrameTask(robot.tool, "position", gain=30.0, target=[0.9, 0.9, 0.2])
    controller = cc.Controller(robot, hand, solver, "torque", limits=limits_of(robot), dt=DT, **options)
    assert controller._confining.midway is not None
    if not looks_ahead:
        controller._confining.midway = None
    return controller


def held(body, q, v, torque):
    """Where a held torque leads in a step, carefully."""
    for _ in range(CAREFUL):
        q, v, _ = rk4(body, q, v, torque, 0.0, DT / CAREFUL, Work())
    return q, v


def misses(robot, controller, states):
    """By how much the velocity's change leaves the bounds on the acceleration, per unit of their room: each state."""
    body, found = cc.Plant().body(robot), []
    for q, v in states:
        command = controller.step(q, v)
        if command.solution.yielded:
            continue
        lower, upper = controller._confining.at(robot.state(q, v))[:2]
        a = (held(body, q, v, command.torque)[1] - v) / DT
        found.append(float(np.max(np.maximum(lower - a, a - upper) / (upper - lower + 1e-3))))
    return np.array(found)


@pytest.mark.parametrize("solver", ["sns", "hqp", "qp"])
@pytest.mark.parametrize("options", [{}, {"metric": "inverse-inertia"}])
def test_what_a_step_comes_to_stays_within_its_bounds(solver, options):
    robot, rng = panda(), np.random.default_rng(1)
    limits = limits_of(robot)
    states = [
        (rng.uniform(limits.position_lower, limits.position_upper), 0.5 * rng.uniform(-1, 1, 7) * limits.velocity_upper)
        for _ in range(60)
    ]
    kept = misses(robot, controller_of(robot, solver, **options), states)
    left = misses(robot, controller_of(robot, solver, looks_ahead=False, **options), states)
    assert len(kept) > 30
    assert np.max(left) > 0.02  # of the room: what held torques miss on their own
    assert np.max(kept) < 0.1 * np.max(left)
    assert np.mean(np.maximum(kept, 0.0)) < 0.05 * np.mean(np.maximum(left, 0.0))


def test_joints_that_brake_before_a_limit_stop_there():
    """Sent against their limits at speed; without the look ahead they pass them."""
    robot, rng = panda(), np.random.default_rng(20)
    limits, body = limits_of(robot), cc.Plant().body(robot)
    passed = {True: 0.0, False: 0.0}
    goals = np.where(rng.random((6, 7)) < 0.5, limits.position_lower - 1.0, limits.position_upper + 1.0)
    for looks_ahead in passed:
        task = cc.PostureTask(goals[0], gain=30.0)
        controller = cc.Controller(robot, task, "sns", "torque", limits=limits, dt=DT)
        if not looks_ahead:
            controller._confining.midway = None
        q, v, worst = np.array(robot.home), np.zeros(7), 0.0
        for k in range(720):
            task.target = goals[k // 120]
            q, v = held(body, q, v, controller.step(q, v).torque)
            worst = max(worst, float(np.max(q - limits.position_upper)), float(np.max(limits.position_lower - q)))
        passed[looks_ahead] = worst
    assert passed[True] < 1e-4 and passed[False] > 1e-3, passed


@pytest.mark.parametrize("robot", [panda(), kinova()], ids=["panda", "kinova"])
def test_the_kernel_is_the_formula(robot):
    rng, n = np.random.default_rng(3), robot.nv
    for _ in range(20):
        state = random_state(robot, rng)
        M, h = state.mass_matrix, state.nonlinear_effects
        a, room = rng.normal(size=n), 1.0 + rng.random(n)
        lower, upper = a - room, a + rng.random(n)
        rows, sides = np.empty((n, n)), np.empty((3, n))
        u = M @ a + h
        assert accelerations(M, h, u, lower, upper, rows, sides) == KEEPS
        np.testing.assert_allclose(rows @ M, np.eye(n), atol=1e-9)
        np.testing.assert_allclose(sides[2], a, atol=1e-8 * (1 + np.abs(h).max()))
        tau = rng.normal(size=n)
        other = np.linalg.solve(M, tau - h)
        np.testing.assert_allclose(rows @ tau - sides[0], other - lower, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(sides[1] - rows @ tau, upper - other, rtol=1e-7, atol=1e-7)
        upper[0] = a[0] - 10.0 * KEPT * room[0]
        assert accelerations(M, h, u, lower, upper, rows, sides) == LEAVES


def test_near_is_a_share_of_the_room_and_open_ends_have_none():
    C, u = np.eye(3), np.array([0.0, 0.94, -7.0])
    lower, upper = np.array([-np.inf, 0.0, -np.inf]), np.array([np.inf, 1.0, 0.0])
    assert not near(C, lower, upper, u, 3, 0.05)
    assert near(C, lower, upper, u, 3, 0.07)
    assert not near(C, lower, upper, np.array([0.0, 1.05, -7.0]), 3, -0.1)
    assert near(C, lower, upper, np.array([0.0, 1.15, -7.0]), 3, -0.1)
    assert near(C, lower, upper, np.array([0.0, 0.5, 1e-9]), 3, 0.05)  # beyond its only end
    shut = np.zeros(3)
    assert near(C, shut, shut, np.array([0.0, 0.0, 1e-9]), 3, 0.05)


def test_a_step_far_from_its_bounds_is_left_alone():
    robot = panda()
    hand = cc.FrameTask(robot.tool)
    with_it, without = (cc.Controller(robot, hand, "sns", "torque") for _ in range(2))
    without._confining.midway = None
    a, b = with_it.step(robot.home), without.step(robot.home)
    np.testing.assert_array_equal(a.torque, b.torque)


def test_without_limits_there_is_nothing_to_look_at():
    robot = panda()
    assert cc.Controller(robot, cc.FrameTask(robot.tool), "sns", "torque", limits=None)._confining.midway is None
    assert cc.Controller(robot, cc.FrameTask(robot.tool), "sns", "acceleration")._confining.midway is None
