"""The page's figures over time and what stands beside the robot: the run's own numbers, and one cursor for all."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.report import Comparison, panels, write_html
from cartctl.report.curves import POINTS, Curve, Panel, spans
from cartctl.report.ellipsoids import shapes_of
from cartctl.report.html import page
from cartctl.report.lifting import ghost_postures
from cartctl.report.run_curves import run_panels
from tests.chromium import Tab, difference, needs_chromium
from tests.standing_arm import ARM, HOME
from tests.test_html import Reader

STAGE = (slice(60, 560), slice(20, 560))  # rows and columns of the robot, in a window of 1000 x 700


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> cc.Robot:
    path = tmp_path_factory.mktemp("arm") / "three.urdf"
    path.write_text(ARM)
    robot = cc.load(str(path), home=HOME)
    robot.limits = robot.limits.replace(acceleration_lower=-30.0, acceleration_upper=30.0)
    return robot


def rollout(robot: cc.Robot, solver: str = "sns", objective: Any = "posture", **more: Any) -> cc.Run:
    """One lap of a circle; the objective draws the arm away from where it would go."""
    start = robot.state(robot.home).placement("tip")
    path = cc.Circle.starting_at(start, 0.15, normal=[0.0, 1.0, 0.0], period=1.5)
    away = cc.Posture(target=robot.configuration({"two": 1.2}, robot.home), gain=2.0) if objective else None
    task = cc.FrameTask("tip", "xz", target=path)
    controller = cc.Controller(robot, task, solver, objective=away, dt=5e-3, **more)
    return cc.simulate(controller, duration=1.6)


@pytest.fixture(scope="module")
def run(robot: cc.Robot) -> cc.Run:
    return rollout(robot)


@pytest.fixture(scope="module")
def file(run: cc.Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_html(run, tmp_path_factory.mktemp("page") / "run.html")


def packed(text: str) -> dict[str, dict[str, Any]]:
    """Title -> panel, as the browser gets it, its numbers decoded."""
    (scene,) = Reader(text).scripts("application/json")
    found = {}
    for panel in json.loads(scene)["panels"]:
        for curve in panel["curves"]:
            for name in ("time", "values"):
                curve[name] = np.frombuffer(base64.b64decode(curve[name]), "<f4")
        found[panel["title"]] = panel
    return found


# --- the curves -------------------------------------------------------------------------------------------------------


def test_the_page_has_the_numbers_of_the_run(run: cc.Run, file: Path) -> None:
    found = packed(file.read_text(encoding="utf-8"))
    assert list(found) == [
        "Position error", "Joint positions", "Joint rates", "Joint torques needed", "Task scales", "Singular values",
        "Time of a step",
    ]  # fmt: skip
    limits, names = run.robot.limits, list(run.robot.dof_names)

    def curve(title: str, index: int) -> tuple[np.ndarray, np.ndarray]:
        one = found[title]["curves"][index]
        return one["time"], one["values"]

    for i, name in enumerate(names):
        time, values = curve("Joint positions", i)
        np.testing.assert_allclose(time, run.time, atol=1e-6)
        span = limits.position_upper[i] - limits.position_lower[i]
        np.testing.assert_allclose(values, (run.q[:, i] - limits.position_lower[i]) / span, atol=1e-6)
        np.testing.assert_allclose(curve("Joint rates", i)[1], run.v[:, i] / 2.0, atol=1e-6)
        assert found["Joint rates"]["curves"][i]["label"] == name
    error = 1e3 * np.linalg.norm(run.tasks[0].error, axis=1)
    np.testing.assert_allclose(curve("Position error", 0)[1], error, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(curve("Task scales", 0)[1], run.tasks[0].scale, atol=1e-6)
    np.testing.assert_allclose(curve("Time of a step", 0)[1], 1e6 * run.solve_time, rtol=1e-6)
    least = [c for c in found["Singular values"]["curves"] if "strong" in c["kinds"]]
    np.testing.assert_allclose(least[0]["values"], run.tasks[0].singular_values.min(axis=1), rtol=1e-6)


def test_torques_needed_are_those_of_the_motion_and_driven_ones_are_the_run_s_own(robot: cc.Robot, run: cc.Run) -> None:
    needed = next(p for p in run_panels(run) if p.title == "Joint torques needed")
    model, data = robot.model, robot.model.createData()
    for k in (0, 40, 150, 300):
        a = (run.v[k + 1] - run.v[k]) / 5e-3
        tau = pin.crba(model, data, run.q[k]) @ a + pin.nonLinearEffects(model, data, run.q[k], run.v[k])
        bound = np.where(tau >= 0, robot.limits.torque_upper, -robot.limits.torque_lower)
        np.testing.assert_allclose([c.values[k] for c in needed.curves], tau / bound, atol=1e-9)
    driven = rollout(robot, level="torque")
    panel = next(p for p in run_panels(driven) if p.title == "Joint torques")
    assert driven.torque is not None
    np.testing.assert_allclose([c.values for c in panel.curves], driven.torque.T / 60.0, atol=1e-12)


def test_what_is_saturated_is_shaded_where_it_is(robot: cc.Robot) -> None:
    limits = robot.limits
    try:
        robot.limits = limits.replace(velocity_upper=0.8, velocity_lower=-0.8)
        run = rollout(robot, objective=None)
        rates = next(p for p in run_panels(run) if p.title == "Joint rates")
    finally:
        robot.limits = limits
    at = (np.abs(run.v) >= 0.8 * (1.0 - 1e-6)).any(axis=1)
    assert 10 < at.sum() < len(at) - 10
    inside = [any(a - 1e-9 <= t < b for a, b in rates.bands[0].spans) for t in run.time]
    assert np.mean(np.array(inside) == at) > 0.97  # gaps of a pixel are closed
    errors = next(p for p in run_panels(run) if p.title == "Position error")
    assert "scaled" in errors.bands[0].words and errors.bands[0].spans


def test_spans_are_the_times_at_which_something_holds() -> None:
    time = np.arange(1000) * 0.01
    on = np.zeros(1000, dtype=bool)
    on[100:200], on[500] = True, True
    assert spans(time, on) == [
        (pytest.approx(1.0), pytest.approx(2.0)),
        (pytest.approx(5.0), pytest.approx(5.0125, abs=0.003)),
    ]
    assert spans(time, ~np.ones(1000, dtype=bool)) == []
    assert spans(time, np.ones(1000, dtype=bool)) == [(0.0, pytest.approx(9.99))]
    assert len(spans(time, np.arange(1000) % 2 == 0)) == 1  # too short to be told apart


def test_long_curves_are_thinned_but_keep_their_peaks() -> None:
    time = np.linspace(0.0, 10.0, 50_000)
    values = np.sin(time)
    values[23_457] = 7.0
    data = Curve("x", "#000000", time, values).packed()
    numbers = np.frombuffer(base64.b64decode(data["values"]), "<f4")
    assert len(numbers) <= POINTS and numbers.max() == 7.0


def test_names_from_a_urdf_close_no_element(run: cc.Run) -> None:
    text = json.dumps(Panel("</script><b>", "", [Curve("</script>", "#000000", run.time, run.time)]).packed())
    assert "</script>" in text  # so that it is the page that keeps it out
    assert "<b>one" in packed(page(run))["Joint positions"]["curves"][0]["label"]
    assert page(run).count("</script>") == 4  # the scene, the viewer, the player, the licences


# --- the ghost and the ellipsoids -------------------------------------------------------------------------------------


def test_the_ghost_follows_the_hand_by_the_least_rates(robot: cc.Robot, run: cc.Run) -> None:
    shown = np.arange(0, len(run.time), 4)
    ghosts = ghost_postures(run, shown)
    assert ghosts is not None and len(ghosts) == len(shown)
    np.testing.assert_array_equal(ghosts[0], run.q[0])
    for q, k in zip(ghosts, shown, strict=True):
        hand = robot.state(q).position("tip")
        np.testing.assert_allclose(hand[[0, 2]], run.tasks[0].pose[k, [0, 2]], atol=2e-4)  # type: ignore[index]
    # The same in fine steps of the formula itself.
    q, fine = np.array(run.q[0]), [np.array(run.q[0])]
    for k in range(len(run.time) - 1):
        for part in (0.25, 0.5, 0.75, 1.0):
            state = robot.state(q)
            wanted = (1.0 - part) * run.tasks[0].pose[k, [0, 2]] + part * run.tasks[0].pose[k + 1, [0, 2]]  # type: ignore[index]
            J = state.jacobian("tip")[[0, 2]]
            q = q + np.linalg.lstsq(J, wanted - state.position("tip")[[0, 2]], rcond=None)[0]
        fine.append(q)
    np.testing.assert_allclose(ghosts, np.array(fine)[shown], atol=5e-3)
    assert np.abs(ghosts - run.q[shown]).max() > 0.1  # the objective did something


def test_there_is_no_ghost_where_nothing_sets_it_apart(robot: cc.Robot, run: cc.Run) -> None:
    shown = np.arange(0, len(run.time), 4)
    alone = rollout(robot, "pinv", objective=None, limits=None)
    assert ghost_postures(alone, shown) is None
    fixed = rollout(robot)
    fixed.tasks[0].rows = [0, 2, 4]  # three rows, three joints
    assert ghost_postures(fixed, shown) is None
    fixed.tasks[0].rows = None
    assert ghost_postures(fixed, shown) is None
    assert 'data-paths="ghost"' not in page(alone) and 'data-paths="ghost"' in page(run)


def test_the_rows_of_a_task_are_kept_in_a_file(run: cc.Run, robot: cc.Robot, tmp_path: Path) -> None:
    assert run.tasks[0].rows == [0, 2]
    assert cc.Run.load(run.save(tmp_path / "run.npz")).tasks[0].rows == [0, 2]
    tool = cc.FrameTask("tip", "xz", expressed_in="tip")
    own = cc.simulate(cc.Controller(robot, [tool, cc.PostureTask()], "task-priority", limits=None), duration=0.01)
    assert [task.rows for task in own.tasks] == [None, None]
    assert cc.Run.load(own.save(tmp_path / "own.npz")).tasks[0].rows is None


def test_ellipsoids_are_those_of_the_jacobian_and_do_not_spin(robot: cc.Robot, run: cc.Run) -> None:
    shown = np.arange(0, len(run.time), 4)
    size = 1.0
    velocity, force = shapes_of(run, run.tasks[0], shown, size)
    for k, sample in enumerate(shown):
        J = robot.state(run.q[sample]).jacobian("tip")[:3]
        R = pin.Quaternion(velocity.quaternions[k]).matrix()
        lengths = velocity.lengths[k] * velocity.unit
        thick = velocity.lengths[k] > 3e-3 * size  # across the plane there is nothing; a film is drawn
        reach = R[:, thick] @ np.diag(lengths[thick] ** 2) @ R[:, thick].T
        np.testing.assert_allclose(reach, J @ J.T, atol=1e-9)
        for i in np.flatnonzero(thick & (force.lengths[k] < 0.31 * size)):
            f = R[:, i] * force.lengths[k, i] * force.unit  # unit torques balance it
            assert np.linalg.norm(J.T @ f) == pytest.approx(1.0, rel=1e-6)
    assert velocity.lengths.max() == pytest.approx(0.24) and force.lengths.max() <= 0.32 + 1e-12
    turns = np.abs(np.sum(velocity.quaternions[1:] * velocity.quaternions[:-1], axis=1))
    assert turns.min() > 0.99


# --- in a browser -----------------------------------------------------------------------------------------------------


def at(tab: Tab) -> float:
    """The moment that the page shows, s."""
    return float(tab.ask("document.getElementById('time').value"))


def canvas(tab: Tab, index: int) -> dict[str, float]:
    """Where a panel's canvas is, in px."""
    box = f"document.querySelectorAll('.panel canvas')[{index}].getBoundingClientRect()"
    return dict(tab.ask(f"(({{left, top, width, height}}) => ({{left, top, width, height}}))({box})"))


