"""Extended Jacobian: the rows that keep an objective extremal, the square solve, and closed paths that close."""

from __future__ import annotations

import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cartctl as cc
from cartctl import ExtendedJacobian, Problem, Status, solve
from cartctl.errors import CartctlError, CartctlWarning, ProblemError, UnsupportedProblem
from cartctl.levels.extremal import extremal_rows
from tests import oracles
from tests import tolerances as tol
from tests.robots_for_tests import kinova, panda, planar


class Bowl(cc.Objective):
    """``1/2 (q - c)^T S (q - c)`` on the joint coordinates, or its negative to climb."""

    def __init__(self, robot, centre, S, sign=1.0, gain=1.0):
        self.robot, self.centre, self.S, self.sign, self.gain = robot, centre, S, sign, gain

    def value(self, state):
        x = self.robot.coordinates(state.q) - self.centre
        return float(self.sign * 0.5 * x @ self.S @ x)

    def gradient(self, state):
        return self.sign * self.S @ (self.robot.coordinates(state.q) - self.centre)


class Hill(Bowl):
    maximise = True


class Manipulability(cc.Objective):
    """``sqrt(det(J J^T))`` of the tip of a planar arm, to be climbed."""

    maximise, gain = True, 1.0

    def __init__(self, robot):
        self.robot = robot

    def value(self, state):
        J = state.jacobian(self.robot.tool)[:2]
        return float(np.sqrt(np.linalg.det(J @ J.T)))

    def gradient(self, state, h=1e-5):
        def at(d):
            return self.value(self.robot.state(self.robot.integrate(state.q, d)))

        return np.array([(at(h * e) - at(-h * e)) / (2 * h) for e in np.eye(self.robot.nv)])


def bowl(robot, rng, cls=Bowl, **more):
    M = rng.normal(size=(robot.nv, robot.nv))
    return cls(robot, 0.3 * rng.normal(size=robot.nv), M @ M.T / robot.nv + np.eye(robot.nv), **more)


def jacobian(tasks, state):
    return np.vstack([task.jacobian(state) for task in tasks])


def projected_gradient(tasks, objective, state):
    """(I - J# J) grad H, with NumPy's pseudo-inverse."""
    J = jacobian(tasks, state)
    return objective.gradient(state) - np.linalg.pinv(J) @ (J @ objective.gradient(state))


def added_row_block(controller, q, v=None):
    """The last equation of the controller's problem: (A_e, b_e)."""
    equation = controller.step(q, v).solution.problem.equations[-1]
    return equation.A, equation.b


# ---------------------------------------------------------------- the added rows


SCENES = {
    "planar 3R, tip": (planar, lambda r: [cc.FrameTask(r.tool, "xy")]),
    "panda, pose": (panda, lambda r: [cc.FrameTask(r.tool)]),
    "panda, position": (panda, lambda r: [cc.FrameTask(r.tool, "position")]),
    "panda, two tasks": (panda, lambda r: [cc.FrameTask(r.tool, "position"), cc.FrameTask("panda_link5", "z")]),
    "kinova, position": (kinova, lambda r: [cc.FrameTask(r.tool, "position")]),
}


@pytest.mark.parametrize("scene", SCENES)
@settings(max_examples=5)
@given(seed=oracles.SEEDS)
def test_added_rows_by_finite_differences(scene, seed):
    """On the extremal set, A_e v is the rate of Z^T grad H along any motion v.

    Z_0^T (I - J# J) grad H has the same rate there as Z^T grad H in any smooth basis Z that starts at Z_0.
    """
    make, build = SCENES[scene]
    robot, rng = make(), np.random.default_rng(seed)
    tasks, objective = build(robot), bowl(make(), rng)
    controller = cc.Controller(robot, tasks, solver="extended-jacobian", objective=objective, limits=None)
    q = robot.integrate(robot.home, 0.2 * rng.normal(size=robot.nv))
    with warnings.catch_warnings():
        warnings.simplefilter("error", CartctlWarning)
        try:
            q = controller.start(q)
        except CartctlWarning:
            return
    here = robot.state(q)
    assert np.linalg.norm(projected_gradient(tasks, objective, here)) < 1e-8
    A, b = added_row_block(controller, q)
    m = jacobian(tasks, here).shape[0]
    assert A.shape == (robot.nv - m, robot.nv) and np.abs(b).max() < 1e-6
    h = 1e-5
    rates = []  # of the projected gradient, column by column
    for e in np.eye(robot.nv):
        ends = [projected_gradient(tasks, objective, robot.state(robot.integrate(q, s * h * e))) for s in (1, -1)]
        rates.append((ends[0] - ends[1]) / (2 * h))
    rates = np.array(rates).T
    # A_e = Z^T rates and rates = Z A_e, for one orthonormal Z: compare what does not depend on Z
    direct = extremal_rows(here, tasks, objective, robot.state(q)).A
    np.testing.assert_allclose(direct.T @ direct, rates.T @ rates, atol=1e-4 * (1.0 + np.linalg.norm(rates)) ** 2)
    v = rng.normal(size=robot.nv)
    assert np.linalg.norm(direct @ v) == pytest.approx(np.linalg.norm(rates @ v), rel=1e-4, abs=1e-5)
    unit = np.linalg.norm(A) / np.linalg.norm(rates)  # the level may bring H into the units of the task
    np.testing.assert_allclose(A.T @ A, unit**2 * rates.T @ rates, atol=1e-4 * (1.0 + np.linalg.norm(A)) ** 2)


