"""The controller: one step, what it owns, what it refuses, and that a refusal leaves no trace."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.errors import (
    CartctlError,
    CartctlWarning,
    ConfigurationError,
    LevelNotFound,
    MetricError,
    NonFiniteError,
    NoTasksError,
    ParameterError,
    ProblemError,
    ShapeError,
    SolverNotFound,
    SolverOutputError,
    TimeStepError,
    UnsupportedProblem,
)
from tests.robots_for_tests import ROBOTS, panda, planar

EXACT = [
    "pinv",
    "dls",
    "projected-gradient",
    "task-priority",
    "singularity-robust-priority",
    "reverse-priority",
    "task-scaling",
]


def reach(robot: cc.Robot, **options: object) -> cc.Controller:
    target = robot.state(robot.integrate(robot.home, 0.1 * np.ones(robot.nv))).placement(robot.tool)
    return cc.Controller(robot, cc.FrameTask(robot.tool, target=target), limits=None, **options)


@pytest.mark.parametrize("name", list(ROBOTS))
@pytest.mark.parametrize("solver", EXACT)
def test_a_step_is_the_textbook_formula(name: str, solver: str) -> None:
    robot = ROBOTS[name]()
    controller = reach(robot, solver=cc.DLS(damping=1e-7) if solver == "dls" else solver)
    q = robot.integrate(robot.home, 0.05 * np.arange(1, robot.nv + 1) / robot.nv)
    command = controller.step(q)
    state, target = robot.state(q), controller.tasks[0].target
    here = state.placement(robot.tool)
    e = np.concatenate([target.translation - here.translation, pin.log3(target.rotation @ here.rotation.T)])
    expected = np.linalg.pinv(state.jacobian(robot.tool), rcond=1e-9) @ (20.0 * e)
    np.testing.assert_allclose(command.velocity, expected, atol=1e-6 * np.linalg.norm(expected))
    assert command.acceleration is None and command.torque is None
    np.testing.assert_allclose(command.references[0].error, e, atol=1e-12)


def test_inertia_metric_minimises_kinetic_energy() -> None:
    robot = panda()
    q = robot.home + 0.03
    M = robot.state(q).mass_matrix
    ours, plain = reach(robot, metric="inertia").step(q).velocity, reach(robot).step(q).velocity
    by_function = reach(robot, metric=lambda state: state.mass_matrix).step(q).velocity
    np.testing.assert_allclose(reach(robot, metric=M).step(q).velocity, ours, rtol=1e-9)
    np.testing.assert_allclose(by_function, ours, rtol=1e-12)
    J = robot.state(q).jacobian(robot.tool)
    np.testing.assert_allclose(J @ ours, J @ plain, atol=1e-10)
    assert ours @ M @ ours < 0.999 * (plain @ M @ plain)
    N = np.eye(7) - np.linalg.pinv(J) @ J  # stationary: no self-motion lowers the energy
    np.testing.assert_allclose(N @ M @ ours, 0.0, atol=1e-9)


def test_an_objective_moves_the_null_space_only() -> None:
    robot = panda()
    q = robot.home + 0.03
    objective = cc.JointRange(gain=50.0)
    state = robot.state(q)
    h = 1e-6
    slope = [
        (objective.value(robot.state(q + h * e)) - objective.value(robot.state(q - h * e))) / (2 * h) for e in np.eye(7)
    ]
    np.testing.assert_allclose(objective.gradient(state), slope, atol=1e-9)
    with_it = reach(robot, solver="projected-gradient", objective=objective).step(q)
    without = reach(robot, solver="pinv").step(q)
    J = state.jacobian(robot.tool)
    np.testing.assert_allclose(J @ (with_it.velocity - without.velocity), 0.0, atol=1e-12)
    assert objective.gradient(state) @ (with_it.velocity - without.velocity) < 0.0


def test_joint_range_ignores_unlimited_joints() -> None:
    robot = ROBOTS["kinova"]()
    gradient = cc.JointRange().gradient(robot.state(robot.home))
    np.testing.assert_array_equal(gradient[robot.continuous], 0.0)
    assert np.abs(gradient[~robot.continuous]).max() > 0.0


def test_priorities_come_in_order() -> None:
    robot = planar()
    q = np.array([0.3, 0.6, -0.8])
    tip = cc.FrameTask("tool", "xy", target=[1.0, 1.0, 0.0])
    posture = cc.PostureTask(target=[1.0, -1.0, 0.5], gain=2.0)
    command = cc.Controller(robot, [tip, posture], solver="task-priority", limits=None).step(q)
    assert command.solution.residuals[0] < 1e-10
    assert command.solution.residuals[1] > 1e-3
    swapped = cc.Controller(robot, [posture, tip], solver="task-priority", limits=None).step(q)
    np.testing.assert_allclose(swapped.velocity, 2.0 * (np.array([1.0, -1.0, 0.5]) - q), atol=1e-12)


@dataclass(frozen=True)
class Doubling(cc.Solver):
    """A user's own solver: twice the least-squares answer, inside bounds it says it honours."""

    name: ClassVar[str] = "doubling"
    honours: ClassVar[frozenset[str]] = frozenset({"bounds"})

    def _solve_impl(self, problem: cc.Problem) -> cc.Solution:
        e = problem.equations[0]
        return cc.Solution(problem, 2.0 * np.linalg.lstsq(e.A, e.b, rcond=None)[0], self.name)


