"""Who counts as standing at a bound, and is left out of what a task may count on."""

from __future__ import annotations

import numpy as np
import pytest

import cartctl as cc
from cartctl.levels.left_out import keep, leave_out
from cartctl.motion.integrate import advance
from tests.ways import General

STILL = 1e-6
NO_ROWS = (np.zeros((0, 7)), np.zeros(0), np.zeros(0))


def test_a_motion_of_the_null_space_does_not_hold_the_hand_back():
    """Joints that the null space moves cannot turn round within a step; that is no bound they stand at."""
    robot = cc.load("panda")
    start = robot.state(robot.home).placement(robot.tool)
    for kind in (cc.Controller, General):
        hand = cc.FrameTask(robot.tool, target=cc.Circle.starting_at(start, 0.1, period=4.0))
        controller = kind(robot, hand, "sns", dt=2e-3, objective=cc.JointRange(gain=100.0))
        run = cc.simulate(controller, robot.home, duration=2.0)
        assert run.metrics().tasks[0].max_m < 2e-4
        assert set(run.status) <= {"OPTIMAL", "SCALED"}
        assert np.abs(run.tasks[0].scale - 1.0).max() < 0.5


def drawn(rng):
    """A Jacobian, a command, and a box in which joints are free, stand at a bound, or have to go on."""
    A, b = rng.normal(size=(3, 7)), rng.normal(size=3)
    lower, upper = -rng.uniform(0.1, 1.0, size=7), rng.uniform(0.1, 1.0, size=7)
    lower[rng.random(7) < 0.4] = 0.0
    upper[rng.random(7) < 0.4] = 0.0
    going = rng.random(7) < 0.2
    lower[going], upper[going] = 0.2, 0.5
    return A, b, lower, upper


def outwards(by, lower, upper):
    return ((by > 0.0) & (abs(upper) <= STILL)) | ((by < 0.0) & (abs(lower) <= STILL))


@pytest.mark.parametrize("moving", [False, True])
def test_slope_or_step_says_who_is_left_out_before_a_target_at_rest(moving):
    """``A^T b`` or ``A# b`` (damped) there, the step alone where the target moves; never who cannot stop in time."""
    rng = np.random.default_rng(3)
    met, joints = 0, np.array([np.full(7, np.inf), np.ones(7), np.full(7, STILL), np.full(7, np.inf)])
    for _ in range(300):
        A, b, lower, upper = drawn(rng)
        slope, inverse = A.T @ b, np.linalg.pinv(A) @ b
        downhill, wanted = outwards(slope, lower, upper), outwards(inverse, lower, upper)
        by = np.where(downhill & (not moving), slope, inverse)
        expected = wanted if moving else downhill | wanted
        met += int(np.sum(np.sign(slope) != np.sign(inverse)))
        left, s, right = np.linalg.svd(A, full_matrices=False)
        reduced, stood, size = A.copy(), np.full(7, np.nan), float(np.linalg.norm(A))
        found = leave_out(reduced, left, s, right, b, joints, lower, upper, *NO_ROWS, size, moving, False, stood)
        assert found == expected.any()
        np.testing.assert_array_equal(reduced, np.where(expected, 0.0, A))
        np.testing.assert_array_equal(stood, np.where(expected & (abs(inverse) > 1e-3), np.sign(by), 0.0))
        narrow_lower, narrow_upper = lower.copy(), upper.copy()
        keep(stood, narrow_lower, narrow_upper)
        np.testing.assert_array_equal(narrow_lower, np.where(stood > 0.0, upper, lower))
        np.testing.assert_array_equal(narrow_upper, np.where(stood < 0.0, lower, upper))
    assert met > 100  # or this would not tell the two apart


def test_a_joint_that_leads_nowhere_is_not_left_out():
    """Its column is round-off, and so is its slope."""
    A, b = np.array([[1.0, 0.5, 1e-17], [0.0, 1.0, -3e-17]]), np.array([2.0, 1.0])
    left, s, right = np.linalg.svd(A, full_matrices=False)
    joints, nothing = np.array([np.full(3, np.inf), np.ones(3), np.full(3, STILL), np.full(3, np.inf)]), np.zeros(3)
    rows, stood = (np.zeros((0, 3)), np.zeros(0), np.zeros(0)), np.empty(3)
    assert leave_out(A.copy(), left, s, right, b, joints, nothing, nothing, *rows, 1.5, False, False, stood)
    np.testing.assert_array_equal(stood, [1.0, 1.0, 0.0])


