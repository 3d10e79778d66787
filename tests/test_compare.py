"""Several solvers side by side: the figures, the table, the overlaid plots, the page, and the verb that makes them."""

from __future__ import annotations

import csv
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin
import pytest
from typer.testing import CliRunner, Result

import cartctl as cc
from cartctl.algebra.problem import Problem
from cartctl.algebra.solution import Solution
from cartctl.cli import files, standings
from cartctl.cli.app import app
from cartctl.errors import ParameterError
from cartctl.report import Comparison
from cartctl.report.comparison_page import comparison_page
from cartctl.report.html import page
from cartctl.report.palette import COLORS, color
from tests.chromium import Tab, difference, needs_chromium, share
from tests.interruptions import interrupt_at
from tests.report_runs import panda_run, planar_run
from tests.test_html import HOSTILE, Reader, commands_of, tracks_of
from tests.test_plots import lines, panel

QUICK = ("--dt", "0.01", "--duration", "0.3")
START = {"joint1": 0.5, "joint2": 1.1, "joint3": 0.9}


def tracked(solver: str, radius: float = 0.3, objective: cc.Objective | None = None, duration: float = 1.2) -> cc.Run:
    """A planar 3R arm that goes round a circle in 1 s."""
    robot = cc.load("planar3R", home=START)
    pose = robot.state(robot.home).placement(robot.tool)
    path = cc.Circle.starting_at(pose, radius, towards=[-1, 0, 0], normal=[0, 0, 1], period=1.0)
    task = cc.FrameTask(robot.tool, axes="xy", gain=15.0, target=path)
    loop = cc.Controller(robot, task, solver, limits=None, objective=objective, dt=0.005)
    return cc.simulate(loop, duration=duration)


@pytest.fixture(scope="module")
def runs() -> dict[str, cc.Run]:
    led = tracked("projected-gradient", objective=cc.JointRange(gain=50.0))
    return {"pinv": tracked("pinv"), "led": led, "steep": tracked("transpose")}


@pytest.fixture
def compared(runs: dict[str, cc.Run]) -> Comparison:
    return Comparison(runs, refused={"shy": "it would rather not"}, notes={"pinv": "no objective"})


def figure(comparison: Comparison, name: str, title: str) -> float | None:
    """One cell by the name of its run and of its column."""
    (index,) = [i for i, column in enumerate(comparison.columns) if column.title == title]
    return comparison.rows[name][index]


# --- figures ---------------------------------------------------------------------------------------------------------


def test_every_figure_is_what_it_says(compared: Comparison) -> None:
    for name, run in compared.runs.items():
        error = 1e3 * np.sqrt((run.tasks[0].error ** 2).sum(axis=1))
        robot, dt = run.robot, 0.005
        limits = robot.limits
        state_rates = (run.v / limits.velocity_upper, -run.v / -limits.velocity_lower)
        sigma = [np.linalg.svd(robot.state(q).jacobian(robot.tool)[:2], compute_uv=False)[-1] for q in run.q]
        lap = run.q[round(1.0 / dt)] - run.q[0]
        middle = (limits.position_upper + limits.position_lower) / 2
        span = limits.position_upper - limits.position_lower
        expected = {
            "position RMS (mm)": np.sqrt(np.mean(error**2)),
            "position largest (mm)": error.max(),
            "position end (mm)": error[-1],
            "peak rate (%)": 100 * max(np.abs(rates).max() for rates in state_rates),
            "least σ": min(sigma),
            "drift a lap (rad)": np.linalg.norm(lap),
            "effort (rad²/s)": sum(float(v @ v) * dt for v in run.command),
            "joint range (at end)": np.mean(((run.q[-1] - middle) / span) ** 2) / 2,
            "median step (µs)": 1e6 * np.median(run.solve_time),
        }
        assert expected["effort (rad²/s)"] > 0.1 and expected["drift a lap (rad)"] > 1e-4
        for title, value in expected.items():
            assert figure(compared, name, title) == pytest.approx(value, rel=1e-9), (name, title)
        assert len(compared.columns) == len(expected) + 1  # and the limits, below


