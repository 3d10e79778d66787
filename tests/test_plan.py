"""Plans as their users meet them: tasks, limits, ends, the run and its report."""

from __future__ import annotations

import json

import numpy as np
import pytest

import cartctl as cc
from cartctl.errors import (
    ConfigurationError,
    NoTasksError,
    ParameterError,
    ProblemError,
    ShapeError,
    SolverNotFound,
    TargetError,
    TimeStepError,
)
from tests.plans_for_tests import circle
from tests.robots_for_tests import kinova, panda, planar

MET = 1e-6  # m and rad at samples
CLOSED = 1e-8  # rad
HELD = 1e-9  # of a limit's half-range


def limits_kept(plan: cc.Plan, limits: cc.Limits, rest: bool = True) -> None:
    """Position, velocity, acceleration at every sample, worked out from q alone."""
    robot, h = plan.robot, plan.meta["dt"]
    v = np.array([robot.difference(a, b) for a, b in zip(plan.q[:-1], plan.q[1:], strict=True)]) / h
    still = np.zeros((1, robot.nv))
    chain = np.concatenate([still, v, still]) if rest else v
    for name, values in (
        ("position", np.array([robot.coordinates(q) for q in plan.q])),
        ("velocity", v),
        ("acceleration", np.diff(chain, axis=0) / h),
    ):
        low, high = getattr(limits, f"{name}_lower"), getattr(limits, f"{name}_upper")
        room = HELD * np.where(np.isfinite(high - low), high - low, 1.0)
        assert (values >= low - room).all() and (values <= high + room).all(), name


def met(plan: cc.Plan, task: cc.FrameTask) -> float:
    """The largest error norm at a sample, from the poses themselves."""
    worst = 0.0
    for q, t in zip(plan.q, plan.time.tolist(), strict=True):
        pose, wanted = plan.robot.state(q).placement(task.frame), task.target(t)
        worst = max(worst, float(np.linalg.norm(wanted.position - pose.translation)))
        if wanted.rotation is not None:
            worst = max(worst, float(np.linalg.norm(wanted.rotation - pose.rotation)))
    return worst


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("free", [False, True])
def test_a_pandas_circle(closed: bool, free: bool) -> None:
    robot = panda()
    hand = circle(robot, 0.15, period=3.0)
    plan = cc.plan(robot, hand, samples=60, closed=closed, q0=None if free else robot.home, methods=("pinv",))
    report = plan.report
    assert report.status is cc.PlanStatus.OPTIMAL and report.feasible, report.message
    assert met(plan, hand) < MET and max(report.residual) < MET
    limits_kept(plan, robot.limits)
    if closed:
        assert np.linalg.norm(robot.difference(plan.q[0], plan.q[-1])) < CLOSED
        assert report.closure < CLOSED and report.drift < CLOSED
    if not free:
        assert np.array_equal(plan.q[0], robot.home)
    if not closed:
        assert report.cost < report.best.cost
    assert report.history[-1].slope < 1e-6


def test_what_is_free_costs_less() -> None:
    """Dropping a constraint never costs more: closed and fixed >= closed >= free, fixed >= free."""
    robot = panda()
    hand = circle(robot, 0.12, period=3.0)
    cost = {
        (closed, fixed): cc.plan(
            robot, hand, samples=40, closed=closed, q0=robot.home if fixed else None, methods=("pinv",)
        ).report.cost
        for closed in (False, True)
        for fixed in (False, True)
    }
    slack = 1.0 + 1e-6
    assert cost[True, True] * slack >= cost[True, False] and cost[True, False] * slack >= cost[False, False]
    assert cost[True, True] * slack >= cost[False, True] and cost[False, True] * slack >= cost[False, False]


