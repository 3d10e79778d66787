"""The acceleration level: its formulas at random states, how errors decay, and rollouts by its own integrator."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pyarrow.csv
import pytest
from scipy.integrate import trapezoid

import cartctl as cc
from cartctl.errors import NonFiniteError, ParameterError, ShapeError, UnsupportedProblem
from cartctl.levels import Secondary, get_level, levels
from cartctl.motion.integrate import by_acceleration, by_velocity
from tests import oracles
from tests.robots_for_tests import ROBOTS, panda, planar, random_state
from tests.test_simulate import circling
from tests.worked_examples import ITEMS, real


def problem_of(level: cc.AccelerationLevel, state: cc.State, tasks: list[cc.Task], **secondary: object) -> cc.Problem:
    anchors = [task.anchor(state) for task in tasks]
    return level.problem(state, tasks, [0.0] * len(tasks), anchors, Secondary(**secondary), None)[0]


def moving_target(rng: np.random.Generator) -> SimpleNamespace:
    parts = {"position": rng.normal(size=3), "rotation": oracles.random_rotation(rng)}
    return SimpleNamespace(**parts, twist=rng.normal(size=6), acceleration=rng.normal(size=6))


# ---------------------------------------------------------------- the formulas


@pytest.mark.parametrize("name", list(ROBOTS))
@pytest.mark.parametrize("gain", [7.0, np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])])
def test_the_command_is_the_textbook_formula(name: str, gain: float | np.ndarray) -> None:
    robot, rng = ROBOTS[name](), np.random.default_rng(1)
    state, target = random_state(robot, rng), moving_target(rng)
    task = cc.FrameTask(robot.tool, gain=gain, target=lambda t: target)
    equation = problem_of(cc.AccelerationLevel(), state, [task]).equations[0]
    K_p, K_d = np.diag(gain**2 * np.ones(6)), np.diag(2.0 * gain * np.ones(6))
    e = task.reference(state, 0.0, None).error
    e_dot = target.twist - state.jacobian(robot.tool) @ state.v
    np.testing.assert_allclose(equation.b, target.acceleration + K_d @ e_dot + K_p @ e, rtol=1e-12)
    np.testing.assert_array_equal(equation.A, state.jacobian(robot.tool))
    np.testing.assert_array_equal(equation.drift, state.drift(robot.tool))


def tasks_on(robot: cc.Robot) -> list[cc.Task]:
    tasks = [cc.FrameTask(robot.tool, "pose"), cc.FrameTask(robot.tool, "x rz"), cc.ComTask("xy"), cc.PostureTask()]
    if robot.tool in ("panda_hand_tcp", "tool"):
        base = "panda_link2" if robot.tool == "panda_hand_tcp" else "joint1"
        tasks.append(cc.RelativeFrameTask(robot.tool, base, "position"))
    return tasks


@pytest.mark.parametrize("name", list(ROBOTS))
def test_the_drift_is_the_rest_of_a_steps_acceleration(name: str) -> None:
    """d(J v)/dt along a step of the simulation, by central differences, is J u + d: sign and size."""
    robot, rng, h = ROBOTS[name](), np.random.default_rng(2), 1e-5
    state, u = random_state(robot, rng), rng.normal(size=robot.nv)
    tasks = tasks_on(robot)
    equations = problem_of(cc.AccelerationLevel(), state, tasks).equations
    ends = [robot.state(*by_acceleration(robot, state.q, state.v, u, sign * h)) for sign in (1.0, -1.0)]
    for task, equation in zip(tasks, equations, strict=True):
        ahead, behind = (task.jacobian(end) @ end.v for end in ends)
        measured = (ahead - behind) / (2.0 * h)
        np.testing.assert_allclose(equation.A @ u + equation.drift, measured, atol=1e-6 * (1.0 + abs(measured).max()))
    assert max(np.abs(e.drift).max() for e in equations) > 1e-2


def test_a_task_at_rest_gets_no_rates() -> None:
    """Reference rates of None stand for zero; a fit and a weight go along."""
    robot = planar()
    state = robot.state([0.3, 0.4, 0.5], [0.1, -0.2, 0.3])
    task = cc.FrameTask("tool", "xy", gain=3.0, target=[1.0, 0.5, 0.0], fit="least_squares", weight=2.0)
    equation = problem_of(cc.AccelerationLevel(), state, [task]).equations[0]
    e = np.array([1.0, 0.5]) - state.position("tool")[:2]
    np.testing.assert_allclose(equation.b, 9.0 * e - 6.0 * state.twist("tool")[:2], rtol=1e-12)
    assert (equation.fit, equation.weight) == ("least_squares", 2.0)


@pytest.mark.parametrize("damping", [0.0, 2.0, np.array([1.0, 2.0, 3.0])])
def test_the_reference_is_the_gradient_less_the_damping(damping: float | np.ndarray) -> None:
    robot = planar()
    state = robot.state([0.3, 0.4, 0.5], [0.1, -0.2, 0.3])
    level, objective = cc.AccelerationLevel(damping=damping), cc.JointRange(gain=5.0)
    tasks = [cc.FrameTask("tool", "xy")]
    both = problem_of(level, state, tasks, objective=objective, share=0.5).reference
    np.testing.assert_allclose(both, -2.5 * objective.gradient(state) - damping * state.v, rtol=1e-12)
    alone = problem_of(level, state, tasks).reference
    if np.any(damping):
        np.testing.assert_allclose(alone, -damping * state.v)
    else:
        assert alone is None


def test_what_it_cannot_do_is_refused_in_words() -> None:
    robot = planar()
    task = cc.FrameTask("tool", "xy")
    with pytest.raises(UnsupportedProblem, match="extremal"):
        cc.Controller(robot, task, "extended-jacobian", "acceleration", limits=None, objective=cc.JointRange(gain=1.0))
    with pytest.raises(UnsupportedProblem, match="damping"):
        cc.Controller(robot, task, "pinv", cc.AccelerationLevel(damping=1.0), limits=None)
    wrong = cc.Controller(robot, task, "dls", cc.AccelerationLevel(damping=[1.0, 2.0]), limits=None)
    with pytest.raises(ShapeError, match="damping"):
        wrong.step(np.zeros(3))
    for damping, error in ((-1.0, ParameterError), ([1.0, -1.0], ParameterError), (np.nan, NonFiniteError)):
        with pytest.raises(error, match="damping"):
            cc.AccelerationLevel(damping=damping)
    with pytest.raises(NonFiniteError, match="the command of task 'tool'"):
        held(robot, np.zeros(3), np.zeros(3), pdd=[np.inf, 0.0])


def test_the_level_is_known_by_name_and_commands_accelerations() -> None:
    assert levels()[:2] == ["velocity", "acceleration"]
    assert isinstance(get_level("acceleration"), cc.AccelerationLevel)
    robot = planar()
    command = cc.Controller(robot, cc.FrameTask("tool", "xy"), level="acceleration", limits=None).step(np.ones(3))
    assert command.velocity is None and command.told is command.acceleration
    np.testing.assert_array_equal(command.acceleration, command.solution.u)


# ---------------------------------------------------------------- published exercises, through robots


def held(robot: cc.Robot, q: np.ndarray, v: np.ndarray, *more: cc.Task, axes: str = "xy", **options: object):
    """The tip's acceleration alone, no feedback: what ``pdd`` asks for, zero where it is not given."""
    at, pdd = np.zeros(6), options.pop("pdd", None)
    if pdd is not None:
        at[: len(pdd)] = pdd
    target = SimpleNamespace(position=None, rotation=None, twist=np.zeros(6), acceleration=at)
    task = cc.FrameTask("tool", axes, gain=0.0, target=lambda t: target)
    options = {"solver": "pinv", "level": "acceleration"} | options
    return cc.Controller(robot, [task, *more], limits=None, **options).step(q, v)


