"""The approach on a compiled tree: the same commands as with Pinocchio's drifts, at rest, in motion and at the edge."""

from __future__ import annotations

import numpy as np
import pytest

import cartctl as cc
from cartctl.compiled.approach import TreeApproach
from cartctl.levels.approach import Approach
from tests.ways import General

SAME = 1e-12


def pair(robot: cc.Robot, tasks: list[cc.Task], **given) -> tuple[cc.Controller, cc.Controller]:
    """The controller as it is made, and one whose approach asks Pinocchio."""
    ours, theirs = (General(robot, tasks, solver="sns", **given) for _ in range(2))
    assert type(ours._confining._approach) is TreeApproach
    theirs._confining._approach = Approach(robot.limits, theirs.dt, theirs.solver, theirs._waiting)
    return ours, theirs


def follow(ours: cc.Controller, theirs: cc.Controller, q: np.ndarray, steps: int) -> float:
    """Both at the same states; the largest difference, relative to the joints' speeds."""
    robot, v, worst = ours.robot, np.zeros(ours.robot.nv), 0.0
    for k in range(steps):
        u = ours.step(q, v, k * ours.dt).velocity
        worst = max(worst, float(np.abs(u - theirs.step(q, v, k * ours.dt).velocity).max()))
        q, v = robot.integrate(q, u * ours.dt), u
    return worst


@pytest.mark.parametrize("name", ["panda", "kinova", "tiago", "planar3R"])
def test_on_a_path_that_waits(name):
    robot = cc.load(name)
    start = robot.state(robot.home).placement(robot.tool)
    axes = "xy" if name.startswith("planar") else "pose"
    hand = cc.FrameTask(robot.tool, axes, target=cc.Circle.starting_at(start, 0.15, period=0.6))
    assert follow(*pair(robot, [hand, cc.PostureTask()], dt=2e-3), np.array(robot.home), 150) <= 1e3 * SAME


def test_out_of_reach():
    robot = cc.load("panda")
    q = np.array([0.0, 0.3, 0.0, -0.15, 0.0, 1.9, 0.7])
    far = robot.state(q).position(robot.tool) * 1.2
    hand = cc.FrameTask(robot.tool, "position", target=far, length=0.4)
    assert follow(*pair(robot, [hand, cc.PostureTask()], dt=2e-3), q, 250) <= 1e3 * SAME


def test_one_step_from_anywhere():
    robot, rng = cc.load("panda"), np.random.default_rng(3)
    worst = 0.0
    for _ in range(30):
        target = robot.state(robot.random_configuration(rng)).placement(robot.tool)
        ours, theirs = pair(robot, [cc.FrameTask(robot.tool, "xyz rz", target=target, length=0.3), cc.PostureTask()])
        q, v = robot.random_configuration(rng), 0.3 * rng.normal(size=7)
        worst = max(worst, float(np.abs(ours.step(q, v).velocity - theirs.step(q, v).velocity).max()))
    assert worst <= SAME


def test_tasks_it_does_not_know_go_the_usual_way():
    """Another task, and a robot that is no compiled tree."""
    robot = cc.load("panda")
    com = cc.ComTask(target=robot.state(robot.home).com + [0.05, 0.0, 0.0])
    tool = cc.FrameTask(robot.tool, expressed_in=robot.tool)
    assert follow(*pair(robot, [com, tool, cc.PostureTask()]), np.array(robot.home), 20) == 0.0
    floating = cc.load("talos", root_joint="free_flyer")
    controller = cc.Controller(floating, cc.FrameTask(floating.tool), solver="sns")
    assert type(controller._confining._approach) is Approach
