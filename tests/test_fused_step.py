"""A step at one stroke and the general way, side by side from equal states: the same answers, told the same."""

from __future__ import annotations

import copy
import tracemalloc
import warnings

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from tests.ways import General, general, struck

SAME = 1e-10  # of u, relative to the largest entry
ROWS = 1e-9  # of commands after the approach, which divides round-off by small singular values


def pair(robot, tasks, **given):
    """Controllers of tasks of their own, equal ones: the one at a stroke, and the general one."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cc.errors.CartctlWarning)
        return cc.Controller(robot, [copied(task) for task in tasks], **given), General(robot, tasks, **given)


def copied(task):
    """Another one; its arrays, which nobody writes to, are the same."""
    other = copy.copy(task)
    other.name = task.name
    return other


def close(a, b, tolerance):
    size = max(1.0, float(np.abs(b[np.isfinite(b)]).max(initial=0.0)))
    np.testing.assert_allclose(a, b, atol=tolerance * size, rtol=0.0)


def assert_same(fused, usual, a, b):
    """Controllers and their commands."""
    assert a.acceleration is b.acceleration is a.torque is b.torque is None
    close(a.velocity, b.velocity, SAME)
    close(a.told, b.told, SAME)
    x, y = a.solution, b.solution
    assert x.u is a.velocity and x.solver == y.solver
    assert (x.recovering, x.guarded, x.yielded, x.failed) == (y.recovering, y.guarded, y.yielded, y.failed)
    if x.lost_rank == y.lost_rank:
        assert (x.status, x.outcome) == (y.status, y.outcome)
    else:  # of tasks that repeat each other, round-off decides whether it is told
        above = np.concatenate([e.A for e in y.problem.equations[:-1]])
        assert np.linalg.matrix_rank(above, 1e-6) < len(above)
    p, q = x.problem, y.problem
    asked = [e.b.size == 0 or np.abs(e.b).max() > 1e-12 for e in q.equations]  # of less, the scale is round-off
    np.testing.assert_allclose(x.scales[asked], y.scales[asked], atol=1e-9, equal_nan=True)
    assert p.metric is p.constraints is q.metric is q.constraints is None
    assert (p.reference is None) == (q.reference is None)
    for name in ("lower", "upper"):
        one, other = getattr(p, name), getattr(q, name)
        assert (one is None) == (other is None)
        if one is not None:
            close(one, other, SAME)
    for e, f in zip(p.equations, q.equations, strict=True):
        assert (e.fit, e.weight, e.name) == (f.fit, f.weight, f.name)
        assert (e.drift is None) == (f.drift is None)
        close(e.A, f.A, SAME)
        close(e.b, f.b, ROWS)
        assert e.size == pytest.approx(f.size, rel=1e-12)
        if e.drift is not None:
            close(e.drift, f.drift, ROWS)
    close(x.residuals, y.residuals, ROWS)
    for r, s in zip(a.references, b.references, strict=True):
        close(r.error, s.error, SAME)
        assert r.pace == pytest.approx(s.pace, abs=1e-8)
        for one, other in ((r.rate, s.rate), (r.acceleration, s.acceleration)):
            assert (one is None) == (other is None)
            if one is not None:
                close(one, other, SAME)
    np.testing.assert_allclose(fused.step_times, usual.step_times, atol=1e-9)
    np.testing.assert_allclose(fused.times(0.7), usual.times(0.7), atol=1e-9)
    for one, other in zip(fused.anchors, usual.anchors, strict=True):
        for u, v in zip(one, other, strict=True) if isinstance(one, tuple) else [(one, other)]:
            close(u, v, SAME)


def side_by_side(fused, usual, q, v, steps, t=0.0, seldom=5):
    """Both from the states the general one comes to; the statuses met. Now and then, certificates too."""
    robot, met = fused.robot, set()
    for k in range(steps):
        a, b = fused.step(q, v, t + k * fused.dt), usual.step(q, v, t + k * fused.dt)
        assert struck(fused) and not struck(usual)
        assert_same(fused, usual, a, b)
        met.add(b.solution.status.name)
        near = b.solution.problem.lower is not None and a.solution.problem.upper is not None
        if near:
            np.testing.assert_array_equal(a.solution.saturated, b.solution.saturated)
        if k % seldom == 0 and fused.solver.name == "sns" and b.solution.status.name != "FAILED":
            one, other = a.solution.certificate(), b.solution.certificate()
            assert [level.claim for level in one.levels] == [level.claim for level in other.levels]
            assert one.worst <= max(1e-7, 10.0 * other.worst)
        q, v = robot.integrate(q, b.velocity * fused.dt), b.velocity
    return met


def start(robot, rng, spread):
    low, high = robot.limits.position_lower, robot.limits.position_upper
    at = np.clip(robot.coordinates(robot.home) + spread * rng.normal(size=robot.nv), low + 1e-3, high - 1e-3)
    return robot.integrate(robot.neutral, at - robot.coordinates(robot.neutral))


def circle(robot, radius=0.1, period=4.0, **given):
    return cc.Circle.starting_at(robot.state(robot.home).placement(robot.tool), radius, period=period, **given)


def job(robot, **target):
    return [cc.FrameTask(robot.tool, **target), cc.PostureTask()]


def drawn(robot, rng):
    """A stack of tasks of all kinds, and what else a controller is given."""
    state = robot.state(robot.random_configuration(rng))
    place = robot.state(robot.home).placement(robot.tool)
    near = place * pin.exp6(0.2 * rng.normal(size=6))
    targets = [None, near, near.translation, np.array(near.rotation), state.placement(robot.tool), circle(robot, 0.12)]
    planar = robot.name.startswith("planar")
    axes = ["xy", "x", "xy rz"] if planar else ["pose", "position", "xy rz", "orientation", "z"]
    tasks = []
    for _ in range(rng.integers(1, 4)):
        kind = rng.integers(4)
        fit = "scale" if rng.random() < 0.8 else "least_squares"
        weight = float(rng.choice([1.0, 0.3, 0.0]))
        if kind < 2:
            frame = robot.tool if kind == 0 else robot.frame_names[len(robot.frame_names) // 2]
            rows = axes[rng.integers(len(axes))]
            target = targets[rng.integers(len(targets))]
            length = float(rng.choice([1.0, 0.3]))
            tasks.append(
                cc.FrameTask(frame, rows, 20.0 * rng.random(), target=target, length=length, fit=fit, weight=weight)
            )
        elif kind == 2:
            tasks.append(cc.JointTask(robot.single_joints[0], rng.normal(size=1), fit=fit, weight=weight))
        else:
            tasks.append(cc.JointTask(robot.single_joints[1:3], gain=[3.0, 5.0], fit=fit))
    if rng.random() < 0.6:
        tasks.append(cc.PostureTask(gain=2.0, fit="least_squares" if rng.random() < 0.8 else "scale"))
    if rng.random() < 0.1:
        tasks = [cc.PostureTask()]
    return tasks


def given(robot, rng):
    solver = rng.choice(["sns", "sns", "sns", "dls", "task-priority"])
    if solver != "sns":
        return {"solver": str(solver), "limits": None}
    limits = robot.limits
    if rng.random() < 0.5:
        fast = float(rng.choice([0.05, 0.3]))
        limits = limits.replace(velocity_lower=-fast, velocity_upper=fast)
    options = {"solver": "sns", "limits": limits if rng.random() < 0.9 else None}
    options["approach"] = bool(rng.random() < 0.7)
    if options["limits"] is not None and rng.random() < 0.2:
        options["disabled"] = robot.single_joints[-1]
    if rng.random() < 0.3:
        options["path_clock"] = False
    return options


@pytest.mark.parametrize("name", ["panda", "kinova", "planar3R", "pr2", "talos"])
def test_random_robots_tasks_solvers_and_states(name):
    """Inside the limits and beyond them, at rest and at speed, step after step."""
    robot, rng, met = cc.load(name), np.random.default_rng(len(name)), set()
    for draw in range(40 if robot.nv < 10 else 10):
        fused, usual = pair(robot, drawn(robot, rng), dt=float(rng.choice([1e-3, 1e-2])), **given(robot, rng))
        assert fused._stroke is not None and usual._stroke is None
        far = draw % 3 == 0
        q = robot.random_configuration(rng) if far else start(robot, rng, 0.3)
        v = rng.normal(size=robot.nv) * (0.0 if draw % 2 else 0.5)
        met |= side_by_side(fused, usual, q, v, 6)
    assert met >= {"OPTIMAL", "SCALED", "RECOVERING"}, met


def test_every_status_it_can_come_to():
    """Skipped, slowed towards rest, at a singularity, damped, asked for too much."""
    robot, rng, met = cc.load("panda"), np.random.default_rng(2), set()
    slow = robot.limits.replace(acceleration_lower=-2.0, acceleration_upper=2.0)
    hand = cc.FrameTask(robot.tool, target=robot.state(robot.home).placement(robot.tool))
    again = 0
    for _ in range(20):
        elbow = cc.FrameTask("panda_link4", "position", target=rng.normal(size=3))
        fused, usual = pair(robot, [hand, elbow], solver="sns", limits=slow, dt=1e-2)
        q, v = start(robot, rng, 0.3), 1.5 * rng.normal(size=7)
        met |= side_by_side(fused, usual, q, v, 3)
        again += any(e.drift is not None for e in fused.step(q, v).solution.problem.equations)
    assert again > 3, "tasks with no feasible scale are slowed towards rest"
    stretched = np.array([0.0, 0.0, 0.0, -0.0698, 0.0, 1.5, 0.7])
    for solver in ("sns", "dls", "task-priority"):
        for at in (stretched, robot.neutral):
            limits = {"limits": None}
            target = robot.state(robot.home).placement(robot.tool)
            for tasks in (job(robot, target=target), [cc.FrameTask(robot.tool, target=target)]):
                met |= side_by_side(*pair(robot, tasks, solver=solver, **limits), np.array(at), np.zeros(7), 2)
    assert met >= {"OPTIMAL", "SCALED", "SINGULAR", "RECOVERING", "INEXACT", "DAMPED", "OVERDETERMINED"}, met


def test_out_of_reach_and_back():
    """At the edge the arm is held back and bends the way it was bent; then the target comes home."""
    robot = cc.load("panda")
    q = np.array([0.0, 0.3, 0.0, -0.15, 0.0, 1.9, 0.7])
    far = robot.state(q).position(robot.tool) * 1.15
    fused, usual = pair(robot, [cc.FrameTask(robot.tool, "position", target=far), cc.PostureTask()], solver="sns")
    side_by_side(fused, usual, q, np.zeros(7), 150, seldom=50)
    for controller in (fused, usual):
        controller.tasks[0].target = 0.8 * far
    side_by_side(fused, usual, q, np.zeros(7), 20, t=0.15, seldom=50)


def users_path(robot):
    """A path of the user's own, which holds no rotation at first."""
    place = robot.state(robot.home).placement(robot.tool)

    def path(t):
        p, w = place.translation + [0.0, 0.05 * np.sin(t), 0.0], np.array([0.0, 0.05 * np.cos(t), 0.0, 0.0, 0.0, 0.0])
        a = np.array([0.0, -0.05 * np.sin(t), 0.0, 0.0, 0.0, 0.0])
        return cc.PathSample(p, None if t < 0.004 else np.array(place.rotation), w, a)

    return path