def test_a_users_own_solver_and_task_take_the_same_road() -> None:
    robot = planar()
    task = cc.FunctionTask(lambda s: [s.q[0] + s.q[2]], target=[1.0], gain=3.0)
    controller = cc.Controller(robot, task, solver=Doubling(), limits=None)
    command = controller.step(np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(command.velocity, [1.8, 0.0, 1.8], atol=1e-6)
    assert cc.solve(command.solution.problem, Doubling).u @ command.velocity > 0


class Seized(cc.Objective):
    gain = 1.0

    def value(self, state: cc.State) -> float:
        return 0.0

    def gradient(self, state: cc.State) -> np.ndarray:
        return np.full(state.robot.nv, np.inf)


@pytest.mark.parametrize(
    ("options", "error", "says"),
    [
        ({"tasks": []}, NoTasksError, "empty"),
        ({"tasks": "hand"}, ProblemError, "tasks"),
        ({"tasks": 3}, ProblemError, "int"),
        ({"tasks": [None]}, ProblemError, "NoneType"),
        ({"solver": "pinvv"}, SolverNotFound, "'pinv'"),
        ({"solver": 3}, ParameterError, "solver"),
        ({"level": "speed"}, LevelNotFound, "velocity"),
        ({"level": None}, ParameterError, "level"),
        ({"dt": 0.0}, TimeStepError, "dt is 0"),
        ({"dt": -1e-3}, TimeStepError, "dt"),
        ({"dt": np.nan}, NonFiniteError, "dt"),
        ({"dt": "1ms"}, ParameterError, "dt"),
        ({"metric": -np.eye(3)}, MetricError, "eigenvalue"),
        ({"metric": np.triu(np.ones((3, 3)))}, MetricError, "symmetric"),
        ({"metric": [1.0, 0.0, 1.0]}, MetricError, "positive"),
        ({"metric": np.eye(4)}, ShapeError, "metric"),
        ({"metric": "mass"}, ParameterError, "'inertia'"),
        ({"objective": cc.JointRange()}, UnsupportedProblem, "projected-gradient"),
        ({"objective": 3.0, "solver": "dls"}, ParameterError, "objective"),
        ({"limits": "robot"}, ParameterError, "limits"),
        ({"robot": "panda"}, ParameterError, "cc.load"),
    ],
)
def test_what_cannot_work_is_refused_when_it_is_made(options: dict, error: type[CartctlError], says: str) -> None:
    arguments = {"robot": planar(), "tasks": cc.FrameTask("tool"), "solver": "pinv", "limits": None} | options
    with pytest.raises(error, match=says) as caught:
        cc.Controller(**arguments)
    assert "\n" not in str(caught.value)


def test_limits_are_never_ignored_in_silence() -> None:
    robot = planar()
    with pytest.raises(UnsupportedProblem, match="honours no limits"):
        cc.Controller(robot, cc.FrameTask("tool"), limits=robot.limits)
    with pytest.raises(ShapeError, match="7 joints"):
        cc.Controller(robot, cc.FrameTask("tool"), limits=panda().limits)
    with pytest.warns(CartctlWarning, match="runs without them") as caught:
        cc.Controller(robot, cc.FrameTask("tool"))
    assert len(caught) == 1 and caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cc.Controller(robot, cc.FrameTask("tool"), limits=None)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (([0.1, 0.2],), ShapeError),
        ((np.zeros((3, 1)),), ShapeError),
        (([0.1, np.nan, 0.3],), NonFiniteError),
        (([0.1, np.inf, 0.3],), NonFiniteError),
        (("abc",), ShapeError),
        ((None,), ShapeError),
        ((np.zeros(3), [0.0]), ShapeError),
        ((np.zeros(3), [0.0, np.nan, 0.0]), NonFiniteError),
        ((np.zeros(3), None, np.nan), NonFiniteError),
        ((np.zeros(3), None, np.inf), NonFiniteError),
        ((np.zeros(3), None, "now"), ParameterError),
    ],
)
def test_a_refused_step_leaves_no_trace(arguments: tuple, error: type[CartctlError]) -> None:
    robot = planar()
    q = np.array([0.3, 0.4, 0.5])
    expected = reach(robot).step(q, t=0.1).velocity
    for earlier in (False, True):
        controller = reach(robot)
        if earlier:
            controller.step(q)
        with pytest.raises(error):
            controller.step(*arguments)
        np.testing.assert_array_equal(controller.step(q, t=0.1).velocity, expected)


