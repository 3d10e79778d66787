"""Singularity policies of a controller: each does what it says, alike for every solver, and nothing far from one."""

from __future__ import annotations

import numpy as np
import pytest

import cartctl as cc
from cartctl.errors import ParameterError, UnsupportedProblem
from cartctl.solvers import solvers_that_honour
from tests.objectives_for_tests import SIX

POLICIES = ("truncate", "damp", "slow-down", "avoid", "halt")
EXACT = [  # these meet a command wherever it can be met, with the least joint rates
    "pinv",
    "projected-gradient",
    "task-priority",
    "singularity-robust-priority",
    "reverse-priority",
    "main-variables",
    "task-scaling",
    "sns",
    "sns-greedy",
    "hqp",
]

every_exact = pytest.mark.parametrize("solver", EXACT)


def folded(distance: float) -> np.ndarray:
    """A planar 3R near the singular posture in which it lies folded on one line, inside its workspace."""
    return np.array([0.3, np.pi + 0.7 * distance, np.pi - 1.3 * distance])


def made(solver: str, singularity: object, target: object = (0.5, 0.9, 0.0), **more) -> cc.Controller:
    robot = SIX["planar3R"]()
    tip = cc.FrameTask("tool", "xy", gain=1.0, target=target)
    options = {"limits": None, "dt": 1e-2} | more
    return cc.Controller(robot, tip, solver, singularity=singularity, **options)