@pytest.mark.parametrize(("make", "axes"), [(panda, "pose"), (kinova, "position")])
def test_tight_limits_bind_and_hold(make, axes: str) -> None:
    """Continuous joints among them; the unlimited plan breaks these limits, the limited one touches and keeps them."""
    robot = make()
    hand = circle(robot, 0.12, period=3.0, axes=axes)
    loose = cc.plan(robot, hand, samples=50, limits=None, q0=robot.home, methods=("pinv",))
    speed, rate = np.abs(loose.v).max(axis=0), np.abs(np.diff(loose.v, axis=0)).max(axis=0) / loose.meta["dt"]
    limits = robot.limits.replace(
        velocity_upper=0.97 * speed + 0.05, velocity_lower=-0.97 * speed - 0.05,
        acceleration_upper=0.97 * rate.max() * np.ones(robot.nv), acceleration_lower=-0.97 * rate.max(),
    )  # fmt: skip
    tight = cc.plan(robot, hand, samples=50, limits=limits, q0=robot.home, methods=("pinv",), starts=[loose])
    assert tight.report.feasible, tight.report.message
    limits_kept(tight, limits)
    assert met_position(tight, hand) < MET
    assert tight.report.cost >= loose.report.cost * (1.0 - 1e-9)
    assert tight.report.qps > 0 and tight.report.osqp_iterations > 0
    assert -1e-2 < tight.report.excess <= 0.0


@pytest.mark.parametrize("seed", range(4))
def test_errors_between_samples_stay_below_their_bound(seed: int) -> None:
    robot, rng = panda(), np.random.default_rng(seed)
    hand = circle(robot, rng.uniform(0.05, 0.2), period=rng.uniform(2.0, 5.0))
    plan = cc.plan(robot, hand, samples=int(rng.integers(15, 60)), limits=None, methods=("pinv",))
    h, worst = plan.meta["dt"], np.zeros(2)
    for k, v in enumerate(plan.command):
        for share in np.linspace(0.0, 1.0, 11)[1:-1]:
            pose = robot.state(robot.integrate(plan.q[k], share * h * v)).placement(robot.tool)
            wanted = hand.target(float(plan.time[k] + share * h))
            worst[0] = max(worst[0], np.linalg.norm(wanted.position - pose.translation))
            worst[1] = max(worst[1], np.linalg.norm(cc.spatial.log3(wanted.rotation @ pose.rotation.T)))
    bound = np.array(plan.report.between)
    assert (worst <= bound).all() and (worst >= 0.1 * bound).all()


def test_the_run_is_a_run(tmp_path) -> None:
    robot = panda()
    hand = circle(robot, 0.1)
    plan = cc.plan(robot, [hand, cc.PostureTask(weight=0.01)], samples=25, methods=("pinv",))
    assert isinstance(plan, cc.Run) and len(plan) == 24 and set(plan.status) == {"OPTIMAL"}
    for k in range(24):
        assert np.allclose(robot.integrate(plan.q[k], plan.meta["dt"] * plan.command[k]), plan.q[k + 1], atol=1e-12)
    figures = plan.metrics()
    assert figures.tasks[0].max_m < MET and figures.violations == 0 and len(figures.tasks) == 2
    again = cc.Run.load(plan.save(tmp_path / "plan.npz"))
    assert np.array_equal(again.q, plan.q) and again.meta["plan"]["cost"] == plan.report.cost
    assert json.dumps(again.meta["plan"])
    assert plan.html(tmp_path / "plan.html").stat().st_size > 1e5
    plan.plot(tmp_path / "plan.png"), plan.report.plot(tmp_path / "report.png"), plan.report.plot()
    assert (tmp_path / "plan.png").stat().st_size > 1e4 < (tmp_path / "report.png").stat().st_size
    text = str(plan.report)
    assert "OPTIMAL" in text and "pinv" in text and "kinetic energy" in text


def test_the_local_view() -> None:
    """Costs by the plan's quadrature, drift over a lap, who keeps the limits."""
    robot = panda()
    hand = circle(robot, 0.15, period=3.0)
    held = cc.Controller(robot, hand, solver="dls", limits=None, dt=3.0 / 59 / 10)
    plan = cc.plan(robot, hand, samples=60, q0=robot.home, closed=True, methods=["pinv", held, held, "pinv"])
    report = plan.report
    assert [m.name for m in report.local] == ["pinv", "dls", "dls (2)", "pinv (2)"]
    for method in report.local:
        run = method.run
        every = round(plan.meta["dt"] / run.meta["dt"])
        Q = run.q[::every]
        V = np.diff(Q, axis=0) / plan.meta["dt"]
        M = np.array([robot.state(q).mass_matrix for q in Q])
        energy = 0.25 * plan.meta["dt"] * np.einsum("ki,kij,kj->", V, M[:-1] + M[1:], V)
        assert method.cost == pytest.approx(energy, rel=1e-12)
        assert method.drift == pytest.approx(np.linalg.norm(robot.difference(run.q[0], run.q[-1])), rel=1e-9)
        assert method.drift > 0.1 and method.on_task and method.keeps
    assert report.drift < CLOSED
    assert report.best is min(report.local, key=lambda m: m.cost)
    assert report.gap == pytest.approx((report.best.cost - report.cost) / report.best.cost)