def agrees(item: dict, key: str, computed: np.ndarray) -> None:
    tolerance = item["tolerance"]
    tolerance = tolerance.get(key, tolerance["*"]) if isinstance(tolerance, dict) else tolerance
    assert key in item["checked_keys"]
    np.testing.assert_allclose(computed, item["expected"][key], rtol=0.0, atol=tolerance, err_msg=key)


def test_damped_accelerations_of_a_planar_4r() -> None:
    """u0 = -q_dot, with and without a rate for the last link's angle."""
    item = ITEMS["r2-2022-02-03-ex2"]
    given = item["inputs"]
    robot, q, v = cc.planar(given["L"]), real(given["q"]), np.array(given["qdot"], dtype=float)
    options = {"solver": "projected-gradient", "level": cc.AccelerationLevel(damping=1.0), "pdd": given["pdd"]}
    angle = cc.FrameTask("tool", "rz", gain=0.0, name="angle")
    agrees(item, "ddq_a", held(robot, q, v, **options).acceleration)
    agrees(item, "ddq_b", held(robot, q, v, angle, **options).acceleration)


@pytest.mark.parametrize("case", [1, 2, 3, 4])
def test_a_tip_kept_from_accelerating(case: int) -> None:
    item = ITEMS["r2-2021-07-12-ex1"]
    given = item["inputs"]
    q, v = real(given[f"case{case}"]["q"]), real(given[f"case{case}"]["qd"])
    command = held(cc.planar(given["L"] if isinstance(given["L"], list) else [given["L"]] * 3), q, v)
    agrees(item, f"h{case}", command.solution.problem.equations[0].drift)
    agrees(item, f"u{case}", command.acceleration)
    assert (command.solution.status is cc.Status.SINGULAR) == (case > 2)