@pytest.mark.parametrize("gain", [5.0, 20.0, 80.0])
def test_feedback_pulls_back_to_the_set(gain):
    """b_e = -K Z^T grad H: off the set, with the hand at rest, |Z^T grad H| decays as e^{-K t}."""
    robot, rng = planar(), np.random.default_rng(4)
    tasks, objective = [cc.FrameTask(robot.tool, "xy", gain=20.0)], bowl(planar(), rng)
    controller = cc.Controller(
        robot, tasks, solver=ExtendedJacobian(gain=gain), objective=objective, limits=None, dt=1e-4
    )
    q = controller.start(np.array([0.4, 0.8, 0.5]))
    J = robot.state(q).jacobian(robot.tool)[:2]
    z = np.linalg.svd(J)[2][-1]
    tasks[0].target = robot.state(q).placement(robot.tool)
    q = robot.integrate(q, 0.02 * z)
    slopes = []
    for k in range(int(1.0 / gain / 1e-4) + 1):
        slopes.append(np.linalg.norm(projected_gradient(tasks, objective, robot.state(q))))
        q = robot.integrate(q, controller.step(q, None, k * 1e-4).velocity * 1e-4)
    assert slopes[-1] / slopes[0] == pytest.approx(np.exp(-1.0), rel=0.1)


# ---------------------------------------------------------------- the algebra


@given(oracles.SEEDS, st.integers(1, 9))
def test_the_square_solve(seed, n):
    """Split into any equations, of any weight: n independent rows leave no choice."""
    rng = np.random.default_rng(seed)
    A, b, d = oracles.matrix(rng, n, n), rng.normal(size=n), rng.normal(size=n)
    cut = [int(rng.integers(0, n + 1))]
    equations = [
        cc.Equation(M, x, drift=y, weight=w)
        for M, x, y, w in zip(np.split(A, cut), np.split(b, cut), np.split(d, cut), (1.0, 3.0), strict=True)
    ]
    solution = solve(Problem(equations), "extended-jacobian")
    np.testing.assert_allclose(solution.u, np.linalg.solve(A, b - d), atol=tol.ORACLE)
    assert solution.status is Status.OPTIMAL


@given(oracles.SEEDS, st.integers(2, 9))
def test_too_few_rows_are_refused(seed, n):
    rng = np.random.default_rng(seed)
    m = int(rng.integers(0, n))
    p = Problem([(rng.normal(size=(m, n)), rng.normal(size=m))])
    with pytest.raises(UnsupportedProblem, match=f"'extended-jacobian' has {m} rows for {n} unknowns") as caught:
        solve(p, "extended-jacobian")
    line = str(caught.value)
    assert "\n" not in line and f"{n - m} equations" in line and "objective" in line


@given(oracles.SEEDS)
def test_rows_without_weight_do_not_fill_the_matrix(seed):
    """An equation of weight 0 is left out of the stack, so it cannot make up the number."""
    rng = np.random.default_rng(seed)
    task = cc.Equation(oracles.matrix(rng, 2, 3), rng.normal(size=2))
    off = cc.Equation(rng.normal(size=(1, 3)), rng.normal(size=1), weight=0.0)
    with pytest.raises(UnsupportedProblem, match="2 rows for 3 unknowns"):
        solve(Problem([task, off]), "extended-jacobian")


@pytest.mark.parametrize("name", ["extended-jacobian", "pinv", "dls", "projected-gradient", "main-variables"])
@given(seed=oracles.SEEDS)
def test_more_added_rows_than_n_minus_m(name, seed):
    """They disturb the task, which is a status of its own; as many as fit do not."""
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, 3, 5), rng.normal(size=3)
    fit, many = (oracles.matrix(rng, k, 5) for k in (2, 3))
    solution = solve(Problem([(A, b), (many, rng.normal(size=3))]), name)
    near = np.linalg.svd(np.vstack([A, many]))[1][-1] < 0.02  # there damping holds back more than the rows disturb
    assert solution.status is Status.OVERDETERMINED or (name == "dls" and near), solution
    if name != "main-variables":
        assert solution.residuals[0] > 1e-6
    if name != "dls":
        assert solve(Problem([(A, b), (fit, rng.normal(size=2))]), name).status is Status.OPTIMAL
        x = rng.normal(size=5)
        assert solve(Problem([(A, A @ x), (many, many @ x)]), name).status is Status.OPTIMAL


