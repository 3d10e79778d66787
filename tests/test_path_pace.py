"""A path is brought back to full speed slowly: where it bends little now, it may soon bend again."""

from __future__ import annotations

import numpy as np
import pytest

import cartctl as cc
from cartctl.bench.building import Stage
from cartctl.bench.sets import select
from cartctl.motion.integrate import advance
from tests.ways import General


def stepped(robot, controller, q, duration):
    """Errors of the hand (m), paces, and whether a command had to be given up, step by step."""
    v, errors, paces, given_up = np.zeros(robot.nv), [], [], []
    for k in range(round(duration / controller.dt)):
        command = controller.step(q, v, k * controller.dt)
        errors.append(np.linalg.norm(command.references[0].error[:3]))
        paces.append(command.references[0].pace)
        given_up.append(command.solution.problem.equations[0].drift is not None)
        q, v = advance(robot, q, v, command, controller.dt)
    return np.array(errors), np.array(paces), np.array(given_up)


@pytest.mark.parametrize("kind", [cc.Controller, General])
def test_a_fast_line_is_kept_to_although_its_bends_come_and_go(kind):
    """Halfway the joints hardly accelerate; at full speed from there on they came 29 mm off."""
    stage = Stage(select(["random-fast"])[0].scenarios[0], 0, 0)
    controller = kind(stage.robot, stage.tasks, "sns", limits=stage.limits, dt=stage.scenario.dt)
    errors, paces, given_up = stepped(stage.robot, controller, stage.start, stage.scenario.duration)
    assert errors.max() <= 5e-4 and not given_up.any()
    assert paces.min() < 0.4  # or nothing was to be slowed


@pytest.mark.parametrize("kind", [cc.Controller, General])
def test_it_rises_with_what_the_joints_can_do_and_begins_anew(kind):
    """No more than a tenth of the joints' accelerations a step; a reset forgets it, a refused step leaves no trace."""
    robot = cc.load("panda")
    start = robot.state(robot.home).placement(robot.tool)
    circle = cc.Circle.starting_at(start, radius=0.15, period=1.0)
    hand = cc.FrameTask(robot.tool, "position", target=circle)
    controller = kind(robot, hand, "sns", dt=5e-3)
    _, paces, _ = stepped(robot, controller, robot.home, 0.6)
    assert paces[0] == 1.0 and paces.min() < 0.6
    run = []
    q, v = robot.home, np.zeros(7)
    controller.reset()
    for k in range(120):
        with pytest.raises(cc.errors.NonFiniteError):
            controller.step(np.full(7, np.nan), v, k * 5e-3)
        command = controller.step(q, v, k * 5e-3)
        run.append(command.references[0].pace)
        state = robot.state(q)
        J, rate = hand.jacobian(state), command.references[0].rate
        joints = np.abs(np.linalg.pinv(J) @ rate)
        rise = 0.1 * np.min(robot.limits.acceleration_upper / np.maximum(joints, 1e-12))
        if k:
            assert run[-1] <= run[-2] + 5e-3 * rise * 1.02 + 1e-12  # 2 %: of damping near singularities
        q, v = advance(robot, q, v, command, 5e-3)
    np.testing.assert_allclose(run, paces[:120], atol=1e-9)