def paths(robot):
    place = robot.state(robot.home).placement(robot.tool)
    turned = place * pin.exp6(np.array([0.1, 0.0, 0.05, 0.0, 0.3, 0.0]))
    points = [place.translation + d for d in ([0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0])]
    return {
        "quintic": circle(robot, period=0.5),
        "trapezoid, two laps": circle(robot, period=0.2, laps=2, timing="trapezoid"),
        "open orientation": cc.Circle.starting_at(place.translation, 0.1, period=0.3),
        "over": circle(robot, period=0.01),
        "ellipse": cc.Ellipse(place, (0.1, 0.05), 1.0),
        "line that turns": cc.Line(place, turned, 0.1),
        "corners": cc.Polygon(points, duration=0.1, closed=False, orientation=place.rotation, timing="trapezoid"),
        "the user's": users_path(robot),
    }


@pytest.mark.parametrize("kind", paths(cc.load("panda")))
@pytest.mark.parametrize("clock", [True, False])
def test_paths_with_and_without_a_clock(kind, clock):
    robot = cc.load("panda")
    tasks = job(robot, target=paths(robot)[kind])
    slow = robot.limits.replace(velocity_lower=-0.3, velocity_upper=0.3)
    fused, usual = pair(robot, tasks, solver="sns", limits=slow, path_clock=clock, dt=2e-3)
    side_by_side(fused, usual, start(robot, np.random.default_rng(1), 0.02), np.zeros(7), 80, seldom=40)
    # time that stands still, and goes back, as a caller's may
    q = np.array(robot.home)
    for t in (0.2, 0.2, 0.1, 0.4):
        assert_same(fused, usual, fused.step(q, None, t), usual.step(q, None, t))