@given(oracles.SEEDS)
def test_algorithmic_singularities_are_singular(seed):
    rng = np.random.default_rng(seed)
    A = oracles.matrix(rng, 3, 5)
    added = np.vstack([A[0] + A[1], rng.normal(size=5)])
    solution = solve(Problem([(A, rng.normal(size=3)), (added, rng.normal(size=2))]), "extended-jacobian")
    assert solution.status is Status.SINGULAR and np.linalg.norm(solution.u) < 1e4


# ---------------------------------------------------------------- the controller


def test_an_objective_is_required():
    robot = planar()
    with pytest.raises(ProblemError, match="'extended-jacobian' has no objective"):
        cc.Controller(robot, cc.FrameTask(robot.tool, "xy"), solver="extended-jacobian", limits=None)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), "fast"])
def test_bad_gains_are_named(value):
    with pytest.raises(CartctlError, match="gain"):
        ExtendedJacobian(gain=value)


@pytest.mark.parametrize("cls, sign", [(Bowl, 1.0), (Hill, -1.0)])
@settings(max_examples=8)
@given(seed=oracles.SEEDS)
def test_the_start_is_projected(cls, sign, seed):
    """The hand stays, the projected gradient vanishes, H is at an optimum of the right kind; targets are left alone."""
    robot, rng = panda(), np.random.default_rng(seed)
    objective = bowl(robot, rng, cls, sign=sign)
    task = cc.FrameTask(robot.tool, "position", target=np.array([0.4, 0.1, 0.5]))
    controller = cc.Controller(robot, task, solver="extended-jacobian", objective=objective, limits=None)
    q0 = robot.integrate(robot.home, 0.2 * rng.normal(size=7))
    kept = q0.copy()
    q = controller.start(q0)
    before, after = robot.state(q0), robot.state(q)
    np.testing.assert_array_equal(q0, kept)
    np.testing.assert_array_equal(task.target, [0.4, 0.1, 0.5])
    np.testing.assert_allclose(after.position(robot.tool), before.position(robot.tool), atol=1e-9)
    assert np.linalg.norm(projected_gradient([task], objective, after)) < 1e-8
    assert sign * objective.value(after) <= sign * objective.value(before) + 1e-12
    J = jacobian([task], after)
    Z = np.linalg.svd(J)[2][3:]
    for z in Z:  # no self-motion betters it: along the arc, corrected back to the hand's place
        for step in (0.01, -0.01):
            near = robot.integrate(q, step * z)
            for _ in range(4):
                gap = after.position(robot.tool) - robot.state(near).position(robot.tool)
                near = robot.integrate(near, np.linalg.pinv(robot.state(near).jacobian(robot.tool)[:3]) @ gap)
            assert sign * objective.value(robot.state(near)) >= sign * objective.value(after) - 1e-10


def test_the_start_of_other_solvers_is_where_it_was():
    robot = planar()
    controller = cc.Controller(
        robot, cc.FrameTask(robot.tool, "xy"), solver="projected-gradient", objective=cc.JointRange(), limits=None
    )
    q0 = np.array([0.4, 0.8, 0.5])
    np.testing.assert_array_equal(controller.start(q0), q0)


def test_climbing_ends_where_descending_the_negative_does():
    robot, rng = planar(), np.random.default_rng(9)
    down = bowl(robot, rng)
    up = Hill(robot, down.centre, down.S, sign=-1.0)
    task, q0 = cc.FrameTask(robot.tool, "xy"), np.array([0.4, 0.8, 0.5])
    ends = [
        cc.Controller(robot, task, solver="extended-jacobian", objective=objective, limits=None).start(q0)
        for objective in (down, up)
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-8)


def test_manipulability_is_climbed_and_kept():
    """A maximised objective, with central differences throughout: a planar 3R stays at the best posture of each tip."""
    robot = planar()
    objective = Manipulability(robot)
    q0 = np.array([0.3, 0.9, 0.9])
    start = robot.state(q0).position(robot.tool)
    path = cc.Line(start, start + np.array([0.1, -0.2, 0.0]), duration=0.5)
    task = cc.FrameTask(robot.tool, "xy", target=path)
    controller = cc.Controller(robot, task, solver="extended-jacobian", objective=objective, limits=None, dt=5e-3)
    run = cc.simulate(controller, q0, 0.5)
    for q in run.q[::25]:
        state = robot.state(q)
        z = np.linalg.svd(state.jacobian(robot.tool)[:2])[2][-1]
        assert abs(z @ objective.gradient(state)) < 1e-3
    assert objective.value(robot.state(run.q[0])) > objective.value(robot.state(q0))


