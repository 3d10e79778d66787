"""Who counts as standing at a bound, and is left out of what a task may count on."""

from __future__ import annotations

import numpy as np

import cartctl as cc
from tests.ways import General


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
