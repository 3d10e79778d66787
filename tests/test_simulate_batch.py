"""Batches of rollouts: the step of the controller from equal states, whatever the batch; fallbacks that say why."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.compiled.path_table import ROW, path_table, read_table
from tests.ways import general

STEP = 1e-10  # rad/s and m/s: one step from equal states, compiled and by Pinocchio


def agrees_step_by_step(controller: cc.Controller, q0s: np.ndarray, duration: float, v0s=None) -> cc.Batch:
    """Every compiled step against Controller.step at the same state; its statuses, scales and errors, too."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # no fallback
        batch = cc.simulate_batch(controller, q0s, duration, v0s=v0s, history=True)
    assert batch.reason is None
    controller = general(controller)
    for i in range(len(batch)):
        controller.reset()
        for k in range(len(batch.time) - 1):
            q, v = batch.q[i, k], batch.v[i, k]
            command = controller.step(q, v, float(batch.time[k]))
            u = batch.v[i, k + 1]
            size = max(1.0, float(np.abs(u).max()))  # without limits, a singularity may ask for 1e4 rad/s
            np.testing.assert_allclose(
                command.velocity, u, atol=STEP * size, rtol=0.0, err_msg=f"rollout {i}, step {k}"
            )
            assert command.solution.status.name == batch.status[i, k], (i, k)
            np.testing.assert_allclose(command.solution.scales, batch.scales[i, k], atol=1e-9, equal_nan=True)
            for task, reference in zip(batch.errors, command.references, strict=True):
                np.testing.assert_allclose(reference.error, task[i, k], atol=1e-11)
            moved = controller.robot.integrate(q, u * controller.dt)
            np.testing.assert_allclose(moved, batch.q[i, k + 1], atol=1e-13 * size)
    return batch


def starts(robot: cc.Robot, n: int, seed: int, spread: float = 0.2) -> np.ndarray:
    rng = np.random.default_rng(seed)
    low, high = robot.limits.position_lower, robot.limits.position_upper
    made = []
    for _ in range(n):
        at = np.clip(robot.coordinates(robot.home) + spread * rng.normal(size=robot.nv), low + 1e-3, high - 1e-3)
        made.append(robot.integrate(robot.neutral, at - robot.coordinates(robot.neutral)))
    return np.array(made)


def circle(robot: cc.Robot, radius: float = 0.1, period: float = 4.0) -> cc.Circle:
    return cc.Circle.starting_at(robot.state(robot.home).placement(robot.tool), radius, period=period)


def panda_job(**given) -> cc.Controller:
    robot = cc.load("panda")
    hand = cc.FrameTask(robot.tool, target=circle(robot))
    return cc.Controller(robot, [hand, cc.PostureTask()], **{"solver": "sns", **given})


def test_the_panda_job():
    """6D pose on a circle from starts off it, a posture, limits, the path that waits, the approach."""
    controller = panda_job()
    batch = agrees_step_by_step(controller, starts(controller.robot, 4, seed=0), 0.4)
    assert batch.statuses.keys() & {"SCALED"}, "from off the path, commands are slowed"
    own = batch._own[:, -1, 0]
    assert (own < batch.time[-1] - 1e-4).any(), "a path waited"


def test_a_whole_rollout_on_the_path():
    """A thousand steps on end: the same run as cc.simulate, round-off apart."""
    controller = panda_job()
    batch = cc.simulate_batch(controller, controller.robot.home[None], 1.0, history=True)
    run = cc.simulate(controller, duration=1.0)
    np.testing.assert_allclose(batch.q[0], run.q, atol=1e-9)
    again = batch.run(0)
    np.testing.assert_allclose(again.tasks[0].error, run.tasks[0].error, atol=1e-9)
    np.testing.assert_allclose(again.tasks[0].singular_values, run.tasks[0].singular_values, atol=1e-8)
    np.testing.assert_allclose(again.tasks[0].pose, run.tasks[0].pose, atol=1e-8)
    np.testing.assert_allclose(again.tasks[0].target, run.tasks[0].target, atol=1e-9)
    assert again.status == run.status and again.meta["solver"] == "sns"
    assert again.metrics().tasks[0].max_m == pytest.approx(run.metrics().tasks[0].max_m, abs=1e-9)


CASES = {
    "no approach, tight speeds": {"approach": False},
    "no clock": {"path_clock": False},
    "no limits": {"limits": None},
    "dls": {"solver": "dls", "limits": None},
    "dls, strong": {"solver": cc.DLS(0.4), "limits": None},
    "task-priority": {"solver": "task-priority", "limits": None},
    "disabled": {"disabled": "panda_joint3"},
}