def asked(controller: cc.Controller, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """J and the command c of its one task."""
    state = controller.robot.state(q)
    task = controller.tasks[0]
    return task.jacobian(state), task.gain * task.reference(state, 0.0, None).error


# ---------------------------------------------------------------- truncate, damp


@every_exact
@pytest.mark.parametrize(
    "policy",
    [cc.Damped(0.1), cc.SigmaDamped(0.2, 0.3), cc.NumericalFiltering(0.1, 0.2, 0.0), cc.Truncated(0.05)],
    ids=repr,
)
@pytest.mark.parametrize("distance", [0.0, 1e-10, 1e-6, 1e-3, 0.05, 0.8])
def test_an_inverse_policy_for_every_solver(solver: str, policy: cc.InversePolicy, distance: float) -> None:
    """``u = J# c`` with the filter factors of the policy, from an SVD of one's own."""
    controller, q = made(solver, policy), folded(distance)
    J, c = asked(controller, q)
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    natural = float(np.linalg.norm(controller.robot.state(q).jacobian("tool")))  # all six rows, of which J is two
    expected = Vt.T @ (policy.factors(s, natural) * (U.T @ c))
    command = controller.step(q)
    np.testing.assert_allclose(command.velocity, expected, atol=1e-6 * (1.0 + np.linalg.norm(c)))
    assert np.linalg.norm(J @ (command.velocity - expected)) < 1e-9


def test_qp_has_it_too() -> None:
    """To the weight it gives the task; without, it has a damping of its own."""
    controller, q = made("qp", cc.Damped(0.1)), folded(0.05)
    J, c = asked(controller, q)
    expected = J.T @ np.linalg.solve(J @ J.T + 0.01 * np.eye(2), c)
    np.testing.assert_allclose(controller.step(q).velocity, expected, atol=1e-2)


@pytest.mark.parametrize("solver", ["pinv", "sns"])
def test_at_the_acceleration_level_the_drift_is_damped_too(solver: str) -> None:
    controller = made(solver, cc.Damped(0.1), level="acceleration")
    q, v = folded(1e-3), np.array([0.5, -0.7, 0.9])
    state = controller.robot.state(q, v)
    task = controller.tasks[0]
    J = task.jacobian(state)
    c = task.reference(state, 0.0, None).error - 2.0 * (J @ v) - task.drift(state)
    expected = J.T @ np.linalg.solve(J @ J.T + 0.01 * np.eye(2), c)
    np.testing.assert_allclose(controller.step(q, v).acceleration, expected, atol=1e-8)


# ---------------------------------------------------------------- slow down


@every_exact
@pytest.mark.parametrize("distance", [1e-7, 1e-5, 1e-3, 3e-3])
def test_slow_down_keeps_the_direction(solver: str, distance: float) -> None:
    controller, q = made(solver, cc.SlowDown(0.1)), folded(distance)
    J, c = asked(controller, q)
    U, s, _ = np.linalg.svd(J)
    share = min(1.0, s[1] * np.linalg.norm(c) / (0.1 * abs(U[:, 1] @ c)))
    assert share < 0.5
    command = controller.step(q)
    u = command.velocity
    np.testing.assert_allclose(J @ u, share * c, atol=1e-9)
    assert np.linalg.norm(u) <= np.linalg.norm(c) / 0.1 * 1.5
    assert command.solution.status is cc.Status.SINGULAR


@every_exact
def test_slow_down_leaves_what_needs_no_lost_direction(solver: str) -> None:
    """Across the folded arm the hand moves at full speed; along it, not at all."""
    q = folded(0.0)
    J = made(solver, None).tasks[0].jacobian(SIX["planar3R"]().state(q))
    U = np.linalg.svd(J)[0]
    p = SIX["planar3R"]().state(q).position("tool")
    for way, share in ((U[:, 0], 1.0), (U[:, 1], 0.0)):
        controller = made(solver, "slow-down", target=p + np.append(0.1 * way, 0.0))
        u = controller.step(q).velocity
        np.testing.assert_allclose(J @ u, share * 0.1 * way, atol=1e-9)


def test_a_path_waits_for_a_hand_that_is_slowed() -> None:
    """A line through the singular circle of a 3R that lies folded: joint rates stay low, the hand on the line."""
    robot = SIX["planar3R"]()
    q0 = folded(0.6)
    start = robot.state(q0).placement("tool")
    goal = start.copy()
    goal.translation = 2.2 * start.translation
    tip = cc.FrameTask("tool", "xy", gain=10.0, target=cc.Line(start, goal, duration=1.0))
    fastest, furthest = {}, {}
    for singularity in (None, cc.SlowDown(0.4)):
        controller = cc.Controller(robot, tip, "pinv", limits=None, dt=1e-3, singularity=singularity)
        run = cc.simulate(controller, q0, duration=3.0)
        fastest[singularity] = np.abs(run.v).max()
        positions = np.array([robot.state(q).position("tool") for q in run.q[::10]])
        way = start.translation / np.linalg.norm(start.translation)
        furthest[singularity] = np.abs(np.cross(way, positions)[:, 2]).max()
    slowed = cc.SlowDown(0.4)
    assert fastest[slowed] <= fastest[None] and furthest[slowed] < 2e-3


# ---------------------------------------------------------------- halt


@pytest.mark.parametrize("solver", list(cc.solvers()))
def test_halt_stops_every_solver_until_reset(solver: str) -> None:
    objective = cc.JointRange() if solver == "extended-jacobian" else None
    controller = made(solver, cc.Halt(0.05), objective=objective)
    moving = controller.step(folded(0.8)).velocity
    assert np.linalg.norm(moving) > 1e-3 and not controller.halted
    command = controller.step(folded(1e-3))
    assert controller.halted and not command.velocity.any()
    assert command.solution.status is cc.Status.SINGULAR and not command.solution.scales.any()
    assert not controller.step(folded(0.8)).velocity.any()  # latched, wherever it is pushed
    controller.reset()
    assert not controller.halted
    np.testing.assert_allclose(controller.step(folded(0.8)).velocity, moving, atol=1e-9)


def test_halt_brakes_within_the_limits() -> None:
    robot = SIX["panda"]()
    goal = robot.state(robot.home).position(robot.tool) + [0.3, 0.0, 0.2]
    hand = cc.FrameTask(robot.tool, "position", gain=5.0, target=goal)
    sigma = np.linalg.svd(hand.jacobian(robot.state(robot.home)))[1][-1]
    controller = cc.Controller(robot, hand, "sns", singularity=cc.Halt(0.97 * sigma), dt=2e-3)
    run = cc.simulate(controller, duration=1.5)
    assert controller.halted and np.abs(run.v).max() > 0.1 and not run.v[-1].any()
    slowing = np.diff(run.v, axis=0) / 2e-3
    assert (np.abs(slowing) <= robot.limits.acceleration_upper * (1 + 1e-9)).all()


@pytest.mark.parametrize("solver", ["pinv", "sns"])
def test_halt_at_the_acceleration_level(solver: str) -> None:
    controller = made(solver, cc.Halt(0.05), level="acceleration")
    v = np.array([0.2, -0.3, 0.1])
    np.testing.assert_allclose(controller.step(folded(1e-3), v).acceleration, -v / 1e-2, rtol=1e-12)


# ---------------------------------------------------------------- avoid


@pytest.mark.parametrize("solver", ["projected-gradient", "reduced-gradient", "task-priority", "sns", "hqp"])
@pytest.mark.parametrize("name", ["planar3R", "panda", "talos"])
def test_avoid_climbs_the_manipulability_of_the_masked_task(solver: str, name: str) -> None:
    """And the hand stays; beside an objective of one's own, both are followed."""
    robot, rng = SIX[name](), np.random.default_rng(2)
    axes = "xy" if name == "planar3R" else "position"
    task, w = cc.FrameTask(robot.tool, axes), cc.Manipulability(axes=axes)
    for given in (None, cc.Posture(gain=0.1)):
        controller = cc.Controller(robot, task, solver, objective=given, limits=None, singularity="avoid")
        plain = cc.Controller(robot, task, solver, objective=given, limits=None)
        q = robot.random_configuration(rng)
        state = robot.state(q)
        added = controller.step(q).velocity - plain.step(q).velocity
        assert np.linalg.norm(task.jacobian(state) @ added) < 1e-9
        assert w.gradient(state) @ added > 1e-6


@pytest.mark.parametrize(
    "task",
    [
        cc.FrameTask("panda_hand_tcp", "position", expressed_in="panda_hand_tcp"),
        cc.FrameTask("panda_hand_tcp", orientation="XYZ"),
        cc.RelativeFrameTask("panda_hand_tcp", "panda_link3", "position"),
        cc.ComTask("xy"),
        cc.FrameTask("panda_hand_tcp", "z rx", length=0.3),
    ],
    ids=lambda task: task.kind,
)
def test_avoid_serves_every_task(task: cc.Task) -> None:
    """Its gradient against differences of sqrt(det(J J^T))."""
    robot = SIX["panda"]()
    controller = cc.Controller(robot, task, "projected-gradient", limits=None, singularity=cc.AvoidSingularity(2.0))
    q = robot.random_configuration(np.random.default_rng(3))
    state = robot.state(q)
    slope = cc.FunctionObjective(lambda s: np.sqrt(np.linalg.det(task.jacobian(s) @ task.jacobian(s).T)), gain=1.0)
    expected, found = slope.gradient(state), controller.objective.direction(state)
    scale = np.linalg.norm(found) / np.linalg.norm(expected)
    np.testing.assert_allclose(found, scale * expected, atol=1e-5 * np.linalg.norm(found))
    assert repr(controller.objective).startswith("TaskManipulability(")


def test_avoid_leads_away_from_a_singularity() -> None:
    """A 3R whose tip turns about its shoulder: led, it unfolds; left alone, it stays as it was."""
    robot = SIX["planar3R"]()
    q0 = folded(0.05)
    ends = {}
    for singularity in (None, cc.AvoidSingularity(2.0)):
        tip = cc.FrameTask("tool", "xy", gain=5.0)
        controller = cc.Controller(robot, tip, "projected-gradient", limits=None, dt=5e-3, singularity=singularity)
        run = cc.simulate(controller, q0, duration=3.0)
        ends[singularity] = np.linalg.svd(tip.jacobian(robot.state(run.q[-1])))[1][-1]
        assert run.metrics().tasks[0].max_m < 0.02
    assert ends[cc.AvoidSingularity(2.0)] > 5.0 * ends[None]


# ---------------------------------------------------------------- all of them


@pytest.mark.parametrize("policy", [*POLICIES, None])
@pytest.mark.parametrize("solver", list(cc.solvers()))
def test_every_solver_takes_every_policy_at_a_singularity(solver: str, policy: str | None) -> None:
    """Finite rates, at the singular posture and near it; what cannot be done is refused when the controller is made."""
    objective = cc.JointRange() if solver == "extended-jacobian" else None
    if policy == "avoid" and solver not in solvers_that_honour("reference") and solver != "extended-jacobian":
        with pytest.raises(UnsupportedProblem, match="no null-space term for an objective"):
            made(solver, policy)
        return
    controller = made(solver, policy, objective=objective)
    for distance in (0.0, 1e-13, 1e-9, 1e-5):
        command = controller.step(folded(distance))
        assert np.isfinite(command.velocity).all() and command.solution.status
        if policy not in (None, "avoid") and solver != "extended-jacobian":
            assert np.linalg.norm(command.velocity) < 60.0, distance  # |c| is about 0.8, the thresholds 0.02 to 0.04


@pytest.mark.parametrize("policy", ["truncate", "damp", "slow-down", "halt"])
@every_exact
def test_far_from_singularities_nothing_changes(policy: str, solver: str) -> None:
    q = folded(0.8)
    guarded, plain = (made(solver, p, path_clock=False).step(q) for p in (policy, None))
    np.testing.assert_allclose(guarded.velocity, plain.velocity, rtol=1e-12)  # the plain one is taken at one stroke
    assert guarded.solution.status is plain.solution.status is cc.Status.OPTIMAL


def test_only_the_task_that_is_near_a_singularity_is_touched() -> None:
    robot = SIX["planar3R"]()
    tip, turn = cc.FrameTask("tool", "xy", target=(0.5, 0.9, 0.0), gain=1.0), cc.JointTask("joint1", [1.0], gain=1.0)
    controller = cc.Controller(robot, [turn, tip], "task-priority", limits=None, singularity="damp")
    solution = controller.step(folded(1e-4)).solution
    plain = cc.Controller(robot, [turn, tip], "task-priority", limits=None).step(folded(1e-4)).solution
    np.testing.assert_array_equal(solution.problem.equations[0].b, plain.problem.equations[0].b)
    assert np.linalg.norm(solution.problem.equations[1].b - plain.problem.equations[1].b) > 1e-2


@pytest.mark.parametrize(
    ("singularity", "error", "words"),
    [
        ("slow", ParameterError, "singularity is 'slow'; expected one of 'truncate', 'damp', 'slow-down'"),
        (3.0, ParameterError, "singularity is 3.0; expected one of"),
        (cc.SelectivelyDamped(), ParameterError, "not linear in the command"),
    ],
)
def test_misuse(singularity: object, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        made("pinv", singularity)


@pytest.mark.parametrize("kind", [cc.SlowDown, cc.Halt, cc.AvoidSingularity])
def test_parameters_are_checked(kind: type) -> None:
    with pytest.raises(ParameterError, match="is 0; expected a number above 0"):
        kind(0.0)


def test_slowing_down_is_a_matter_of_velocities() -> None:
    with pytest.raises(UnsupportedProblem, match="level 'acceleration' commands no velocities"):
        made("pinv", "slow-down", level="acceleration")