@pytest.mark.parametrize("moving", [False, True])
def test_a_box_of_accelerations_alone_holds_nobody_back(moving):
    """A joint that has just set off may at most stop in the next step: no bound at which it stands."""
    A, b = np.array([[1.0, 0.5, 0.2], [0.0, 1.0, -0.3]]), np.array([-2.0, 1.0])
    left, s, right = np.linalg.svd(A, full_matrices=False)
    lower, rows = np.zeros(3), (np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    for width, found in ((0.2, False), (0.1, True)):  # of 0.2 that accelerations allow
        joints = np.array([np.full(3, 5.0), np.ones(3), np.full(3, STILL), np.full(3, 0.2)])
        reduced, stood = A.copy(), np.empty(3)
        box = (lower, lower + width)
        assert leave_out(reduced, left, s, right, b, joints, *box, *rows, 1.5, moving, False, stood) == found
        assert (reduced[:, 0] == 0.0).all() == found and (stood[0] == -1.0) == found


def at_rest(kind, solver, level):
    """A Panda stretched out towards what it cannot reach, with joint 2 at its limit."""
    robot = cc.load("panda")
    hand = cc.FrameTask(robot.tool, "position", target=[0.559, -1.546, -1.222], gain=20.0)
    controller = kind(robot, hand, solver, level, dt=1e-2)
    q, v = robot.home, np.zeros(7)
    for k in range(500):
        q, v = advance(robot, q, v, controller.step(q, v, 1e-2 * k), 1e-2)
    return robot, hand, q, v


@pytest.mark.parametrize("kind", [cc.Controller, General])
def test_pressed_joints_are_kept_at_their_bounds(kind):
    """Out of reach and at rest alone: not for a target in reach, one that moves, a lower task, or where a wall is."""
    robot, hand, q, v = at_rest(General, "sns", "velocity")
    limits = robot.limits
    near = (q - limits.position_lower < 1e-9) | (limits.position_upper - q < 1e-9)
    assert near.any() and np.abs(v).max() < 1e-6

    def kept(tasks, **options):
        problem = kind(robot, tasks, "sns", dt=1e-2, **options).step(q, v).solution.problem
        return problem.lower == problem.upper

    slope = robot.state(q).jacobian(robot.tool)[:3].T @ (hand.target - robot.state(q).position(robot.tool))
    outwards = near & np.where(q > 0.5 * (limits.position_lower + limits.position_upper), slope > 0.0, slope < 0.0)
    assert outwards.any()
    np.testing.assert_array_equal(kept(hand), outwards)
    place = robot.state(q).placement(robot.tool)
    inwards = cc.FrameTask(robot.tool, "position", target=0.9 * place.translation)
    assert not kept(inwards).any()
    away = cc.Line(place, robot.state(robot.home).placement(robot.tool), 1.0)
    assert not kept(cc.FrameTask(robot.tool, "position", target=away)).any()
    turned = cc.FrameTask(robot.tool, "orientation", target=np.array(place.rotation), name="turn")
    assert not kept([turned, hand]).any()
    far = cc.HalfSpace(robot.tool, np.array([0.0, 0.0, 1.0]), 5.0)
    assert not kept(hand, constraints=[far]).any()


SLOW = [
    ([0.0, -2.0, -2.0], [2.0, 2.0, 2.0]),
    ([0.0, -2.0, -2.0], [0.0, 2.0, 2.0]),
    ([-1e-3, -2.0, -2.0], [1e-3, 2.0, 2.0]),
]


@pytest.mark.parametrize("lower, upper", SLOW, ids=["one way", "frozen", "slow"])
@pytest.mark.parametrize("solver", ["sns", "hqp", "qp"])
@pytest.mark.parametrize("level", ["velocity", "acceleration"])
def test_the_others_do_what_one_joint_cannot(lower, upper, solver, level):
    """A target in reach, nothing near an edge: the command was cut down to what the slowest joint could do of it."""
    robot = cc.planar([1.0, 1.0, 1.0])
    goal = robot.state([0.2, 1.0, 0.2]).position("tool")
    limits = robot.limits.replace(
        velocity_lower=np.array(lower),
        velocity_upper=np.array(upper),
        acceleration_lower=-20.0,
        acceleration_upper=20.0,
    )
    hand = cc.FrameTask("tool", "xy", target=goal, gain=5.0)
    run = cc.simulate(cc.Controller(robot, hand, solver, level, limits=limits, dt=5e-3), [0.2, 0.6, 0.7], duration=3.0)
    assert np.linalg.norm(run.tasks[0].error[-1]) < 1e-4


@pytest.mark.parametrize("joint", [0, 1, 2, 4])
def test_a_slow_joint_does_not_lead_least_squares_off_a_path(joint):
    robot = cc.load("panda")
    bound = robot.limits.velocity_upper.copy()
    bound[joint] = 0.02
    limits = robot.limits.replace(velocity_lower=-bound, velocity_upper=bound)
    circle = cc.Circle.starting_at(robot.state(robot.home).placement(robot.tool), radius=0.1, period=4.0)
    hand = cc.FrameTask(robot.tool, "position", target=circle)
    run = cc.simulate(cc.Controller(robot, hand, "hqp", limits=limits, dt=5e-3), robot.home, duration=3.0)
    assert run.metrics().tasks[0].max_m < 5e-4