@pytest.mark.parametrize("case", CASES)
def test_solvers_and_switches(case):
    controller = panda_job(**CASES[case])
    if case.endswith("tight speeds"):
        controller.limits = controller.robot.limits.replace(velocity_upper=0.2, velocity_lower=-0.2)
    agrees_step_by_step(controller, starts(controller.robot, 3, seed=1), 0.05)


def test_from_anywhere_inside_the_limits_and_beyond():
    """Random states at speed: joints at their limits, states that cannot be kept, targets far off."""
    robot = cc.load("panda")
    rng = np.random.default_rng(5)
    hand = cc.FrameTask(robot.tool, target=robot.state(robot.home).placement(robot.tool))
    controller = cc.Controller(robot, [hand, cc.PostureTask()], solver="sns")
    q0s = np.array([robot.random_configuration(rng) for _ in range(6)])
    q0s[0] += 0.02 * np.sign(q0s[0]) * (np.abs(q0s[0]) > 2.0)
    batch = agrees_step_by_step(controller, q0s, 0.03, v0s=rng.normal(size=(6, 7)))
    assert "RECOVERING" in batch.statuses


def test_tasks_of_all_kinds_it_holds():
    """Some axes, rows weighed in metres, joints held, gains one a row, open targets, three ranks."""
    robot = cc.load("panda")
    position = robot.state(robot.home).position(robot.tool) + [0.05, 0.1, -0.1]
    tasks = [
        cc.FrameTask(robot.tool, "xy rz", gain=[5.0, 10.0, 3.0], target=position, length=0.3),
        cc.JointTask("panda_joint2", gain=4.0),
        cc.FrameTask("panda_link4", "z", target=[0.0, 0.0, 0.7], fit="least_squares"),
        cc.PostureTask(np.full(7, -0.2), gain=2.0),
    ]
    for solver in ("sns", "task-priority", "dls"):
        limits = {} if solver == "sns" else {"limits": None}
        controller = cc.Controller(robot, tasks, solver=solver, **limits)
        agrees_step_by_step(controller, starts(robot, 3, seed=2), 0.03)


@pytest.mark.parametrize("name", ["kinova", "pr2", "talos", "planar3R"])
def test_other_robots(name):
    """Continuous joints, prismatic ones, branches, and an arm with fewer joints than rows."""
    robot = cc.load(name)
    turned = robot.state(robot.home).placement(robot.tool) * pin.exp6(np.array([0.05, 0.02, 0.0, 0.1, 0.0, 0.2]))
    controller = cc.Controller(robot, [cc.FrameTask(robot.tool, target=turned), cc.PostureTask()], solver="sns")
    agrees_step_by_step(controller, starts(robot, 2, seed=3, spread=0.1), 0.03)


def test_at_the_edge_of_the_workspace():
    """A target out of reach: the arm stretches, is held back and kept calm, in both the same."""
    robot = cc.load("panda")
    q = np.array([0.0, 0.3, 0.0, -0.15, 0.0, 1.9, 0.7])
    far = robot.state(q).placement(robot.tool)
    far.translation = far.translation * 1.15
    controller = cc.Controller(
        robot, [cc.FrameTask(robot.tool, "position", target=far), cc.PostureTask()], solver="sns"
    )
    agrees_step_by_step(controller, q[None], 0.25)


def test_a_corner_that_waits_and_one_that_does_not():
    robot = cc.load("panda")
    start = robot.state(robot.home).placement(robot.tool)
    corners = [start.translation + d for d in ([0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.2, 0.0])]
    for timing in ("quintic", "trapezoid"):
        path = cc.Polygon(corners, duration=0.5, closed=False, orientation=start.rotation, timing=timing)
        controller = cc.Controller(robot, [cc.FrameTask(robot.tool, target=path), cc.PostureTask()], solver="sns")
        batch = agrees_step_by_step(controller, np.array(robot.home)[None], 0.6)
        assert batch._own[0, -1, 0] < batch.time[-1], "too fast for the arm, so it waited"


def test_a_fast_path_needs_no_more_samples_than_its_shape_does():
    """Where an acceleration passes zero, differences of rates over short times are round-off: no reason to halve."""
    T, a = np.eye(3), 0.5

    def path(t):  # 4 Hz
        w = 8.0 * np.pi
        c, s, z = np.cos(w * t), np.sin(w * t), np.zeros(3)
        twist = np.array([-a * w * s, a * w * c, 0.0, *z])
        return cc.PathSample(
            np.array([a * c, a * s, 0.3]), T, twist, np.array([-a * w * w * c, -a * w * w * s, 0.0, *z])
        )

    times = np.linspace(0.0, 0.25, 126)
    table = path_table(path, times, "task")
    assert len(table) < 20_000
    out = np.empty(ROW)
    for t in np.random.default_rng(0).uniform(0.0, 0.25, 200):
        read_table(table, t, out)
        own = path(t)
        np.testing.assert_allclose(out[10:13], own.position, atol=1e-11)
        np.testing.assert_allclose(out[13:19], own.twist, atol=1e-10)
        np.testing.assert_allclose(out[19:25], own.acceleration, atol=1e-7)


