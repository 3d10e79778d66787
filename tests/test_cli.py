"""The command line as its users meet it: what it prints, where, and how it ends."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import cartctl as cc
from cartctl.cli import files, hand, shapes
from cartctl.cli.app import app
from cartctl.cli.choices import OBJECTIVES, PATHS, PLANES, SINGULARITIES
from cartctl.cli.console import number
from cartctl.cli.probes import PACKAGES
from cartctl.errors import ParameterError
from cartctl.levels.singularity_policies import NAMED, as_policy
from tests.interruptions import interrupt_at

ROOT = Path(__file__).resolve().parents[1]
QUICK = ("--dt", "0.01", "--duration", "0.3")

# A planar arm in the x-y plane of the world or, with other axes, in another one; its home is mid-range.
ARM = """<robot name="{name}">
  <link name="base"/><link name="l1"/><link name="l2"/><link name="l3"/><link name="tip"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="l1"/><axis xyz="{axis}"/>
    <limit lower="0.2" upper="1.6" velocity="2" effort="10"/></joint>
  <joint name="elbow" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.5 0 0"/><axis xyz="{axis}"/>
    <limit lower="{bend}" upper="2.2" velocity="2" effort="10"/></joint>
  <joint name="wrist" type="continuous"><parent link="l2"/><child link="l3"/><origin xyz="0.4 0 0"/><axis xyz="{axis}"/>
    </joint>
  <joint name="flange" type="fixed"><parent link="l3"/><child link="tip"/><origin xyz="{last} 0 0"/></joint>
