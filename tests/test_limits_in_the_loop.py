"""A controller under limits: nothing is ever violated, whatever the target, the step or the start."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cartctl as cc
from benchmarks.rollouts import inside, limits_of, rollout
from cartctl.errors import CartctlError, ParameterError, UnsupportedProblem
from cartctl.motion.integrate import advance
from tests import oracles

VIOLATED = 1e-9
ROBOTS = {name: cc.load(name) for name in ("panda", "lwr")}


@pytest.mark.parametrize("solver", ["sns", "hqp", "task-scaling", "sns-greedy", "qp"])
@pytest.mark.parametrize("level", ["velocity", "acceleration"])
def test_no_limit_is_ever_violated(solver, level):
    starts = 6 if solver in ("sns", "hqp") else 2
    for name, robot in ROBOTS.items():
        limits = limits_of(robot)
        for seed in range(starts):
            worst = rollout(robot, limits, np.random.default_rng(seed), 250, level, solver).worst
            assert worst["position"] < VIOLATED and worst["velocity"] < VIOLATED, (name, seed, worst)
            assert worst["acceleration"] < VIOLATED / 1e-4, (name, seed, worst)  # a difference of v over dt >= 1e-4


@pytest.mark.parametrize("level", ["velocity", "acceleration"])
def test_joints_come_back_from_outside_at_a_bounded_rate(level):
    robot = ROBOTS["panda"]
    limits, dt = limits_of(robot), 0.01
    for side in ("upper", "lower"):
        q = robot.home.copy()
        q[3] = getattr(limits, f"position_{side}")[3] + (0.05 if side == "upper" else -0.05)
        controller = cc.Controller(robot, [cc.FrameTask(robot.tool)], solver="sns", level=level, limits=limits, dt=dt)
        v, statuses = np.zeros(7), []
        for k in range(40):
            command = controller.step(q, v, k * dt)
            statuses.append(command.solution.status)
            before = v
            q, v = advance(robot, q, v, command, dt)
            assert (np.abs(v) <= limits.velocity_upper + VIOLATED).all()
            assert (np.abs(v - before) <= limits.acceleration_upper * dt + VIOLATED).all()
            if k == 15:
                assert limits.position_lower[3] - VIOLATED <= q[3] <= limits.position_upper[3] + VIOLATED
        assert statuses[0] is cc.Status.RECOVERING and statuses[-1] is not cc.Status.RECOVERING


def test_limits_that_change_while_running():
    robot = ROBOTS["panda"]
    limits, dt = limits_of(robot), 0.005
    hand = cc.FrameTask(robot.tool, "position", gain=20.0, target=[0.4, 0.5, 0.5])
    controller = cc.Controller(robot, [hand], solver="sns", limits=limits, dt=dt)
    q, v = robot.home.copy(), np.zeros(7)
    for k in range(400):
        if k == 60:
            slow = limits.replace(
                velocity_lower=0.3 * limits.velocity_lower, velocity_upper=0.3 * limits.velocity_upper
            )
            controller.limits = slow
            fast_at_change = np.abs(v)
        command = controller.step(q, v, k * dt)
        assert (np.abs(command.velocity - v) <= limits.acceleration_upper * dt + VIOLATED).all()
        q, v = advance(robot, q, v, command, dt)
    assert (fast_at_change > 0.3 * limits.velocity_upper).any()  # it was too fast for the new limits
    assert (np.abs(v) <= 0.3 * limits.velocity_upper + VIOLATED).all()
    assert controller.limits is slow
    with pytest.raises(ParameterError):
        controller.limits = "none"
    assert controller.limits is slow


@given(seed=oracles.SEEDS, dt=st.sampled_from([1e-4, 1e-3, 5e-3, 2e-2]))
@settings(max_examples=10)
def test_disabled_joints_stand_still(seed, dt):
    robot = ROBOTS["lwr"]
    rng = np.random.default_rng(seed)
    limits = limits_of(robot)
    off = [robot.joint_names[i] for i in rng.choice(7, 2, replace=False)]
    hand = cc.FrameTask(robot.tool, "position", gain=5.0, target=rng.normal(size=3))
    controller = cc.Controller(robot, [hand], solver="sns", limits=limits, dt=dt, disabled=off)
    q, v = inside(rng, limits), np.zeros(7)
    start, index = q.copy(), [robot.dof(name) for name in off]
    for k in range(50):
        q, v = advance(robot, q, v, controller.step(q, v, k * dt), dt)
    np.testing.assert_array_equal(q[index], start[index])
    assert np.abs(q - start).max() > 0.0


def test_jerk_where_asked():
    robot = ROBOTS["panda"]
    limits, dt = limits_of(robot).replace(jerk_lower=-500.0, jerk_upper=500.0), 0.01
    hand = cc.FrameTask(robot.tool, "position", gain=10.0, target=[0.4, 0.5, 0.5])
    controller = cc.Controller(robot, [hand], solver="sns", limits=limits, dt=dt, jerk=True)
    q, v, a = robot.home.copy(), np.zeros(7), np.zeros(7)
    for k in range(300):
        command = controller.step(q, v, k * dt).velocity
        jerk = ((command - v) / dt - a) / dt
        assert np.abs(jerk).max() <= 500.0 + 1e-5
        a, v = (command - v) / dt, command
        q = robot.integrate(q, v * dt)
    assert np.linalg.norm(robot.state(q).position(robot.tool) - hand.target) < 2e-3


def test_cartesian_bounds_hold_and_the_task_gets_the_rest():
    robot = ROBOTS["panda"]
    start = robot.state(robot.home).position(robot.tool)
    wall = cc.HalfSpace(robot.tool, [1.0, 0.0, 0.0], float(start[0]) + 0.1)
    hand = cc.FrameTask(robot.tool, "position", gain=10.0, target=start + [0.4, 0.3, 0.0])
    for solver in ("sns", "hqp", "qp"):
        controller = cc.Controller(robot, [hand], solver=solver, dt=2e-3, constraints=[wall])
        run = cc.simulate(controller, robot.home, 2.0)
        reached = np.array([robot.state(q).position(robot.tool) for q in run.q])
        assert reached[:, 0].max() <= start[0] + 0.1 + 1e-6, solver
        assert reached[-1, 0] > start[0] + 0.08, solver
        if solver == "hqp":  # slowing down does not bend: sns stops at the wall, least squares slides along it
            assert reached[-1, 1] > start[1] + 0.2, solver
    with pytest.raises(UnsupportedProblem, match="constraint rows"):
        cc.Controller(robot, [hand], solver="pinv", limits=None, constraints=[wall])


def test_a_refused_input_leaves_no_trace():
    robot = ROBOTS["panda"]
    for solver in ("sns", "hqp"):
        twins = []
        for _ in range(2):
            hand = cc.FrameTask(robot.tool, gain=20.0, target=np.array([0.5, 0.2, 0.4]))
            twins.append((hand, cc.Controller(robot, [hand], solver=solver, dt=0.01)))
        q, v = robot.home.copy(), np.zeros(7)
        for k in range(60):
            if k in (5, 20):  # only one of them sees the bad input
                hand, controller = twins[0]
                for bad in ((np.full(7, np.nan), v), (q[:3], v), (q, np.full(7, np.inf)), ("q", v)):
                    with pytest.raises(CartctlError):
                        controller.step(bad[0], bad[1], k * 0.01)
                with pytest.raises(CartctlError):
                    controller.step(q, v, float("nan"))
                with pytest.raises(CartctlError):
                    hand.target = [np.nan, 0.0, 0.0]
            one, other = (controller.step(q, v, k * 0.01).velocity for _, controller in twins)
            np.testing.assert_array_equal(one, other)
            v = one
            q = robot.integrate(q, v * 0.01)


def test_a_path_waits_for_a_hand_that_is_slowed_down():
    robot = ROBOTS["panda"]
    start = robot.state(robot.home).placement(robot.tool)
    circle = cc.Circle.starting_at(start, radius=0.15, period=1.0)
    limits = robot.limits.replace(acceleration_lower=-np.inf, acceleration_upper=np.inf)
    off = {}
    for clock in (True, False):
        hand = cc.FrameTask(robot.tool, gain=60.0, target=circle)
        controller = cc.Controller(robot, [hand], solver="sns", limits=limits, dt=5e-3, path_clock=clock)
        run = cc.simulate(controller, robot.home, 3.0)
        line = np.array([circle(t).position for t in np.linspace(0.0, 1.0, 4001)])
        hands = np.array([robot.state(q).position(robot.tool) for q in run.q[::5]])
        off[clock] = max(np.linalg.norm(line - p, axis=1).min() for p in hands)
        late = controller.times(3.0)[0]
        assert (late < 2.9) if clock else (late == 3.0)
    assert off[True] < 1e-3 < 5e-3 < off[False]
    with pytest.raises(UnsupportedProblem, match="path clock"):
        cc.Controller(robot, [hand], solver="sns", level="acceleration", path_clock=True)


def test_what_needs_limits_says_so():
    robot = ROBOTS["panda"]
    hand = cc.FrameTask(robot.tool)
    with pytest.raises(ParameterError, match="disabled"):
        cc.Controller(robot, [hand], solver="sns", limits=None, disabled=robot.joint_names[0])
    with pytest.raises(ParameterError, match="acceleration"):
        cc.Controller(robot, [hand], solver="sns", limits=robot.limits.replace(acceleration_upper=0.0))
    with pytest.raises(ParameterError, match="constraints"):
        cc.Controller(robot, [hand], solver="sns", constraints=["wall"])