def test_what_is_changed_while_running():
    """Targets of every kind, gains, weights, fits, limits; what cannot be done at one stroke, and back."""
    robot = cc.load("panda")
    place = robot.state(robot.home).placement(robot.tool)
    fused, usual = pair(robot, [*job(robot), cc.JointTask("panda_joint2", fit="least_squares")][:2], solver="sns")
    q, v, t = np.array(robot.home), np.zeros(7), 0.0
    one, other = fused.tasks, usual.tasks

    def both(change, at_one_stroke=True):
        nonlocal q, v, t
        for controller in (fused, usual):
            change(controller)
        for _ in range(4):
            a, b = fused.step(q, v, t), usual.step(q, v, t)
            assert struck(fused) == at_one_stroke
            assert_same(fused, usual, a, b)
            q, v, t = robot.integrate(q, b.velocity * 1e-3), b.velocity, t + 1e-3

    def target(k, value):
        return lambda c: setattr(c.tasks[k], "target", value)

    def joints(t):
        return np.full(7, 0.1 * t), np.full(7, 0.1), np.zeros(7)

    both(lambda c: None)
    both(target(0, place * pin.SE3(np.eye(3), np.array([0.05, 0.0, 0.0]))))
    both(target(0, circle(robot, 0.05, 1.0)))
    both(target(0, users_path(robot)))
    both(target(0, place.translation + [0.0, 0.1, 0.0]))
    both(target(0, None))
    both(lambda c: setattr(c.tasks[0], "gain", 5.0))
    both(lambda c: setattr(c.tasks[0], "gain", np.full(6, 7.0)))  # may be changed in place
    both(lambda c: c.tasks[0].gain.fill(3.0))
    both(lambda c: setattr(c.tasks[0], "gain", 5.0))
    both(target(0, circle(robot, 0.05, 1.0)))
    both(target(1, joints), at_one_stroke=False)
    both(target(1, np.full(7, 0.2)))
    both(lambda c: setattr(c.tasks[1], "fit", "scale"))
    both(lambda c: setattr(c.tasks[1], "fit", "least_squares"))
    both(lambda c: setattr(c.tasks[1], "weight", 0.5))
    both(lambda c: setattr(c, "limits", robot.limits.replace(velocity_lower=-0.05, velocity_upper=0.05)))
    both(lambda c: setattr(c, "limits", None))
    both(lambda c: setattr(c, "objective", cc.JointRange()), at_one_stroke=False)
    both(lambda c: setattr(c, "objective", None))
    both(lambda c: c.reset())
    both(lambda c: setattr(c, "limits", robot.limits))
    both(lambda c: setattr(c, "solver", cc.HQP()), at_one_stroke=False)
    assert one is fused.tasks and other is usual.tasks