@needs_chromium
@pytest.mark.chromium
def test_dragging_the_cursor_moves_the_robot_and_playing_moves_the_cursor(file: Path, tab: Tab) -> None:
    tab.resize(1000, 700)
    tab.open(file.as_uri() + "#t=0.1")
    early, box = tab.picture(), canvas(tab, 1)
    assert at(tab) == pytest.approx(0.1)
    middle = box["top"] + 0.5 * box["height"]
    tab.drag((box["left"] + 60.0, middle), (box["left"] + 46.0 + 0.5 * (box["width"] - 54.0), middle), 4)
    assert at(tab) == pytest.approx(0.8, abs=0.02)
    assert "0.8" in tab.ask("document.getElementById('clock').textContent")
    late = tab.picture()
    assert difference(early, late, *STAGE) > 0.01  # the robot has moved
    assert difference(early, late, slice(None), slice(600, 1000)) > 1e-3  # so have the cursors
    value = tab.ask("document.querySelectorAll('.panel output')[1].textContent")
    assert any(name in value for name in ("one", "two", "three"))
    tab.ask("document.getElementById('play').click()")
    tab.until("Number(document.getElementById('time').value) !== 0.8")
    moved = at(tab)
    tab.until(f"Math.abs(Number(document.getElementById('time').value) - {moved}) > 0.05")
    tab.ask("document.getElementById('play').click()")
    assert not tab.console and not tab.requests


