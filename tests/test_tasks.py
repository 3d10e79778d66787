"""Tasks: errors whose derivative is the Jacobian, drifts, masks, axes, Euler sequences, targets."""

from __future__ import annotations

import warnings

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cartctl as cc
from cartctl.errors import (
    CartctlError,
    CartctlWarning,
    FrameNotFound,
    JointNotFound,
    NonFiniteError,
    ParameterError,
    ShapeError,
    TargetError,
)
from cartctl.spatial import EULER_SEQUENCES
from tests.robots_for_tests import ROBOTS, along, panda, planar, random_state, talos

STEP = 1e-6


def tasks_of(robot: cc.Robot) -> list[cc.Task]:
    tool = robot.tool
    other = robot.frame_names[len(robot.frame_names) // 2]
    joints = robot.single_joints
    return [
        cc.FrameTask(tool),
        cc.FrameTask(tool, "position"),
        cc.FrameTask(tool, "x rz", length=0.3),
        cc.FrameTask(tool, [0, 1, 0, 1, 0, 1]),
        cc.RelativeFrameTask(tool, other),
        cc.RelativeFrameTask(other, tool, "y rx"),
        cc.ComTask(),
        cc.ComTask("xy"),
        cc.PostureTask(),
        cc.JointTask([joints[-1], joints[0]]),
        cc.FunctionTask(lambda s: np.sin(s.position(tool)), name="sines"),
        cc.FunctionTask(lambda s: s.position(tool)[:2] * 2.0, lambda s: 2.0 * s.jacobian(tool)[:2], name="given"),
    ]


@pytest.mark.parametrize("name", list(ROBOTS))
@pytest.mark.parametrize("k", range(12))
def test_jacobian_and_drift_by_finite_differences(name: str, k: int) -> None:
    robot = ROBOTS[name]()
    task = tasks_of(robot)[k]
    task.check(robot)
    rng = np.random.default_rng(100 * k + len(name))
    state = random_state(robot, rng)
    anchor = task.anchor(state)  # the error towards where we are now: its derivative there is -J
    J = task.jacobian(state)
    assert J.shape == (len(task.units(robot)), robot.nv)
    for i in rng.choice(robot.nv, min(robot.nv, 8), replace=False):
        e = STEP * np.eye(robot.nv)[i]
        ends = [task.reference(along(robot, state, s * e), 0.0, anchor).error for s in (1, -1)]
        np.testing.assert_allclose(-J[:, i], (ends[0] - ends[1]) / (2 * STEP), atol=5e-8)
    ahead, behind = (along(robot, state, s * STEP * state.v) for s in (1, -1))
    difference = (task.jacobian(ahead) - task.jacobian(behind)) @ state.v / (2 * STEP)
    loose = 1e-3 if task.kind == "function" else 1e-6  # a difference of a difference
    np.testing.assert_allclose(task.drift(state), difference, atol=loose * (1 + state.v @ state.v))


@pytest.mark.parametrize("name", list(ROBOTS))
@pytest.mark.parametrize("k", range(14))
def test_curvatures_are_drifts_along_other_velocities(name: str, k: int) -> None:
    """All at once, or one by one; the state comes back as it was."""
    robot, rng = ROBOTS[name](), np.random.default_rng(7 * k + len(name))
    tool = robot.tool
    more = [cc.FrameTask(tool, expressed_in=tool), cc.FrameTask(tool, "rx z", orientation="XYZ")]
    task = [*tasks_of(robot), *more][k]
    task.check(robot)
    state = random_state(robot, rng)
    before = np.array(task.drift(state))
    V = rng.normal(size=(4, robot.nv))
    curvatures = task.curvatures(state, V)
    assert curvatures.shape == (len(task.units(robot)), 4)
    for column, v in zip(curvatures.T, V, strict=True):
        alone = task.drift(robot.state(state.q, v))
        np.testing.assert_allclose(column, alone, atol=1e-10 * (1.0 + v @ v) * (1.0 + np.abs(alone).max(initial=0.0)))
    np.testing.assert_array_equal(task.drift(state), before)


@pytest.mark.parametrize("sequence", EULER_SEQUENCES)
def test_euler_rates_through_the_analytic_jacobian(sequence: str) -> None:
    robot = panda()
    task = cc.FrameTask(robot.tool, "orientation", orientation=sequence)
    rng = np.random.default_rng(9)
    for _ in range(20):
        state = random_state(robot, rng)
        from cartctl.spatial import euler_angles, euler_rates

        phi = euler_angles(sequence, state.rotation(robot.tool))
        if abs(np.linalg.det(euler_rates(sequence, phi))) > 0.2:
            break
    columns = []
    for e in STEP * np.eye(robot.nv):
        ends = [euler_angles(sequence, along(robot, state, s * e).rotation(robot.tool)) for s in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2 * STEP))
    np.testing.assert_allclose(task.jacobian(state), np.array(columns).T, atol=1e-6)
    ahead, behind = (along(robot, state, s * STEP * state.v) for s in (1, -1))
    difference = (task.jacobian(ahead) - task.jacobian(behind)) @ state.v / (2 * STEP)
    np.testing.assert_allclose(task.drift(state), difference, atol=1e-4 * (1 + state.v @ state.v))