def test_a_task_shared_by_two_robots():
    """Whichever of two controllers has taken over a target last, both follow it."""
    task = cc.FrameTask("panda_hand", "position")
    first, second = (cc.Controller(cc.load("panda"), [task, cc.PostureTask()], solver="sns") for _ in range(2))
    for x in (0.4, 0.5, 0.45):
        task.target = [x, 0.1, 0.5]
        a, b = first.step(first.robot.home), second.step(second.robot.home)
        np.testing.assert_array_equal(a.references[0].error, b.references[0].error)
        np.testing.assert_array_equal(a.velocity, b.velocity)


BAD = {
    "nan": lambda q: (np.full(7, np.nan), None, 0.0),
    "short": lambda q: (q[:3], None, 0.0),
    "far": lambda q: (np.full(7, 1e10), None, 0.0),
    "words": lambda q: ("q", None, 0.0),
    "no rates": lambda q: (q, np.full(7, np.inf), 0.0),
    "two rates": lambda q: (q, np.zeros(2), 0.0),
    "no time": lambda q: (q, None, float("nan")),
    "time in words": lambda q: (q, None, "now"),
}


@pytest.mark.parametrize("bad", BAD)
def test_refused_inputs_say_the_same_and_leave_no_trace(bad):
    robot = cc.load("panda")
    fused, usual = pair(robot, job(robot, target=circle(robot)), solver="sns")
    untouched, _ = pair(robot, job(robot, target=circle(robot)), solver="sns")
    q, v = np.array(robot.home), np.zeros(7)
    for k in range(6):
        words = []
        for controller in (fused, usual):
            with pytest.raises(cc.errors.CartctlError) as refusal:
                controller.step(*BAD[bad](q))
            words.append((type(refusal.value), str(refusal.value)))
        assert words[0] == words[1]
        a, b = fused.step(q, v, k * 1e-3), untouched.step(q, v, k * 1e-3)
        np.testing.assert_array_equal(a.velocity, b.velocity)
        assert struck(fused) and fused.step_times == untouched.step_times
        q, v = robot.integrate(q, a.velocity * 1e-3), a.velocity