def test_a_planar_4r_at_rest() -> None:
    item = ITEMS["r2-2018-07-11-ex2"]
    given = item["inputs"]
    command = held(cc.planar(given["L"]), real(given["q"]), np.zeros(4), pdd=given["a"])
    agrees(item, "ddq_pinv", command.acceleration)


@pytest.mark.parametrize("singular", [False, True])
def test_a_spatial_elbow_in_motion(singular: bool) -> None:
    item = ITEMS["r1-2019-09-11-ex1"]
    given = item["inputs"]
    d1, a2, a3 = given["DH"][0][2], given["DH"][1][1], given["DH"][2][1]
    lift, up = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    joints = [
        oracles.Joint("revolute", up, np.eye(3), np.zeros(3)),
        oracles.Joint("revolute", lift, np.eye(3), np.array([0.0, 0.0, d1])),
        oracles.Joint("revolute", lift, np.eye(3), np.array([given["a2_singular"] if singular else a2, 0.0, 0.0])),
    ]
    robot = cc.Robot(oracles.pinocchio_chain(joints, np.eye(3), np.array([a3, 0.0, 0.0])), tool="tool")
    command = held(robot, real(given["q"]), np.array(given["qdot"], dtype=float), axes="position")
    equation, tail = command.solution.problem.equations[0], "_sing" if singular else ""
    agrees(item, f"J{tail}", equation.A)
    agrees(item, f"drift{tail}", equation.drift)
    agrees(item, f"ddq{tail}", command.acceleration)
    assert command.solution.status is (cc.Status.SINGULAR if singular else cc.Status.OPTIMAL)


# ---------------------------------------------------------------- rollouts


@pytest.mark.parametrize("gain", [4.0, 10.0])
def test_an_error_decays_critically_damped(gain: float) -> None:
    """From rest ``e = (1 + k t) exp(-k t) e0``; sampling shifts it by less than a step, k dt exp(-1) of e0 at most."""
    robot = planar()
    q0 = np.array([0.3, 0.6, 0.8])
    target = robot.state(q0).position("tool") + [-0.05, 0.08, 0.0]
    off = []
    for dt in (2e-3, 1e-3):
        task = cc.FrameTask("tool", "xy", gain=gain, target=target)
        run = cc.simulate(cc.Controller(robot, task, level="acceleration", limits=None, dt=dt), q0, duration=1.5)
        expected = ((1.0 + gain * run.time) * np.exp(-gain * run.time))[:, None] * run.tasks[0].error[0]
        off.append(np.abs(run.tasks[0].error - expected).max() / 0.08)
        assert off[-1] < gain * dt * np.exp(-1.0)
    assert off[1] == pytest.approx(0.5 * off[0], rel=0.05)  # first order in dt


