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
