"""The torque level: its formulas at random states, the three norms, what h knows of, and what is refused."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.algebra.inverses import Damped
from cartctl.errors import (
    FrameNotFound,
    MetricError,
    NonFiniteError,
    ParameterError,
    ShapeError,
    UnderactuatedRobot,
    UnsupportedProblem,
)
from cartctl.levels import Secondary, levels
from cartctl.levels.acceleration import AccelerationLevel
from tests import oracles
from tests.robots_for_tests import ROBOTS, panda, planar, random_state, talos
from tests.test_acceleration_level import moving_target, tasks_on

DRIVEN = ["pendulum", "planar", "panda", "kinova"]
METRICS = {
    "identity": lambda M: np.eye(len(M)),
    "inverse-inertia": np.linalg.inv,
    "inverse-inertia-squared": lambda M: np.linalg.inv(M @ M),
}


def problem_of(level, state, tasks, metric=None, **secondary):
    anchors = [task.anchor(state) for task in tasks]
    return level.problem(state, tasks, [0.0] * len(tasks), anchors, Secondary(**secondary), metric)[0]


def level_of(solver="sns", **options):
    level = cc.TorqueLevel(**options)
    level.check(cc.solvers.get_solver(solver))
    return level


def moving(robot, axes, rng, gain=7.0):
    target = moving_target(rng)
    return cc.FrameTask(robot.tool, axes, gain=gain, target=lambda t: target)


# ---------------------------------------------------------------- the formulas


@pytest.mark.parametrize("name", DRIVEN)
@pytest.mark.parametrize("gain", [7.0, np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])])
def test_the_problem_is_the_textbook_formula(name, gain):
    robot, rng = ROBOTS[name](), np.random.default_rng(1)
    for _ in range(5):
        state, target = random_state(robot, rng), moving_target(rng)
        task = cc.FrameTask(robot.tool, gain=gain, target=lambda t, target=target: target)
        equation = problem_of(level_of(), state, [task]).equations[0]
        J, M = state.jacobian(robot.tool), state.mass_matrix
        A = np.linalg.solve(M, J.T).T
        size = np.abs(A).max()
        np.testing.assert_allclose(equation.A, A, rtol=1e-9, atol=1e-10 * size)
        h = pin.rnea(robot.model, robot.model.createData(), state.q, state.v, np.zeros(robot.nv))
        np.testing.assert_allclose(equation.drift, state.drift(robot.tool) - A @ h, atol=1e-9 * (1 + size))
        e, e_dot = task.reference(state, 0.0, None).error, target.twist - J @ state.v
        np.testing.assert_allclose(equation.b, target.acceleration + 2.0 * gain * e_dot + gain**2 * e, rtol=1e-11)


@pytest.mark.parametrize("name", DRIVEN)
def test_several_tasks_are_those_of_the_acceleration_level_through_the_inertia(name):
    """Fits, weights and names go along; one task alone takes the fused way to the same numbers."""
    robot, rng = ROBOTS[name](), np.random.default_rng(2)
    state = random_state(robot, rng)
    tasks = [moving(robot, "position", rng), *tasks_on(robot)]
    M, h = state.mass_matrix, state.nonlinear_effects
    below = problem_of(AccelerationLevel(), state, tasks).equations
    for together in (problem_of(level_of(), state, tasks).equations, None):
        for k, (task, there) in enumerate(zip(tasks, below, strict=True)):
            here = together[k] if together else problem_of(level_of(), state, [task]).equations[0]
            A = np.linalg.solve(M, there.A.T).T
            size = 1e-9 * (1.0 + np.abs(A).max() + np.abs(there.b).max())
            np.testing.assert_allclose(here.A, A, atol=size)
            np.testing.assert_allclose(here.b, there.b, atol=size)
            np.testing.assert_allclose(here.drift, there.drift - A @ h, atol=size * (1 + np.abs(h).max()))
            assert (here.fit, here.weight, here.name) == (there.fit, there.weight, there.name)


@pytest.mark.parametrize("name", DRIVEN)
@pytest.mark.parametrize("metric", list(METRICS))
def test_the_robot_accelerates_as_the_task_asks(name, metric):
    """Pinocchio's forward dynamics under the command: J a + J_dot v = b, whatever the norm."""
    robot, rng = ROBOTS[name](), np.random.default_rng(3)
    axes = {"pendulum": "x", "planar": "x", "panda": "pose", "kinova": "position"}[name]
    for _ in range(5):
        state = random_state(robot, rng)
        controller = cc.Controller(robot, moving(robot, axes, rng), "pinv", "torque", limits=None, metric=metric)
        command = controller.step(state.q, state.v)
        assert command.velocity is None and command.acceleration is None and command.told is command.torque
        a = pin.aba(robot.model, robot.model.createData(), state.q, state.v, command.torque)
        J, b = controller.tasks[0].jacobian(state), command.solution.problem.equations[0].b
        off = np.abs(J @ a + controller.tasks[0].drift(state) - b).max()
        assert off < 1e-7 * (1 + np.abs(b).max()) * max(1.0, np.linalg.cond(J) / 100.0)