</robot>"""


def arm_text(name: str = "three", axis: str = "0 0 1", bend: float = 0.4, last: float = 0.3) -> str:
    return ARM.format(name=name, axis=axis, bend=bend, last=last)


@pytest.fixture
def arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A robot file in an empty working folder."""
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(arm_text())
    return "arm.urdf"


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures take seconds; most tests ask only whether they were asked for."""

    def picture(run: cc.Run, path: Path) -> Path:
        Path(path).write_text(f"picture of {len(run)} steps")
        return Path(path)

    monkeypatch.setattr(cc.Run, "html", picture)
    monkeypatch.setattr(cc.Run, "plot", picture)


def cartctl(*args: str) -> Result:
    return CliRunner().invoke(app, [str(a) for a in args], prog_name="cartctl", env={"COLUMNS": "80"})


def the_error(result: Result) -> str:
    """The one line of a run that was refused."""
    assert result.exit_code == 2, result.output
    lines = result.stderr.splitlines()
    assert len(lines) == 1 and lines[0].startswith("error: "), result.stderr
    assert "Traceback" not in result.output
    return lines[0]


def assert_readable(text: str) -> None:
    """Plain text of 80 columns."""
    assert "\x1b" not in text
    assert max(map(len, text.splitlines())) <= 80
    assert not re.search(r"\b(nan|inf)\b", text)


def environment(**more: str) -> dict[str, str]:
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    return os.environ | {"PYTHONPATH": path, "COLUMNS": "80"} | more


def process(*args: str, code: str = "", **more: str) -> subprocess.CompletedProcess[bytes]:
    """A real process: ``python -m cartctl`` after ``code``."""
    script = f"import sys; {code}\nsys.argv = ['cartctl', *{list(args)!r}]\nfrom cartctl.cli import main; main()"
    command = [sys.executable, "-c", script] if code else [sys.executable, "-m", "cartctl", *args]
    return subprocess.run(command, capture_output=True, env=environment(**more), timeout=120, check=False)


# --- track: what it does ---------------------------------------------------------------------------------------------


def test_track_follows_the_circle_and_writes_what_it_names(arm: str) -> None:
    result = cartctl("track", arm, "--dt", "0.005", "--period", "1", "--csv", "--parquet")
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    assert_readable(result.stdout)
    for suffix in ("html", "npz", "png", "csv", "parquet"):
        name = f"out/three-circle-projected-gradient.{suffix}"
        assert name in result.stdout and Path(name).stat().st_size > 1000
    assert Path("out/three-circle-projected-gradient.png").read_bytes().startswith(b"\x89PNG")

    run = cc.Run.load("out/three-circle-projected-gradient.npz")
    assert run.time[-1] == pytest.approx(1.5) and not run.interrupted  # a lap of 1 s and 0.5 s to settle
    measured = run.metrics()
    assert measured.tasks[0].rms_m is not None and measured.tasks[0].rms_m < 2e-3
    assert number(1e3 * measured.tasks[0].rms_m) in result.stdout
    assert run.tasks[0].units == ["m", "m"] and "axes xy" in result.stdout
    travelled = np.ptp(run.tasks[0].pose[:, :2], axis=0)
    assert travelled == pytest.approx([0.2, 0.2], abs=5e-3)  # radius 0.1 m
    for joint in ("shoulder", "elbow", "wrist"):
        assert re.search(rf"^{joint} ", result.stdout, re.MULTILINE)


def test_the_panda_is_driven_by_torques(plain: None, tmp_path: Path) -> None:
    options = ("--level", "torque", "--out", str(tmp_path), "--dt", "0.002", "--duration", "0.8")
    result = cartctl("track", "panda", *options, "--solver", "sns")
    assert result.exit_code == 0, result.output
    assert_readable(result.stdout)
    assert "torque level, metric inverse-inertia" in " ".join(result.stdout.split()) and "enforced" in result.stdout
    run = cc.Run.load(tmp_path / "panda-circle-sns.npz")
    assert run.meta["level"] == "torque" and run.meta["metric"] == "inverse-inertia"
    figures = run.metrics()
    assert figures.tasks[0].rms_m < 0.2e-3 and figures.peak_torque > 10.0
    assert number(figures.peak_torque) in result.stdout and "torque  outside" in result.stdout
    floating = cartctl("track", "talos", "--root-joint", "free_flyer", *options)
    assert "without a motor" in the_error(floating)


def test_metrics_are_those_of_the_level(plain: None, tmp_path: Path) -> None:
    options = ("--out", str(tmp_path), "--dt", "0.01", "--duration", "0.1")
    of_torques = cartctl("track", "panda", "--level", "torque", "--metric", "inertia", *options)
    assert "'inverse-inertia'" in the_error(of_torques)
    assert "'inertia'" in the_error(cartctl("track", "panda", "--metric", "inverse-inertia", *options))
    assert cartctl("track", "panda", "--metric", "inertia", *options).exit_code == 0
    assert cc.Run.load(tmp_path / "panda-circle-projected-gradient.npz").meta["metric"] == "inertia"


def test_the_panda_tracks_its_whole_pose(plain: None, tmp_path: Path) -> None:
    result = cartctl("track", "panda", "--out", str(tmp_path), "--dt", "0.01")
    assert result.exit_code == 0, result.output
    assert_readable(result.stdout)
    assert "axes pose" in result.stdout and "circle of radius 0.1 m in xy" in result.stdout
    assert "orientation" in result.stdout and "1 redundant" in result.stdout
    run = cc.Run.load(tmp_path / "panda-circle-projected-gradient.npz")
    assert run.meta["objective"].startswith("JointRange(gain=100.0")
    assert run.meta["cycles"] == [0.0, 4.0]
    assert run.metrics().violations == 0  # the objective sets in softly


def test_options_reach_the_run(arm: str, plain: None) -> None:
    result = cartctl(
        "track", arm, *QUICK, "--solver", "dls", "--damping", "0.2", "--gain", "3", "--objective-gain", "7",
        "--axes", "x rz", "--frame", "l3", "--path", "line", "--home", "elbow=1.9", "--out", "elsewhere/deep",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    run = cc.Run.load("elsewhere/deep/three-line-dls.npz")
    assert run.meta["solver_parameters"] == {"damping": "0.2"}
    assert run.meta["objective"].startswith("JointRange(gain=7.0")
    assert run.meta["dt"] == 0.01 and len(run) == 30
    assert run.tasks[0].frame == "l3" and run.tasks[0].units == ["m", "rad"]
    assert run.q[0, 1] == 1.9


def test_gain_is_the_rate_at_which_errors_decay(arm: str, plain: None) -> None:
    lags = []
    for gain in ("2", "40"):
        assert cartctl("track", arm, "--dt", "0.01", "--period", "1", "--gain", gain).exit_code == 0
        lags.append(cc.Run.load("out/three-circle-projected-gradient.npz").metrics().tasks[0].final_m)
    assert lags[1] < 1e-3 * lags[0]


@pytest.mark.parametrize("name", [name for name in OBJECTIVES if name != "none"])
def test_every_objective_by_name(arm: str, plain: None, name: str) -> None:
    """It aims at what the hand does, its default gain is one the loop can take, and the header says it."""
    result = cartctl("track", arm, *QUICK, "--objective", name)
    assert result.exit_code == 0 and f"objective  {name}, gain " in result.stdout
    run = cc.Run.load("out/three-circle-projected-gradient.npz")
    assert run.meta["objective"].startswith(name.title().replace("-", "") + "(")
    assert "axes=" not in run.meta["objective"] or "axes='xy'" in run.meta["objective"]
    assert run.metrics().tasks[0].max_m < 1e-2


def test_singularity_policies_by_name_are_those_of_the_controller() -> None:
    assert tuple(NAMED) == SINGULARITIES
    text = " ".join(cartctl("track", "--help").stdout.split())
    assert "--singularity" in text and "--solver pinv --singularity damp" in text


@pytest.mark.parametrize("name", SINGULARITIES)
def test_every_singularity_policy_by_name(arm: str, plain: None, name: str) -> None:
    result = cartctl("track", arm, *QUICK, "--singularity", name)
    assert result.exit_code == 0, result.stdout
    assert f"near a singularity: {name}" in " ".join(result.stdout.split())
    run = cc.Run.load("out/three-circle-projected-gradient.npz")
    assert run.meta["singularity"] == repr(as_policy(name))


def test_compare_takes_a_singularity_policy_and_names_who_refuses_it(arm: str, plain: None) -> None:
    result = cartctl("compare", arm, *QUICK, "--solvers", "pinv,projected-gradient", "--singularity", "avoid")
    assert result.exit_code == 0, result.stdout
    words = " ".join(result.stdout.split())
    assert "near a singularity: avoid" in words and "another singularity policy" in words
    assert Path("out/three-circle-projected-gradient.npz").exists()
    both = cartctl("compare", arm, *QUICK, "--solvers", "pinv,dls", "--singularity", "damp")
    assert both.exit_code == 0
    for solver in ("pinv", "dls"):
        assert cc.Run.load(f"out/three-circle-{solver}.npz").meta["singularity"] == repr(as_policy("damp"))


@pytest.mark.parametrize(
    ("solver", "asked", "words", "objective"),
    [
        ("projected-gradient", [], "joint-range, gain 100", "JointRange(gain=100.0"),
        ("projected-gradient", ["--objective", "none"], "objective  none\n", None),
        ("pinv", [], "none: pinv has no null-space term", None),
    ],
)
def test_the_objective_is_named(
    arm: str, plain: None, solver: str, asked: list[str], words: str, objective: str | None
) -> None:
    result = cartctl("track", arm, *QUICK, "--solver", solver, *asked)
    assert words in re.sub(" +\n", "\n", result.stdout)
    found = cc.Run.load(f"out/three-circle-{solver}.npz").meta["objective"]
    assert found is None if objective is None else found.startswith(objective)


@pytest.mark.parametrize("solver", ["projected-gradient", "dls"])
def test_a_path_out_of_reach_ends_properly(arm: str, plain: None, solver: str) -> None:
    result = cartctl("track", arm, "--dt", "0.01", "--radius", "5", "--period", "1", "--solver", solver)
    assert result.exit_code == 0, result.output
    assert_readable(result.stdout)
    assert result.stderr.startswith("warning: the hand strayed by ") and result.stderr.count("\n") == 1
    run = cc.Run.load(f"out/three-circle-{solver}.npz")
    assert len(run) == 150 and np.isfinite(run.q).all()
    for name in set(run.status):
        assert f"{name} {run.status.count(name)}" in result.stdout
    for joint in run.metrics().joints[:2]:
        assert joint.violations and re.search(rf"^{joint.name} .* {joint.violations} *$", result.stdout, re.MULTILINE)


def test_a_singular_home_is_said(arm: str, plain: None) -> None:
    result = cartctl("track", arm, *QUICK, "--home", "elbow=0", "--home", "wrist=0", "--solver", "dls")
    assert result.exit_code == 0
    lines = result.stderr.splitlines()
    assert len(lines) == 2 and lines[0] == "warning: home is outside the limits of elbow"
    assert lines[1].startswith("warning: home is singular for axes xy")
    singular = cc.Run.load("out/three-circle-dls.npz").status.count("SINGULAR")
    assert singular and f"SINGULAR {singular}" in result.stdout
    assert "SINGULAR: A task lost rank here" in result.stdout


def test_a_missing_mesh_is_one_warning(arm: str, plain: None) -> None:
    mesh = '<visual><geometry><mesh filename="package://nowhere/hand.stl"/></geometry></visual>'
    Path(arm).write_text(arm_text().replace('<link name="tip"/>', f'<link name="tip">{mesh}</link>'))
    result = cartctl("track", arm, *QUICK)
    assert result.exit_code == 0
    assert result.stderr.startswith("warning: ") and "package://nowhere/hand.stl" in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_robots_own_name_cannot_leave_the_folder(arm: str, plain: None) -> None:
    Path(arm).write_text(arm_text(name="../../[bold]my arm"))
    assert cartctl("track", arm, *QUICK).exit_code == 0
    assert [p.name for p in Path("out").glob("*.npz")] == ["bold_my_arm-circle-projected-gradient.npz"]


@pytest.mark.parametrize("there", [True, False])
def test_open_shows_the_page(arm: str, plain: None, monkeypatch: pytest.MonkeyPatch, there: bool) -> None:
    asked: list[str] = []
    monkeypatch.setattr(files.webbrowser, "open", lambda uri: (asked.append(uri), there)[1])
    result = cartctl("track", arm, *QUICK, "--open")
    assert result.exit_code == 0
    assert asked == [Path("out/three-circle-projected-gradient.html").resolve().as_uri()]
    assert ("warning: no browser found" in result.stderr) is not there


# --- track: the path chosen for a robot ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", PATHS)
@pytest.mark.parametrize("plane", PLANES)
def test_every_path_starts_and_ends_at_the_hand(kind: str, plane: str) -> None:
    robot = cc.load("elbow3R")
    here = hand.Hand(robot, robot.tool)
    path = shapes.Shape(kind, plane, 0.07, 1.3, 3).path(here)
    assert path.duration == pytest.approx(3.9) and path.closed and len(path.cycle_times()) == 4
    for t in (0.0, path.duration):
        sample = path(t)
        assert sample.position == pytest.approx(here.pose.translation, abs=1e-12)
        assert sample.rotation == pytest.approx(here.pose.rotation, abs=1e-12)
        assert sample.twist == pytest.approx(np.zeros(6), abs=1e-12)
    points = path.polyline(4001) - here.pose.translation
    (normal,) = set("xyz") - set(plane)
    assert np.abs(points[:, "xyz".index(normal)]).max() < 1e-12
    diameter = np.linalg.norm(points[:, None] - points[None, ::40], axis=2).max()
    assert diameter == pytest.approx(0.14, rel=0.2 if kind == "lissajous" else 0.04)


@pytest.mark.parametrize("planes", [("xy", "yx"), ("xz", "zx"), ("yz", "zy")])
def test_a_plane_turned_over_goes_the_other_way_round(planes: tuple[str, str]) -> None:
    robot = cc.load("elbow3R")
    here = hand.Hand(robot, robot.tool)
    turns = []
    for plane in planes:
        p = shapes.Shape("circle", plane, 0.1, 1.0, 1).path(here).polyline(100)
        turns.append(np.cross(p[:-1] - p.mean(axis=0), np.diff(p, axis=0)).sum(axis=0))
    assert turns[0] == pytest.approx(-turns[1]) and np.linalg.norm(turns[0]) > 0.01
    a, b = ("xyz".index(letter) for letter in planes[0])
    assert np.cross(np.eye(3)[a], np.eye(3)[b]) @ turns[0] > 0.0


@pytest.mark.parametrize(
    ("axis", "axes", "plane"),
    [("0 0 1", "xy", "xy"), ("0 1 0", "xz", "xz"), ("1 0 0", "z", "xz"), ("0.6 0 0.8", "xy", "xy")],
)
def test_axes_are_those_the_robot_can_move(arm: str, axis: str, axes: str, plane: str) -> None:
    text = arm_text(axis=axis)
    if axes == "z":  # about x, links along x: the tip moves only once the last joint is off that axis
        text = text.replace('xyz="0.3 0 0"', 'xyz="0 0.3 0"').replace('type="continuous"', 'type="fixed"')
        text = text.replace('name="elbow" type="revolute"', 'name="elbow" type="fixed"')
        text = text.replace('lower="0.2" upper="1.6"', 'lower="-0.01" upper="0.01"')
    Path(arm).write_text(text)
    robot = cc.load(arm)
    here = hand.Hand(robot, "tip")
    assert (here.axes, here.plane(here.axes)) == (axes, plane)
    assert not here.is_singular(here.axes)


def test_axes_of_larger_robots() -> None:
    for name, axes in (("elbow3R", "position"), ("panda", "pose"), ("planar4R", "xy")):
        robot = cc.load(name)
        assert hand.Hand(robot, robot.tool).axes == axes


def test_a_singular_home_does_not_hide_an_axis(arm: str) -> None:
    stretched = hand.Hand(cc.load(arm, home={"elbow": 0.0, "wrist": 0.0, "shoulder": 0.7}), "tip")
    assert stretched.axes == "xy" and stretched.is_singular("xy")
    bent = hand.Hand(cc.load(arm), "tip")
    assert not bent.is_singular("xy")
    J = bent.robot.state(bent.robot.home).jacobian("tip")
    assert bent.singular_values("xy") == pytest.approx(np.linalg.svd(J[:2], compute_uv=False))


def test_a_frame_that_nothing_moves_is_refused(arm: str) -> None:
    with pytest.raises(ParameterError, match="moves the origin of frame 'base'"):
        _ = hand.Hand(cc.load(arm), "base").axes
    assert "'base'" in the_error(cartctl("track", arm, "--frame", "base"))


@pytest.mark.parametrize(("name", "size"), [("panda", 0.1), ("planar2R", 0.2), ("planar3R", 0.2), ("so101", 0.05)])
def test_the_size_fits_the_robot(name: str, size: float) -> None:
    robot = cc.load(name)
    assert hand.Hand(robot, robot.tool).size == size


# --- track: bad input ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--dt", "0"], "dt is 0"),
        (["--dt", "nan"], "dt is nan"),
        (["--dt", "-1e-3"], "dt is -0.001"),
        (["--duration", "inf"], "--duration is inf"),
        (["--duration", "1e-4"], "--duration is 0.0001"),
        (["--radius", "nan"], "--radius is nan"),
        (["--size", "0"], "--radius is 0"),
        (["--period", "nan"], "--period is nan"),
        (["--period", "-2", "--path", "polygon"], "--period is -2"),
        (["--laps", "0"], "laps is 0"),
        (["--laps", "-3", "--path", "line"], "laps is -3"),
        (["--gain", "nan"], "gain is nan"),
        (["--gain", "-1"], "gain is -1"),
        (["--objective-gain", "nan"], "--objective-gain is nan"),
        (["--objective-gain", "0"], "--objective-gain is 0"),
        (["--objective-gain", "3", "--objective", "none"], "there is no objective"),
        (["--objective", "jont-range"], "did you mean 'joint-range'?"),
        (["--singularity", "dampen"], "did you mean 'damp'?"),
        (["--singularity", ""], "singularity ''"),
        (["--singularity", "slow-down", "--level", "acceleration"], "no velocities that could be slowed down"),
        (["--singularity", "avoid", "--solver", "pinv"], "or another singularity policy"),
        (["--objective", "joint-range", "--solver", "pinv"], "no null-space term"),
        (["--solver", "projected-gradint"], "did you mean 'projected-gradient'"),
        (["--solver", "dls", "--damping", "nan"], "damping is nan"),
        (["--damping", "0.1"], "--damping is 0.1, but solver 'projected-gradient' has none"),
        (["--level", "velocty"], "did you mean 'velocity'?"),
        (["--path", "circel"], "did you mean 'circle'?"),
        (["--plane", "xw"], "unknown plane 'xw'"),
        (["--axes", "xq"], "axes is 'xq'"),
        (["--axes", ""], "axes is ''"),
        (["--frame", "tpi"], "did you mean 'tip'?"),
        (["--frame", ""], "unknown frame ''"),
        (["--home", "elbow"], "--home is 'elbow'"),
        (["--home", "elbw=1"], "did you mean 'elbow'?"),
        (["--home", "elbow=nan"], "'elbow' is nan"),
        (["--root-joint", "flying"], "'flying'"),
        (["--out", "arm.urdf"], "--out is 'arm.urdf'"),
        (["--out", "arm.urdf/below"], "--out is 'arm.urdf/below'"),
    ],
)
def test_bad_options_are_one_line_and_leave_nothing(arm: str, options: list[str], words: str) -> None:
    assert words in the_error(cartctl("track", arm, *options))
    assert os.listdir() == ["arm.urdf"] and Path(arm).is_file()


@pytest.mark.parametrize("verb", ["track", "info"])
@pytest.mark.parametrize(
    ("robot", "words"),
    [
        ("pnada", "did you mean 'panda'?"),
        ("", "unknown robot ''"),
        ("nowhere/arm.urdf", "nowhere/arm.urdf: no such file"),
        ("folder.urdf", "folder.urdf is a folder"),
        ("torn.urdf", "torn.urdf is not well-formed XML"),
        ("still.urdf", "none that moves"),
        ("bomb.urdf", "declares XML entities"),
    ],
)
def test_bad_robots_are_one_line(arm: str, verb: str, robot: str, words: str) -> None:
    Path("folder.urdf").mkdir()
    Path("torn.urdf").write_text("<robot><link")
    Path("still.urdf").write_text('<robot name="r"><link name="a"/></robot>')
    Path("bomb.urdf").write_text('<!DOCTYPE r [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]><robot name="&b;"/>')
    assert words in the_error(cartctl(verb, robot))


@pytest.mark.parametrize(
    "args", [["track"], ["trak", "panda"], ["track", "panda", "--solvr", "x"], ["track", "panda", "--dt", "fast"],
             ["track", "panda", "--package-dir", "nowhere"], ["info", "panda", "spare"]],
)  # fmt: skip
def test_wrong_usage_ends_with_2(args: list[str]) -> None:
    result = cartctl(*args)
    assert result.exit_code == 2 and result.stdout == ""
    assert "Usage: cartctl" in result.stderr and "Traceback" not in result.stderr


def test_a_mistyped_verb_is_offered_the_close_one() -> None:
    assert "'track'" in cartctl("trak", "panda").stderr


def test_the_unexpected_is_one_line_unless_debug(arm: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("of all\nthings")

    monkeypatch.setattr(cc, "simulate", broken)
    result = cartctl("track", arm)
    assert result.exit_code == 1
    assert result.stderr == (
        "error: unexpected ZeroDivisionError: of all things (run it again with --debug for the traceback)\n"
    )
    assert isinstance(cartctl("track", arm, "--debug").exception, ZeroDivisionError)


def test_too_many_steps_are_said_as_such(arm: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def huge(*_: object, **__: object) -> None:
        raise MemoryError("Unable to allocate 1 TiB")

    monkeypatch.setattr(cc, "simulate", huge)
    result = cartctl("track", arm)
    assert result.exit_code == 1 and "larger --dt" in result.stderr and result.stderr.count("\n") == 1


# --- interruption ----------------------------------------------------------------------------------------------------


def test_ctrl_c_saves_what_there_is(arm: str, plain: None, monkeypatch: pytest.MonkeyPatch) -> None:
    interrupt_at(25, monkeypatch)
    result = cartctl("track", arm, "--dt", "0.01", "--open")
    assert result.exit_code == 130
    assert result.stderr == "interrupted: at 0.24 s of 4.5 s; what there is follows\n"
    run = cc.Run.load("out/three-circle-projected-gradient.npz")
    assert run.interrupted and len(run) == 24 and len(run.time) == 25
    for suffix in ("html", "npz", "png"):
        assert f"three-circle-projected-gradient.{suffix}" in result.stdout
        assert Path(f"out/three-circle-projected-gradient.{suffix}").is_file()
    assert_readable(result.stdout)


def test_ctrl_c_after_one_sample_saves_it_without_pictures(
    arm: str, plain: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupt_at(1, monkeypatch)
    result = cartctl("track", arm, "--dt", "0.01")
    assert result.exit_code == 130
    assert [p.name for p in Path("out").iterdir()] == ["three-circle-projected-gradient.npz"]


def test_ctrl_c_before_the_first_step_leaves_an_older_run_alone(
    arm: str, plain: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cartctl("track", arm, *QUICK).exit_code == 0
    before = Path("out/three-circle-projected-gradient.npz").read_bytes()
    interrupt_at(0, monkeypatch)
    result = cartctl("track", arm, "--dt", "0.01")
    assert result.exit_code == 130 and result.stderr == "interrupted: before the first step\n"
    assert Path("out/three-circle-projected-gradient.npz").read_bytes() == before


def test_ctrl_c_elsewhere_ends_quietly(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cc, "load", interrupted)
    for verb in ("track", "info"):
        result = cartctl(verb, "panda")
        assert result.exit_code == 130 and result.stderr.startswith("interrupted: ")


@pytest.mark.skipif(os.name == "nt", reason="SIGINT as a terminal sends it")
def test_a_real_sigint(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cartctl", "track", "planar3R", "--duration", "2000", "--out", str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment(), text=True) as it:
        assert it.stdout is not None
        for line in it.stdout:
            if line.startswith("limits"):  # the last line before the rollout
                break
        time.sleep(1.0)
        it.send_signal(signal.SIGINT)
        printed, complaint = it.communicate(timeout=60)
    assert it.returncode == 130
    assert complaint.startswith("interrupted: at ") and complaint.count("\n") == 1
    run = cc.Run.load(tmp_path / "planar3R-circle-projected-gradient.npz")
    assert run.interrupted and 0 < len(run) < 2_000_000
    assert f"OPTIMAL {len(run)} of {len(run)} steps" in printed
    assert (tmp_path / "planar3R-circle-projected-gradient.html").stat().st_size > 1000


# --- info, doctor, help ----------------------------------------------------------------------------------------------


def test_info_lists_every_robot_and_solver() -> None:
    result = cartctl("info")
    assert result.exit_code == 0 and result.stderr == ""
    assert_readable(result.stdout)
    listed = {line.split()[0] for line in result.stdout.splitlines() if line[:1].strip()}
    assert set(cc.robots()) | set(cc.solvers()) <= listed


def test_info_shows_one_robot() -> None:
    result = cartctl("info", "panda")
    assert result.exit_code == 0, result.output
    assert_readable(result.stdout)
    robot = cc.load("panda")
    for i, name in enumerate(robot.dof_names):
        row = re.search(rf"^{name} +revolute +(.*?) *$", result.stdout, re.MULTILINE)
        assert row, name
        limits = robot.limits
        expected = (
            robot.home[i], limits.position_lower[i], limits.position_upper[i],
            limits.velocity_upper[i], limits.acceleration_upper[i], limits.torque_upper[i],
        )  # fmt: skip
        assert [float(x) for x in row[1].split()] == pytest.approx(expected, rel=5e-3, abs=1e-9)
    assert f"{robot.tool} (tool)" in result.stdout and "-9.81" in result.stdout and "rank 6" in result.stdout
    assert "panda_link1" not in result.stdout and "more: --frames" in result.stdout
    assert "home from" in result.stdout and "acceleration from" in result.stdout


def test_info_analyses_the_hand_at_home() -> None:
    result = cartctl("info", "panda")
    robot = cc.load("panda")
    s = np.linalg.svd(robot.state(robot.home).jacobian(robot.tool), compute_uv=False)
    assert "x y z rx ry rz at home: rank 6 of 6, degree of redundancy 1" in result.stdout
    shown = line_of("singular values", result.stdout)
    assert [float(x) for x in shown.split()] == pytest.approx(s, rel=5e-3)
    assert float(line_of("condition", result.stdout)) == pytest.approx(s[0] / s[-1], rel=5e-3)
    assert float(line_of("manipulability", result.stdout)) == pytest.approx(np.prod(s), rel=5e-3)
    assert "lost" not in result.stdout and "determinant" not in result.stdout
    assert len(re.findall(r"^velocity ellipsoid .* (?:m|rad)/s *$", result.stdout, re.MULTILINE)) == 2


def test_info_analyses_a_given_configuration(arm: str) -> None:
    """Stretched along the axis of the shoulder: 0 velocity and any force along x, at 0.5 + 0.4 + 0.3 m."""
    Path(arm).write_text(arm_text(bend=-0.4))
    result = cartctl("info", arm, "--home", "shoulder=0", "--home", "elbow=0", "--home", "wrist=0")
    assert result.exit_code == 0, result.output
    assert_readable(result.stdout)
    assert line_of("its Jacobian", result.stdout) == "x y at home: rank 1 of 2, degree of redundancy 2"
    assert line_of("lost", result.stdout) == "x"
    reach = np.linalg.norm([1.2, 0.7, 0.3])
    assert line_of("velocity ellipsoid", result.stdout) == f"{number(reach)}  0 m/s"
    assert line_of("force ellipsoid", result.stdout) == f"any  {number(1.0 / reach)} N"
    assert "condition" not in result.stdout


def test_info_of_other_frames_and_axes(arm: str) -> None:
    square = cartctl("info", arm, "--axes", "xy rz")
    robot = cc.load(arm)
    J = robot.state(robot.home).jacobian("tip")[[0, 1, 5]]
    assert float(line_of("determinant", square.stdout)) == pytest.approx(np.linalg.det(J), rel=5e-3)
    assert line_of("its Jacobian", square.stdout) == "x y rz at home: rank 3 of 3, degree of redundancy 0"
    elbow = cartctl("info", arm, "--frame", "l2")
    assert line_of("frame", elbow.stdout) == "l2" and "rank 1 of 1" in line_of("its Jacobian", elbow.stdout)
    still = cartctl("info", arm, "--frame", "base")
    assert still.exit_code == 0 and line_of("lost", still.stdout) == "x, y, z, rx, ry, rz"


def line_of(name: str, text: str) -> str:
    """What stands beside a name."""
    found = re.search(rf"^{name}  +(.*?) *$", text, re.MULTILINE)
    assert found, text
    return found[1]


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["panda", "--home", "panda_joint1"], "--home is 'panda_joint1'"),
        (["panda", "--home", "panda_jont1=1"], "did you mean 'panda_joint1'"),
        (["panda", "--frame", "panda_hnd"], "did you mean 'panda_hand'"),
        (["panda", "--axes", "xq"], "axes is 'xq'"),
        (["--home", "elbow=1"], "--home is given without a robot"),
        (["--frame", "tip"], "--frame is given without a robot"),
    ],
)
def test_bad_options_of_info_are_one_line(args: list[str], words: str) -> None:
    assert words in the_error(cartctl("info", *args))


def test_info_unfolds_all_frames() -> None:
    shown = cartctl("info", "panda", "--frames").stdout.split()
    assert set(cc.load("panda").frame_names) <= set(shown)


def test_info_of_a_file_with_unlimited_and_lopsided_joints(arm: str) -> None:
    text = arm_text().replace('name="flange" type="fixed"', 'name="flange" type="prismatic"')
    text = text.replace(
        '<origin xyz="0.3 0 0"/></joint>', '<limit lower="0" upper="0.2" velocity="1" effort="5"/></joint>'
    )
    Path(arm).write_text(text)
    result = cartctl("info", arm)
    assert result.exit_code == 0, result.output
    assert_readable(result.stdout)
    rows = {line.split()[0]: line.split()[1:] for line in result.stdout.splitlines() if len(line.split()) > 6}
    assert rows["wrist"][0] == "continuous" and rows["wrist"][2:4] == ["-", "-"]
    assert rows["flange"][0] == "prismatic" and rows["flange"][2:4] == ["0", "0.2"]
    assert rows["elbow"][1:4] == ["1.3", "0.4", "2.2"]


def test_doctor_finds_this_installation_well() -> None:
    result = cartctl("doctor")
    assert result.exit_code == 0, result.output
    assert_readable(result.stdout)
    for name in (*PACKAGES, "python", "cartctl", "kernels", "kernel cache", "BLAS", "robots", "chromium"):
        assert re.search(rf"^(ok|note) +{re.escape(name)} ", result.stdout, re.MULTILINE), name


def test_doctor_asks_for_what_the_package_declares() -> None:
    declared = dict(re.findall(r'^ +"([a-z-]+)>=([\d.]+)",$', _dependencies(), re.MULTILINE))
    assert {name: oldest for name, (_, oldest) in PACKAGES.items()} == declared


def _dependencies() -> str:
    return (ROOT / "pyproject.toml").read_text().partition("\ndependencies = [")[2].partition("]")[0]


@pytest.mark.parametrize(
    ("module", "body", "reason"),
    [
        ("numba", "raise ImportError('no such\\nlibrary')", "ImportError: no such library"),
        ("matplotlib", "import os; os._exit(7)", "ends its process with 7"),
        ("scipy", "import no_such_thing", "No module named 'no_such_thing'"),
        ("pinocchio", "a_test_runner = True", "is another package of that name"),
        ("numpy", "raise ModuleNotFoundError('gone', name='numpy')", "gone"),
    ],
)
def test_doctor_names_what_is_broken_and_its_remedy(tmp_path: Path, module: str, body: str, reason: str) -> None:
    (tmp_path / f"{module}.py").write_text(body)
    name = next(name for name, (brought, _) in PACKAGES.items() if brought == module)
    result = process("doctor", PYTHONPATH=os.pathsep.join([str(tmp_path), str(ROOT)]))
    printed = " ".join(result.stdout.decode().split())
    assert result.returncode == 1 and result.stderr == b""
    assert f"broken {name} {metadata.version(name)}, but import {module}: {reason} " in printed
    remedy = f"pip install --force-reinstall '{name}>={PACKAGES[name][1]}'"
    assert ("pip uninstall -y pinocchio && " if module == "pinocchio" else "") + remedy in printed
    assert re.search(rf"To be mended: .*\b{name}\b", printed)
    assert "ok rich" in printed and ("broken numba" not in printed or module in ("numba", "numpy"))
    if module == "numpy":
        assert re.search(r"broken numba [\d.]+, but it needs numpy broken", printed)


def test_doctor_names_what_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    from cartctl.cli import probes

    monkeypatch.setitem(probes.PACKAGES, "no-such-thing", ("nothing", "1.0"))
    monkeypatch.setitem(probes.PACKAGES, "numpy", ("numpy", "999"))
    result = cartctl("doctor")
    assert result.exit_code == 1
    assert re.search(r"^missing +no-such-thing +not installed", result.stdout, re.MULTILINE)
    assert "pip install 'no-such-thing>=1.0'" in result.stdout
    assert "expected 999 or later" in result.stdout and "To be mended: numpy, no-such-thing." in result.stdout


@pytest.mark.parametrize("module", ["typer", "rich"])
def test_without_its_own_libraries_it_still_says_so(module: str) -> None:
    result = process("doctor", code=f"sys.modules[{module!r}] = None")
    assert result.returncode == 1
    assert result.stderr.decode() == f"error: {module} is not installed; pip install 'typer>=0.12' 'rich>=13'\n"


def test_a_verb_without_a_package_it_needs_points_to_doctor() -> None:
    result = process("info", "panda", code="sys.modules['pinocchio'] = None")
    assert result.returncode == 2 and b"cartctl doctor" in result.stderr and b"Traceback" not in result.stderr


@pytest.mark.parametrize("verb", [[], ["track"], ["plan"], ["info"], ["doctor"]])
def test_help_shows_an_example(verb: list[str]) -> None:
    result = cartctl(*verb, "--help")
    assert result.exit_code == 0
    assert_readable(result.stdout)
    assert "Example:  cartctl " + "".join(verb) in result.stdout


def test_help_imports_nothing_slow() -> None:
    code = "import atexit; atexit.register(lambda: print(*sys.modules))"
    result = process("--help", code=code)
    assert result.returncode == 0
    slow = {"pinocchio", "matplotlib", "numba", "scipy", "numpy", "meshcat", "pyarrow"}
    assert slow.isdisjoint(result.stdout.decode().split())


def test_version() -> None:
    assert cartctl("--version").stdout == f"cartctl {cc.__version__}\n"
    result = process("--version")
    assert (result.returncode, result.stdout.split()) == (0, [b"cartctl", cc.__version__.encode()])


def test_a_terminal_that_knows_only_ascii(arm: str) -> None:
    code = "import cartctl; cartctl.Run.html = cartctl.Run.plot = lambda *_: None"
    result = process("track", arm, *QUICK, code=code, PYTHONIOENCODING="ascii")
    assert result.returncode == 0 and result.stderr == b""
    assert result.stdout.isascii() and b"==" in result.stdout


def test_a_reader_that_leaves_early_is_no_drama() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "cartctl", "info"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment()
    ) as it:
        assert it.stdout is not None and it.stderr is not None
        it.stdout.close()
        assert it.stderr.read() == b""


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "-"), (float("inf"), "-"), (0.0, "0"), (2.17, "2.17"), (-0.0698, "-0.0698"), (87.0, "87"),
     (1234.56, "1235"), (3.14e-6, "3.1e-06"), (7.5e8, "7.5e+08"), (0.001, "0.001")],
)  # fmt: skip
def test_numbers_stay_short(value: float | None, text: str) -> None:
    assert number(value) == text


def test_axes_that_no_path_moves_are_refused(arm: str, plain: None) -> None:
    result = cartctl("track", arm, *QUICK, "--axes", "rz")
    assert result.exit_code == 2 and "holds no position" in result.stderr


@pytest.mark.parametrize("args", [["track", "panda", "--laps", "1.5"], ["trak"], ["track"], ["info", "--nope"]])
def test_wrong_usage_is_one_line_too(args: list[str]) -> None:
    result = process(*args)
    assert result.returncode == 2
    assert result.stderr.startswith(b"error: ") and result.stderr.count(b"\n") == 1 and b"--help" in result.stderr