def test_a_pair_that_is_no_rotation_is_refused():
    robot = cc.load("kinova")
    fused, usual = pair(robot, job(robot), solver="sns")
    for size in (1.1, 1.0 + 5e-6):
        for controller in (fused, usual):
            with pytest.raises(cc.errors.ConfigurationError, match="norm"):
                controller.step(np.array(robot.home) * size)
    margin = np.array(robot.home) * (1.0 + 9.95e-7)  # a robot lets it pass
    assert_same(fused, usual, fused.step(margin), usual.step(margin))


@pytest.mark.parametrize("what", ["nan", "words", "raises"])
def test_a_path_that_goes_astray(what):
    """Refused in the general way's words; the step after goes on as if nothing had happened."""
    robot = cc.load("panda")
    good, broken = circle(robot), []

    def path(t):
        s = good(t)
        if not broken:
            return s
        if what == "raises":
            raise ZeroDivisionError("the user's own")
        return "here" if what == "words" else cc.PathSample(s.position * np.nan, s.rotation, s.twist, s.acceleration)

    controllers = [*pair(robot, job(robot), solver="sns"), cc.Controller(robot, job(robot), solver="sns")]
    for controller in controllers:
        controller.tasks[0].target = path
    q, v = start(robot, np.random.default_rng(0), 0.05), np.zeros(7)
    for k in range(6):
        words = []
        broken.append(True)
        for controller in controllers[:2]:
            with pytest.raises((cc.errors.CartctlError, ZeroDivisionError)) as refusal:
                controller.step(q, v, k * 1e-3)
            words.append((type(refusal.value), str(refusal.value)))
        broken.clear()
        assert words[0] == words[1]
        a, b, c = (controller.step(q, v, k * 1e-3) for controller in controllers)
        assert struck(controllers[0])
        np.testing.assert_array_equal(a.velocity, c.velocity)
        assert_same(*controllers[:2], a, b)
        q, v = robot.integrate(q, a.velocity * 1e-3), a.velocity