def test_violations_are_counted_and_wrong() -> None:
    run = tracked("pinv", duration=0.5)
    limits = run.robot.limits
    run.v[10:14, 0], run.q[20, 1] = 1.5 * limits.velocity_upper[0], limits.position_upper[1] + 0.2
    comparison = Comparison({"wild": run, "tame": tracked("dls", duration=0.5)})
    titles = [column.title for column in comparison.columns]
    outside, rate = titles.index("outside limits (samples)"), titles.index("peak rate (%)")
    a = np.diff(run.v, axis=0) / 0.005
    beyond = (run.q < limits.position_lower) | (run.q > limits.position_upper) | (np.abs(run.v) > limits.velocity_upper)
    beyond[1:] |= np.abs(a) > limits.acceleration_upper
    assert comparison.rows["wild"][outside] == beyond.sum() >= 5
    assert comparison.wrong("wild", outside) and comparison.wrong("wild", rate)
    assert not comparison.wrong("tame", outside) and not comparison.wrong("tame", rate)
    assert comparison.rows["wild"][rate] == pytest.approx(150.0)


def test_the_best_of_a_column_are_those_that_look_it(runs: dict[str, cc.Run]) -> None:
    comparison = Comparison({**runs, "again": runs["pinv"]})
    titles = [column.title for column in comparison.columns]
    rms = {name: run.metrics().tasks[0].rms_m for name, run in runs.items()}
    assert min(rms, key=lambda name: rms[name] or 0.0) in ("pinv", "led") and rms["steep"] > 10 * (rms["pinv"] or 0.0)
    assert "steep" not in comparison.best(titles.index("position RMS (mm)"))
    assert comparison.best(titles.index("joint range (at end)")) == {"led"}
    assert comparison.best(titles.index("outside limits (samples)")) == set()
    winners = comparison.best(titles.index("effort (rad²/s)"))
    assert ("pinv" in winners) == ("again" in winners)
    assert not any(Comparison({"a": runs["led"], "b": runs["led"]}).best(i) for i in range(len(titles)))


def test_a_task_without_metres_and_several_tasks_have_their_own_columns() -> None:
    robot = cc.load("planar4R")
    tasks = [cc.FrameTask(robot.tool, axes="xy"), cc.FrameTask("link2", axes="rz")]
    run = cc.simulate(cc.Controller(robot, tasks, "task-priority", limits=None, dt=0.01), duration=0.2)
    titles = [column.title for column in Comparison([run]).columns]
    assert f"{robot.tool} position RMS (mm)" in titles and "link2 orientation end (mrad)" in titles
    assert f"{robot.tool} orientation RMS (mrad)" not in titles