def test_a_gimbal_lock_is_said_and_does_not_explode() -> None:
    robot = panda()
    task = cc.FrameTask(robot.tool, orientation="ZYZ")  # at home the hand points down: theta = pi
    controller = cc.Controller(robot, task, limits=None)
    with pytest.warns(CartctlWarning, match="gimbal lock"):
        command = controller.step(robot.home)
    assert command.solution.status is cc.Status.SINGULAR
    task.target = robot.state(robot.home + 0.05).placement(robot.tool)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert np.linalg.norm(controller.step(robot.home).velocity) < 1e3
    xyz = cc.FrameTask(robot.tool, orientation="XYZ")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cc.Controller(robot, xyz, limits=None).step(robot.home).solution.status is cc.Status.OPTIMAL


def test_euler_reference_rates_belong_to_the_path() -> None:
    robot = panda()
    start = robot.state(robot.home + 0.3).placement(robot.tool)
    end = start * pin.SE3(pin.exp3(np.array([0.4, -0.3, 0.5])), np.array([0.1, 0.0, 0.05]))
    task = cc.FrameTask(robot.tool, orientation="XYZ", target=cc.Line(start, end, duration=2.0))
    state = robot.state(robot.home + 0.3)
    from cartctl.spatial import euler_angles

    t, h = 0.83, 1e-5
    phi = [euler_angles("XYZ", task.target(t + s * h).rotation) for s in (-1, 0, 1)]
    reference = task.reference(state, t, task.anchor(state))
    np.testing.assert_allclose(reference.rate[3:], (phi[2] - phi[0]) / (2 * h), atol=1e-7)
    np.testing.assert_allclose(reference.acceleration[3:], (phi[2] - 2 * phi[1] + phi[0]) / h**2, atol=1e-4)


@pytest.mark.parametrize("solver", ["pinv", cc.DLS(damping=0.05)])
@pytest.mark.parametrize("seed", range(5))
def test_tool_axes_and_base_axes_give_the_same_motion(solver: object, seed: int) -> None:
    robot, rng = panda(), np.random.default_rng(seed)
    q = robot.random_configuration(rng)
    target = robot.state(robot.random_configuration(rng)).placement(robot.tool)
    commands = [
        cc.Controller(robot, cc.FrameTask(robot.tool, target=target, expressed_in=axes), solver=solver, limits=None)
        .step(q)
        .velocity
        for axes in ("world", robot.tool, "panda_link3")
    ]
    for other in commands[1:]:
        np.testing.assert_allclose(other, commands[0], rtol=1e-9, atol=1e-9 * np.linalg.norm(commands[0]))


