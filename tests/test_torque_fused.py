"""The torque level and sns at one stroke: the general way's answers, and only where that may be taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

import cartctl as cc
from cartctl.errors import NonFiniteError, ShapeError
from tests.robots_for_tests import ROBOTS, panda, random_state

SAME = 1e-12  # relative to the largest entry


@dataclass(frozen=True)
class Plain(cc.SNS):
    """A user's own solver, which answers as sns does."""

    name: ClassVar[str] = "plain"


def two_ways(robot, tasks, **options):
    make = lambda solver, level: cc.Controller(robot, tasks(), solver, level, **options)  # noqa: E731
    return lambda level: (make("sns", level()), make(Plain(), level()))


def hand(robot, target=None, axes="pose", **options):
    return cc.FrameTask(robot.tool, axes, target=target, **options)


def ranked(robot):
    return [
        hand(robot, axes="position", gain=np.array([5.0, 10.0, 20.0])),
        cc.PostureTask(gain=3.0),
    ]


def rows_of(robot):
    return [hand(robot, axes="z rx", name="some rows"), hand(robot, axes="x", fit="least_squares")]


STACKS = {"pose": lambda r: [hand(r)], "ranked": ranked, "rows": rows_of}
LEVELS = {
    "by inertia": lambda n: cc.TorqueLevel(),
    "none": lambda n: cc.TorqueLevel(0.0),
    "number": lambda n: cc.TorqueLevel(2.0),
    "vector": lambda n: cc.TorqueLevel(np.linspace(0.0, 5.0, n)),
    "friction": lambda n: cc.TorqueLevel(friction=cc.Friction(viscous=0.3, coulomb=0.2)),
}


def assert_same(a, b):
    assert a.status is b.status
    assert a.recovering == b.recovering and a.yielded == b.yielded
    pairs = [(a.u, b.u), (a.scales, b.scales)]
    p, q = a.problem, b.problem
    assert len(p.equations) == len(q.equations)
    for e, f in zip(p.equations, q.equations, strict=True):
        assert (e.fit, e.weight, e.name) == (f.fit, f.weight, f.name)
        pairs += [(e.A, f.A), (e.b, f.b), (e.drift, f.drift), (np.array([e.size]), np.array([f.size]))]
    for name in ("lower", "upper", "reference", "constraints"):
        x, y = getattr(p, name), getattr(q, name)
        assert (x is None) == (y is None)
        if x is not None and y is not None:
            pairs += list(zip(x, y, strict=True)) if name == "constraints" else [(x, y)]
    for x, y in pairs:
        finite = np.abs(y[np.isfinite(y)]).max(initial=1.0)
        np.testing.assert_allclose(x, y, rtol=0.0, atol=SAME * finite)
    np.testing.assert_array_equal(a.saturated, b.saturated)
    assert a.lost_rank == b.lost_rank


@pytest.mark.parametrize("name", ["pendulum", "planar", "panda", "kinova"])
@pytest.mark.parametrize("stack", STACKS)
@pytest.mark.parametrize("damping", LEVELS)
def test_both_ways_agree_step_after_step(name, stack, damping):
    """Each with its own warm start, at states that lie together and at random ones."""
    robot, rng = ROBOTS[name](), np.random.default_rng(4)
    for options in ({}, {"limits": None}):
        fused, plain = two_ways(robot, lambda: STACKS[stack](robot), **options)(lambda: LEVELS[damping](robot.nv))
        assert fused._fused is not None and plain._fused is None
        for k in range(40):
            if k % 8 == 0:
                at = random_state(robot, rng)
                q, v = np.array(at.q), 0.3 * at.v
            q = robot.integrate(q, 1e-3 * v)
            v = v + 1e-2 * rng.normal(size=robot.nv)
            assert_same(fused.step(q, v, 1e-3 * k).solution, plain.step(q, v, 1e-3 * k).solution)


def test_objectives_wrenches_paths_and_soft_starts_go_along():
    robot, rng = panda(), np.random.default_rng(5)
    at = robot.state(robot.home)
    circle = cc.Circle(center=at.position(robot.tool), radius=0.1, period=3.0)
    push = cc.Wrench(robot.tool, lambda t: np.array([10.0 * t, 0.0, 5.0, 0.0, 1.0, 0.0]))
    ways = two_ways(
        robot,
        lambda: [hand(robot, circle, axes="position")],
        objective=cc.JointRange(3.0),
        soft_start=0.05,
        limits=robot.limits,
    )
    fused, plain = ways(lambda: cc.TorqueLevel(0.0, wrenches=push))
    for k in range(100):
        q, v = robot.home + 0.05 * rng.normal(size=7), 0.3 * rng.normal(size=7)
        assert_same(fused.step(q, v, 1e-3 * k).solution, plain.step(q, v, 1e-3 * k).solution)


