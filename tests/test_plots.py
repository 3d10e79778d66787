"""The figure of a run: the lines are the run's numbers, limits are marked, nothing global is touched."""

from __future__ import annotations

import subprocess
import sys
import warnings
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from matplotlib.figure import Figure

from cartctl.errors import ParameterError
from cartctl.motion.run import Run
from cartctl.report import plot_run
from cartctl.report.axes import logarithmic
from cartctl.report.palette import COLORS, NAMED, POINTS, pens, plain, thinned
from tests.report_runs import planar_run, robot_of, run_of


def chain(joints: int, rng: np.random.Generator, limited: bool = True) -> Any:
    """Return a robot of ``joints`` revolute joints with limits that are not symmetric."""
    model = pin.Model()
    model.name = "chain"
    parent = 0
    for k in range(joints):
        axis = pin.JointModelRevoluteUnaligned(*rng.normal(size=3))
        reach = rng.uniform(1.0, 3.0, 2) if limited else np.full(2, np.inf)
        speed = np.array([rng.uniform(1.0, 3.0) if limited else np.inf])
        bounds = (np.array([10.0]), speed, -reach[:1], reach[1:])
        parent = model.addJoint(parent, axis, pin.SE3.Random(), f"joint{k}", *bounds)
    model.addFrame(pin.Frame("tip", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return robot_of(model, pin.GeometryModel(), "tip", "chain")


def random_run(robot: Any, rng: np.random.Generator, steps: int = 50) -> Run:
    """Return a run of plausible noise: six-row task, positions and rates within their limits."""
    n, limits = robot.nv, robot.limits
    low, high = np.clip(limits.position_lower, -3, 3), np.clip(limits.position_upper, -3, 3)
    speed = np.clip(limits.velocity_upper, 0, 3)
    arrays = {
        "q": rng.uniform(low, high, (steps + 1, n)), "v": rng.uniform(-0.9 * speed, 0.9 * speed, (steps + 1, n)),
        "error": 1e-3 * rng.normal(size=(steps + 1, 6)), "sigma": rng.uniform(0.1, 2.0, (steps + 1, min(6, n))),
        "pose": rng.normal(size=(steps + 1, 7)), "target": rng.normal(size=(steps + 1, 7)),
    }  # fmt: skip
    return run_of(robot, 0.01, arrays, ["m"] * 3 + ["rad"] * 3)


def panel(figure: Any, title: str) -> Any:
    """Return the axes whose title on the left begins with ``title``."""
    return next(axes for axes in figure.axes if axes.get_title(loc="left").startswith(title))


def lines(axes: Any) -> dict[str, np.ndarray]:
    """Return label -> y of the labelled lines."""
    return {line.get_label(): np.asarray(line.get_ydata()) for line in axes.get_lines() if line.get_label()[0] != "_"}


def driven(run: Run, rng: np.random.Generator) -> Run:
    """Return the run with torques up to twice the limits of 10 N m upwards and 5 N m downwards."""
    n = run.robot.nv
    limits = {"torque_upper": np.full(n, 10.0), "torque_lower": np.full(n, -5.0)}
    run.robot.limits = run.robot.limits.replace(**limits)
    run.torque = rng.uniform(-10.0, 20.0, (len(run), n))
    return run


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def test_torques_are_shares_of_the_limit_in_their_direction(rng: np.random.Generator) -> None:
    robot = chain(4, rng)
    kinematic = random_run(robot, rng)
    assert not any(axes.get_title(loc="left").startswith("Joint torques") for axes in plot_run(kinematic).axes)
    run = driven(random_run(robot, rng), rng)
    axes = panel(plot_run(run), "Joint torques")
    assert run.torque is not None
    for i, name in enumerate(robot.dof_names):
        share = np.where(run.torque[:, i] >= 0, run.torque[:, i] / 10.0, run.torque[:, i] / 5.0)
        np.testing.assert_allclose(lines(axes)[name], share)
        np.testing.assert_array_equal(axes.get_lines()[i].get_xdata(), run.time[:-1])
    worst = np.abs(np.where(run.torque >= 0, run.torque / 10.0, run.torque / 5.0))
    assert axes.get_title(loc="right").startswith(f"peak {100 * worst.max():.3g} %")


def test_torques_without_limits_are_named_not_drawn(rng: np.random.Generator) -> None:
    run = driven(random_run(chain(3, rng), rng), rng)
    open_ended = np.array([np.inf, 10.0, 10.0])
    run.robot.limits = run.robot.limits.replace(torque_upper=open_ended)
    axes = panel(plot_run(run), "Joint torques")
    assert set(lines(axes)) == set(run.robot.dof_names[1:])
    assert "joint0" in axes.get_xlabel()


def test_lines_are_the_runs_numbers(rng: np.random.Generator) -> None:
    robot = chain(5, rng)
    run = random_run(robot, rng)
    figure = plot_run(run)
    error = run.tasks[0].error
    np.testing.assert_allclose(lines(panel(figure, "Position error"))["tip"], 1e3 * np.sqrt((error[:, :3] ** 2).sum(1)))
    np.testing.assert_allclose(lines(panel(figure, "Orientation"))["tip"], 1e3 * np.sqrt((error[:, 3:] ** 2).sum(1)))
    for i, name in enumerate(robot.dof_names):
        low, high = robot.model.lowerPositionLimit[i], robot.model.upperPositionLimit[i]
        speed = robot.model.velocityLimit[i]
        np.testing.assert_allclose(lines(panel(figure, "Joint positions"))[name], (run.q[:, i] - low) / (high - low))
        np.testing.assert_allclose(lines(panel(figure, "Joint rates"))[name], run.v[:, i] / speed)
    smallest = lines(panel(figure, "Singular values"))["tip (smallest bold)"]
    np.testing.assert_allclose(smallest, run.tasks[0].singular_values.min(axis=1))
    step = panel(figure, "Time of a control step").get_lines()[0].get_ydata()
    np.testing.assert_allclose(step, 1e6 * run.solve_time)


def test_errors_are_logarithmic_and_limits_are_marked(rng: np.random.Generator) -> None:
    figure = plot_run(random_run(chain(4, rng), rng))
    for title in ("Position error", "Orientation error", "Singular values", "Time of a control step"):
        assert panel(figure, title).get_yscale() == "log", title
    for title, limits in (("Joint positions", {0.0, 1.0}), ("Joint rates", {-1.0, 1.0})):
        axes = panel(figure, title)
        level = {float(line.get_ydata()[0]) for line in axes.get_lines() if len(line.get_ydata()) == 2}
        assert level == limits
        assert axes.get_ylim()[0] < min(limits) and axes.get_ylim()[1] > max(limits)


def test_a_violated_limit_stays_in_the_picture(rng: np.random.Generator) -> None:
    run = random_run(chain(3, rng), rng)
    run.v[20, 1] = -1.7 * run.robot.limits.velocity_upper[1]
    axes = panel(plot_run(run), "Joint rates")
    assert axes.get_ylim()[0] < -1.7
    assert axes.get_title(loc="right") == "peak 170 % (joint1)"


def test_joints_without_limits_are_named_not_drawn(rng: np.random.Generator) -> None:
    figure = plot_run(planar_run("arm"))  # a limited shoulder and a continuous elbow
    axes = panel(figure, "Joint positions")
    assert set(lines(axes)) == {"armshoulder"} and "armelbow" in axes.get_xlabel()
    free = plot_run(random_run(chain(3, rng, limited=False), rng))
    for title in ("Joint positions", "Joint rates"):
        assert not lines(panel(free, title))
        assert "no joint has" in panel(free, title).texts[0].get_text()


def test_of_many_joints_the_endangered_stand_out(rng: np.random.Generator) -> None:
    robot = chain(30, rng)
    run = random_run(robot, rng)
    run.q[:] *= 0.1
    run.v[:] *= 0.1
    endangered = [3, 8, 21]
    run.v[:, endangered] = 0.97 * robot.limits.velocity_upper[endangered]
    figure = plot_run(run)
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert {f"joint{i}" for i in endangered} <= set(texts)
    assert texts[-1] == "23 others, farther from their limits" and len(texts) == 8
    rates = [line for line in panel(figure, "Joint rates").get_lines() if len(line.get_ydata()) > 2]
    assert len(rates) == 30 and len({line.get_color() for line in rates}) == len(COLORS) + 1


def test_steps_at_which_something_gave_way_are_shaded_and_counted(rng: np.random.Generator) -> None:
    run = random_run(chain(3, rng), rng)
    run.status[:20] = ["INEXACT"] * 20
    run.status[5:12] = ["SCALED"] * 7
    labels = [text.get_text() for text in panel(plot_run(run), "Position error").get_legend().get_texts()]
    assert labels == ["tip", "scaled (7 steps)"]


def test_draws_without_warnings_whatever_the_run(rng: np.random.Generator) -> None:
    perfect = random_run(chain(2, rng), rng)
    perfect.tasks[0].error[:] = 0.0
    perfect.v[:] = 0.0
    no_step = random_run(chain(2, rng), rng, steps=1)
    no_step.time, no_step.q, no_step.v = no_step.time[:1], no_step.q[:1], no_step.v[:1]
    no_step.command, no_step.status, no_step.solve_time = no_step.command[:0], [], no_step.solve_time[:0]
    for record in no_step.tasks:
        record.error, record.singular_values, record.scale = record.error[:1], record.singular_values[:1], np.zeros(0)
    taskless = random_run(chain(2, rng), rng)
    taskless.tasks = []
    odd = random_run(chain(2, rng), rng)
    odd.tasks[0].units = ["", "", "m", "m", "rad", ""]
    odd.tasks[0].name = "_$\\frac{$^"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for run in (perfect, no_step, taskless, odd, planar_run("_a$b$")):
            plot_run(run).canvas.draw()


def test_refuses_a_run_without_samples(rng: np.random.Generator) -> None:
    run = random_run(chain(2, rng), rng)
    run.time = run.time[:0]
    with pytest.raises(ParameterError, match="no sample"):
        plot_run(run)


def test_leaves_pyplot_and_the_viewer_alone() -> None:
    code = (
        "import sys, cartctl.report, cartctl.report.plots as p\n"
        "assert 'matplotlib.pyplot' not in sys.modules and 'meshcat' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_legend_covers_no_data(rng: np.random.Generator) -> None:
    figure = plot_run(random_run(chain(7, rng), rng))
    figure.canvas.draw()
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert all(not box.overlaps(axes.get_window_extent()) for axes in figure.axes)
    assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1


def test_thinning_keeps_every_peak_and_trough(rng: np.random.Generator) -> None:
    time, values = np.arange(100_000) / 1e3, rng.normal(size=100_000)
    values[[12_345, 77_777]] = 50.0, -40.0
    t, y = thinned(time, values)
    assert len(t) <= POINTS and (np.diff(t) > 0).all()
    assert y.max() == 50.0 and t[y.argmax()] == time[12_345] and y.min() == -40.0 and t[y.argmin()] == time[77_777]
    same = thinned(time[:POINTS], values[:POINTS])
    assert len(same[0]) == POINTS


def test_a_curve_of_one_value_is_drawn_without_a_warning() -> None:
    axes = Figure().add_subplot()
    axes.plot([0.0, 1.0], [0.2, 0.2])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        logarithmic(axes)
    assert axes.get_yscale() == "log" and axes.get_ylim() == pytest.approx((0.125, 0.5))


def test_pens_differ_until_they_run_out() -> None:
    few = pens([f"j{i}" for i in range(NAMED)])
    assert len({(pen.color, pen.dashed) for pen in few}) == NAMED
    many = pens([f"j{i}" for i in range(NAMED + 1)], np.arange(NAMED + 1.0))
    assert [pen.label for pen in many if pen.label] == [f"j{i}" for i in range(NAMED + 1)][-len(COLORS) :]


def test_names_are_shown_as_they_are() -> None:
    assert plain("a$x$") == r"a\$x\$" and plain("_hidden").strip() == "_hidden" and len(plain("x" * 100)) == 40