@needs_chromium
@pytest.mark.chromium
def test_ghost_ellipsoids_and_trace_are_switched(file: Path, tab: Tab) -> None:
    tab.resize(1000, 700)
    tab.open(file.as_uri() + "#t=1.0")
    boxes = tab.ask("[...document.querySelectorAll('[data-paths]')].map((b) => [b.dataset.paths, b.checked])")
    assert boxes == [["task0/traced", True], ["ghost", False], ["velocity0", False], ["force0", False]]
    plain = tab.picture()
    for paths, _ in boxes:
        switch = f"document.querySelector('[data-paths=\"{paths}\"]').click()"
        tab.ask(switch)
        other = tab.picture()
        assert difference(plain, other, *STAGE) > 3e-4, paths
        tab.ask(switch)
    assert difference(plain, tab.picture(), *STAGE) < 1e-4
    assert "without anything in the null space" in tab.ask("document.getElementById('switches').textContent")
    assert not tab.console and not tab.requests


@needs_chromium
@pytest.mark.chromium
def test_it_is_readable_on_a_phone(file: Path, tab: Tab) -> None:
    tab.resize(400, 800, phone=True)
    tab.open(file.as_uri() + "#t=1.0")
    assert tab.ask("document.scrollingElement.scrollWidth") <= 400
    box = canvas(tab, 0)
    assert box["width"] > 340.0 and box["left"] >= 0.0
    sizes = tab.ask("[...document.querySelectorAll('.panel *')].map((e) => parseFloat(getComputedStyle(e).fontSize))")
    assert min(sizes) >= 11.0
    tab.ask("scrollTo(0, 700)")
    stage = tab.ask("document.getElementById('stage').getBoundingClientRect().top")
    assert stage == 0.0  # the robot stays in sight
    assert not tab.console and not tab.requests


@needs_chromium
@pytest.mark.chromium
def test_a_comparison_has_a_curve_a_run_and_switches_hide_it(robot: cc.Robot, tab: Tab, tmp_path: Path) -> None:
    runs = [rollout(robot), rollout(robot, "pinv", objective=None, limits=None)]
    file = Comparison(runs).html(tmp_path / "compare.html")
    found = packed(file.read_text(encoding="utf-8"))
    for title in ("Position error", "Smallest singular value", "Least task scale", "Time of a step"):
        assert [curve["label"] for curve in found[title]["curves"]] == ["sns", "pinv"], title
        assert [curve["run"] for curve in found[title]["curves"]] == [0, 1]
    np.testing.assert_allclose(
        found["Position error"]["curves"][1]["values"], 1e3 * panels.norm(runs[1].tasks[0], "m"), rtol=1e-6, atol=1e-9
    )
    tab.resize(1000, 700)
    tab.open(file.as_uri() + "#t=1.0")
    columns = slice(600, 1000)
    both = tab.picture()
    tab.ask("document.querySelector('[data-run=\"1\"]').click()")
    assert difference(both, tab.picture(), slice(None), columns) > 1e-3
    assert not tab.console and not tab.requests
