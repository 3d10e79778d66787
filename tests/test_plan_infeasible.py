"""Plans that cannot be: which sample, which task, which limit, by how much; said by the run and by a warning."""

from __future__ import annotations

import re

import numpy as np
import pytest

import cartctl as cc
from tests.plans_for_tests import circle
from tests.robots_for_tests import panda, planar


def told(robot: cc.Robot, tasks, **how) -> cc.Plan:
    with pytest.warns(cc.CartctlWarning, match="no plan: sample"):
        return cc.plan(robot, tasks, methods=("pinv",), **how)


def sample_of(message: str) -> int:
    found = re.match(r"sample (\d+) of (\d+) \(t = ([\d.]+) s\)", message)
    assert found is not None, message
    return int(found[1])


def test_out_of_reach() -> None:
    """A 3R of reach 2.1 m on a line that leaves it: the first sample beyond is named, with what is missed there."""
    robot = planar()
    q0 = np.array([0.3, 0.9, -1.2])
    p0 = robot.state(q0).position("tool")
    end = np.array([2.6, 0.6, 0.0])
    tip = cc.FrameTask("tool", "xy", target=cc.Line(p0, end, duration=2.0), name="tip")
    plan = told(robot, tip, samples=41, q0=q0)
    report = plan.report
    assert report.status is cc.PlanStatus.OUT_OF_REACH and not report.feasible and report.gap is None
    k = sample_of(report.message)
    far = [np.linalg.norm(tip.target(t).position) > 2.1 for t in plan.time.tolist()]
    assert k == far.index(True)
    assert "task 'tip' is missed by" in report.message and "out of reach" in report.message
    missed = float(re.search(r"missed by ([\d.e-]+) m", report.message)[1])
    assert missed == pytest.approx(np.linalg.norm(tip.target(float(plan.time[k])).position) - 2.1, rel=1e-2)
    assert plan.status[k] == "INFEASIBLE" and plan.status[0] == "OPTIMAL"
    assert np.isfinite(plan.q).all() and plan.metrics().steps == 40
    assert str(report).startswith("OUT_OF_REACH")


def test_out_of_reach_for_one_posture_only() -> None:
    """A wrist that is held from the wrong side: another posture reaches the sample, and the message says so."""
    robot = panda()
    start = robot.state(robot.home).placement(robot.tool)
    far = start.copy()
    far.translation = start.translation + [0.0, 0.0, 0.75]
    hand = cc.FrameTask(robot.tool, target=cc.Line(start, far, duration=2.0))
    plan = told(robot, hand, samples=30, q0=robot.home)
    assert plan.report.status is cc.PlanStatus.OUT_OF_REACH
    assert "missed by" in plan.report.message


@pytest.mark.parametrize("kind", ["velocity", "acceleration"])
def test_too_fast(kind: str) -> None:
    robot = panda()
    hand = circle(robot, 0.2, period=2.0)
    limits = robot.limits.replace(**{f"{kind}_upper": 0.25, f"{kind}_lower": -0.25})
    plan = told(robot, hand, samples=40, limits=limits, q0=robot.home)
    report = plan.report
    assert report.status is cc.PlanStatus.LIMITS and not report.feasible and report.excess > 0.0
    k = sample_of(report.message)
    name = re.search(r"of joint '([^']+)'", report.message)[1]
    assert f": {kind} of joint" in report.message and "a longer duration may help" in report.message
    value = float(re.search(r"would be (-?[\d.e+-]+) rad", report.message)[1])
    v = np.concatenate([np.zeros((1, 7)), plan.command, np.zeros((1, 7))])
    shown = plan.command if kind == "velocity" else np.diff(v, axis=0) / plan.meta["dt"]
    assert shown[k, robot.dof(name)] == pytest.approx(value, rel=1e-3)
    assert abs(value) == pytest.approx(np.abs(shown).max(), rel=1e-3) and abs(value) > 0.25
    assert "INFEASIBLE" in plan.status
    assert plan.report.residual.m < 1e-6  # the task goes first


def test_time_makes_it_feasible() -> None:
    """The advice of the message holds: three times as long, and the same limits are kept."""
    robot = panda()
    limits = robot.limits.replace(velocity_upper=0.6, velocity_lower=-0.6)
    told(robot, circle(robot, 0.12, period=1.5), samples=40, limits=limits, q0=robot.home)
    plan = cc.plan(robot, circle(robot, 0.12, period=6.0), samples=40, limits=limits, q0=robot.home, methods=("pinv",))
    assert plan.report.feasible


def test_a_start_beyond_its_limits() -> None:
    robot = panda()
    limits = robot.limits.replace(position_upper=np.where(np.arange(7) == 0, -0.5, robot.limits.position_upper))
    plan = told(robot, circle(robot, 0.05), samples=20, limits=limits, q0=robot.home)
    assert plan.report.status is cc.PlanStatus.LIMITS
    assert sample_of(plan.report.message) == 0 and "position of joint 'panda_joint1'" in plan.report.message
    assert "its limit is -0.5" in plan.report.message


def test_tasks_that_contradict_each_other() -> None:
    robot = planar()
    q0 = np.array([0.3, 0.9, -1.2])
    path = cc.Line(robot.state(q0).position("tool"), [1.0, 0.5, 0.0], duration=1.0)
    here, there = cc.FrameTask("tool", "xy", target=path), cc.FrameTask("tool", "xy", name="there")
    plan = told(robot, [here, there], samples=20, q0=q0)
    assert plan.report.status is cc.PlanStatus.OUT_OF_REACH
    assert 0 < sample_of(plan.report.message) <= 5