def test_where_limits_exclude_each_other_the_general_way_decides():
    robot = panda()
    weak = 0.2 * robot.limits.torque_upper
    limits = robot.limits.replace(torque_lower=-weak, torque_upper=weak)
    fused, plain = two_ways(robot, lambda: [hand(robot)], limits=limits)(cc.TorqueLevel)
    seen, rng = set(), np.random.default_rng(6)
    for _ in range(60):
        q = rng.uniform(limits.position_lower, limits.position_upper)
        v = rng.uniform(limits.velocity_lower, limits.velocity_upper)
        a, b = fused.step(q, v).solution, plain.step(q, v).solution
        assert_same(a, b)
        seen |= set(a.yielded)
    assert "acceleration" in seen


@pytest.mark.parametrize(
    "options",
    [
        {"metric": "inverse-inertia"},
        {"metric": np.arange(1.0, 8.0)},
        {"singularity": "damp"},
        {"singularity": "halt"},
    ],
)
def test_what_the_fused_way_does_not_know_takes_the_general_one(options):
    robot = panda()
    controller = cc.Controller(robot, hand(robot), "sns", "torque", **options)
    assert controller._fused is None
    assert controller.step(robot.home + 0.1).solution.status in (cc.Status.OPTIMAL, cc.Status.SINGULAR)


def test_a_level_of_the_users_own_takes_the_general_way():
    class Own(cc.TorqueLevel):
        pass

    robot = panda()
    assert cc.Controller(robot, hand(robot), "sns", Own())._fused is None


def test_constraints_take_the_general_way():
    robot = panda()
    wall = cc.HalfSpace(robot.tool, normal=(0, 0, 1), offset=0.2)
    fused, plain = two_ways(robot, lambda: [hand(robot)], constraints=[wall])(cc.TorqueLevel)
    a, b = (way.step(robot.home, 0.1 * np.ones(7)).solution for way in (fused, plain))
    assert_same(a, b)
    assert a.problem.constraints[0].shape[0] == 8


def test_settings_may_change_while_running():
    """Gains, damping, limits: what the fused way keeps at hand is made anew."""
    robot = panda()
    fused, plain = two_ways(robot, lambda: [hand(robot)])(cc.TorqueLevel)
    q, v = robot.home + 0.02, 0.2 * np.ones(7)
    changes = [
        lambda c: setattr(c.tasks[0], "gain", 7.0),
        lambda c: setattr(c.level, "damping", 3.0),
        lambda c: setattr(c.level, "damping", np.linspace(1.0, 2.0, 7)),
        lambda c: setattr(c.level, "damping", None),
        lambda c: setattr(c, "limits", robot.limits.replace(torque_upper=np.full(7, 1.0))),
        lambda c: setattr(c, "limits", robot.limits),
    ]
    before = None
    for change in changes:
        for way in (fused, plain):
            change(way)
        a, b = fused.step(q, v).solution, plain.step(q, v).solution
        assert_same(a, b)
        assert before is None or not np.array_equal(a.u, before)
        before = a.u


def test_errors_are_those_of_the_general_way():
    robot = panda()
    bad = {"at": np.nan}
    wrench = cc.Wrench(robot.tool, lambda t: np.full(6, bad["at"]))
    fused, plain = two_ways(robot, lambda: [hand(robot)])(lambda: cc.TorqueLevel(wrenches=wrench))
    for way in (fused, plain):
        with pytest.raises(NonFiniteError, match="wrench"):
            way.step(robot.home)
    bad["at"] = 1.0
    assert_same(fused.step(robot.home).solution, plain.step(robot.home).solution)
    for way in (fused, plain):
        way.level.damping = np.ones(6)
        with pytest.raises(ShapeError, match=r"damping has shape \(6,\); expected a number or \(7,\)"):
            way.step(robot.home)


def test_its_answers_prove_themselves():
    """The problem is put together when somebody asks, also after the robot has moved on."""
    robot, rng = panda(), np.random.default_rng(7)
    controller = cc.Controller(robot, hand(robot), "sns", "torque")
    kept = [controller.step(robot.home + 0.2 * rng.normal(size=7), 0.3 * rng.normal(size=7)) for _ in range(20)]
    for command in kept:
        assert command.solution.certificate().holds()
        assert command.solution.bound_violation() < 1e-9
        again = cc.solve(command.solution.problem, "sns")
        np.testing.assert_allclose(again.u, command.torque, atol=1e-9)