def test_laps_and_starts() -> None:
    """Over two laps the drift is the larger one; a start of the caller's is taken up."""
    robot = planar()
    q0 = np.array([0.3, 0.9, -1.2])
    p0 = robot.state(q0).position("tool")
    tip = cc.FrameTask("tool", "xy", target=cc.Circle.starting_at(p0, radius=0.2, period=2.0, laps=2))
    plan = cc.plan(robot, tip, samples=41, q0=q0, objective="joint-speed", methods=("pinv",))
    assert plan.meta["cycles"] == [0.0, 2.0, 4.0]
    laps = [np.linalg.norm(plan.q[b] - plan.q[a]) for a, b in ((0, 20), (20, 40))]
    assert plan.report.drift == pytest.approx(max(laps))
    again = cc.plan(robot, tip, samples=41, q0=q0, objective="joint-speed", methods=(), starts=[plan, plan.q[::2]])
    assert again.report.cost == pytest.approx(plan.report.cost, rel=1e-6)
    assert {"start 1", "start 2"} <= {s.name for s in again.report.starts}
    assert again.report.best is None and again.report.gap is None


@pytest.mark.parametrize(
    "objective",
    ["joint-range", "inverse-manipulability", "torque", "self-clearance"],
)
def test_every_named_objective_is_improved(objective: str) -> None:
    """Beside a little speed, so that the path has no reason to jump: never above the start, most often well below."""
    robot = panda()
    hand = circle(robot, 0.1, period=3.0)
    plan = cc.plan(robot, hand, samples=20, objective=objective, methods=("pinv",), iterations=15)
    assert plan.report.feasible, plan.report.message
    limits_kept(plan, robot.limits)
    assert plan.report.cost < plan.report.local[0].cost


def test_clearance_of_a_scene() -> None:
    robot = panda()
    elbow = robot.state(robot.home).position("panda_link4")
    scene = cc.Scene().sphere("ball", 0.06, at=elbow + [0.0, 0.16, 0.0])
    clearance = cc.Clearance(scene, points=["panda_link4"], within=0.4)
    hand = circle(robot, 0.05, period=2.0)
    objective = cc.JointSpeed() + 20.0 * clearance
    near = cc.plan(robot, hand, samples=15, objective="joint-speed", methods=("pinv",), q0=robot.home)
    far = cc.plan(robot, hand, samples=15, objective=objective, methods=("pinv",), q0=robot.home)
    mean = [np.mean([clearance.value(robot.state(q)) for q in plan.q]) for plan in (near, far)]
    assert mean[1] > mean[0] + 0.01 and far.report.feasible


def test_least_squares_tasks_are_a_part_of_the_cost() -> None:
    robot = panda()
    hand = circle(robot, 0.1, period=3.0)
    away = [
        np.linalg.norm(
            cc.plan(robot, [hand, cc.PostureTask(weight=w)], samples=20, methods=("pinv",)).q - robot.home, axis=1
        ).mean()
        for w in (0.0, 100.0)
    ]
    assert away[1] < away[0]


def test_two_degrees_left() -> None:
    """A position alone: four directions are free, and the plan still beats the local methods."""
    robot = panda()
    hand = circle(robot, 0.15, period=3.0, axes="position")
    plan = cc.plan(robot, hand, samples=30, q0=robot.home, objective="joint-speed", methods=("pinv",))
    assert plan.report.feasible and plan.report.cost < plan.report.best.cost and met_position(plan, hand) < MET


def met_position(plan: cc.Plan, task: cc.FrameTask) -> float:
    return max(
        float(np.linalg.norm(task.target(t).position - plan.robot.state(q).position(task.frame)))
        for q, t in zip(plan.q, plan.time.tolist(), strict=True)
    )


def test_no_degree_left_is_inverse_kinematics() -> None:
    robot = cc.planar([1.0, 0.7])
    q0 = np.array([0.4, 1.1])
    p0 = robot.state(q0).position("tool")
    tip = cc.FrameTask("tool", "xy", target=cc.Line(p0, p0 + [-0.3, 0.2, 0.0], duration=2.0))
    plan = cc.plan(robot, tip, samples=20, q0=q0, methods=("pinv",))
    assert plan.report.status is cc.PlanStatus.OPTIMAL and met_position(plan, tip) < MET


