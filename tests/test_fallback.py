"""Where no scale but 0 will do: an arm stretched out leaves its singularity, if its target is not straight ahead."""

from __future__ import annotations

import numpy as np
import pytest

import cartctl as cc
from tests.ways import General

BOTH = pytest.mark.parametrize("kind", [cc.Controller, General])


def straight(kind, offset, **given):
    """A planar arm stretched out along x, its tip asked for a point beside where it is."""
    robot = cc.load("planar3R")
    q = np.array([0.3, 0.0, 0.0])
    tip = robot.state(q).position("tool")
    task = cc.FrameTask("tool", "xy", target=tip + offset, gain=4.0)
    return kind(robot, task, "sns", dt=1e-3, **given), q, tip + offset


@BOTH
@pytest.mark.parametrize("limits", [None, "slow"])
def test_an_arm_stretched_out_leaves_its_singularity(kind, limits):
    robot = cc.load("planar3R")
    given = None if limits is None else robot.limits.replace(velocity_lower=-2.0, velocity_upper=2.0)
    controller, q, goal = straight(kind, np.array([-0.8, -0.4, 0.0]), limits=given)
    first = controller.step(q, np.zeros(3), 0.0).solution
    assert np.abs(first.u).max() > 1e-3 and first.lost_rank
    run = cc.simulate(controller, q, duration=3.0)
    assert np.linalg.norm(robot.state(run.q[-1]).position("tool")[:2] - goal[:2]) < 1e-3
    if given is not None:
        assert np.abs(run.v).max() <= 2.0 + 1e-9


@BOTH
def test_what_pulls_straight_out_is_not_followed(kind):
    """The tip is asked further out along the arm: nothing of that can be done, and the arm stands."""
    robot = cc.load("planar3R")
    q = np.array([0.3, 0.0, 0.0])
    out = robot.state(q).position("tool")
    controller = kind(robot, cc.FrameTask("tool", "xy", target=1.5 * out, gain=4.0), "sns", dt=1e-3, limits=None)
    run = cc.simulate(controller, q, duration=0.5)
    assert np.abs(run.v).max() < 1e-6


@BOTH
@pytest.mark.parametrize("level", ["velocity", "acceleration"])
def test_a_task_of_more_rows_than_the_robot_can_do_is_done_as_far_as_it_can_be(kind, level):
    """One link, a position in the plane out of its reach: it turns towards it, while it moves and from rest."""
    robot = cc.planar([1.0])
    limits = robot.limits.replace(acceleration_lower=-10.0, acceleration_upper=10.0)
    hand = cc.FrameTask("tool", "xy", target=[3.0, 1.0, 0.0], gain=5.0)
    run = cc.simulate(kind(robot, hand, "sns", level, limits=limits, dt=1e-2), [-2.0], duration=4.0)
    assert run.q[-1, 0] == pytest.approx(np.arctan2(1.0, 3.0), abs=1e-3)
    assert np.abs(run.v[-50:]).max() < 1e-3
    assert np.abs(np.diff(run.v[:, 0])).max() <= 10.0 * 1e-2 + 1e-9


@BOTH
def test_an_arm_of_five_joints_takes_a_pose_as_near_as_it_comes(kind):
    """Six rows for five joints: sns arrives where least squares do."""
    robot = cc.load("so101")
    rng = np.random.default_rng(3)
    lower, upper = (np.clip(x, -2.0, 2.0) for x in (robot.limits.position_lower, robot.limits.position_upper))
    goal = robot.state(rng.uniform(lower, upper)).placement(robot.tool).homogeneous
    q = rng.uniform(lower, upper)
    limits = robot.limits.replace(acceleration_lower=-10.0, acceleration_upper=10.0)
    errors = []
    for solver in ("sns", "hqp"):
        hand = cc.FrameTask(robot.tool, target=goal + 0.02 * np.eye(4, k=3), gain=5.0)
        run = cc.simulate(kind(robot, hand, solver, limits=limits, dt=1e-2), q, duration=6.0)
        assert np.abs(run.v[-50:]).max() < 1e-3
        errors.append(np.linalg.norm(run.tasks[0].error[-1]))
    assert errors[0] == pytest.approx(errors[1], abs=1e-3)