def test_a_configuration_off_the_manifold_is_refused() -> None:
    robot = ROBOTS["talos"]()
    controller = reach(robot)
    good = controller.step(robot.home).velocity
    with pytest.raises(ConfigurationError):
        controller.step(1.1 * robot.home + 0.3)
    np.testing.assert_array_equal(controller.step(robot.home).velocity, good)


def test_a_gradient_of_infinities_is_refused_by_name() -> None:
    controller = cc.Controller(
        planar(), cc.FrameTask("tool", "xy"), solver="projected-gradient", limits=None, objective=Seized()
    )
    with pytest.raises(NonFiniteError, match="Seized"):
        controller.step(np.zeros(3))


@pytest.mark.parametrize("huge", [1e10, 1e200])
def test_absurd_magnitudes_are_refused(huge: float) -> None:
    robot = planar()
    for arguments in ((np.array([huge, 0.0, 0.0]),), (np.zeros(3), np.array([0.0, -huge, 0.0]))):
        with np.errstate(over="ignore"), pytest.raises(ParameterError, match="magnitude of at most"):
            reach(robot).step(*arguments)
    with pytest.raises(ParameterError, match="magnitude"):
        robot.state(np.zeros(3), np.array([0.0, huge, 0.0]))


def test_a_gain_that_cannot_be_stable_at_dt_is_said() -> None:
    with pytest.warns(CartctlWarning, match="unstable"):
        cc.Controller(planar(), cc.FrameTask("tool", "xy", gain=2500.0), limits=None, dt=1e-3)