def test_a_moving_base_and_a_held_task() -> None:
    """Tangent spaces that turn; and a second task that holds what it found, beside the path."""
    robot = cc.load("panda", root_joint="planar")
    hand = circle(robot, 0.2, period=3.0)
    base = cc.FrameTask("panda_link0", "z rz", name="heading")
    plan = cc.plan(robot, [hand, base], samples=20, objective="joint-speed", q0=robot.home, methods=("pinv",))
    assert plan.report.feasible, plan.report.message
    assert met(plan, hand) < MET
    assert plan.report.cost < plan.report.best.cost
    held = robot.state(robot.home).rotation("panda_link0")
    assert max(np.abs(robot.state(q).rotation("panda_link0") - held).max() for q in plan.q) < MET


def test_misuse_is_refused() -> None:
    robot, free = planar(), cc.FrameTask("tool", "xy", target=[1.0, 0.5, 0.0])
    q0 = np.array([0.3, 0.9, -1.2])
    tip = cc.FrameTask("tool", "xy", target=cc.Line(robot.state(q0).position("tool"), [1.0, 0.5, 0.0], duration=1.0))
    scene = cc.Scene().sphere("ball", 0.1, at=[3.0, 0.0, 0.0])
    for error, call in {
        "tasks": (ProblemError, lambda: cc.plan(robot, 3)),
        "empty": (NoTasksError, lambda: cc.plan(robot, [])),
        "soft": (NoTasksError, lambda: cc.plan(robot, [cc.PostureTask()], duration=1.0)),
        "clearance": (ProblemError, lambda: cc.plan(robot, [tip, cc.ClearanceTask(scene)])),
        "robot": (ParameterError, lambda: cc.plan("panda", tip)),
        "duration": (ParameterError, lambda: cc.plan(robot, free)),
        "negative": (TimeStepError, lambda: cc.plan(robot, tip, duration=-1.0)),
        "samples": (ParameterError, lambda: cc.plan(robot, tip, samples=2)),
        "samples type": (ParameterError, lambda: cc.plan(robot, tip, samples=20.5)),
        "objective": (ParameterError, lambda: cc.plan(robot, tip, objective="speed")),
        "limits": (ParameterError, lambda: cc.plan(robot, tip, limits=3.0)),
        "limits size": (ShapeError, lambda: cc.plan(robot, tip, limits=panda().limits)),
        "closed": (ParameterError, lambda: cc.plan(robot, tip, closed="yes")),
        "not closed": (TargetError, lambda: cc.plan(robot, tip, closed=True)),
        "q0": (TargetError, lambda: cc.plan(robot, tip, q0=[0.0, 1.0, 0.0])),
        "q0 shape": (ShapeError, lambda: cc.plan(robot, tip, q0=[0.0, 1.0])),
        "method": (SolverNotFound, lambda: cc.plan(robot, tip, methods=["pinvv"])),
        "methods": (ParameterError, lambda: cc.plan(robot, tip, methods=3)),
        "starts": (ShapeError, lambda: cc.plan(robot, tip, starts=[np.zeros((5, 2))])),
        "iterations": (ParameterError, lambda: cc.plan(robot, tip, iterations=0)),
        "progress": (ParameterError, lambda: cc.plan(robot, tip, progress=3)),
    }.values():
        with pytest.raises(error):
            call()
    slow = cc.FrameTask("tool", "xy", gain=1.0, target=tip.target)
    with pytest.raises(ParameterError, match="whole part"):
        cc.plan(robot, tip, methods=[cc.Controller(robot, slow, limits=None, dt=0.3)])
    with pytest.raises(ConfigurationError):
        cc.plan(kinova(), circle(kinova(), 0.1), q0=np.zeros(kinova().nq))


def test_the_callers_tasks_stay_as_they_are() -> None:
    robot = planar()
    q0 = np.array([0.3, 0.9, -1.2])
    path = cc.Line(robot.state(q0).position("tool"), [1.0, 0.5, 0.0], duration=1.0)
    tip = cc.FrameTask("tool", "xy", target=path)
    told: list[str] = []
    cc.plan(robot, tip, samples=10, q0=q0, methods=("pinv",), progress=told.append)
    assert tip.target is path and tip._path is path
    assert any("pinv" in words for words in told) and any("search" in words for words in told)