def test_huge_commands_fail_as_in_the_general_way():
    """Where squares would overflow, the general way is taken, and the next step is at one stroke again."""
    robot = cc.load("panda")
    fused, usual = pair(robot, job(robot, target=[0.5, 0.0, 0.5]), solver="sns")
    q = np.array(robot.home)
    for gain, at_one_stroke in ((1.0, True), (1e200, False), (1.0, True)):
        for controller in (fused, usual):
            controller.tasks[0].gain = gain
        a, b = fused.step(q), usual.step(q)
        assert struck(fused) == at_one_stroke
        assert a.solution.status is b.solution.status
        close(a.velocity, b.velocity, SAME)


def test_inputs_of_every_kind():
    robot = cc.load("panda")
    fused, usual = pair(robot, job(robot, target=circle(robot)), solver="sns")
    q, v = np.array(robot.home) + 0.01, np.full(7, 0.1)
    read_only = q.copy()
    read_only.flags.writeable = False
    for given_q in (q, read_only, q.tolist(), np.repeat(q, 2)[::2], q.astype(np.float32)):
        for given_v in (None, v, v.tolist(), np.repeat(v, 2)[::2]):
            for t in (0, np.float64(0.5), 0.5):
                a, b = fused.step(given_q, given_v, t), usual.step(given_q, given_v, t)
                assert struck(fused)
                assert_same(fused, usual, a, b)


def test_what_a_command_shows_stays():
    """Looked at late, a step shows what it was, whatever came after it."""
    robot = cc.load("panda")
    fused, usual = pair(robot, job(robot, target=circle(robot)), solver="sns")
    early, states = [], []
    q, v = start(robot, np.random.default_rng(3), 0.2), np.zeros(7)
    for k in range(5):
        early.append(fused.step(q, v, k * 1e-3))
        states.append((q, v, k * 1e-3))
        q, v = robot.integrate(q, early[-1].velocity * 1e-3), early[-1].velocity.copy()
    for task in fused.tasks:
        task.weight, task.gain, task.fit = 0.5, 1.0, "least_squares"
    fused.tasks[0].target = None
    fused.step(q, v, 1.0)
    for command, state in zip(early, states, strict=True):
        other = usual.step(*state)
        close(command.velocity, other.velocity, SAME)
        for e, f in zip(command.solution.problem.equations, other.solution.problem.equations, strict=True):
            assert (e.fit, e.weight, e.name) == (f.fit, f.weight, f.name)
            close(e.b, f.b, ROWS)
            close(e.A, f.A, SAME)
        for r, s in zip(command.references, other.references, strict=True):
            close(r.error, s.error, SAME)
        assert command.solution is command.solution and command.references is command.references


@pytest.mark.parametrize("options", [{}, {"limits": None, "solver": "dls"}])
def test_a_run_holds_the_same(options):
    """cc.simulate by both ways: everything a Run holds."""
    robot = cc.load("kinova")
    fused, usual = pair(robot, job(robot, target=circle(robot, 0.1, 0.4)), **{"solver": "sns", "dt": 2e-3, **options})
    q0 = start(robot, np.random.default_rng(4), 0.1)
    a, b = (cc.simulate(controller, q0, 0.5) for controller in (fused, usual))
    assert struck(fused) and a.status == b.status
    for name in ("time", "q", "v", "command"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=1e-8)
    for x, y in zip(a.tasks, b.tasks, strict=True):
        for name in ("error", "scale", "singular_values", "pose", "target"):
            one, other = getattr(x, name), getattr(y, name)
            assert (one is None) == (other is None)
            if one is not None:
                np.testing.assert_allclose(one, other, atol=1e-8, equal_nan=True)