# ---------------------------------------------------------------- the three norms


def taut(robot, rng):
    """A state at which the hand's position is far from singular, and the command for it."""
    while True:
        state = random_state(robot, rng)
        J = state.jacobian(robot.tool)[:3]
        s = np.linalg.svd(J)[1]
        if s[-1] > 0.1 * s[0]:
            return state, J


@pytest.mark.parametrize("solver", ["pinv", "projected-gradient", "sns", "hqp", "task-priority"])
@pytest.mark.parametrize("metric", list(METRICS))
def test_the_three_norms_against_a_kkt_system(solver, metric):
    """min (tau - u0)^T W (tau - u0) subject to J M^-1 tau = c, with the damped u0 and with u0 = 0."""
    robot, rng = panda(), np.random.default_rng(4)
    for damping in (0.0, 3.0):
        if damping and solver == "pinv":
            continue
        for _ in range(4):
            state, J = taut(robot, rng)
            M, h = state.mass_matrix, state.nonlinear_effects
            task = moving(robot, "position", rng)
            controller = cc.Controller(robot, task, solver, cc.TorqueLevel(damping), limits=None, metric=metric)
            command = controller.step(state.q, state.v)
            c = command.solution.problem.equations[0].b - state.drift(robot.tool)[:3] + J @ np.linalg.solve(M, h)
            brake = damping * state.v if metric == "identity" else damping * M @ state.v
            u0 = h - brake if damping else np.zeros(7)
            expected = oracles.constrained_minimum(np.linalg.solve(M, J.T).T, c, METRICS[metric](M), u0)
            np.testing.assert_allclose(command.torque, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_the_classical_closed_forms():
    """(J M^-1)# c, M J# c and J^T Lambda c: the last is the operational space's, dynamically consistent."""
    robot, rng = panda(), np.random.default_rng(5)
    for _ in range(10):
        state, J = taut(robot, rng)
        M, task = state.mass_matrix, moving(robot, "position", rng)
        commands = {
            metric: cc.Controller(robot, task, "pinv", "torque", limits=None, metric=metric).step(state.q, state.v)
            for metric in METRICS
        }
        equation = commands["identity"].solution.problem.equations[0]
        c = equation.rhs
        A = J @ np.linalg.inv(M)
        Lambda = np.linalg.inv(A @ J.T)
        for metric, tau in {
            "identity": np.linalg.pinv(A) @ c,
            "inverse-inertia": J.T @ Lambda @ c,
            "inverse-inertia-squared": M @ np.linalg.pinv(J) @ c,
        }.items():
            np.testing.assert_allclose(commands[metric].torque, tau, rtol=1e-6, atol=1e-7 * np.abs(tau).max())


def test_the_null_space_of_the_operational_space():
    """tau = J^T F + (I - J^T J_bar^T) u0 with J_bar = M^-1 J^T Lambda: the second part does not move the hand."""
    robot, rng = panda(), np.random.default_rng(6)
    state, J = taut(robot, rng)
    M = state.mass_matrix
    solution = (
        cc.Controller(
            robot, moving(robot, "position", rng), "projected-gradient", "torque", limits=None, metric="inverse-inertia"
        )
        .step(state.q, state.v)
        .solution
    )
    Lambda = np.linalg.inv(J @ np.linalg.solve(M, J.T))
    J_bar = np.linalg.solve(M, J.T) @ Lambda
    N = np.eye(7) - J.T @ J_bar.T
    np.testing.assert_allclose(solution.null_part, N @ solution.problem.reference, atol=1e-7)
    assert np.linalg.norm(solution.null_part) > 0.1
    np.testing.assert_allclose(J @ np.linalg.solve(M, solution.null_part), 0.0, atol=1e-8)


# ---------------------------------------------------------------- the reference


class _Roll(cc.Objective):
    gain = 4.0

    def value(self, state):
        return float(np.sin(state.q).sum())

    def gradient(self, state):
        return np.cos(state.q)


@pytest.mark.parametrize("metric", [*METRICS, "own"])
@pytest.mark.parametrize("damping", [0.0, 2.0, np.arange(1.0, 8.0), None])
@pytest.mark.parametrize("objective", [None, _Roll()])
def test_the_reference_is_by_metric(metric, damping, objective):
    """h - M D v + M k g with the metrics of inertia, h - D v + k g with the others; 0 where there is neither."""
    robot, rng = panda(), np.random.default_rng(7)
    state = random_state(robot, rng)
    controller = cc.Controller(
        robot,
        cc.FrameTask(robot.tool),
        "projected-gradient",
        cc.TorqueLevel(damping),
        limits=None,
        objective=objective,
        metric=np.ones(7) if metric == "own" else metric,
    )
    u0 = controller.step(state.q, state.v).solution.problem.reference
    mapped = metric.startswith("inverse")
    inertia = state.mass_matrix.diagonal()
    by_default = 20.0 if mapped else np.minimum(3.0 + 10.0 * inertia, 300.0 * inertia)
    D = by_default if damping is None else damping
    push = -D * state.v + (0.0 if objective is None else -4.0 * np.cos(state.q))
    if objective is None and damping is not None and not np.any(damping):
        assert u0 is None
    else:
        expected = state.nonlinear_effects + (state.mass_matrix @ push if mapped else push)
        np.testing.assert_allclose(u0, expected, rtol=1e-10, atol=1e-10)


def test_a_solver_without_reference_gets_the_classical_form_unless_damping_is_asked_for():
    robot = panda()
    command = cc.Controller(robot, cc.FrameTask(robot.tool), "pinv", "torque", limits=None).step(robot.home)
    assert command.solution.problem.reference is None
    with pytest.raises(UnsupportedProblem, match="damping"):
        cc.Controller(robot, cc.FrameTask(robot.tool), "pinv", cc.TorqueLevel(damping=1.0), limits=None)


# ---------------------------------------------------------------- what h knows of


@pytest.mark.parametrize("level", [cc.TorqueLevel, cc.AccelerationLevel])
def test_friction_wrenches_and_payloads_are_known(level):
    """The command gives the same acceleration of the hand on the loaded robot as on the bare one."""
    robot, rng = panda(), np.random.default_rng(8)
    payload = cc.Payload(2.5, [0.02, -0.05, 0.1], np.diag([0.02, 0.03, 0.04]))
    loaded = robot.carrying(payload)
    friction = cc.Friction(viscous=np.linspace(0.1, 1.0, 7), coulomb=0.7, width=0.02)
    push, turned = rng.normal(size=6), rng.normal(size=6)
    wrenches = [
        cc.Wrench(robot.tool, lambda t: push * (1.0 + t)),
        cc.Wrench("panda_link4", turned, expressed_in="panda_link4"),
    ]
    known = level(friction=friction, wrenches=wrenches)
    for t in (0.0, 1.7):
        state = random_state(robot, rng)
        task = moving(robot, "pose", rng)
        controller = cc.Controller(loaded, task, "pinv", known, limits=None)
        command = controller.step(state.q, state.v, t)
        R, at = state.rotation("panda_link4"), loaded.state(state.q, state.v)
        felt = state.jacobian(robot.tool).T @ (push * (1.0 + t))
        felt = felt + state.jacobian("panda_link4").T @ np.concatenate([R @ turned[:3], R @ turned[3:]])
        lost = np.linspace(0.1, 1.0, 7) * state.v + 0.7 * np.tanh(state.v / 0.02)
        a = np.linalg.solve(at.mass_matrix, command.torque + felt - lost - at.nonlinear_effects)
        J, wanted = at.jacobian(robot.tool), task.reference(at, t, None)
        b = wanted.acceleration + 14.0 * (wanted.rate - J @ state.v) + 49.0 * wanted.error
        np.testing.assert_allclose(J @ a + at.drift(robot.tool), b, atol=1e-7 * np.abs(b).max())


def test_a_payload_is_a_body_fixed_to_its_frame():
    """M and g change by J_c^T I J_c and -J_c^T m g of the added body, from the frame's Jacobian."""
    robot, rng = panda(), np.random.default_rng(9)
    com, inertia = np.array([0.03, -0.02, 0.11]), oracles.random_rotation(rng)
    inertia = inertia @ np.diag([0.02, 0.03, 0.04]) @ inertia.T
    inertia = 0.5 * (inertia + inertia.T)
    loaded = robot.carrying(cc.Payload(1.7, com, inertia, frame="panda_link6"))
    state = random_state(robot, rng)
    there = loaded.state(state.q, state.v)
    J, R = state.jacobian("panda_link6"), state.rotation("panda_link6")
    p = R @ com
    J_com = J[:3] - np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]]) @ J[3:]
    M = 1.7 * J_com.T @ J_com + J[3:].T @ (R @ inertia @ R.T) @ J[3:]
    np.testing.assert_allclose(there.mass_matrix - state.mass_matrix, M, atol=1e-12)
    np.testing.assert_allclose(there.gravity - state.gravity, 1.7 * 9.81 * J_com[2], atol=1e-11)
    assert robot.state(state.q).mass_matrix is not there.mass_matrix
    np.testing.assert_array_equal(robot.state(state.q).mass_matrix, state.mass_matrix)  # the robot itself is untouched
    again = cc.load("panda").carrying(cc.Payload(1.0)).carrying(cc.Payload(0.5, frame="panda_link3"))
    assert len(again.spec["payloads"]) == 2