def test_more_tasks_than_joints_is_overdetermined():
    """The tip, its angle and another point: five rows on three joints, and no room for an objective."""
    robot = planar()
    frames = [f for f in robot.frame_names if f != robot.tool]
    tasks = [
        cc.FrameTask(robot.tool, "x y rz", target=np.array([1.0, 0.5, 0.0])),
        cc.FrameTask(frames[-1], "xy", target=np.array([-1.0, 0.3, 0.0])),
    ]
    controller = cc.Controller(robot, tasks, solver="extended-jacobian", objective=cc.JointRange(), limits=None)
    solution = controller.step(np.array([0.4, 0.8, 0.5])).solution
    assert solution.status is Status.OVERDETERMINED and solution.residuals.max() > 1e-3


# ---------------------------------------------------------------- closed paths


def steady_circle(centre, radius, period, rotation=None):
    """Round and round at constant speed: every lap is like the one before."""
    rate = 2.0 * np.pi / period

    def at(t):
        c, s = np.cos(rate * t), np.sin(rate * t)
        velocity = radius * rate * np.array([-s, c, 0.0])
        return SimpleNamespace(
            position=centre + radius * np.array([c, s, 0.0]),
            rotation=rotation,
            twist=np.concatenate([velocity, np.zeros(3)]),
            acceleration=np.concatenate([-radius * rate**2 * np.array([c, s, 0.0]), np.zeros(3)]),
        )

    return at


def laps(robot, axes, solver, radius, period=1.0, dt=2e-3, count=5):
    """Configurations at the start of each lap and at the end of the last, after half a lap of running in."""
    tip = robot.state(robot.home)
    rotation = tip.rotation(robot.tool) if axes == "pose" else None
    path = steady_circle(tip.position(robot.tool) - [radius, 0.0, 0.0], radius, period, rotation)
    task = cc.FrameTask(robot.tool, axes, target=path)
    objective = cc.JointRange(gain=10.0) if solver == "extended-jacobian" else None
    controller = cc.Controller(robot, task, solver=solver, objective=objective, limits=None, dt=dt)
    run = cc.simulate(controller, robot.home, (count + 1) * period)
    per_lap = round(period / dt)
    return run, [run.q[k * per_lap] for k in range(1, count + 2)]


CIRCLES = {
    "planar 3R": (lambda: cc.load("planar3R"), "xy", 0.3),
    "panda, pose": (panda, "pose", 0.1),
    "panda, position": (panda, "position", 0.1),
}


@pytest.mark.parametrize("name", CIRCLES)
def test_closed_task_paths_give_closed_joint_paths(name):
    """To 1e-6 rad over five laps; the pseudo-inverse drifts by more than a thousand times that."""
    make, axes, radius = CIRCLES[name]
    robot = make()
    run, starts = laps(robot, axes, "extended-jacobian", radius)
    drift = max(np.abs(robot.difference(starts[0], q)).max() for q in starts[1:])
    assert drift < 1e-6
    assert set(run.status) == {"OPTIMAL"}
    assert np.linalg.norm(run.tasks[0].error[500:], axis=1).max() < 2e-3
    plain, starts = laps(robot, axes, "pinv", radius)
    assert np.abs(robot.difference(starts[0], starts[-1])).max() > 1e-3
    assert np.linalg.norm(plain.tasks[0].error[500:], axis=1).max() < 2e-3


@pytest.mark.parametrize("name", CIRCLES)
def test_from_rest_to_rest(name):
    """cc.Circle rests at both ends: once at rest again, the joints are where they started."""
    make, axes, radius = CIRCLES[name]
    robot = make()
    tip = robot.state(robot.home).position(robot.tool)
    path = cc.Circle(tip - np.array([radius, 0.0, 0.0]), radius=radius, period=0.5, laps=5)
    task = cc.FrameTask(robot.tool, axes, target=path)
    ends = {}
    for solver in ("extended-jacobian", "pinv"):
        objective = cc.JointRange(gain=10.0) if solver == "extended-jacobian" else None
        controller = cc.Controller(robot, task, solver=solver, objective=objective, limits=None, dt=2e-3)
        run = cc.simulate(controller, robot.home, path.duration + 0.6)
        ends[solver] = np.abs(robot.difference(run.q[0], run.q[-1])).max()
    assert ends["extended-jacobian"] < 1e-6 and ends["pinv"] > 1e-3