def test_back_and_forth_between_the_ways():
    """What lasts goes along: anchors, clocks, how the arm was bent."""
    robot = cc.load("panda")
    fused, usual = pair(robot, job(robot, target=circle(robot, 0.15, 0.6)), solver="sns")
    q, v = start(robot, np.random.default_rng(6), 0.05), np.zeros(7)
    for k in range(60):
        if k % 7 == 3:
            fused._fall_back()
            a = fused._stepped(q, v, k * 1e-3)
            assert not struck(fused)
        else:
            a = fused.step(q, v, k * 1e-3)
        b = usual.step(q, v, k * 1e-3)
        assert_same(fused, usual, a, b)
        q, v = robot.integrate(q, b.velocity * 1e-3), b.velocity
    assert fused.step_times[0] < 59e-3 - 1e-4, "a path waited"
    late = general(fused)
    assert_same(late, usual, late.step(q, v, 60e-3), usual.step(q, v, 60e-3))


@pytest.mark.parametrize("kind", [cc.Controller, General])
def test_a_target_at_rest_waits_for_nobody(kind):
    """However slowly it is approached, its time goes on; a path that is given later is joined where it is by then."""
    robot = cc.load("panda")
    hand = cc.FrameTask(robot.tool, target=robot.state(robot.home).position(robot.tool) + [0.0, 0.2, 0.1])
    slow = robot.limits.replace(velocity_lower=-0.1, velocity_upper=0.1)
    controller = kind(robot, [hand, cc.PostureTask()], solver="sns", limits=slow)
    q, v = np.array(robot.home), np.zeros(7)
    for k in range(80):
        if k == 40:
            hand.target = circle(robot, 0.15, 0.5)
        command = controller.step(q, v, k * 1e-3)
        assert command.solution.status.name == "SCALED"
        late = k * 1e-3 - controller.step_times[0]
        assert late == 0.0 if k <= 40 else late > 1e-4
        assert controller.step_times[1] == k * 1e-3
        q, v = robot.integrate(q, command.velocity * 1e-3), command.velocity


def test_what_is_left_to_the_general_way():
    robot = cc.load("panda")
    hand = cc.FrameTask(robot.tool)
    for tasks, options in (
        (hand, {"solver": "pinv", "limits": None}),
        (hand, {"solver": "hqp"}),
        (hand, {"solver": "sns", "level": "acceleration"}),
        (hand, {"solver": "sns", "metric": "inertia"}),
        (hand, {"solver": "sns", "objective": cc.JointRange()}),
        (hand, {"solver": "sns", "singularity": "damp"}),
        (hand, {"solver": "sns", "jerk": True}),
        (hand, {"solver": "sns", "constraints": [cc.HalfSpace(robot.tool, [0.0, 0.0, -1.0], 0.0)]}),
        (cc.ComTask(), {"solver": "sns"}),
        (cc.FrameTask(robot.tool, expressed_in=robot.tool), {"solver": "sns"}),
        (cc.FrameTask(robot.tool, orientation="ZYZ"), {"solver": "sns"}),
    ):
        controller = cc.Controller(robot, tasks, **options)
        assert controller._stroke is None
        controller.step(robot.home + 0.1)
    floating = cc.load("talos", root_joint="free_flyer")
    assert cc.Controller(floating, cc.FrameTask(floating.tool), solver="sns")._stroke is None


def test_steps_leave_nothing_behind():
    """Thousands of steps take no more memory than one."""
    controller, _ = pair(cc.load("panda"), job(cc.load("panda"), target=circle(cc.load("panda"))), solver="sns")
    q, v = np.array(controller.robot.home), np.zeros(7)
    for k in range(200):
        controller.step(q, v, k * 1e-3)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for k in range(3000):
            controller.step(q, v, 0.2 + k * 1e-3)
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 4096