def test_friction_by_its_formula_and_from_a_urdf():
    friction = cc.Friction(viscous=0.5, coulomb=[1.0, 2.0], width=0.1)
    v = np.array([0.3, -0.02])
    np.testing.assert_allclose(friction.torque(v), 0.5 * v + [np.tanh(3.0), 2.0 * np.tanh(-0.2)], rtol=1e-14)
    assert friction.torque(v) @ v > 0.0
    found = cc.Friction.of(panda())
    np.testing.assert_allclose(found.torque(np.ones(7)), panda().model.damping + panda().model.friction)
    assert found.viscous.min() > 0.0


# ---------------------------------------------------------------- every solver works at the level


def test_the_whole_registry_works():
    """Each answers the level's problem; those that meet tasks exactly deliver the acceleration asked for."""
    robot, rng = panda(), np.random.default_rng(10)
    state, J = taut(robot, rng)
    exact = 0
    for name in cc.solvers():
        task = moving(robot, "position", rng)
        if name == "extended-jacobian":
            with pytest.raises(UnsupportedProblem, match="level 'torque' has no rows .* extremal"):
                cc.Controller(robot, task, name, "torque", limits=None, objective=cc.JointRange())
            continue
        takes = cc.solvers.get_solver(name).takes_metric
        for metric in METRICS if takes else ["identity"]:
            command = cc.Controller(robot, task, name, "torque", limits=None, metric=metric).step(state.q, state.v)
            assert np.isfinite(command.torque).all() and command.solution.status is not cc.Status.FAILED, (name, metric)
            if command.solution.status is cc.Status.OPTIMAL:
                exact += 1
                e = command.solution.problem.equations[0]
                a = np.linalg.solve(state.mass_matrix, command.torque - state.nonlinear_effects)
                np.testing.assert_allclose(J @ a + state.drift(robot.tool)[:3], e.b, atol=1e-6 * np.abs(e.b).max())
    assert exact >= 3 * 8
    for name in cc.solvers.solvers_that_honour("bounds"):
        command = cc.Controller(robot, task, name, "torque").step(state.q, state.v)
        assert (np.abs(command.torque) <= robot.limits.torque_upper).all(), name