def test_masks_in_tool_axes_control_the_tools_own_directions() -> None:
    robot, rng = panda(), np.random.default_rng(3)
    state = random_state(robot, rng)
    R = state.rotation(robot.tool)
    J = cc.FrameTask(robot.tool, "z rx", expressed_in=robot.tool).jacobian(state)
    full = state.jacobian(robot.tool)
    np.testing.assert_allclose(J, [R[:, 2] @ full[:3], R[:, 0] @ full[3:]], atol=1e-12)


@given(st.lists(st.booleans(), min_size=6, max_size=6).filter(any))
def test_masks_select_rows(mask: list[bool]) -> None:
    robot = panda()
    state = robot.state(robot.home)
    letters = " ".join(n for n, m in zip(("x", "y", "z", "rx", "ry", "rz"), mask, strict=True) if m)
    rows = np.flatnonzero(mask)
    for axes in (mask, letters, np.array(mask, dtype=float)):
        np.testing.assert_array_equal(cc.FrameTask(robot.tool, axes).jacobian(state), state.jacobian(robot.tool)[rows])


@pytest.mark.parametrize("axes", ["", "w", "xx", "pos", [1, 0], [2, 0, 0, 0, 0, 0], [0] * 6, None, 3, "x r"])
def test_bad_axes_are_refused(axes: object) -> None:
    with pytest.raises(ParameterError, match="axes is"):
        cc.FrameTask("tool", axes)


def test_targets_of_every_kind() -> None:
    robot = panda()
    state = robot.state(robot.home)
    here, there = state.placement(robot.tool), robot.state(robot.home + 0.2).placement(robot.tool)
    task = cc.FrameTask(robot.tool)
    anchor = task.anchor(state)
    np.testing.assert_allclose(task.reference(state, 0.0, anchor).error, 0.0, atol=1e-12)
    wanted = np.concatenate([there.translation - here.translation, pin.log3(there.rotation @ here.rotation.T)])
    for target, rows in {"pose": (there, slice(0, 6)), "matrix": (there.homogeneous, slice(0, 6))}.values():
        task.target = target
        np.testing.assert_allclose(task.reference(state, 0.0, anchor).error[rows], wanted[rows], atol=1e-12)
    for target, rows, held in (
        (there.translation, slice(0, 3), slice(3, 6)),
        (there.rotation, slice(3, 6), slice(0, 3)),
    ):
        task.target = target
        error = task.reference(state, 0.0, anchor).error
        np.testing.assert_allclose(error[rows], wanted[rows], atol=1e-12)
        np.testing.assert_allclose(error[held], 0.0, atol=1e-12)
    task.target = cc.Line(here, there, duration=1.0)
    reference = task.reference(state, 0.5, anchor)
    np.testing.assert_allclose(reference.error, wanted / 2, atol=1e-9)
    np.testing.assert_allclose(reference.rate, 1.875 * wanted, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("target", "error"),
    [
        ([1.0, 2.0], TargetError),
        ("here", TargetError),
        (np.diag([1.0, 1.0, -1.0]), TargetError),
        (2.0 * np.eye(3), TargetError),
        (np.ones((4, 4)), TargetError),
        ([0.0, np.nan, 0.0], NonFiniteError),
        (np.full((4, 4), np.inf), NonFiniteError),
    ],
)
def test_bad_targets_are_refused_and_leave_the_old_one(target: object, error: type[CartctlError]) -> None:
    task = cc.FrameTask("tool", target=[0.1, 0.2, 0.3])
    with pytest.raises(error) as caught:
        task.target = target
    assert "tool" in str(caught.value) and "\n" not in str(caught.value)
    assert task.target == [0.1, 0.2, 0.3]


def test_a_path_that_goes_astray_is_refused_in_the_step() -> None:
    robot = panda()

    class Astray:
        position, rotation, twist, acceleration = np.full(3, np.nan), None, np.zeros(6), np.zeros(6)

    task = cc.FrameTask(robot.tool, target=lambda t: Astray() if t > 0.5 else 3)
    controller = cc.Controller(robot, task, limits=None)
    with pytest.raises(TargetError, match="returned a int"):
        controller.step(robot.home, t=0.0)
    with pytest.raises(NonFiniteError, match=robot.tool):
        controller.step(robot.home, t=1.0)
    task.target = None
    np.testing.assert_allclose(controller.step(robot.home).velocity, 0.0, atol=1e-9)