def test_wrong_answers_of_a_users_solver_or_objective_are_named() -> None:
    @dataclass(frozen=True)
    class Broken(cc.Solver):
        name: ClassVar[str] = "broken"
        honours: ClassVar[frozenset[str]] = frozenset({"reference"})
        answer: tuple[float, ...] = ()

        def _solve_impl(self, problem: cc.Problem) -> cc.Solution:
            return cc.Solution(problem, np.array(self.answer), self.name)

    class Short(Seized):
        def gradient(self, state: cc.State) -> np.ndarray:
            return np.zeros(2)

    task = cc.FrameTask("tool", "xy")
    for answer in ((1.0, np.nan, 0.0), (1.0, 2.0)):
        with pytest.raises(SolverOutputError, match="broken"):
            cc.Controller(planar(), task, solver=Broken(answer), limits=None).step(np.zeros(3))
    with pytest.raises(ShapeError, match="Short"):
        cc.Controller(planar(), task, solver="dls", objective=Short(), limits=None).step(np.zeros(3))


def test_rows_that_are_only_round_off_are_never_inverted() -> None:
    robot = panda()
    home = robot.state(robot.home)
    finger = home.placement("panda_hand").actInv(home.placement("panda_leftfinger")).translation
    rigid = cc.RelativeFrameTask("panda_leftfinger", "panda_hand", "position", target=finger + [0.0, 0.01, 0.0])
    constant = cc.FunctionTask(lambda s: s.rotation(robot.tool)[0] @ s.rotation(robot.tool)[1], target=[1.0])
    for task in (rigid, constant):
        for solver in EXACT:
            command = cc.Controller(robot, task, solver=solver, limits=None).step(robot.home)
            assert command.solution.status is cc.Status.SINGULAR, solver
            assert np.abs(command.velocity).max() < 1e-6
    both = cc.Controller(robot, [cc.FrameTask(robot.tool), rigid], solver="task-priority", limits=None)
    assert cc.simulate(both, duration=0.02).metrics().tasks[0].max_m < 1e-9


def test_a_target_left_open_holds_the_first_step_until_reset() -> None:
    robot = planar()
    controller = cc.Controller(robot, cc.FrameTask("tool", "xy"), limits=None)
    q = np.array([0.2, 0.4, 0.6])
    np.testing.assert_allclose(controller.step(q).velocity, 0.0, atol=1e-12)
    away = controller.step(q + 0.1).velocity
    assert np.linalg.norm(away) > 0.1
    controller.reset()
    np.testing.assert_allclose(controller.step(q + 0.1).velocity, 0.0, atol=1e-12)


def test_arguments_are_neither_changed_nor_kept() -> None:
    robot = panda()
    controller = reach(robot)
    q, v = np.array(robot.home), np.zeros(7)
    command = controller.step(q, v)
    kept = command.velocity.copy()
    np.testing.assert_array_equal(q, robot.home)
    q[:] = 0.0
    controller.step(robot.home + 0.3)
    np.testing.assert_array_equal(command.velocity, kept)
    np.testing.assert_array_equal(
        command.solution.problem.equations[0].A @ kept,
        command.solution.problem.equations[0].A @ command.velocity,
    )


def test_a_soft_start_rises_smoothly_to_the_full_share() -> None:
    robot = panda()
    hard, soft = (
        cc.Controller(
            robot,
            cc.FrameTask(robot.tool),
            solver="projected-gradient",
            limits=None,
            objective=cc.JointRange(),
            soft_start=s,
        )
        for s in (0.0, 0.4)
    )
    full = hard.step(robot.home, t=5.0).velocity
    shares = [
        soft.step(robot.home, t=5.0 + dt).velocity @ full / (full @ full) for dt in (0.0, 0.1, 0.2, 0.3, 0.4, 2.0)
    ]
    np.testing.assert_allclose(shares, [0.0, 0.15625, 0.5, 0.84375, 1.0, 1.0], atol=1e-9)
    soft.reset()
    np.testing.assert_allclose(soft.step(robot.home, t=9.0).velocity, 0.0, atol=1e-9)
    with pytest.raises(ParameterError, match="soft_start"):
        cc.Controller(robot, cc.FrameTask(robot.tool), limits=None, soft_start=-1.0)