def test_policies_keep_torques_sane_at_a_singularity():
    """Straight up, Lambda explodes for a push along the arm; truncation and damping don't, nor do bounds."""
    robot = planar()
    q = np.array([0.4, 1e-7, -1e-7])
    v = np.zeros(3)
    out = np.array([np.cos(0.4), np.sin(0.4), 0.0])
    target = SimpleNamespace(position=None, rotation=None, twist=np.zeros(6), acceleration=np.append(out, np.zeros(3)))
    task = cc.FrameTask("tool", "xy", gain=0.0, target=lambda t: target)
    J = robot.state(q).jacobian("tool")[:2]
    Lambda = np.linalg.inv(J @ np.linalg.solve(robot.state(q).mass_matrix, J.T))
    assert np.abs(J.T @ Lambda @ out[:2]).max() > 1e4
    for solver in (cc.DLS(1e-2), cc.TaskPriority(policy=Damped(1e-2)), cc.DLSSigma()):
        tau = cc.Controller(robot, task, solver, "torque", limits=None, metric="inverse-inertia").step(q, v).torque
        assert np.abs(tau).max() < 100.0, solver
    for solver in ("sns", "hqp", "qp", "task-scaling", "sns-greedy"):
        tau = cc.Controller(robot, task, solver, "torque", metric="inverse-inertia").step(q, v).torque
        assert (np.abs(tau) <= robot.limits.torque_upper).all(), solver