def test_joint_targets_go_the_short_way_round() -> None:
    robot = ROBOTS["kinova"]()
    turning = robot.dof_names[int(np.flatnonzero(robot.continuous)[0])]
    task = cc.JointTask(turning, target=[3.1])
    state = robot.state(robot.configuration({turning: -3.1}, robot.home))
    assert task.reference(state, 0.0, None).error[0] == pytest.approx(6.2 - 2 * np.pi)
    posture = cc.PostureTask()
    np.testing.assert_allclose(posture.reference(robot.state(robot.home), 0.0, None).error, 0.0, atol=1e-12)
    assert len(posture.units(talos())) == talos().nv - 6


def test_joint_paths_bring_their_rates() -> None:
    robot = planar()
    task = cc.JointTask(target=lambda t: (np.array([t, 2 * t, 0.0]), [1.0, 2.0, 0.0], np.zeros(3)), gain=5.0)
    command = cc.Controller(robot, task, limits=None).step(np.zeros(3), t=0.1)
    np.testing.assert_allclose(command.velocity, [1.5, 3.0, 0.0])


@pytest.mark.parametrize(
    ("task", "error"),
    [
        (cc.FrameTask("hand"), FrameNotFound),
        (cc.FrameTask("tool", expressed_in="hand"), FrameNotFound),
        (cc.RelativeFrameTask("tool", "hand"), FrameNotFound),
        (cc.JointTask(["knee"]), JointNotFound),
        (cc.PostureTask([1.0, 2.0]), TargetError),
        (cc.FrameTask("tool", gain=[1.0, 2.0]), ShapeError),
        (cc.FunctionTask(lambda s: np.nan), NonFiniteError),
        (cc.FunctionTask(lambda s: s.q[:2], lambda s: np.ones((3, 3))), ShapeError),
        (cc.FunctionTask(lambda s: s.q[:2], lambda s: np.ones((2, 5))), ShapeError),
        (cc.FunctionTask(lambda s: s.q[:2], target=[1.0]), TargetError),
    ],
)
def test_what_does_not_fit_the_robot_is_refused_by_the_controller(task: cc.Task, error: type[CartctlError]) -> None:
    with pytest.raises(error):
        cc.Controller(planar(), task, limits=None)


@pytest.mark.parametrize(
    "options",
    [
        {"gain": -1.0},
        {"gain": np.nan},
        {"gain": "fast"},
        {"weight": -1.0},
        {"fit": "best"},
        {"length": 0.0},
        {"orientation": "ZZY"},
    ],
)
def test_bad_parameters_are_refused(options: dict) -> None:
    with pytest.raises(CartctlError) as caught:
        cc.FrameTask("tool", **options)
    assert next(iter(options)) in str(caught.value)


def test_two_hands_keep_their_relative_pose() -> None:
    robot = cc.load("baxter")
    left, right = "left_gripper", "right_gripper"
    if left not in robot.frame_names:
        pytest.fail(f"baxter's frames changed: {robot.frame_names}")
    state = robot.state(robot.home)
    start = state.placement(left)
    away = cc.Line(start, pin.SE3(start.rotation, start.translation + [0.05, 0.0, 0.06]), duration=1.0)
    hold, move = cc.RelativeFrameTask(right, left), cc.FrameTask(left, target=away)
    run = cc.simulate(cc.Controller(robot, [hold, move], solver="task-priority", limits=None, dt=2e-3), duration=1.2)
    figures = run.metrics()
    assert figures.tasks[0].max_m < 1e-4 and figures.tasks[0].max_rad < 1e-4
    assert figures.tasks[1].final_m < 1e-5
