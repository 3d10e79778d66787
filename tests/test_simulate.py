"""Rollouts: the Panda circle, interruption, and what a Run remembers, saves and measures."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pyarrow.csv
import pyarrow.parquet
import pytest

import cartctl as cc
from cartctl.errors import (
    CartctlError,
    FileError,
    NonFiniteError,
    ParameterError,
    RunFileError,
    ShapeError,
    TimeStepError,
)
from tests.robots_for_tests import ROBOTS, panda, planar


def circling(robot: cc.Robot, dt: float = 1e-3, laps: int = 1, **options: object) -> cc.Controller:
    """The tool on a circle of radius 0.1 m, 4 s a lap, that starts where home has it."""
    start = robot.state(robot.home).placement(robot.tool)
    centre = pin.SE3(start.rotation, start.translation - start.rotation[:, 0] * 0.1)
    hand = cc.FrameTask(robot.tool, target=cc.Circle(center=centre, radius=0.1, period=4.0, laps=laps))
    options = {"solver": "projected-gradient", "objective": cc.JointRange()} | options
    return cc.Controller(robot, hand, limits=None, dt=dt, **options)


@pytest.fixture(scope="module")
def circle() -> cc.Run:
    return cc.simulate(circling(panda()), duration=5.0)


def test_the_panda_circle_is_tracked(circle: cc.Run) -> None:
    figures = circle.metrics(after=0.5).tasks[0]
    assert figures.rms_m < 0.05e-3
    assert figures.final_m < 1e-6 and figures.final_rad < 1e-6
    assert circle.metrics().status == {"OPTIMAL": 5000}
    radius = np.linalg.norm(circle.tasks[0].target[:, :3] - circle.tasks[0].target[:4000, :3].mean(0), axis=1)
    assert np.ptp(circle.tasks[0].target[:, 0]) == pytest.approx(0.2, abs=1e-6) and radius.max() < 0.21


@pytest.mark.parametrize("solver", ["pinv", cc.DLS(damping=1e-3), "task-priority"])
def test_every_solver_tracks_the_circle(solver: object) -> None:
    run = cc.simulate(circling(panda(), solver=solver, objective=None), duration=5.0)
    assert run.metrics(after=0.5).tasks[0].rms_m < 0.05e-3
    assert run.metrics().tasks[0].final_m < 1e-6


class _Roll(cc.Objective):
    """Pushes the first joint, as far as the null space lets it."""

    gain = 1.0

    def value(self, state: cc.State) -> float:
        return float(state.q[0])

    def gradient(self, state: cc.State) -> np.ndarray:
        return 2.0 * np.eye(state.robot.nv)[0]


def test_the_objective_brings_the_joints_nearer_to_mid_range() -> None:
    robot, objective = panda(), cc.JointRange(gain=300.0)
    rolled = cc.simulate(  # the hand stays, the elbow rolls aside
        cc.Controller(
            robot,
            cc.FrameTask(robot.tool),
            solver="projected-gradient",
            limits=None,
            objective=_Roll(),
            dt=4e-3,
        ),
        duration=1.5,
    )
    assert rolled.metrics().tasks[0].final_m < 1e-4
    q0 = rolled.q[-1]
    start = robot.state(q0).placement(robot.tool)
    hand = cc.FrameTask(robot.tool, target=cc.Circle.starting_at(start, radius=0.1, period=4.0))
    runs = [
        cc.simulate(cc.Controller(robot, hand, solver=s, objective=o, limits=None, dt=4e-3), q0=q0, duration=5.0)
        for s, o in (("projected-gradient", objective), ("pinv", None))
    ]
    ours, plain = (objective.value(robot.state(run.q[-1])) for run in runs)
    assert ours < 0.7 * plain
    slopes = []
    for run in runs:  # what self-motion could still gain
        state = robot.state(run.q[-1])
        J = state.jacobian(robot.tool)
        slopes.append(np.linalg.norm((np.eye(7) - np.linalg.pinv(J) @ J) @ objective.gradient(state)))
    assert slopes[0] < 0.05 * slopes[1]
    assert all(run.metrics().tasks[0].max_m < 1e-3 for run in runs)
    margins = [min(j.position_margin for j in run.metrics().joints) for run in runs]
    assert margins[0] > margins[1]


def test_a_run_is_what_an_independent_forward_kinematics_says(circle: cc.Run) -> None:
    robot = panda()
    data = robot.model.createData()
    for k in (0, 1234, 5000):
        pin.framesForwardKinematics(robot.model, data, circle.q[k])
        placed = data.oMf[robot.frame_id(robot.tool)]
        np.testing.assert_allclose(circle.tasks[0].pose[k, :3], placed.translation, atol=1e-12)
        R = pin.Quaternion(circle.tasks[0].pose[k, 3:]).toRotationMatrix()
        np.testing.assert_allclose(R, placed.rotation, atol=1e-9)
        wanted = circle.tasks[0].target[k]
        np.testing.assert_allclose(circle.tasks[0].error[k, :3], wanted[:3] - placed.translation, atol=1e-12)
        s = np.linalg.svd(
            pin.computeFrameJacobian(
                robot.model, data, circle.q[k], robot.frame_id(robot.tool), pin.LOCAL_WORLD_ALIGNED
            )
        )[1]
        np.testing.assert_allclose(circle.tasks[0].singular_values[k], s, atol=1e-10)
    for k in (0, 777, 4999):
        np.testing.assert_allclose(
            pin.integrate(robot.model, circle.q[k], circle.command[k] * 1e-3), circle.q[k + 1], atol=1e-14
        )
        np.testing.assert_array_equal(circle.v[k + 1], circle.command[k])


def test_saving_and_loading_loses_nothing(circle: cc.Run, tmp_path: Path) -> None:
    path = circle.save(tmp_path / "deep" / "run")
    assert path == tmp_path / "deep" / "run.npz"
    again = cc.Run.load(path)
    for name in ("time", "q", "v", "command", "solve_time"):
        np.testing.assert_array_equal(getattr(again, name), getattr(circle, name))
    assert again.status == circle.status and again.meta == circle.meta
    for a, b in zip(again.tasks, circle.tasks, strict=True):
        assert (a.name, a.kind, a.frame, a.units) == (b.name, b.kind, b.frame, b.units)
        np.testing.assert_array_equal(a.error, b.error)
        np.testing.assert_array_equal(a.pose, b.pose)
    assert again.metrics() == circle.metrics()
    assert again.meta["versions"]["pin"] and again.meta["solver"] == "projected-gradient"
    json.dumps(again.meta)


def test_exports_hold_every_sample(circle: cc.Run, tmp_path: Path) -> None:
    csv = pyarrow.csv.read_csv(circle.to_csv(tmp_path / "a" / "run.csv"))
    parquet = pyarrow.parquet.read_table(circle.to_parquet(tmp_path / "b" / "run.parquet"))
    assert csv.column_names == parquet.column_names and csv.num_rows == parquet.num_rows == 5001
    np.testing.assert_allclose(parquet["q3"].to_numpy(), circle.q[:, 3])
    np.testing.assert_allclose(csv["command panda_joint2"].to_numpy()[:-1], circle.command[:, 1])
    np.testing.assert_allclose(csv["panda_hand_tcp error1 [m]"].to_numpy(), circle.tasks[0].error[:, 1])
    assert csv["status"][0].as_py() == "OPTIMAL" and parquet["status"][5000].as_py() is None


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 torn"])
def test_what_is_no_run_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "run.npz").write_bytes(content)
    with pytest.raises(RunFileError, match="run.npz"):
        cc.Run.load(tmp_path / "run.npz")
    np.savez(tmp_path / "other.npz", a=np.arange(3))
    with pytest.raises(RunFileError, match="other.npz"):
        cc.Run.load(tmp_path / "other.npz")
    with pytest.raises(RunFileError, match="no such file"):
        cc.Run.load(tmp_path / "none.npz")


def test_metrics_by_independent_formulas(circle: cc.Run) -> None:
    robot, figures = panda(), circle.metrics(after=1.0)
    e = circle.tasks[0].error[circle.time >= 1.0]
    assert figures.tasks[0].rms_m == pytest.approx(np.sqrt((e[:, :3] ** 2).sum(1).mean()))
    assert figures.tasks[0].max_rad == pytest.approx(np.sqrt((e[:, 3:] ** 2).sum(1)).max())
    low, high = robot.limits.position_lower, robot.limits.position_upper
    for i, joint in enumerate(figures.joints):
        assert joint.position_margin == pytest.approx(
            min((circle.q[:, i] - low[i]).min(), (high[i] - circle.q[:, i]).min())
        )
        assert joint.velocity_ratio == pytest.approx(np.abs(circle.v[:, i]).max() / robot.limits.velocity_upper[i])
        a = np.abs(np.diff(circle.v[:, i])).max() / 1e-3
        assert joint.acceleration_ratio == pytest.approx(a / robot.limits.acceleration_upper[i])
    assert figures.step_p50 == pytest.approx(np.median(circle.solve_time)) and figures.step_p99 >= figures.step_p50


def test_violations_are_counted() -> None:
    robot = planar()
    fast = cc.JointTask("joint1", target=lambda t: ([0.0 * t], [10.0], [0.0]), gain=0.0)
    limits = robot.limits
    steps = 100
    run = cc.simulate(cc.Controller(robot, fast, limits=None, dt=0.01), q0=np.zeros(3), duration=1.0)
    joint = run.metrics().joints[0]
    too_far = int((run.q[:, 0] > limits.position_upper[0]).sum())
    assert joint.velocity_ratio == pytest.approx(10.0 / limits.velocity_upper[0])
    assert joint.violations == steps and 0 < too_far < steps
    assert joint.position_margin == pytest.approx(limits.position_upper[0] - 10.0, abs=1e-9)
    assert run.metrics().joints[1].violations == 0


def test_drift_over_a_closed_path_is_measured() -> None:
    robot = panda()
    run = cc.simulate(circling(robot, solver="pinv", objective=None, laps=2, dt=4e-3), duration=8.0)
    lap_times = run.meta["cycles"]
    assert len(lap_times) == 3 and lap_times[-1] == pytest.approx(8.0)
    ends = [run.q[round(t / 4e-3)] for t in lap_times]
    expected = max(np.linalg.norm(b - a) for a, b in zip(ends[:-1], ends[1:], strict=True))
    assert run.metrics().path_drift == pytest.approx(expected) and expected > 1e-3
    line = cc.Controller(planar(), cc.FrameTask("tool", "xy"), limits=None)
    assert cc.simulate(line, duration=0.01).metrics().path_drift is None


@pytest.mark.parametrize("name", list(ROBOTS))
def test_several_tasks_on_every_robot(name: str) -> None:
    robot = ROBOTS[name]()
    tasks = [cc.FrameTask(robot.tool, "xy"), cc.ComTask("x"), cc.PostureTask()]
    run = cc.simulate(cc.Controller(robot, tasks, solver="task-priority", limits=None, dt=0.01), duration=0.3)
    assert [t.kind for t in run.tasks] == ["frame", "com", "posture"] and len(run) == 30
    assert run.tasks[2].pose is None and run.tasks[1].pose.shape == (31, 3)
    assert pin.isNormalized(robot.model, run.q[-1])
    assert all(np.isfinite(t.error).all() for t in run.tasks)
    figures = run.metrics()
    assert len(figures.joints) == robot.nv


class _Interrupting(cc.FrameTask):
    steps = 0

    def reference(self, state: cc.State, t: float, anchor: object) -> cc.Reference:
        self.steps += 1
        if self.steps > 40:
            raise KeyboardInterrupt
        return super().reference(state, t, anchor)


def test_an_interrupted_rollout_keeps_what_it_has(tmp_path: Path) -> None:
    controller = cc.Controller(planar(), _Interrupting("tool", "xy", target=[1.0, 1.0, 0.0]), limits=None, dt=0.01)
    with pytest.raises(cc.RunInterrupted) as caught:
        cc.simulate(controller, q0=np.array([0.1, 0.2, 0.3]), duration=10.0, save=tmp_path / "run.npz")
    run, saved = caught.value.run, cc.Run.load(tmp_path / "run.npz")
    assert run.interrupted and saved.interrupted and len(run) == len(saved) == 39
    assert isinstance(caught.value, KeyboardInterrupt)
    assert saved.metrics().tasks[0].max_m > 0.1 and len(saved.time) == 40


def test_a_real_interrupt_of_a_real_process_leaves_a_file(tmp_path: Path) -> None:
    code = (
        "import os, signal, cartctl as cc\n"
        "c = cc.Controller(cc.planar([1, 1, 1]), cc.FrameTask('tool', 'xy'), limits=None)\n"
        "stop = lambda k, n: k > 1 and os.kill(os.getpid(), signal.SIGINT)\n"
        "cc.simulate(c, duration=1e4, save='run.npz', progress=stop)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode != 0 and "RunInterrupted" in done.stderr
    assert len(cc.Run.load(tmp_path / "run.npz")) > 0


def test_a_failing_step_also_saves(tmp_path: Path) -> None:
    task = cc.JointTask("joint1", target=lambda t: ([np.nan if t > 0.05 else t], [0.0], [0.0]))
    with pytest.raises(NonFiniteError):
        cc.simulate(cc.Controller(planar(), task, limits=None, dt=0.01), duration=1.0, save=tmp_path / "run.npz")
    assert len(cc.Run.load(tmp_path / "run.npz")) == 5


def test_a_rollout_without_a_step_leaves_an_older_file_alone(tmp_path: Path) -> None:
    robot = planar()
    good = cc.Controller(robot, cc.FrameTask("tool", "xy"), limits=None)
    cc.simulate(good, duration=0.01, save=tmp_path / "run.npz")
    bad = cc.Controller(robot, cc.JointTask("joint1", target=lambda t: ([np.nan], [0.0], [0.0])), limits=None)
    with pytest.raises(NonFiniteError):
        cc.simulate(bad, duration=0.01, save=tmp_path / "run.npz")
    assert len(cc.Run.load(tmp_path / "run.npz")) == 10


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"duration": 0.0}, ParameterError),
        ({"duration": -1.0}, ParameterError),
        ({"duration": np.nan}, NonFiniteError),
        ({"duration": 1e-12}, ParameterError),
        ({"q0": [0.0]}, ShapeError),
        ({"q0": [0.0, 0.0, np.inf]}, NonFiniteError),
        ({"v0": [0.0]}, ShapeError),
        ({"t0": np.nan}, NonFiniteError),
    ],
)
def test_bad_arguments_are_refused(options: dict, error: type[CartctlError]) -> None:
    controller = cc.Controller(planar(), cc.FrameTask("tool", "xy"), limits=None)
    with pytest.raises(error):
        cc.simulate(controller, **({"duration": 0.1} | options))


def test_steps_are_counted_without_round_off() -> None:
    controller = cc.Controller(planar(), cc.FrameTask("tool", "xy"), limits=None, dt=1e-3)
    told: list[tuple[int, int]] = []
    run = cc.simulate(controller, duration=0.3, t0=2.0, progress=lambda k, n: told.append((k, n)))
    assert len(run) == 300 and run.time[0] == 2.0 and run.time[-1] == pytest.approx(2.3, abs=1e-12)
    assert told[-1] == (300, 300)


def test_a_failure_that_persists_also_saves(tmp_path: Path) -> None:
    robot, calls = planar(), [0]

    def height(state: cc.State) -> float:
        calls[0] += 1
        if calls[0] > 30:
            raise RuntimeError("sensor gone")
        return state.position("tool")[1]

    task = cc.FunctionTask(height, lambda s: s.jacobian("tool")[1])
    with pytest.raises(RuntimeError, match="sensor gone"):
        cc.simulate(cc.Controller(robot, task, limits=None), duration=1.0, save=tmp_path / "run.npz")
    assert len(cc.Run.load(tmp_path / "run.npz")) > 2


@pytest.mark.parametrize(("dt", "duration"), [(1e-300, 1.0), (1e-9, 1e9), (1e-3, 1e300)])
def test_more_steps_than_can_be_kept_are_refused(dt: float, duration: float) -> None:
    controller = cc.Controller(planar(), cc.FrameTask("tool", "xy"), limits=None, dt=dt)
    with pytest.raises(TimeStepError, match="steps"):
        cc.simulate(controller, duration=duration)


def test_a_tampered_run_is_refused(circle: cc.Run, tmp_path: Path) -> None:
    path = circle.save(tmp_path / "run.npz")
    with np.load(path) as file:
        arrays = dict(file)
    for change in ({"time": arrays["time"][:-5]}, {"q": np.full_like(arrays["q"], np.nan)}, {"v": arrays["v"][:3]}):
        np.savez(tmp_path / "bad.npz", **(arrays | change))
        with pytest.raises(RunFileError, match="bad.npz"):
            cc.Run.load(tmp_path / "bad.npz")


def test_files_that_cannot_be_written_are_named(circle: cc.Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for write in (circle.save, circle.to_csv, circle.to_parquet, circle.plot, circle.html):
        with pytest.raises(FileError, match="cannot be written"):
            write(tmp_path / "file" / "below.npz" if write == circle.save else tmp_path / "file" / "below.png")
    with pytest.raises(ParameterError, match="file type"):
        circle.plot(tmp_path / "run.foo")
    with pytest.raises(ParameterError, match=".csv"):
        circle.save(tmp_path / "run.csv")


def test_links_are_followed_when_writing(circle: cc.Run, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "run.csv").symlink_to(tmp_path / "there" / "real.csv")
    circle.to_csv(tmp_path / "run.csv")
    assert (tmp_path / "run.csv").is_symlink() and (tmp_path / "there" / "real.csv").stat().st_size > 1000