def test_rows_that_are_round_off_are_not_inverted():
    """A planar arm cannot move along z: the row of A is zero, and stays out of the answer."""
    robot = cc.load("panda")
    q = robot.home
    plain = cc.Controller(robot, cc.FrameTask(robot.tool, "x"), "pinv", "torque", limits=None).step(q)
    assert plain.solution.problem.equations[0].size >= np.linalg.norm(plain.solution.problem.equations[0].A)
    arm = planar()
    command = cc.Controller(arm, cc.FrameTask("tool", "xz"), "pinv", "torque", limits=None).step(
        np.array([0.3, 0.4, 0.5])
    )
    assert command.solution.status is cc.Status.SINGULAR and np.abs(command.torque).max() < 100.0


# ---------------------------------------------------------------- what is refused


def test_metrics_are_named_by_level():
    robot = panda()
    task = cc.FrameTask(robot.tool)
    for level, wrong, right in (
        ("torque", "inertia", "'inverse-inertia', 'inverse-inertia-squared'"),
        ("torque", "joint-limits", "'identity'"),
        ("velocity", "inverse-inertia", "'inertia'"),
        ("acceleration", "inverse-inertia-squared", "'identity'"),
    ):
        with pytest.raises(ParameterError, match=f"{wrong}.*{right}"):
            cc.Controller(robot, task, level=level, limits=None, metric=wrong)
    with pytest.raises(ParameterError, match="inverse-inertia"):
        cc.Controller(robot, task, level="torque", limits=None, metric="inertial")


def test_robots_without_a_motor_for_everything_are_refused_at_this_level_alone():
    robot = talos()
    hand = cc.FrameTask(robot.tool, "position")
    with pytest.raises(UnderactuatedRobot, match="root_joint.*level 'acceleration' or 'velocity'"):
        cc.Controller(robot, hand, level="torque", limits=None)
    command = cc.Controller(robot, hand, level="acceleration", limits=None).step(robot.home)
    assert command.torque is None and np.isfinite(command.acceleration).all()
    with pytest.raises(UnderactuatedRobot, match="inertia matrix"):
        cc.Controller(cc.load("icub"), cc.FrameTask(cc.load("icub").tool), level="torque", limits=None)


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (lambda: cc.TorqueLevel(damping=-1.0), ParameterError, "damping"),
        (lambda: cc.TorqueLevel(damping=np.nan), NonFiniteError, "damping"),
        (lambda: cc.TorqueLevel(friction=0.1), ParameterError, "friction"),
        (lambda: cc.TorqueLevel(wrenches=[np.zeros(6)]), ParameterError, "wrenches"),
        (lambda: cc.Friction(viscous=-0.1), ParameterError, "viscous"),
        (lambda: cc.Friction(coulomb=[0.1, -0.1]), ParameterError, "coulomb"),
        (lambda: cc.Friction(width=0.0), ParameterError, "width"),
        (lambda: cc.Wrench("hand", np.zeros(3)), ShapeError, "hand"),
        (lambda: cc.Wrench("hand", [0, 0, np.inf, 0, 0, 0]), NonFiniteError, "hand"),
        (lambda: cc.Wrench(3, np.zeros(6)), ParameterError, "frame"),
        (lambda: cc.Payload(-1.0), ParameterError, "mass"),
        (lambda: cc.Payload(1.0, inertia=np.diag([1.0, 1.0, 3.0])), MetricError, "inertia"),
        (lambda: cc.Payload(1.0, inertia=np.array([[1.0, 0.5, 0], [0, 1.0, 0], [0, 0, 1.0]])), MetricError, "inertia"),
        (lambda: panda().carrying(2.0), ParameterError, "payload"),
        (lambda: cc.Payload(1e308), ParameterError, r"mass is 1e\+308"),
        (lambda: cc.Payload(1.0, com=[0, 0, 1e10]), ParameterError, r"com\[2\] is 1e\+10"),
        (lambda: cc.Payload(1.0, inertia=1e10 * np.eye(3)), ParameterError, "inertia has an entry"),
        (lambda: cc.Friction.of("panda"), ParameterError, "robot is a str"),
        (lambda: panda().carrying(cc.Payload(1.0, frame="hnad")), FrameNotFound, "hnad"),
    ],
)
def test_bad_loads_are_refused_in_words(make, error, says):
    with pytest.raises(error, match=says):
        make()


