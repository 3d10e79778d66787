"""Published exercises of dynamic redundancy and of bounded accelerations, solved by controllers on robots.

The same printed results as in the two files beside this one, which answer them by arrays alone: here a robot is built
from the exercise's data, and the level makes the problem.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from tests import oracles
from tests.test_acceleration_level import agrees, held
from tests.test_worked_examples import ITEMS, real


def asked_for(acceleration, axes, frame="tool"):
    """A task of which nothing but an acceleration is asked."""
    at = np.zeros(6)
    at[: len(acceleration)] = acceleration
    target = SimpleNamespace(position=None, rotation=None, twist=np.zeros(6), acceleration=at)
    return cc.FrameTask(frame, axes, gain=0.0, target=lambda t: target)


def arm(joints, tool, bodies, gravity):
    """A chain of :mod:`tests.oracles` with a body (mass, centre of mass, moment about z) at each joint."""
    model = oracles.pinocchio_chain(joints, np.eye(3), np.array(tool))
    for k, (mass, com, moment) in enumerate(bodies, start=1):
        model.appendBodyToJoint(k, pin.Inertia(mass, np.array(com), np.diag([0.0, 0.0, moment])), pin.SE3.Identity())
    model.gravity = pin.Motion(np.array(gravity), np.zeros(3))
    return cc.Robot(model, tool="tool")


def joint(kind, axis, at=(0.0, 0.0, 0.0)):
    return oracles.Joint(kind, np.array(axis, dtype=float), np.eye(3), np.array(at, dtype=float))


# ---------------------------------------------------------------- dynamic redundancy


@pytest.mark.parametrize("solver", ["pinv", "sns", "hqp", "task-priority"])
def test_least_torques_of_a_pr_arm(solver):
    """M = [[a, b cos q2], [b cos q2, c]]: at q2 = pi/2 the metrics I and M^-2 ask for the same torques."""
    item = ITEMS["r2-2022-04-13-ex5"]
    point = item["inputs"]["check_point_chosen_here"]
    m2, d = 1.0, 0.5
    bodies = [(point["a"] - m2, np.zeros(3), 0.0), (m2, [d, 0.0, 0.0], point["c"] - m2 * d**2)]
    robot = arm(
        [joint("prismatic", [0, 1, 0]), joint("revolute", [0, 0, 1])],
        [1.0, 0.0, 0.0],
        bodies,
        [0.0, -point["g"][0] / point["a"], 0.0],
    )
    q = real(item["inputs"]["q"])
    state = robot.state(q)
    np.testing.assert_allclose(state.mass_matrix, np.diag([point["a"], point["c"]]), atol=1e-12)
    np.testing.assert_allclose(state.gravity, point["g"], atol=1e-12)
    task = asked_for([0.0, point["ydd"]], "y")
    for metric in ("identity", "inverse-inertia-squared"):
        level = cc.TorqueLevel(0.0)
        command = cc.Controller(robot, task, solver, level, limits=None, metric=metric).step(q)
        agrees(item, "at_point", command.torque)


def test_least_actuation_of_an_rp_arm():
    """(J B^-1)# times the command, and the same with damping: minus what of K q_dot lies in the null space."""
    item = ITEMS["r2-2010-06-15"]
    point = item["inputs"]["check_point_chosen_here"]
    q, far = np.array(point["q"]), 0.3  # m: of the sliding link's centre of mass
    moment = point["b11"] - point["b22"] * far**2
    bodies = [(0.0, np.zeros(3), moment), (point["b22"], [far - q[1], 0.0, 0.0], 0.0)]
    robot = arm(
        [joint("revolute", [0, 0, 1]), joint("prismatic", [1, 0, 0])], [point["d2"], 0.0, 0.0], bodies, [0.0, 0.0, 0.0]
    )
    B = np.diag([point["b11"], point["b22"]])
    np.testing.assert_allclose(robot.state(q).mass_matrix, B, atol=1e-12)
    J = robot.state(q).jacobian("tool")[1:2]
    np.testing.assert_allclose(J, [[(point["d2"] + q[1]) * np.cos(q[0]), np.sin(q[0])]], atol=1e-12)
    at_rest = cc.Controller(robot, asked_for([0.0, 1.0], "y"), "pinv", "torque", limits=None).step(q)
    agrees(item, "at_point", at_rest.torque)
    v, K = np.array([0.6, -0.9]), np.array([2.0, 3.0])
    moving = cc.Controller(robot, asked_for([0.0, 1.0], "y"), "pinv", "torque", limits=None).step(q, v)
    damped = cc.Controller(
        robot, asked_for([0.0, 1.0], "y"), "projected-gradient", cc.TorqueLevel(K), limits=None
    ).step(q, v)
    A = J @ np.linalg.inv(B)
    N = np.eye(2) - np.linalg.pinv(A) @ A
    h = robot.state(q, v).nonlinear_effects
    np.testing.assert_allclose(damped.torque, moving.torque + N @ (h - K * v), atol=1e-12)
    assert np.abs(N @ (K * v)).max() > 0.1


