"""Tasks that are out of reach only for what ranks above them: they come to rest, too."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.levels.approach_kernel import ASKED, BEND, ROWS
from cartctl.levels.beneath_kernel import held_beneath, narrowed
from tests.test_coming_to_rest import FORMS, STANDS, in_place, limits_of, reversals, rolled, stack
from tests.ways import General

DT = 1e-2  # s


def at_the_end(shares, count=200):
    """The largest share of a speed limit and the reversals above 1e-6 of it, in the last steps."""
    last = shares[-count:]
    return np.abs(last).max(), reversals(last)


@pytest.mark.parametrize("solver", ["sns", "hqp"])
@pytest.mark.parametrize("level, accelerations", FORMS)
def test_a_hand_in_place_that_cannot_turn_that_far(solver, level, accelerations):
    """Two links, the height is reached, the angle is not: the arm stood at full speed in turn, every step."""
    robot = cc.planar([1.0, 1.0])
    limits = robot.limits.replace(velocity_lower=-1.0, velocity_upper=1.0)
    if accelerations:
        limits = limits.replace(acceleration_lower=-10.0, acceleration_upper=10.0)
    tasks = [
        cc.FrameTask("tool", "y", target=[0.0, -1.5, 0.0], gain=10.0),
        cc.FrameTask("tool", "rz", target=np.eye(3), gain=10.0),
    ]
    run = cc.simulate(cc.Controller(robot, tasks, solver, level, limits=limits, dt=5e-3), [-0.3, -0.8], duration=8.0)
    speed, turned = at_the_end(run.v, 400)
    assert speed <= STANDS and turned == 0
    assert abs(run.tasks[0].error[-1, 0]) <= 1e-9
    angles = run.q.sum(axis=1)  # of the hand; -1.5 = sin q1 + sin(q1 + q2), and q1 + q2 no nearer to 0 than this
    assert angles[-1] == pytest.approx(-np.arcsin(0.5), abs=1e-3)


@cache
def panda():
    return cc.load("panda")


@pytest.mark.parametrize("solver", ["sns", "hqp"])
@pytest.mark.parametrize("seed", range(10))
def test_the_panda_in_place_and_turned_as_far_as_it_goes(solver, seed):
    robot = panda()
    found = rolled(
        robot, stack(robot, "ranked", in_place(robot, seed), gain=10.0), solver, "velocity", False, duration=14.0
    )
    speed, turned = at_the_end(found.shares)
    assert found.excess <= 1e-9 and speed <= STANDS and turned == 0


def bends(robot, q, upper, lower):
    """D, Vt and what a motion along each row of Vt does to the lower task, as the approach sees it."""
    state = robot.state(q)
    A, J = upper.jacobian(state), lower.jacobian(state)
    (m, n), M = J.shape, len(A)
    k, size = min(m, n), float(np.linalg.norm(J))
    U, Vt, D, stood = np.empty((m, k)), np.empty((k, n)), np.empty((ROWS, k)), np.empty(n)
    back, base, rest = np.empty((m, M)), np.empty(m), np.empty(m)
    joints = np.array([np.full(n, 5.0), np.full(n, 2.0), np.full(n, 1e-6), np.full(n, 1.0)])
    error, none = np.full(m, 2.0), np.zeros(0)  # far: every curvature is asked for
    b = 20.0 * error
    narrowed.compiled(
        A, np.zeros(M), J, b, error, joints, none, none, DT, size, False, U, Vt, D, back, base, rest, stood
    )
    along = Vt[D[ASKED] != 0.0]
    own, others = lower.curvatures(state, along), upper.curvatures(state, along)
    held_beneath.compiled(error, base, rest, U, Vt, D, joints, back, own, others, DT, size, True, True, b)
    return A, J, U, Vt, D, back, others


@pytest.mark.parametrize("seed", range(5))
def test_curvatures_are_those_of_motions_that_keep_the_tasks_above(seed):
    """Against second differences of where the elbow is, on the curve on which the hand stays in place."""
    robot = panda()
    q = robot.random_configuration(np.random.default_rng(seed))
    upper = cc.FrameTask(robot.tool, "position", target=np.zeros(3))
    lower = cc.FrameTask("panda_link4", "position", target=np.zeros(3))
    A, J, U, Vt, D, _, others = bends(robot, q, upper, lower)
    asked = np.flatnonzero(D[ASKED])
    assert len(asked) >= 1
    h = 1e-4
    for c, k in enumerate(asked):
        v = Vt[k]
        if np.linalg.norm(A @ v) > 1e-9 or D[0, k] < 1e-6 * np.linalg.norm(J):
            continue
        a = -np.linalg.lstsq(A, others[:, c], rcond=None)[0]
        at = [robot.state(robot.integrate(q, t * v + 0.5 * t * t * a)) for t in (-h, 0.0, h)]
        hands, elbows = ([s.position(f) for s in at] for f in (robot.tool, "panda_link4"))
        assert np.linalg.norm(hands[0] - 2.0 * hands[1] + hands[2]) / h**2 <= 1e-5
        second = (elbows[0] - 2.0 * elbows[1] + elbows[2]) / h**2
        assert D[BEND, k] == pytest.approx(U[:, k] @ second, abs=1e-5)


@pytest.mark.parametrize("solver", ["sns", "hqp"])
def test_where_nothing_is_near_the_edge_nothing_is_changed(solver):
    """A position and an orientation, both in reach and close: as without the approach."""
    robot = panda()
    pose = robot.state(robot.home).placement(robot.tool)
    goal = pin.SE3(pose.rotation @ pin.exp3(np.array([0.02, -0.01, 0.03])), pose.translation + [0.005, -0.003, 0.004])
    tasks = stack(robot, "ranked", goal.homogeneous, gain=2.0)
    limits = limits_of(robot, True)
    with_, without = (
        General(robot, tasks, solver, limits=limits, dt=DT, approach=on).step(robot.home).velocity
        for on in (True, False)
    )
    np.testing.assert_allclose(with_, without, atol=1e-12)


def test_a_task_that_repeats_the_one_above_is_met_with_it():
    """Nothing is left to it, and nothing more is needed."""
    robot = panda()
    goal = robot.state(robot.home).position(robot.tool) + [0.1, 0.0, 0.1]
    tasks = [cc.FrameTask(robot.tool, "position", target=goal, name=name) for name in ("one", "other")]
    run = cc.simulate(cc.Controller(robot, tasks, "sns", dt=DT), robot.home, duration=6.0)
    assert max(np.linalg.norm(task.error[-1]) for task in run.tasks) <= 1e-3