def test_what_does_not_fit_the_robot_is_refused_when_the_controller_is_made():
    robot = planar()
    task = cc.FrameTask("tool", "xy")
    for level in (cc.TorqueLevel, cc.AccelerationLevel):
        with pytest.raises(ShapeError, match="viscous"):
            cc.Controller(robot, task, "pinv", level(friction=cc.Friction(np.ones(2))), limits=None)
        for wrench in (cc.Wrench("tol", np.zeros(6)), cc.Wrench("tool", np.zeros(6), expressed_in="tol")):
            with pytest.raises(FrameNotFound, match="tol"):
                cc.Controller(robot, task, "pinv", level(wrenches=wrench), limits=None)
    ghost = cc.Wrench("tool", lambda t: np.full(6, np.nan if t > 0.0 else 0.0))
    controller = cc.Controller(robot, task, "pinv", cc.TorqueLevel(wrenches=ghost), limits=None)
    q = np.array([0.3, 0.4, 0.5])
    first = controller.step(q).torque
    with pytest.raises(NonFiniteError, match="wrench on 'tool' at t = 1"):
        controller.step(q, t=1.0)
    np.testing.assert_array_equal(controller.step(q).torque, first)
    wrong = cc.Controller(robot, task, "projected-gradient", cc.TorqueLevel(damping=[1.0, 2.0]), limits=None)
    with pytest.raises(ShapeError, match="damping"):
        wrong.step(q, np.ones(3))


# ---------------------------------------------------------------- the acceleration level's torque


def test_the_computed_torque_is_offered_and_stays_that_of_its_instant():
    robot, rng = panda(), np.random.default_rng(11)
    controller = cc.Controller(robot, cc.FrameTask(robot.tool), "pinv", "acceleration", limits=None)
    first, second = random_state(robot, rng), random_state(robot, rng)
    commands = [controller.step(s.q, s.v) for s in (first, second)]
    for state, command in zip((first, second), commands, strict=True):
        expected = pin.rnea(robot.model, robot.model.createData(), state.q, state.v, command.acceleration)
        np.testing.assert_allclose(command.torque, expected, rtol=1e-9, atol=1e-9)
        assert command.told is command.acceleration
    assert levels() == ["velocity", "acceleration", "torque"]


def test_the_mass_matrix_brings_placements_and_jacobians_along():
    """Whichever is asked for first, the numbers are the same."""
    rng = np.random.default_rng(12)
    for make in ROBOTS.values():
        robot = make()
        q, v = robot.random_configuration(rng), rng.normal(size=robot.nv)
        one, other = robot.state(q, v), robot.state(q, v)
        M, J = one.mass_matrix, one.jacobian(robot.tool)
        np.testing.assert_array_equal(other.jacobian(robot.tool), J)
        np.testing.assert_array_equal(other.mass_matrix, M)
        np.testing.assert_array_equal(M, M.T)
        np.testing.assert_array_equal(one.placement(robot.tool).homogeneous, other.placement(robot.tool).homogeneous)
        np.testing.assert_allclose(one.drift(robot.tool), other.drift(robot.tool), rtol=0, atol=0)