# ---------------------------------------------------------------- bounded accelerations


def bounded(robot, most):
    """Acceleration limits alone."""
    n, free = robot.nv, {}
    for quantity in ("position", "velocity", "jerk", "torque"):
        free |= {f"{quantity}_lower": np.full(n, -np.inf), f"{quantity}_upper": np.full(n, np.inf)}
    return cc.Limits(**free, acceleration_lower=-np.asarray(most), acceleration_upper=np.asarray(most, dtype=float))


def command_of(robot, q, v, acceleration, solver, most):
    task = asked_for(acceleration, "xy")
    return cc.Controller(robot, task, solver, "acceleration", limits=bounded(robot, most)).step(q, v)


@pytest.mark.parametrize("solver", ["sns", "sns-greedy", "qp", "hqp"])
def test_saturation_of_a_planar_4r(solver):
    """Joints 1 and 4 saturate and the other two deliver the rest of the command, unscaled."""
    item = ITEMS["r2-2018-07-11-ex2"]
    given = item["inputs"]
    robot = cc.planar(given["L"])
    options = (robot, real(given["q"]), np.zeros(4), given["a"])
    command = command_of(*options, cc.QP(damping=1e-6) if solver == "qp" else solver, given["Amax"])
    expected = np.array(item["expected"]["ddq_sns"], dtype=float)
    np.testing.assert_allclose(command.acceleration, expected, atol=item["tolerance"])
    assert np.linalg.norm(command.acceleration) == pytest.approx(item["expected"]["norm"], abs=item["tolerance"])
    assert command.solution.saturated.tolist() == [-1, 0, 0, 1] and command.solution.scales[0] == 1.0


def test_plain_scaling_of_a_planar_4r():
    item = ITEMS["r2-2018-07-11-ex2"]
    given = item["inputs"]
    command = command_of(
        cc.planar(given["L"]), real(given["q"]), np.zeros(4), given["a"], "task-scaling", given["Amax"]
    )
    agrees(item, "ddq_scaled", command.acceleration)
    agrees(item, "scale_needed_pinv", 1.0 / command.solution.scales[0])


def test_saturation_of_a_3r_in_motion():
    """The tip kept from accelerating: joint 3 at its bound, and in case 1, which the source calls feasible, too."""
    item = ITEMS["r2-2021-07-12-ex1"]
    given = item["inputs"]
    robot, most = cc.planar([float(x) for x in given["L"]]), real(given["Umax"])
    printed = np.array(item["expected"]["u2_sns"])
    case = given["case2"]
    command = command_of(robot, real(case["q"]), real(case["qd"]), [0.0, 0.0], "sns", most)
    np.testing.assert_allclose(command.acceleration, printed, atol=2e-4)
    assert command.solution.saturated.tolist() == [0, 0, -1]
    case = given["case1"]
    free = held(robot, real(case["q"]), real(case["qd"])).acceleration
    assert (np.abs(free) > most).any()
    first = command_of(robot, real(case["q"]), real(case["qd"]), [0.0, 0.0], "sns", most)
    assert (np.abs(first.acceleration) <= most).all() and first.solution.saturated[2] == -1
    J, v = robot.state(real(case["q"])).jacobian("tool")[:2], real(case["qd"])
    drift = robot.state(real(case["q"]), v).drift("tool")[:2]
    np.testing.assert_allclose(J @ first.acceleration + drift, 0.0, atol=1e-9)


@pytest.mark.parametrize("case", [0, 2])
def test_the_hardest_braking_of_a_3r(case):
    """pdd = -lambda pd with the largest lambda the bounds allow; in case 3 none does, and the task is not served."""
    item = ITEMS["r2-2021-09-10-ex1"]
    given = item["inputs"]
    robot, q, most = cc.planar([float(x) for x in given["L"]]), real(given["q"]), real(given["Umax"])
    v = real(given["qd"][case])
    speed = robot.state(q, v).twist("tool")[:2]
    command = command_of(robot, q, v, -1e3 * speed, "task-scaling", most)
    if case == 0:
        agrees(item, "lam1", 1e3 * command.solution.scales[0])
        agrees(item, "u1", command.acceleration)
        state = robot.state(q, v)
        agrees(item, "pdd1", state.jacobian("tool")[:2] @ command.acceleration + state.drift("tool")[:2])
    else:
        assert command.solution.status is cc.Status.INFEASIBLE
