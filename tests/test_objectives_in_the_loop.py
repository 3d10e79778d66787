"""Spent in the null space, every objective gets better while the hand stays: each method, each robot, each level."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import cartctl as cc
from cartctl.solvers import solvers_that_honour
from tests.objectives_for_tests import PLANE, SIX, objectives

STILL = 1e-9  # m/s and rad/s of the hand, at null-space rates of norm 1
WEIGHED = {"qp": 1e-4}  # it weighs the tasks against the reference instead of ranking them
H = 1e-6

every_robot = pytest.mark.parametrize("name", list(SIX))
every_solver = pytest.mark.parametrize("solver", solvers_that_honour("reference"))


def hand(name: str) -> cc.FrameTask:
    """A task that leaves joints to spare."""
    axes = {"kinova": "position"}.get(name, "x y" if name in PLANE else "pose")
    return cc.FrameTask(SIX[name]().tool, axes, gain=20.0)


@cache
def scaled(name: str, key: str) -> tuple[cc.Objective, tuple[np.ndarray, np.ndarray]]:
    """The objective with such a gain that u0 has norm 1 in a random state, and that state."""
    robot, rng = SIX[name](), np.random.default_rng(21)
    objective = objectives(name)[key]
    while True:
        q, v = robot.random_configuration(rng), rng.normal(size=robot.nv)
        state = robot.state(q, v)
        J = hand(name).jacobian(state)
        if np.linalg.svd(J)[1][-1] > 0.05:
            break
    return (1.0 / np.linalg.norm(objective.direction(state))) * objective, (q, v)


@every_robot
@every_solver
def test_the_hand_holds_and_the_objective_gets_better(name: str, solver: str) -> None:
    robot, task = SIX[name](), hand(name)
    for key in objectives(name):
        objective, (q, v) = scaled(name, key)
        controller = cc.Controller(robot, task, solver, objective=objective, limits=None, approach=False)
        u = controller.step(q, v).velocity
        state = robot.state(q, v)
        assert np.linalg.norm(task.jacobian(state) @ u) < WEIGHED.get(solver, STILL), key
        ends = [objective.value(robot.state(robot.integrate(q, s * H * u), v)) for s in (1.0, -1.0)]
        rate = (ends[0] - ends[1]) / (2.0 * H)
        gradient = objective.gradient(state)
        assert rate == pytest.approx(gradient @ u, abs=1e-5 * (1.0 + np.linalg.norm(gradient))), key
        Z = np.linalg.svd(task.jacobian(state))[2][np.linalg.matrix_rank(task.jacobian(state)) :]
        possible = np.linalg.norm(Z @ gradient) ** 2  # what steepest descent in the null space gains
        assert gradient @ u < -1e-3 * possible - 1e-12 if possible > 1e-8 else gradient @ u < 1e-8, key


@every_robot
@pytest.mark.parametrize("solver", ["projected-gradient", "task-priority", "sns"])
def test_the_exact_methods_descend_the_projected_gradient(name: str, solver: str) -> None:
    """``u = (I - J# J) u0``: the steepest way there is."""
    robot, task = SIX[name](), hand(name)
    for key in objectives(name):
        objective, (q, v) = scaled(name, key)
        u = cc.Controller(robot, task, solver, objective=objective, limits=None, approach=False).step(q, v).velocity
        state = robot.state(q, v)
        J = task.jacobian(state)
        u0 = objective.direction(state)
        np.testing.assert_allclose(u, u0 - np.linalg.pinv(J) @ (J @ u0), atol=1e-9, err_msg=key)


@every_robot
@pytest.mark.parametrize("solver", ["projected-gradient", "sns"])
def test_at_the_acceleration_level(name: str, solver: str) -> None:
    """``u0 = -k grad H - D v``: the hand's acceleration is what the task asks for, to 1e-9 m/s^2, H or no H."""
    robot, task = SIX[name](), hand(name)
    D = 3.0
    for key in objectives(name):
        objective, (q, v) = scaled(name, key)
        led, plain = (
            cc.Controller(robot, task, solver, cc.AccelerationLevel(D), objective=o, limits=None)
            .step(q, v)
            .acceleration
            for o in (objective, None)
        )
        state = robot.state(q, v)
        J = task.jacobian(state)
        assert np.linalg.norm(J @ (led - plain)) < STILL, key
        expected = objective.direction(state)
        expected = expected - np.linalg.pinv(J) @ (J @ expected)
        np.testing.assert_allclose(led - plain, expected, atol=1e-9, err_msg=key)
        assert objective.gradient(state) @ (led - plain) <= 1e-12, key


@pytest.mark.parametrize("level", ["velocity", "acceleration"])
@pytest.mark.parametrize(
    ("key", "gain"),
    [
        ("manipulability", 200.0),
        ("smallest-singular-value", 5.0),
        ("inverse-condition", 20.0),
        ("velocity-ratio", 2.0),
        ("torque-per-force", 200.0),
        ("gravity-torque", 1.0),
        ("payload", 1.0),
        ("contact", 1.0),
        ("posture", 2.0),
        ("joint-range", 100.0),
    ],
)
def test_a_rollout_gains_all_the_time(level: str, key: str, gain: float) -> None:
    """A Panda, its hand held for three seconds: H gets better with every sample, and the hand stays."""
    robot = SIX["panda"]()
    damping = 6.0
    known = objectives("panda")[key]
    strength = gain / known.gain * (damping if level == "acceleration" else 1.0)
    objective = strength * known
    kind = cc.AccelerationLevel(damping) if level == "acceleration" else level
    controller = cc.Controller(
        robot, cc.FrameTask(robot.tool), "projected-gradient", kind, objective=objective, limits=None, dt=5e-3
    )
    q0 = robot.integrate(robot.home, 0.3 * np.random.default_rng(3).normal(size=7))  # home is a plane of symmetry
    run = cc.simulate(controller, q0, duration=3.0)
    values = np.array([known.value(robot.state(q)) for q in run.q[::20]])
    gained = np.diff(values if known.maximise else -values)
    size = np.abs(values).max()
    back = {"velocity": 1e-9, "acceleration": 1e-6}[level]  # a joint with inertia swings past the best, a little
    assert gained.min() > -back * size and gained.sum() > 3e-4 * size
    task = run.metrics().tasks[0]
    assert task.max_m < 1e-3 and task.max_rad < 1e-3


def test_under_limits_too() -> None:
    """SNS with the Panda's limits: an objective as strong as can be breaks none, and the hand stays."""
    robot = SIX["panda"]()
    objective = cc.Manipulability(gain=1e4) + 1e3 * cc.GravityTorque()
    controller = cc.Controller(robot, cc.FrameTask(robot.tool), "sns", objective=objective, dt=2e-3)
    run = cc.simulate(controller, duration=1.0)
    measured = run.metrics()
    assert measured.violations == 0 and measured.tasks[0].max_m < 1e-4
    assert objective.value(robot.state(run.q[-1])) < objective.value(robot.state(run.q[0]))
