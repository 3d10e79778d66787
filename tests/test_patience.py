"""Whoever gets no nearer slows down until it does, or stands; and nobody else is slowed down."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cartctl as cc
from cartctl.levels.patience import PATIENCE, patience_of, size_of
from cartctl.levels.patience_kernel import IDLE, SHARE, STEP, forget, look_on, slow_down
from cartctl.motion.integrate import advance
from tests.test_beneath import at_the_end
from tests.test_coming_to_rest import FORMS, STANDS, arm, in_place, limits_of, rolled, stack
from tests.ways import General

DT = 1e-2  # s
JOINTS = np.array([[10.0, 10.0], [2.0, 0.5], [1e-5, 1e-5], [1.0, 1.0]])  # as in levels.approach


def fresh(count=1):
    state = np.zeros(size_of(count, 2))
    forget.compiled(state, count, PATIENCE)
    return state


def note(state, missed, share=1.0, size=1.0, off=0.0):
    """A step at the given share of the speeds; off: (2,) from where the step before was to lead."""
    missed = np.atleast_1d(np.asarray(missed, dtype=float))
    x = state[-2:] + off
    look_on.compiled(missed, np.full(len(missed), size), x, share * JOINTS[1] * DT, JOINTS, DT, state)


# ---------------------------------------------------------------- the arithmetic


def test_who_comes_nearer_is_left_alone():
    state, missed = fresh(), 5.0
    for _ in range(1000):
        missed *= 0.999
        note(state, missed)
        assert state[SHARE] == 1.0 and state[IDLE] <= 2.0 * DT


def test_who_does_not_is_slowed_down_from_what_it_moves_at():
    state = fresh()
    note(state, 1.0)
    for k in range(1000):
        share = min(0.25, state[SHARE])
        note(state, 1.0 + 0.004 * share * (-1) ** k, share=share)
        if state[SHARE] < 1.0:
            assert state[SHARE] < 0.25 and k >= round(PATIENCE / DT)
    assert state[SHARE] == 5e-7


def test_it_returns_while_that_leads_nearer():
    state = fresh()
    for _ in range(300):
        note(state, 1.0, share=min(0.25, state[SHARE]))
    missed = 1.0
    assert state[SHARE] < 0.05
    for steepness, seconds in ((0.01, 3.0), (0.1, 0.5)):
        for _ in range(60):  # what it had been idle for
            missed -= steepness * state[STEP]
            note(state, missed, share=state[SHARE] * 0.5)
        before = state[SHARE]
        for _ in range(round(seconds / DT)):
            missed -= steepness * state[STEP]
            note(state, missed, share=state[SHARE] * 0.5)
            assert state[SHARE] >= before
        assert state[SHARE] == pytest.approx(np.e * before, rel=1e-2)


def test_who_has_arrived_may_move():
    state = fresh()
    for _ in range(1000):
        note(state, 5e-5)
        assert state[SHARE] == 1.0


def test_to_stand_is_not_to_be_idle():
    state = fresh()
    for _ in range(1000):
        note(state, 1.0, share=5e-4)
        assert state[SHARE] == 1.0


def test_what_somebody_else_does_begins_anew():
    state = fresh(2)
    for _ in range(500):
        note(state, [1.0, 2.0], share=state[SHARE])
    assert state[SHARE] < 1e-3
    note(state, [1.0, 2.0005], share=0.0)
    assert state[SHARE] < 1e-3
    note(state, [1.0, 2.0015], share=0.0)
    assert state[SHARE] == 1.0
    for _ in range(200):
        note(state, [1.0, 2.0])
    note(state, [1.0, 2.5])  # a push while it still moves: the way back counts from there
    assert state[IDLE] == 0.0
    for k in range(1000):
        note(state, [1.0, 2.5 - 4e-4 * k])
        assert state[SHARE] == 1.0


def test_a_task_below_begins_anew_where_one_above_comes_nearer():
    """It may have been nearer on the way, by chance."""
    state, first, second = fresh(2), 1.0, 0.1
    for _ in range(200):
        first, second = first - 4e-3, second + 4e-3
        note(state, [first, second])
    for _ in range(200):
        second -= 4e-3 * 0.9
        note(state, [first, second])
        assert state[SHARE] == 1.0


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1.0, 100.0), st.floats(0.0, 2.0))
def test_every_way_is_bounded(seed, size, steepness):
    """Of a task that swings about its best: what patience takes, and no more."""
    rng, state, way, best = np.random.default_rng(seed), fresh(), 0.0, 3.0
    speed = float(np.linalg.norm(JOINTS[1]))
    for _ in range(2000):
        share = state[SHARE]
        swing = share * size * speed * DT * abs(rng.normal(0.0, 0.1 + steepness))
        note(state, best + min(swing, share * size * speed * DT), share=share, size=size)
        way += share * speed * DT
    assert way <= speed * (PATIENCE + 1.0)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_the_box_is_narrowed_and_never_left(seed, accelerations):
    rng = np.random.default_rng(seed)
    v, share = rng.normal(size=2), 10.0 ** rng.uniform(-6, 0)
    lower = rng.normal(size=2) * (100.0 if accelerations else 1.0)
    upper = lower + rng.exponential(size=2) * (100.0 if accelerations else 1.0)
    low, high = lower.copy(), upper.copy()
    slow_down.compiled(v, JOINTS, share, DT, accelerations, low, high)
    assert (lower <= low).all() and (low <= high).all() and (high <= upper).all()
    cap = share * JOINTS[1]
    nearest = np.clip(0.0, *((v + DT * lower, v + DT * upper) if accelerations else (lower, upper)))
    y = (v + DT * low, v + DT * high) if accelerations else (low, high)
    for end in y:  # within the share, or as near to it as the box goes
        assert (np.abs(end) <= np.maximum(cap, np.abs(nearest)) + 1e-9).all()


def test_patience_is_longer_for_who_cannot_stop_soon():
    assert patience_of(JOINTS) == PATIENCE + 0.1
    assert patience_of(np.array([[np.inf], [2.0], [0.0], [1.0]])) == PATIENCE


# ---------------------------------------------------------------- in the loop


def standing(found):
    speed, turned = at_the_end(found.shares, 100)
    assert found.excess <= 1e-9 and speed <= STANDS and turned == 0


@pytest.mark.parametrize(
    "name, solver, form, seed",
    [
        ("panda", "hqp", 0, 8),  # round and round
        ("panda", "sns", 1, 9),
        ("lwr", "sns", 1, 1),
        ("lwr", "hqp", 1, 1),
        ("lwr", "hqp", 1, 3),
        ("lwr", "hqp", 2, 1),
        ("lwr", "hqp", 0, 19),
        ("lwr", "hqp", 2, 16),
        ("kinova", "sns", 0, 2),  # every step
        ("kinova", "hqp", 1, 12),
        ("panda", "qp", 0, 0),
        ("lwr", "qp", 1, 1),
        ("kinova", "qp", 2, 1),
    ],
)
def test_who_swung_for_ever_stands(name, solver, form, seed):
    """A position in reach, an orientation that is not, there."""
    robot = arm(name)
    standing(rolled(robot, stack(robot, "ranked", in_place(robot, seed)), solver, *FORMS[form], duration=24.0))


@pytest.mark.parametrize("level, accelerations", FORMS)
@pytest.mark.parametrize("solver", ["sns", "hqp"])
def test_fitted_tasks_stand_too(solver, level, accelerations):
    robot = arm("lwr")
    target = in_place(robot, 1)
    tasks = [
        cc.FrameTask(robot.tool, "position", target=target, gain=20.0),
        cc.FrameTask(robot.tool, "orientation", target=target, gain=20.0, fit="least_squares", name="turn"),
    ]
    standing(rolled(robot, tasks, solver, level, accelerations, duration=16.0))


def restless(kind=cc.Controller):
    """A controller whose robot would swing for ever, and its robot."""
    robot = arm("kinova")
    tasks = stack(robot, "ranked", in_place(robot, 2))
    return kind(robot, tasks, "sns", limits=limits_of(robot, False), dt=DT), robot


def share_of(controller):
    """Of the speed limits, that is left."""
    if controller._stroke is not None and controller._ahead:
        return controller._stroke.lasting.memory.patience[SHARE]
    return controller._confining.patience[SHARE]


def run_on(controller, robot, q, v, steps, begin=0):
    for k in range(begin, begin + steps):
        q, v = advance(robot, q, v, controller.step(q, v, k * DT), DT)
    return q, v


@pytest.mark.parametrize("kind", [cc.Controller, General])
def test_a_new_target_is_gone_to_at_once(kind):
    controller, robot = restless(kind)
    q, v = run_on(controller, robot, robot.home, np.zeros(robot.nv), 1600)
    assert share_of(controller) < 1.0
    there = robot.state(robot.home).placement(robot.tool)
    for task in controller.tasks:
        task.target = there
    anew = kind(robot, controller.tasks, "sns", limits=controller.limits, dt=DT)
    np.testing.assert_allclose(controller.step(q, v, 16.0).velocity, anew.step(q, v, 0.0).velocity, atol=1e-9)
    assert share_of(controller) == 1.0


@pytest.mark.parametrize("kind", [cc.Controller, General])
def test_new_limits_a_push_and_a_reset_begin_anew(kind):
    controller, robot = restless(kind)
    q, v = run_on(controller, robot, robot.home, np.zeros(robot.nv), 1600)
    assert share_of(controller) < 1.0
    pushed = robot.integrate(q, np.full(robot.nv, 0.05))
    controller.step(pushed, v, 16.0)
    assert share_of(controller) == 1.0
    run_on(controller, robot, q, v, 1600, begin=1601)
    assert share_of(controller) < 1.0
    controller.limits = controller.limits
    assert share_of(controller) == 1.0
    run_on(controller, robot, q, v, 1600, begin=3201)
    assert share_of(controller) < 1.0
    controller.reset()
    assert share_of(controller) == 1.0


def test_at_one_stroke_as_in_the_general_way():
    """The same states to both; and who takes turns knows what the other has seen."""
    controller, robot = restless()
    general, _ = restless(General)
    q, v = robot.home, np.zeros(robot.nv)
    for k in range(1200):
        fused = controller.step(q, v, k * DT)
        usual = general.step(q, v, k * DT)
        if k % 20 == 0:
            seen = controller._stroke.lasting.memory.patience
            np.testing.assert_allclose(seen, general._confining.patience, rtol=1e-6, atol=1e-9)
        q, v = advance(robot, q, v, fused, DT)
        if share_of(general) < 1.0:
            assert np.abs(usual.velocity).max() <= share_of(general) * 2.0 * robot.limits.velocity_upper.max()
    assert share_of(general) < 1e-3
    before = controller._stroke.lasting.memory.patience
    controller._fall_back()
    np.testing.assert_array_equal(controller._confining.patience, before)
    controller._hand_over(controller._stroke)
    np.testing.assert_array_equal(controller._stroke.lasting.memory.patience, before)


def test_many_at_once_as_one_by_one():
    controller, robot = restless()
    one = cc.simulate(controller, robot.home, duration=16.0)
    many = cc.simulate_batch(restless()[0], np.array([robot.home, robot.home]), duration=16.0, history=True)
    np.testing.assert_allclose(many.q[1], one.q, atol=1e-12)
    assert np.abs(one.v[-1] / robot.limits.velocity_upper).max() <= STANDS


# ---------------------------------------------------------------- who is not slowed down


@pytest.mark.parametrize("level, accelerations", FORMS)
def test_a_slow_robot_has_the_time_it_takes(level, accelerations):
    robot = arm("planar3R")
    slow = robot.limits.replace(velocity_lower=-0.02, velocity_upper=0.02)
    if accelerations:
        slow = slow.replace(acceleration_lower=-0.01, acceleration_upper=0.01)
    q = robot.home + [0.3, -0.2, 0.3]
    hand = cc.FrameTask(robot.tool, "xy", target=robot.state(q).position(robot.tool))
    controller = cc.Controller(robot, hand, "sns", level, limits=slow, dt=DT)
    run = cc.simulate(controller, robot.home, duration=60.0)
    assert np.linalg.norm(run.tasks[0].error[-1]) <= 1e-6
    assert share_of(controller) == 1.0


@pytest.mark.parametrize("solver", ["sns", "hqp"])
def test_an_objective_has_the_null_space_for_as_long_as_it_likes(solver):
    robot = arm("panda")
    target = robot.state(robot.home).position(robot.tool) + [2.0, 0.0, 0.0]  # out of reach
    hand = cc.FrameTask(robot.tool, "position", target=target)
    controller = cc.Controller(robot, hand, solver, objective=cc.JointRange(0.05), dt=DT)
    q, v = run_on(controller, robot, robot.home, np.zeros(7), 800)
    assert share_of(controller) == 1.0
    controller.objective = None
    q, v = run_on(controller, robot, q, v, 10, begin=800)
    controller.objective = cc.JointRange(0.05)
    controller.step(q, v, 9.0)
    assert share_of(controller) == 1.0


@pytest.mark.parametrize("solver", ["sns", "hqp"])
def test_a_target_led_by_hand_beyond_reach_is_followed(solver):
    """Assigned in every step, round about the robot: what cannot be reached is still pointed at."""
    robot = arm("panda")
    hand = cc.FrameTask(robot.tool, "position", target=[2.0, 0.0, 0.5], gain=5.0)
    controller = cc.Controller(robot, hand, solver, dt=DT)
    q, v = run_on(controller, robot, robot.home, np.zeros(7), 500)
    for k in range(500, 1500):
        angle = 0.1 * (k - 500) * DT
        hand.target = [2.0 * np.cos(angle), 2.0 * np.sin(angle), 0.5]
        q, v = run_on(controller, robot, q, v, 1, begin=k)
    x, y, _ = robot.state(q).position(robot.tool)
    assert abs(np.arctan2(y, x) - 1.0) <= 0.1


def test_tasks_of_others_are_not_judged():
    """Their targets may move without saying so."""
    robot = arm("planar3R")

    class Own(cc.FrameTask):
        pass

    controller = cc.Controller(robot, Own(robot.tool, "xy", target=[4.0, 2.0, 0.0]), "sns", dt=DT)
    q, v = run_on(controller, robot, robot.home, np.zeros(3), 100)
    for k in range(400):  # in place of a plant that does as it likes
        controller.step(q, np.ones(3) * (-1) ** k, 1.0 + k * DT)
    assert share_of(controller) == 1.0


def test_a_path_is_followed_however_long_it_takes():
    robot = arm("panda")
    start = robot.state(robot.home).placement(robot.tool)
    circle = cc.Circle.starting_at(start, radius=0.8, period=8.0)  # leaves the reach
    controller = cc.Controller(robot, cc.FrameTask(robot.tool, "position", target=circle), "sns", dt=DT)
    run_on(controller, robot, robot.home, np.zeros(7), 1000)
    assert share_of(controller) == 1.0


@pytest.mark.parametrize("kind", [cc.Controller, General])
def test_the_way_back_from_a_push_is_as_long_as_it_is(kind):
    """A low gain; far from the nearest it ever was, for long."""
    robot = arm("panda")
    tasks = [cc.FrameTask(robot.tool, target=robot.state(robot.home).placement(robot.tool), gain=0.5), cc.PostureTask()]
    controller = kind(robot, tasks, "sns", dt=DT)
    q, v = run_on(controller, robot, robot.home, np.zeros(7), 100)
    q, v = run_on(controller, robot, robot.integrate(q, [0.6, 0.3, -0.3, 0.3, 0.3, 0.0, 0.0]), v, 3000, begin=100)
    assert share_of(controller) == 1.0
    assert np.linalg.norm(controller.step(q, v, 31.0).references[0].error) <= 1e-6


@pytest.mark.parametrize("seed", [9, 17, 20])
def test_a_detour_to_a_target_in_reach_is_made(seed):
    """The LWR turns the wrong way first, for seconds."""
    robot = arm("lwr")
    tasks = stack(robot, "ranked", in_place(robot, seed), gain=10.0)
    controller = cc.Controller(robot, tasks, "sns", limits=limits_of(robot, True), dt=2e-2)
    run = cc.simulate(controller, robot.home, duration=30.0)
    assert max(np.linalg.norm(task.error[-1]) for task in run.tasks) <= 1e-3


@pytest.mark.parametrize("seconds", [2.0, 4.0, 10.0])
def test_a_robot_that_was_held_starts_where_it_is(seconds):
    """Brakes on, and the velocity that is told handed back as if it moved."""
    robot = arm("panda")
    target = robot.state(robot.home).position(robot.tool) + [0.1, 0.1, 0.1]
    controller = cc.Controller(robot, cc.FrameTask(robot.tool, "position", target=target, gain=3.0), "sns", dt=DT)
    q, v, begin = robot.home, np.zeros(7), round(seconds / DT)
    for k in range(begin):
        v = controller.step(q, v, k * DT).velocity
    q, v = run_on(controller, robot, q, np.zeros(7), 600, begin=begin)
    assert np.linalg.norm(robot.state(q).position(robot.tool) - target) <= 1e-6


def test_a_hand_is_held_against_what_others_do():
    """The first joint is turned by somebody else; a steady lag is not idleness."""
    robot, misses = arm("panda"), []
    hand = cc.FrameTask(robot.tool, target=robot.state(robot.home).placement(robot.tool), gain=5.0)
    controller = cc.Controller(robot, hand, "sns", disabled=["panda_joint1"], dt=DT)
    q, v = robot.home, np.zeros(7)
    for k in range(1500):
        command = controller.step(q, v, k * DT)
        misses.append(np.linalg.norm(command.references[0].error))
        v = command.velocity.copy()
        v[0] = 0.05 * np.sin(2.0 * np.pi * k * DT / 12.0)
        q = robot.integrate(q, DT * v)
        v[0] = 0.0
    assert share_of(controller) == 1.0 and max(misses) <= 0.02


@pytest.mark.parametrize("kind", [cc.Controller, General])
@pytest.mark.parametrize("again", [True, False])
def test_no_velocity_given_and_the_same_target_again(kind, again):
    controller, robot = restless(kind)
    q, targets = robot.home, [task.target for task in controller.tasks]
    for k in range(1600):
        if again:
            for task, target in zip(controller.tasks, targets, strict=True):
                task.target = np.array(target)
        command = controller.step(q, None, k * DT)
        q = robot.integrate(q, DT * command.velocity)
    assert share_of(controller) < 1e-3
    assert np.abs(command.velocity / robot.limits.velocity_upper).max() <= STANDS