def test_a_path_whose_twist_is_not_its_velocity_says_so_at_once():
    """No density would make a table of it; it is stepped in Python."""
    robot = cc.load("panda")
    start = robot.state(robot.home).placement(robot.tool)
    asked = []

    def path(t):
        asked.append(t)
        position = start.translation + [0.0, 0.05 * np.sin(3.0 * t), 0.0]
        return cc.PathSample(position, start.rotation, np.zeros(6), np.zeros(6))

    controller = cc.Controller(robot, [cc.FrameTask(robot.tool, target=path)], solver="sns", dt=1e-3)
    with pytest.warns(cc.CartctlWarning, match="too rough at t = .* derivatives of its position"):
        batch = cc.simulate_batch(controller, np.array(robot.home)[None], 0.02)
    assert batch.reason is not None and len(asked) < 30_000


def test_a_circle_is_worked_out_in_the_loop(monkeypatch):
    """Its samples are not made ahead; asked as anybody's path, the same comes of it."""
    controller = panda_job()
    q0s = starts(controller.robot, 3, seed=5)
    own = cc.simulate_batch(controller, q0s, 0.3, history=True)
    monkeypatch.setattr("cartctl.compiled.plan.curve_of", lambda path: None)
    sampled = cc.simulate_batch(controller, q0s, 0.3, history=True)
    np.testing.assert_allclose(own.q, sampled.q, atol=1e-9)
    np.testing.assert_allclose(own.errors[0], sampled.errors[0], atol=1e-9)
    monkeypatch.undo()
    monkeypatch.setattr("cartctl.compiled.plan.path_table", None)
    cc.simulate_batch(controller, q0s, 0.3)


def test_bit_for_bit_whatever_the_batch():
    controller = panda_job()
    q0s = starts(controller.robot, 12, seed=4)
    order = np.random.default_rng(0).permutation(12)
    whole = cc.simulate_batch(controller, q0s, 0.1, threads=1)
    shuffled = cc.simulate_batch(controller, q0s[order], 0.1, threads=3)
    np.testing.assert_array_equal(shuffled.q_end, whole.q_end[order])
    np.testing.assert_array_equal(shuffled.v_end, whole.v_end[order])
    for i in (0, 7):
        alone = cc.simulate_batch(controller, q0s[i : i + 1], 0.1, history=True)
        np.testing.assert_array_equal(alone.q_end[0], whole.q_end[i])
        np.testing.assert_array_equal(alone.q[0, -1], whole.q_end[i])
        np.testing.assert_array_equal(alone.error_end[0][0], whole.error_end[0][i])


def test_limits_are_kept_over_many_starts():
    controller = panda_job()
    robot = controller.robot
    batch = cc.simulate_batch(controller, starts(robot, 50, seed=9, spread=0.5), 0.5, history=True)
    low, high = robot.limits.position_lower, robot.limits.position_upper
    assert (batch.q >= low - 1e-9).all() and (batch.q <= high + 1e-9).all()
    assert (np.abs(batch.v) <= robot.limits.velocity_upper + 1e-9).all()
    rise = np.diff(batch.v, axis=1) / controller.dt
    assert (rise <= robot.limits.acceleration_upper * (1.0 + 1e-9)).all()
    assert (rise >= robot.limits.acceleration_lower * (1.0 + 1e-9)).all()
    assert sum(batch.statuses.values()).sum() == 50 * 500


FALLBACKS = {
    "objective": ({"objective": cc.JointRange()}, "an objective is not compiled: JointRange"),
    "solver": ({"solver": "hqp"}, "solver 'hqp' is not compiled"),
    "policy": ({"solver": cc.TaskPriority(cc.Damped(0.1)), "limits": None}, "policy Damped"),
    "metric": ({"metric": "inertia"}, "a metric is not compiled"),
    "level": ({"level": "acceleration"}, "level 'acceleration' is not compiled"),
    "singularity": ({"singularity": "damp"}, "a singularity policy is not compiled"),
    "jerk": ({"jerk": True}, "jerk limits are not compiled"),
    "constraint": ({"constraints": [cc.HalfSpace("panda_hand_tcp", [0, 0, -1.0], 0.0)]}, "constraint.*HalfSpace"),
}