def test_sliding_joints_change_the_units() -> None:
    model = pin.Model()
    for axis in "XY":
        model.addJoint(len(model.names) - 1, getattr(pin, f"JointModelP{axis}")(), pin.SE3.Identity(), f"slide{axis}")
    model.addFrame(pin.Frame("tip", 2, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    robot = cc.Robot(model, name="table", tool="tip")
    run = cc.simulate(cc.Controller(robot, cc.FrameTask("tip", axes="xy"), limits=None, dt=0.01), duration=0.05)
    titles = [column.title for column in Comparison([run]).columns]
    assert "effort (m²/s)" in titles and "drift a lap (m)" in titles
    assert Comparison([run]).shown("pinv")[titles.index("peak rate (%)")] == "-"


def test_runs_without_names_get_those_of_their_solvers(runs: dict[str, cc.Run]) -> None:
    again = Comparison([runs["pinv"], runs["steep"], runs["pinv"], runs["pinv"]])
    assert list(again.runs) == ["pinv", "transpose", "pinv (2)", "pinv (3)"]


def test_what_cannot_be_compared_is_refused(runs: dict[str, cc.Run]) -> None:
    with pytest.raises(ParameterError, match="runs is empty"):
        Comparison([])
    with pytest.raises(ParameterError, match="'planar' differ in robot or tasks"):
        Comparison({"pinv": runs["pinv"], "planar": planar_run()})
    still = tracked("pinv", duration=0.01)
    still.time, still.q, still.v = still.time[:1], still.q[:1], still.v[:1]
    still.command, still.status, still.solve_time = still.command[:0], [], still.solve_time[:0]
    with pytest.raises(ParameterError, match="'still' holds no step"):
        Comparison({"still": still})


def test_the_remark_tells_how_the_steps_went(runs: dict[str, cc.Run]) -> None:
    run = tracked("pinv", duration=0.1)
    run.status[3:7] = ["SINGULAR"] * 4
    run.meta["interrupted"] = True
    comparison = Comparison({"odd": run, "fine": runs["pinv"]}, refused={"shy": "no"}, notes={"odd": "no limits"})
    assert comparison.remark("odd") == "OPTIMAL 16, SINGULAR 4; interrupted; no limits"
    assert comparison.remark("fine") == "OPTIMAL" and comparison.remark("shy") == "refused: no"


# --- files -----------------------------------------------------------------------------------------------------------


def test_csv_holds_full_precision(compared: Comparison, tmp_path: Path) -> None:
    with compared.to_csv(tmp_path / "deep" / "table.csv").open(encoding="utf-8", newline="") as file:
        rows = {row["solver"]: row for row in csv.DictReader(file)}
    assert list(rows) == ["pinv", "led", "steep", "shy"]
    for name in compared.runs:
        for column, value in zip(compared.columns, compared.rows[name], strict=True):
            assert float(rows[name][column.title]) == value
    assert rows["shy"]["remark"] == "refused: it would rather not" and rows["shy"]["least σ"] == ""
    assert rows["pinv"]["remark"].endswith("; no objective")


def test_markdown_is_a_table_whatever_the_names(runs: dict[str, cc.Run], tmp_path: Path) -> None:
    comparison = Comparison({"a|b": runs["pinv"], "c": runs["led"]}, refused={"<i>": "x\n|y"})
    text = comparison.to_markdown(tmp_path / "table.md").read_text(encoding="utf-8")
    rows = [re.split(r"(?<!\\)\|", line)[1:-1] for line in text.splitlines()]
    assert len(rows) == 5 and {len(row) for row in rows} == {len(comparison.columns) + 2}
    assert rows[2][0].strip() == "a\\|b" and rows[4][0].strip() == "\\<i\\>"
    best = rows[0].index(" joint range (at end) ")
    assert rows[3][best].strip().startswith("**") and not rows[2][best].strip().startswith("**")


# --- plots -----------------------------------------------------------------------------------------------------------


def test_lines_are_the_numbers_of_each_run(compared: Comparison) -> None:
    with pytest.raises(ParameterError, match="file type"):
        compared.plot("compared.doc")
    drawn = compared.plot()
    for name, run in compared.runs.items():
        robot = run.robot
        error = 1e3 * np.linalg.norm(run.tasks[0].error, axis=1)
        expected = {
            "Position error": error,
            "Smallest singular value": run.tasks[0].singular_values[:, -1],
            "Norm of the joint rates": np.sqrt((run.v**2).sum(axis=1)),
            "Largest joint rate": np.abs(run.v / robot.limits.velocity_upper).max(axis=1),
            "Objective: joint range": [cc.JointRange().value(robot.state(q)) for q in run.q],
        }
        for title, values in expected.items():
            np.testing.assert_allclose(lines(panel(drawn, title))[name], values, rtol=1e-9, atol=1e-12, err_msg=title)
    assert panel(drawn, "Position error").get_yscale() == "log"
    steps = panel(drawn, "Time of a control step")
    assert [text.get_text() for text in steps.get_yticklabels()] == list(compared.runs)


def test_one_colour_a_run_in_all_panels_and_one_legend(runs: dict[str, cc.Run]) -> None:
    names = [f"run {k}" for k in range(17)]
    drawn = Comparison(dict.fromkeys(names, runs["pinv"])).plot()
    (legend,) = drawn.legends
    assert [text.get_text() for text in legend.get_texts()] == names
    assert all(axes.get_legend() is None for axes in drawn.axes)
    looks = {(line.get_color(), line.get_linestyle()) for line in legend.get_lines()}
    assert len(looks) == len(names) and len({line.get_color() for line in legend.get_lines()}) == len(names)
    for title in ("Position error", "Norm of the joint rates"):
        found = [line.get_color() for line in panel(drawn, title).get_lines()]
        assert found == [color(k) for k in range(17)]
    widths = [line.get_linewidth() for line in panel(drawn, "Position error").get_lines()]
    assert widths == sorted(widths, reverse=True) and widths[0] > 2 * widths[-1]  # equal lines show as stripes
    drawn.canvas.draw()
    box = legend.get_window_extent()
    assert all(not box.overlaps(axes.get_tightbbox()) for axes in drawn.axes)


def test_the_velocity_limit_is_marked_where_it_matters(runs: dict[str, cc.Run]) -> None:
    fast = tracked("pinv", duration=0.3)
    fast.v[7] = 1.6 * fast.robot.limits.velocity_upper
    axes = panel(Comparison([runs["pinv"], fast]).plot(), "Largest joint rate")
    assert axes.get_ylim()[1] > 1.6
    assert 1.0 in [float(line.get_ydata()[0]) for line in axes.get_lines() if len(line.get_ydata()) == 2]


def test_colours_beyond_the_palette_stay_apart() -> None:
    made = [color(k) for k in range(3 * len(COLORS) - 1)]  # black gets no darker
    assert len(set(made)) == len(made) and made[: len(COLORS)] == list(COLORS)
    assert all(re.fullmatch("#[0-9a-f]{6}", tint) for tint in made)


# --- the page --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def planar_runs() -> dict[str, cc.Run]:
    """Three runs of one arm: as it went, with the joints elsewhere, and one that ended early."""
    plain, other, short = planar_run(), planar_run(), planar_run()
    move = np.outer(np.sin(np.pi * other.time / other.time[-1]), [0.5, -0.8])
    other.q = np.array([pin.integrate(other.robot.model, q, d) for q, d in zip(other.q, move, strict=True)])
    n = 60
    short.time, short.q, short.v = short.time[: n + 1], short.q[: n + 1], short.v[: n + 1]
    short.command, short.status, short.solve_time = short.command[:n], short.status[:n], short.solve_time[:n]
    record = short.tasks[0]
    record.error, record.scale = record.error[: n + 1], record.scale[:n]
    record.singular_values = record.singular_values[: n + 1]
    record.pose, record.target = record.pose[: n + 1], record.target[: n + 1]
    return {"plain": plain, "other": other, "short": short}


@pytest.fixture(scope="module")
def planar_page(planar_runs: dict[str, cc.Run], tmp_path_factory: pytest.TempPathFactory) -> Path:
    comparison = Comparison(planar_runs, refused={"shy": "it would rather not"})
    return comparison.html(tmp_path_factory.mktemp("page") / "planar.html")


def test_every_ghost_moves_as_its_own_joints_do(planar_runs: dict[str, cc.Run], planar_page: Path) -> None:
    tracks = tracks_of(planar_page.read_text(encoding="utf-8"))
    for k, run in enumerate(planar_runs.values()):
        model, data = run.robot.model, run.robot.model.createData()
        moving = sorted(path for path in tracks if path.startswith(f"/meshcat/run{k}/robot/"))
        assert len(moving) == model.njoints - 1
        for joint, path in enumerate(moving, start=1):
            times, positions = tracks[path][".position"]
            assert times[-1] == pytest.approx(1.0)  # all last as long as the longest, or they would loop apart
            for i in (0, 5, len(times) // 2, len(times) - 1):
                pin.forwardKinematics(model, data, run.q[np.argmin(np.abs(run.time - times[i]))])
                np.testing.assert_allclose(positions[i], data.oMi[joint].translation, atol=1e-6)


def test_shapes_are_sent_once_and_lent_to_the_ghosts(planar_runs: dict[str, cc.Run], planar_page: Path) -> None:
    commands = commands_of(planar_page.read_text(encoding="utf-8"))
    sent = {c["path"]: c["object"] for c in commands if c["type"] == "set_object" and "/robot/" in c["path"]}
    owners = {path.rpartition("/")[2]: o["geometries"][0] for path, o in sent.items() if "/run0/" in path}
    assert len(owners) == 2 and "/meshcat/robot/0" in sent  # what stands on the ground belongs to all
    for k, name in ((1, "other"), (2, "short")):
        for index, owner in owners.items():
            ghost = sent[f"/meshcat/run{k}/robot/{index}"]
            assert ghost["geometries"][0]["data"]["attributes"] == {}
            assert ghost["geometries"][0]["userData"]["borrows"] == owner["uuid"]
            (material,) = ghost["materials"]
            assert f"#{material['color']:06x}" == color(k) and 0.1 < material["opacity"] < 0.6, name
    (still,) = [path for path in sent if "/run" not in path]
    assert still == "/meshcat/robot/0"


def test_the_page_holds_the_table_and_a_switch_a_run(planar_runs: dict[str, cc.Run], planar_page: Path) -> None:
    reader = Reader(planar_page.read_text(encoding="utf-8"))
    boxes = [attrs for tag, attrs in reader.tags if tag == "input" and "data-run" in attrs]
    assert [box["data-run"] for box in boxes] == ["0", "1", "2"]
    comparison = Comparison(planar_runs)
    (body,) = reader.texts["tbody"]
    for name in planar_runs:
        assert name in body
        for text in comparison.shown(name):
            assert text in body
    assert "shy" in body and "refused: it would rather not" in body
    assert "plain is solid" in reader.texts["header"][0]


def test_hostile_names_are_only_shown_here_too() -> None:
    run = planar_run(HOSTILE)
    run.tasks[0].name = HOSTILE
    reader = Reader(comparison_page(Comparison({HOSTILE: run, "b": run}, refused={"c": HOSTILE}, notes={"b": HOSTILE})))
    assert reader.texts["tbody"][0].count(HOSTILE) == 3
    assert not {"img", "b", "iframe", "object"} & {tag for tag, _ in reader.tags}
    assert len(reader.scripts(None)) == 2
    assert not any(name.startswith("on") for _, attrs in reader.tags for name in attrs)


def test_six_pandas_are_hardly_larger_than_one() -> None:
    run = panda_run()
    alone, six = len(page(run)), len(comparison_page(Comparison({str(k): run for k in range(6)})))
    assert alone < six < alone + 5e6 and six < 20e6


@needs_chromium
@pytest.mark.chromium
def test_browser_draws_all_and_switches_each(planar_page: Path, tab: Tab) -> None:
    scene = slice(0, 480)  # above the table
    shown = tab.look(planar_page, "#t=0.5")
    assert share(shown, (40, 80, 140), 40) > 0.003 and share(shown, (150, 60, 45), 40) > 0.003  # the solid links
    for box in (0, 1, 2):
        click(tab, box)
        assert difference(shown, tab.picture(), scene) > 0.001, box
        click(tab, box)
    assert difference(shown, tab.picture(), scene) < 1e-3
    click(tab, 0, 1, 2)
    assert share(tab.picture(), (150, 60, 45), 40) < 1e-3
    assert not tab.console and not tab.requests


@needs_chromium
@pytest.mark.chromium
@pytest.mark.parametrize("size", [(1280, 800), (412, 800)])
def test_browser_plays_the_robots_above_the_table(planar_page: Path, size: tuple[int, int], tab: Tab) -> None:
    first, second = (tab.look(planar_page, f"#t={t}", size) for t in (0.1, 0.5))
    assert not tab.console and not tab.requests
    assert difference(first, second, slice(60, 400)) > 0.005
    stage, table = (tab.ask(f"document.getElementById('{name}').getBoundingClientRect().{side}")
                    for name, side in (("stage", "bottom"), ("runs", "top")))  # fmt: skip
    assert stage == table


def click(tab: Tab, *boxes: int) -> None:
    """Click the switches of some runs."""
    for box in boxes:
        tab.ask(f"document.querySelector('[data-run=\"{box}\"]').click()")


# --- the verb --------------------------------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures take seconds; most tests ask only whether they were asked for."""

    def picture(comparison: Comparison, path: Path) -> Path:
        Path(path).write_text(", ".join(comparison.runs))
        return Path(path)

    monkeypatch.setattr(Comparison, "html", picture)
    monkeypatch.setattr(Comparison, "plot", picture)


@dataclass(frozen=True)
class Stubborn(cc.Solver):
    """Refuses whatever it is asked."""

    name: ClassVar[str] = "stubborn"

    def _solve_impl(self, problem: Problem) -> Solution:
        raise cc.errors.UnsupportedProblem("solver 'stubborn' will not; ask another")


@dataclass(frozen=True)
class Needy(Stubborn):
    """Cannot be made from its name alone."""

    name: ClassVar[str] = "needy"
    wish: float


@pytest.fixture
def difficult(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two more solvers in the registry."""
    module = ModuleType("cartctl.solvers.difficult")
    module.Stubborn, module.Needy = Stubborn, Needy  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    registry = sys.modules["cartctl.solvers"]._REGISTRY
    monkeypatch.setitem(registry, "stubborn", "difficult:Stubborn")
    monkeypatch.setitem(registry, "needy", "difficult:Needy")


def compare(*args: str, columns: int = 80) -> Result:
    arguments = ["compare", "planar3R", "--home", "joint2=1.1", *map(str, args)]
    return CliRunner().invoke(app, arguments, prog_name="cartctl", env={"COLUMNS": str(columns)})


def rows_of(text: str, name: str) -> list[list[str]]:
    """The lines of the tables that begin with ``name``."""
    return [line.split() for line in text.splitlines() if re.match(rf"{re.escape(name)} ", line)]


def test_compare_runs_and_writes_what_it_names(folder: Path) -> None:
    result = compare("--solvers", "pinv,projected-gradient", "--solver", "transpose", "--dt", "0.01", "--period", "1")
    assert result.exit_code == 0, result.output
    assert result.stderr == "" and "\x1b" not in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 80
    for suffix in ("html", "png", "md", "csv"):
        name = f"out/planar3R-circle-compare.{suffix}"
        assert name in result.stdout and Path(name).stat().st_size > 300
    assert "out/planar3R-circle-<solver>.npz" in result.stdout
    names = ["pinv", "projected-gradient", "transpose"]
    loaded = {name: cc.Run.load(f"out/planar3R-circle-{name}.npz") for name in names}
    assert sorted(p.name for p in Path("out").glob("*.npz")) == sorted(f"planar3R-circle-{n}.npz" for n in names)
    expected = Comparison(loaded)
    with Path("out/planar3R-circle-compare.csv").open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["solver"] for row in table] == names
    for name in names:
        printed = [word for row in rows_of(result.stdout, name) for word in row]
        for text in expected.shown(name):
            assert text in printed, (name, text)
    assert "no objective, no limits" in table[0]["remark"] and "no objective" not in table[1]["remark"]
    assert loaded["pinv"].meta["objective"] is None and loaded["projected-gradient"].meta["objective"]
    assert "for 1 of 3, the others have no null-space term" in re.sub(r"\s+", " ", result.stdout)


def test_an_objective_that_leads_no_solver_is_said_to_lead_none(folder: Path, plain: None) -> None:
    result = compare("--solvers", "pinv,transpose", "--dt", "0.01", "--period", "1")
    assert result.exit_code == 0, result.output
    assert "objective none, since no solver here has a null-space term" in re.sub(r"\s+", " ", result.stdout)


def test_all_solvers_are_the_default(folder: Path, plain: None) -> None:
    result = compare(*QUICK)
    assert result.exit_code == 0, result.output
    made = Path("out/planar3R-circle-compare.html").read_text().split(", ")
    with Path("out/planar3R-circle-compare.csv").open(encoding="utf-8", newline="") as file:
        listed = [row["solver"] for row in csv.DictReader(file)]
    assert sorted(listed) == sorted(cc.solvers()) and set(made) <= set(listed)
    assert {"pinv", "dls", "task-priority"} <= set(made)


def test_solvers_that_refuse_are_listed_with_their_reason(folder: Path, plain: None, difficult: None) -> None:
    result = compare(*QUICK, "--solvers", "stubborn,pinv,needy", columns=400)
    assert result.exit_code == 0, result.output
    text = re.sub(r"\s+", " ", result.stdout)
    assert "refused: solver 'stubborn' will not; ask another" in text
    assert "refused: solver 'needy' needs wish;" in text
    assert Path("out/planar3R-circle-compare.html").read_text() == "pinv"
    assert "refused: solver 'needy'" in Path("out/planar3R-circle-compare.csv").read_text(encoding="utf-8")


def test_when_all_refuse_there_is_nothing_to_compare(folder: Path, plain: None, difficult: None) -> None:
    result = compare(*QUICK, "--solvers", "stubborn")
    assert result.exit_code == 2 and not list(Path("out").iterdir())
    assert result.stderr.startswith("error: none of the solvers") and "will not" in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize("objective", ["none", "joint-range"])
def test_the_objective_goes_to_those_that_can(folder: Path, plain: None, objective: str) -> None:
    options = ("--objective", objective, *(() if objective == "none" else ("--objective-gain", "7")))
    result = compare(*QUICK, "--solvers", "pinv,projected-gradient", *options)
    assert result.exit_code == 0, result.output
    metas = [cc.Run.load(f"out/planar3R-circle-{n}.npz").meta["objective"] for n in ("pinv", "projected-gradient")]
    assert metas[0] is None
    assert metas[1] is None if objective == "none" else metas[1].startswith("JointRange(gain=7.0")
    assert ("no objective" in result.stdout) == (objective != "none")


def test_damping_goes_to_those_that_have_one(folder: Path, plain: None) -> None:
    result = compare(*QUICK, "--solvers", "pinv,dls", "--damping", "0.3")
    assert result.exit_code == 0, result.output
    assert cc.Run.load("out/planar3R-circle-dls.npz").meta["solver_parameters"]["damping"] == "0.3"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--solvers", "pinw"], "did you mean 'pinv'?"),
        (["--solvers", ","], "--solvers is ','"),
        (["--solvers", "pinv", "--damping", "0.1"], "--damping is 0.1, but solver 'pinv' has none"),
        (["--dt", "0"], "dt is 0"),
        (["--level", "velocty"], "did you mean 'velocity'?"),
        (["--objective", "jont-range"], "did you mean 'joint-range'?"),
        (["--objective-gain", "0"], "--objective-gain is 0"),
        (["--objective-gain", "3", "--objective", "none"], "there is no objective"),
        (["--radius", "nan"], "--radius is nan"),
        (["--frame", "tpi"], "unknown frame 'tpi'"),
        (["--out", "file/below"], "--out is 'file/below'"),
    ],
)
def test_bad_options_are_one_line_and_leave_nothing(folder: Path, options: list[str], words: str) -> None:
    Path("file").write_text("")
    result = compare(*options)
    assert result.exit_code == 2, result.output
    (line,) = result.stderr.splitlines()
    assert line.startswith("error: ") and words in line
    assert os.listdir() == ["file"]


def test_ctrl_c_keeps_and_reports_what_is_done(folder: Path, plain: None, monkeypatch: pytest.MonkeyPatch) -> None:
    interrupt_at(70, monkeypatch)
    result = compare(*QUICK, "--solvers", "pinv,dls,transpose,sdls", "--open")
    assert result.exit_code == 130
    assert result.stderr == "interrupted: during transpose, 2 of 4 solvers done; what is done follows\n"
    assert sorted(p.name for p in Path("out").glob("*.npz")) == ["planar3R-circle-dls.npz", "planar3R-circle-pinv.npz"]
    assert Path("out/planar3R-circle-compare.html").read_text() == "pinv, dls"
    assert rows_of(result.stdout, "pinv") and not rows_of(result.stdout, "transpose")


def test_ctrl_c_before_anything_is_done_writes_nothing(
    folder: Path, plain: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupt_at(12, monkeypatch)
    result = compare(*QUICK, "--solvers", "pinv,dls")
    assert result.exit_code == 130 and not list(Path("out").iterdir())
    assert result.stderr == "interrupted: during pinv, 0 of 2 solvers done; nothing is done yet\n"


def test_open_shows_the_page(folder: Path, plain: None, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr(files.webbrowser, "open", lambda uri: (asked.append(uri), True)[1])
    assert compare(*QUICK, "--solvers", "pinv", "--open", "--out", "there").exit_code == 0
    assert asked == [Path("there/planar3R-circle-compare.html").resolve().as_uri()]


def test_help_shows_an_example() -> None:
    result = compare("--help")
    assert result.exit_code == 0 and "Example:  cartctl compare panda" in result.stdout


def test_progress_counts_over_all_runs(folder: Path, plain: None, monkeypatch: pytest.MonkeyPatch) -> None:
    from contextlib import contextmanager

    from cartctl.cli import contest

    told: list[tuple[int, int, str | None]] = []

    @contextmanager
    def listening(_: str) -> Any:
        yield lambda k, n, doing=None: told.append((k, n, doing))

    monkeypatch.setattr(contest, "progress", listening)
    assert compare(*QUICK, "--solvers", "pinv,dls").exit_code == 0
    assert {n for _, n, _ in told} == {60} and told[-1] == (60, 60, "2 of 2: dls")
    assert [k for k, _, _ in told] == sorted(k for k, _, _ in told) and (30, 60, "1 of 2: pinv") in told


@pytest.mark.parametrize("width", [60, 80, 120, 220])
def test_tables_fit_the_terminal_with_every_figure(runs: dict[str, cc.Run], width: int) -> None:
    from rich.console import Console

    long = {"pinv": runs["pinv"], "singularity-robust-priority": runs["led"]}
    comparison = Comparison(long, refused={"shy": "it would rather not " * 6})
    console = Console(width=width, record=True, file=open(os.devnull, "w"))  # noqa: SIM115
    made = list(standings.tables(comparison, console))
    for table in made:
        console.print(table)
    text = console.export_text()
    assert "…" not in text and max(map(len, text.splitlines())) <= width
    assert text.count("refused: it would rather not") == 1
    assert sum(len(rows_of(text, "pinv")[k]) - 1 for k in range(len(made))) == len(comparison.columns) + 1  # OPTIMAL
    assert len(made) <= {60: 4, 80: 3, 120: 2, 220: 1}[width]


def test_tables_for_terminals_that_know_only_ascii(runs: dict[str, cc.Run]) -> None:
    from io import BytesIO, TextIOWrapper

    from rich.console import Console

    stream = TextIOWrapper(BytesIO(), encoding="ascii")
    console = Console(width=80, file=stream)
    for table in standings.tables(Comparison(runs), console):
        console.print(table)
    stream.flush()
    text = stream.buffer.getvalue().decode("ascii")  # type: ignore[attr-defined]
    assert "sigma" in text and "rad^2/s" in text