def bound_on_error(run: cc.Run, target: cc.Path, gain: float) -> float:
    """A held command misses the target's jerk: half a step of it on average, ``K_p e = dt/2 jerk``; as much again for
    the arm's own."""
    dt, h = run.meta["dt"], 1e-4
    times = run.time[:: max(1, len(run.time) // 500)]
    jerk = [(target(t + h).acceleration[:3] - target(t - h).acceleration[:3]) / (2 * h) for t in times]
    return dt * float(np.linalg.norm(jerk, axis=1).max()) / gain**2


@pytest.mark.parametrize("solver", ["pinv", cc.DLS(damping=1e-3), "task-priority"])
def test_the_panda_tracks_a_circle(solver: str | cc.Solver) -> None:
    """Measured: 2.2 um RMS at 1 ms, 8.8 um at 4 ms."""
    rms = []
    for dt in (4e-3, 2e-3):
        controller = circling(panda(), dt=dt, solver=solver, objective=None, level="acceleration")
        run = cc.simulate(controller, duration=4.5)
        figures = run.metrics(after=0.5)
        rms.append(figures.tasks[0].rms_m)
        bound = bound_on_error(run, controller.tasks[0].target, 20.0)
        assert rms[-1] < figures.tasks[0].max_m < bound < 1.5e-5 * dt / 1e-3
        assert figures.tasks[0].final_m < 1e-6
    assert rms[1] == pytest.approx(0.5 * rms[0], rel=0.1)


@pytest.mark.parametrize("solver", ["pinv", cc.DLS(damping=1e-3), "task-priority"])
def test_a_planar_arm_tracks_a_circle_above_a_posture(solver: str | cc.Solver) -> None:
    robot = planar()
    q0 = np.array([0.3, 0.6, 0.8])
    circle = cc.Circle.starting_at(robot.state(q0).placement("tool"), radius=0.2, period=3.0)
    tasks: list[cc.Task] = [cc.FrameTask("tool", "xy", gain=15.0, target=circle)]
    if solver == "task-priority":
        tasks.append(cc.PostureTask(gain=2.0))
    controller = cc.Controller(robot, tasks, solver, "acceleration", limits=None, dt=2e-3)
    run = cc.simulate(controller, q0, duration=3.5)
    assert run.metrics().tasks[0].max_m < bound_on_error(run, circle, 15.0) < 5e-4
    assert run.metrics().tasks[0].final_m < 1e-5


def test_damping_ends_self_motion_and_leaves_the_task() -> None:
    """A start along the null space: without damping it lasts, with D it decays as exp(-D t)."""
    robot = panda()
    J = robot.state(robot.home).jacobian(robot.tool)
    v0 = 0.2 * np.linalg.svd(J)[2][-1]
    ends = {}
    for damping in (0.0, 3.0):
        level = cc.AccelerationLevel(damping=damping)
        controller = cc.Controller(robot, cc.FrameTask(robot.tool), "projected-gradient", level, limits=None, dt=4e-3)
        run = cc.simulate(controller, duration=1.0, v0=v0)
        assert run.metrics().tasks[0].max_m < 1e-4
        ends[damping] = np.linalg.norm(run.v[-1]) / 0.2
    assert ends[0.0] > 0.9 and ends[3.0] == pytest.approx(np.exp(-3.0), rel=0.1)


def test_a_run_records_the_acceleration_and_moves_by_it(tmp_path) -> None:
    robot = ROBOTS["kinova"]()
    target = robot.state(robot.integrate(robot.home, 0.1 * np.ones(robot.nv))).placement(robot.tool)
    task = cc.FrameTask(robot.tool, target=target, gain=8.0)
    dt = 5e-3
    run = cc.simulate(cc.Controller(robot, task, level="acceleration", limits=None, dt=dt), duration=0.5)
    assert run.meta["level"] == "acceleration"
    for k in (0, 17, len(run) - 1):
        step = run.v[k] * dt + run.command[k] * dt**2 / 2
        np.testing.assert_allclose(robot.integrate(run.q[k], step), run.q[k + 1], atol=1e-13)
        np.testing.assert_allclose(run.v[k] + run.command[k] * dt, run.v[k + 1], atol=1e-13)
    fine = np.linspace(0.0, 1.0, 2001)[:, None, None]
    v = run.v[:-1] + fine * (run.v[1:] - run.v[:-1])
    assert run.metrics().effort == pytest.approx(trapezoid((v**2).sum(2), fine[:, 0, 0], axis=0).sum() * dt)
    peak = np.abs(run.command).max(axis=0)
    np.testing.assert_allclose([j.peak_acceleration for j in run.metrics().joints], peak, rtol=1e-9)
    table = pyarrow.csv.read_csv(run.to_csv(tmp_path / "run.csv"))
    name = robot.dof_names[1]
    np.testing.assert_allclose(table[f"acceleration command {name}"].to_numpy()[:-1], run.command[:, 1])
    again = cc.Run.load(run.save(tmp_path / "run"))
    np.testing.assert_array_equal(again.command, run.command)
    assert again.metrics() == run.metrics()


def test_the_integrators_by_their_formulas() -> None:
    robot, dt = ROBOTS["talos"](), 0.01
    rng = np.random.default_rng(3)
    state, u = random_state(robot, rng), rng.normal(size=robot.nv)
    q, v = by_velocity(robot, state.q, u, dt)
    np.testing.assert_allclose(robot.difference(state.q, q), u * dt, atol=1e-12)
    np.testing.assert_array_equal(v, u)
    q, v = by_acceleration(robot, state.q, state.v, u, dt)
    np.testing.assert_allclose(robot.difference(state.q, q), state.v * dt + u * dt**2 / 2, atol=1e-12)
    np.testing.assert_allclose(v, state.v + u * dt, atol=1e-15)


def test_a_soft_start_acts_on_the_objective_alone() -> None:
    robot = panda()
    v = 0.1 * np.ones(7)
    level = cc.AccelerationLevel(damping=2.0)
    task, objective = cc.FrameTask(robot.tool), cc.JointRange()
    controller = cc.Controller(
        robot, task, "projected-gradient", level, limits=None, objective=objective, soft_start=1.0
    )
    slope = objective.direction(robot.state(robot.home))
    for t, share in ((0.0, 0.0), (0.5, 0.5), (1.0, 1.0)):
        u0 = controller.step(robot.home, v, t).solution.problem.reference
        np.testing.assert_allclose(u0, share * slope - 2.0 * v, rtol=1e-12)