@pytest.mark.parametrize("case", FALLBACKS)
def test_what_is_not_compiled_is_stepped_in_python_and_says_why(case):
    changes, words = FALLBACKS[case]
    controller = panda_job(**changes)
    q0s = starts(controller.robot, 2, seed=6)
    with pytest.warns(cc.CartctlWarning, match=f"stepped in Python, for .*{words}"):
        batch = cc.simulate_batch(controller, q0s, 0.01, history=True)
    assert batch.reason
    for i, q0 in enumerate(q0s):
        run = cc.simulate(controller, q0, 0.01)
        np.testing.assert_array_equal(batch.q[i], run.q)
        np.testing.assert_array_equal(batch.q_end[i], run.q[-1])
        assert batch.run(i).status == run.status


def test_other_tasks_and_joints_fall_back_by_name():
    panda, talos = cc.load("panda"), cc.load("talos", root_joint="free_flyer")
    for robot, task, words in (
        (panda, cc.ComTask(target=[0.3, 0.0, 0.4]), "task 'com' is a ComTask"),
        (panda, cc.FrameTask(panda.tool, expressed_in=panda.tool), "expressed in the axes of"),
        (panda, cc.FrameTask(panda.tool, orientation="XYZ"), "Euler angles XYZ"),
        (talos, cc.FrameTask(talos.tool), "joint 'root_joint' is a FreeFlyer"),
        (panda, cc.JointTask(target=lambda t: (np.zeros(7), np.zeros(7), np.zeros(7))), "path of joint coordinates"),
    ):
        controller = cc.Controller(robot, task, solver="sns")
        with pytest.warns(cc.CartctlWarning, match=words):
            cc.simulate_batch(controller, robot.home[None], 2e-3)


def test_misuse_is_refused():
    controller = panda_job()
    home = controller.robot.home
    wrong = [
        (cc.errors.ShapeError, "q0s has shape", {"q0s": home}),
        (cc.errors.ShapeError, "v0s has shape", {"v0s": np.zeros(6)}),
        (cc.errors.NonFiniteError, r"q0s\[0\]", {"q0s": np.full((1, 7), np.nan)}),
        (cc.errors.TimeStepError, "duration", {"duration": 0.0}),
        (cc.errors.ParameterError, "threads", {"threads": 0}),
        (cc.errors.ParameterError, "history", {"history": 1}),
    ]
    for error, words, changes in wrong:
        with pytest.raises(error, match=words):
            cc.simulate_batch(controller, **{"q0s": home[None], "duration": 0.01, **changes})
    with pytest.raises(cc.errors.ParameterError, match="expected a cc.Controller"):
        cc.simulate_batch(None, home[None])
    batch = cc.simulate_batch(controller, home[None], 0.002)
    with pytest.raises(cc.errors.ParameterError, match="history=True"):
        batch.run(0)
    with pytest.raises(cc.errors.ParameterError, match="index is 1"):
        cc.simulate_batch(controller, home[None], 0.002, history=True).run(1)


def test_no_starts_at_all():
    batch = cc.simulate_batch(panda_job(), np.zeros((0, 7)), 0.01, history=True)
    assert len(batch) == 0 and batch.q_end.shape == (0, 7)


def test_interpreted_and_compiled_agree():
    code = """
import tests.test_simulate_batch as t, cartctl as cc, numpy as np
controller = t.panda_job()
batch = cc.simulate_batch(controller, t.starts(controller.robot, 1, seed=0), 0.003)
print([batch.q_end.tolist(), batch.v_end.tolist()])
"""
    answers = []
    for off in ("0", "1"):
        env = {**os.environ, "NUMBA_DISABLE_JIT": off, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        answers.append(np.array(eval(done.stdout)))  # noqa: S307 - printed above
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-10)


def test_a_row_of_dust_is_no_size():
    """An arm folded back on itself, along which it is asked to move: 1e-15 of a link's length is left of J."""
    robot = cc.load("planar2R")
    q0 = np.array([[np.pi, -np.pi], [3.14159265358979, -3.14159265358979], [0.0, 0.0]])
    hand = cc.FrameTask(robot.tool, "x", target=[7.0, 0.0, 0.0], gain=1.0)
    batch = cc.simulate_batch(cc.Controller(robot, [hand, cc.PostureTask()], "sns", dt=1e-3), q0, 0.05, history=True)
    assert "FAILED" not in batch.statuses and np.isfinite(batch.v).all()
