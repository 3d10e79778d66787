"""``cartctl calibrate`` as its users meet it, the table it reads, and the report it writes."""

from __future__ import annotations

import csv
import json
import os
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner, Result

import cartctl as cc
from cartctl import calibration as cal
from cartctl.cli.app import app
from cartctl.errors import CartctlWarning, MeasurementError, ParameterError
from cartctl.report import plot_calibration, write_calibration_html
from tests.calibration_for_tests import measure, puma
from tests.chromium import needs_chromium, share, shoot

QUATERNION = ["qx", "qy", "qz", "qw"]


def cartctl(*args: object) -> Result:
    return CliRunner().invoke(app, [str(a) for a in args], prog_name="cartctl", env={"COLUMNS": "80"})


def the_error(result: Result) -> str:
    assert result.exit_code == 2, result.output
    (line,) = result.stderr.splitlines()
    assert line.startswith("error: ") and "Traceback" not in result.output
    return line


def joint_names(robot: cc.Robot) -> list[str]:
    return [joint.name for joint in cal.RobotChain(robot).joints]


def write(path: Path, header: list[str], rows: np.ndarray) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([[f"{x:.12g}" for x in row] for row in rows])
    return path


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Job:
    """A LWR with planted errors, somewhere in the room of the device, and the CSV of its poses in deg and mm."""

    def __init__(self, path: Path, wild: int = 0, kind: str = "pose", far: bool = True) -> None:
        self.robot = cc.load("lwr")
        base = np.array([[0, -1, 0, 1.0], [0.6, 0, -0.8, -2.0], [0.8, 0, 0.6, 0.5], [0, 0, 0, 1]]) if far else None
        self.chain = cal.RobotChain(self.robot, base=base)
        self.data = measure(self.chain, "placements tool", 0, count=50, wild=wild)
        header = [f"{name} [deg]" for name in joint_names(self.robot)]
        columns = [np.degrees(self.data.q)]
        if kind == "distance":
            header += ["distance [mm]", "ax", "ay", "az"]
            anchors = np.tile([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.5], [-1, -1, 0], [0.3, 0.2, 0]], (10, 1))
            columns += [1e3 * np.linalg.norm(self.data.poses[:, :3, 3] - anchors, axis=1)[:, None], anchors]
        else:
            header += ["x [mm]", "y [mm]", "z (mm)"]
            columns.append(1e3 * self.data.poses[:, :3, 3])
        if kind == "pose":
            header += QUATERNION
            columns.append(Rotation.from_matrix(self.data.poses[:, :3, :3]).as_quat())
        write(path, header, np.column_stack(columns))


# --- the verb ---------------------------------------------------------------------------------------------------------


def test_from_a_csv_to_a_better_urdf(folder: Path) -> None:
    job = Job(folder / "m.csv")
    result = cartctl("calibrate", "m.csv", "--robot", "lwr", "-p", "placements tool", "--align")
    assert result.exit_code == 0, result.output
    assert max(map(len, result.stdout.splitlines())) <= 80 and "\x1b" not in result.output
    assert not re.search(r"\b(nan|inf)\b", result.output)
    assert "cannot be told apart" in result.stderr
    (rms,) = re.findall(r"position RMS \(mm\) +(\S+) +(\S+) +(\S+)", result.stdout)
    before, after, validated = map(float, rms)
    assert before > 2.0 and after < 0.25 and after < validated < 0.5  # noise of 0.1 mm in each of three directions
    for suffix in ("urdf", "json", "html"):
        assert f"out/lwr-calibrated.{suffix}" in result.stdout
    assert sorted(os.listdir("out")) == [f"lwr-calibrated.{s}" for s in ("html", "json", "urdf")]

    call = " ".join(result.stdout[result.stdout.index("cc.load(") :].split()).replace("/ ", "/")
    loaded = cc.load("out/lwr-calibrated.urdf", tool="calibrated_tool")
    assert "'out/lwr-calibrated.urdf', tool='calibrated_tool'" in call
    for q, T in zip(job.data.q, job.data.exact, strict=True):  # in the frame of the device, where it was measured
        assert np.abs(loaded.state(q).position("calibrated_tool") - T[:3, 3]).max() < 5e-4
    facts = json.loads(Path("out/lwr-calibrated.json").read_text())
    assert (
        facts["rank"] == 34
        and facts["measurements"] == 50
        and facts["after"][0]["rms"] * 1e3 == pytest.approx(after, rel=0.01)
    )
    page = Path("out/lwr-calibrated.html").read_text()
    assert (
        page.startswith("<!DOCTYPE html>")
        and "data:image/png;base64," in page
        and "http" not in page.split("<body>")[1]
    )


def test_outliers_are_named_and_survived(folder: Path) -> None:
    job = Job(folder / "m.csv", wild=5)
    options = ("calibrate", "m.csv", "--robot", "lwr", "-p", "placements tool", "--align", "--folds", "0")
    plain = cartctl(*options, "--out", "plain")
    robust = cartctl(*options, "--loss", "huber")
    assert plain.exit_code == robust.exit_code == 0
    assert "5 outliers" in robust.stderr and "cross-validated" not in robust.stdout
    loaded = {name: cc.load(f"{name}/lwr-calibrated.urdf", tool="calibrated_tool") for name in ("plain", "out")}
    worst = {
        name: max(
            np.abs(robot.state(q).position("calibrated_tool") - T[:3, 3]).max()
            for q, T in zip(job.data.q, job.data.exact, strict=True)
        )
        for name, robot in loaded.items()
    }
    assert worst["out"] < 5e-4 < 2e-3 < worst["plain"]


@pytest.mark.parametrize("kind", ["position", "distance"])
def test_positions_and_distances(folder: Path, kind: str) -> None:
    job = Job(folder / "m.csv", kind=kind, far=False)
    result = cartctl("calibrate", "m.csv", "-r", "lwr", "-p", "lwr_joint*.rx tool.x", "--noise", "1e-4", "--folds", "3")
    assert result.exit_code == 0, result.output
    assert ("distance RMS" if kind == "distance" else "position RMS") in result.stdout
    facts = json.loads(Path("out/lwr-calibrated.json").read_text())
    assert facts["kind"] == kind and facts["noise"] == {"m": 1e-4} and facts["noise_given"]
    assert len(facts["parameters"]) == 8 and len(job.data.q) == facts["measurements"]


def test_too_few_and_other_units_are_warned_of(folder: Path) -> None:
    """Two poses fit anything; degrees read as radians do not converge, and a script sees that by the exit code."""
    Job(folder / "m.csv", far=False)
    lines = Path("m.csv").read_text().splitlines(keepends=True)
    Path("few.csv").write_text("".join(lines[:3]))
    few = cartctl("calibrate", "few.csv", "--robot", "lwr")
    assert few.exit_code == 0 and "12 numbers were measured for 12 unknowns" in few.stderr
    head = re.sub(r" [\[(](deg|mm)[\])]", "", lines[0])
    Path("units.csv").write_text(head + "".join(lines[1:]))
    wrong = cartctl("calibrate", "units.csv", "--robot", "lwr", "--folds", "0")
    assert "[deg]" in wrong.stderr and "warning: " in wrong.stderr
    assert wrong.exit_code == (1 if "the files hold what was reached" in wrong.stderr else 0)
    facts = json.loads(Path("out/lwr-calibrated.json").read_text())
    assert (facts["outcome"] == "CONVERGED") == (wrong.exit_code == 0) and facts["after"][0]["rms"] > 1.0


def test_meshes_are_found_by_the_call_it_prints(folder: Path) -> None:
    robot = cc.load("panda")
    data = measure(cal.RobotChain(robot), "placements", 1)
    write(folder / "m.csv", [*robot.joint_names, "x", "y", "z"], np.column_stack([data.q, data.poses[:, :3, 3]]))
    result = cartctl("calibrate", "m.csv", "--robot", "panda", "--folds", "0")
    assert result.exit_code == 0, result.output
    text = result.stdout[result.stdout.index("cc.load(") :]
    call = "".join(line.strip() + (" " if line.rstrip().endswith(",") else "") for line in text.splitlines())
    loaded = eval(call, {"cc": cc})  # noqa: S307 - what the user is told to type; missing meshes would be an error here
    assert len(loaded.visual_model.geometryObjects) >= len(robot.visual_model.geometryObjects)


@pytest.mark.parametrize("moment", ["calibrate", "page", "second file"])
def test_ctrl_c_leaves_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch, moment: str) -> None:
    Job(folder / "m.csv", far=False)

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    if moment == "calibrate":
        monkeypatch.setattr("cartctl.calibration.gauss_newton._descend", stop)
    elif moment == "page":
        monkeypatch.setattr("cartctl.report.calibration_page.calibration_page", stop)
    else:
        plain, made = Path.write_text, iter(range(10))

        def write_text(self: Path, *args: object, **options: object) -> int:
            done = plain(self, *args, **options)  # type: ignore[arg-type]
            if next(made) == 1:
                raise KeyboardInterrupt
            return done

        monkeypatch.setattr(Path, "write_text", write_text)
    result = cartctl("calibrate", "m.csv", "--robot", "lwr", "--folds", "0")
    assert result.exit_code == 130 and "interrupted" in result.stderr
    assert not os.path.isdir("out") or os.listdir("out") == []


def test_old_files_survive_an_interruption(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Job(folder / "m.csv", far=False)
    Path("out").mkdir()
    Path("out/lwr-calibrated.urdf").write_text("before")

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("cartctl.report.calibration_page.calibration_page", stop)
    assert cartctl("calibrate", "m.csv", "--robot", "lwr").exit_code == 130
    assert Path("out/lwr-calibrated.urdf").read_text() == "before" and os.listdir("out") == ["lwr-calibrated.urdf"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--robot", "lwrr"), "lwr"),
        (("--robot", "lwr", "-p", "lwr_joint8"), "did you mean"),
        (("--robot", "lwr", "-p", "  "), "at least one"),
        (("--robot", "lwr", "--noise", "small"), "--noise"),
        (("--robot", "lwr", "--noise", "1e-4"), "two standard deviations"),
        (("--robot", "lwr", "--loss", "l1"), "huber"),
        (("--robot", "lwr", "--frame", "hand"), "hand"),
        (("--robot", "lwr", "--folds", "1"), "folds"),
        (("--robot", "lwr", "--folds", "51"), "at most 50"),
        (("--robot", "panda"), "lwr_joint1"),
    ],
)
def test_bad_options_are_one_line(folder: Path, options: tuple[str, ...], words: str) -> None:
    Job(folder / "m.csv", far=False)
    assert words in the_error(cartctl("calibrate", "m.csv", *options))
    assert not Path("out").exists() or not os.listdir("out")


def test_a_folder_that_cannot_be_had_is_said_before_the_work(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Job(folder / "m.csv", far=False)
    monkeypatch.setattr("cartctl.calibration.gauss_newton._descend", pytest.fail)
    assert "--out is 'm.csv'" in the_error(cartctl("calibrate", "m.csv", "--robot", "lwr", "--out", "m.csv"))


def test_help_shows_an_example() -> None:
    result = cartctl("calibrate", "--help")
    text = " ".join(result.output.split())
    assert result.exit_code == 0 and "cartctl calibrate measured.csv --robot panda" in text and "(deg)" in text


# --- the table --------------------------------------------------------------------------------------------------------


def table(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_units_order_comments_and_blank_lines(tmp_path: Path) -> None:
    robot = cc.load("planar2R")
    path = table(
        tmp_path / "m.csv",
        "\ufeff# a comment\n z , joint2 [deg],x [cm], joint1,y (mm)\n\n0.5,90,10,0.25,3\n# more\n0,-90,20,0,4\n",
    )
    found = cal.read_table(path, robot)
    np.testing.assert_allclose(found.q, [[0.25, np.pi / 2], [0.0, -np.pi / 2]])
    np.testing.assert_allclose(found.values, [[0.1, 0.003, 0.5], [0.2, 0.004, 0.0]])
    assert found.kind == "position" and found.anchor is None and len(found) == 2


def test_continuous_and_sliding_joints_and_joints_that_do_not_matter(tmp_path: Path) -> None:
    kinova = cc.load("kinova")
    names = joint_names(kinova)
    path = table(
        tmp_path / "k.csv", ",".join([*names, "distance"]) + "\n" + ",".join(["0.5"] * len(names) + ["1.0"]) + "\n"
    )
    found = cal.read_table(path, kinova)
    assert found.q.shape == (1, kinova.nq) and found.kind == "distance"
    np.testing.assert_allclose(cal.RobotChain(kinova).coordinates(found.q), 0.5)
    ppr = cc.load("ppr")
    path = table(
        tmp_path / "p.csv",
        ",".join([f"{ppr.joint_names[0]} [mm]", *ppr.joint_names[1:], "x,y,z"]) + "\n250,0,0,1,2,3\n",
    )
    assert cal.read_table(path, ppr).q[0, 0] == 0.25
    tiago = cc.load("tiago_dual")
    one = "arm_left_tool_link" if "arm_left_tool_link" in tiago.frame_names else tiago.tool
    needed = [joint.name for joint in cal.RobotChain(tiago, one).joints]
    path = table(
        tmp_path / "t.csv",
        ",".join([*needed, "x,y,z"]) + "\n" + ",".join(["0.1"] * len(needed) + ["1", "0", "0"]) + "\n",
    )
    assert len(needed) < tiago.nv
    np.testing.assert_allclose(cal.RobotChain(tiago, one).coordinates(cal.read_table(path, tiago, one).q), 0.1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "holds 0 rows"),
        ("joint1,joint2,x,y,z\n", "holds 1 rows"),
        ("joint1;joint2;x;y;z\n0;0;0;0;0\n", "row 1 has one column"),
        ("joint1,joint3,x,y,z\n0,0,0,0,0\n", "row 1, column 2: unknown name 'joint3'"),
        ("joint1,joint1,x,y,z\n0,0,0,0,0\n", "row 1, column 2: 'joint1' stands there twice"),
        ("joint1,x,y,z\n0,0,0,0\n", "lacks the joints joint2"),
        ("joint1,joint2,x,y\n0,0,0,0\n", "but not z"),
        ("joint1,joint2\n0,0\n", "neither x y z nor distance"),
        ("joint1,joint2,x,y,z,distance\n0,0,0,0,0,0\n", "both x y z and distance"),
        ("joint1,joint2,x,y,z,qx\n0,0,0,0,0,0\n", "but not qy qz qw"),
        ("joint1,joint2,x,y,z,ax,ay,az\n0,0,0,0,0,0,0,0\n", "ax ay az to distance"),
        ("joint1 [mm],joint2,x,y,z\n0,0,0,0,0\n", "row 1, column 1: 'joint1' has the unit 'mm'; expected rad, deg"),
        ("joint1,joint2,x [deg],y,z\n0,0,0,0,0\n", "row 1, column 3: 'x' has the unit 'deg'; expected m, mm, cm"),
        ("joint1,joint2,x [inch],y,z\n0,0,0,0,0\n", "'inch'"),
        ("joint1,joint2,x,y,z\n0,0,0,0,0\n0,0,0,0\n", "row 3 has 4 columns; expected 5"),
        ("joint1,joint2,x,y,z\n0,0,0,0,0\n0,0,0,zero,0\n", "row 3, column 4 (y): 'zero'"),
        ("joint1,joint2,x,y,z\n0,0,0,0,nan\n", "row 2, column 5 (z): 'nan'"),
        ("joint1,joint2,x,y,z\n\n0,,0,0,0\n", "row 3, column 2 (joint2): ''"),
        ("joint1,joint2,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,0,1\n0,0,0,0,0,1,1,0,0\n", "row 3, columns qx qy qz qw"),
        ('joint1,joint2,x,y,z\n0,0,"0,0,0\n', "row 2"),
    ],
)
def test_errors_name_row_and_column(tmp_path: Path, text: str, words: str) -> None:
    path = table(tmp_path / "m.csv", text)
    with pytest.raises(MeasurementError) as error:
        cal.read_table(path, cc.load("planar2R"))
    assert words in str(error.value) and str(path) in str(error.value)


def test_files_that_are_none(tmp_path: Path) -> None:
    for path, words in ((tmp_path / "none.csv", "No such file"), (tmp_path, "directory")):
        with pytest.raises(MeasurementError, match=words):
            cal.read_table(path, cc.load("planar2R"))
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(MeasurementError, match="UTF-8"):
        cal.read_table(tmp_path / "b.csv", cc.load("planar2R"))


@pytest.mark.parametrize(("row", "unit"), [("0,90,1,0,0", r"joint2 \[deg\]"), ("0,1,1500,0,0", r"x \[mm\]")])
def test_what_looks_like_other_units_is_said(tmp_path: Path, row: str, unit: str) -> None:
    path = table(tmp_path / "m.csv", f"joint1,joint2,x,y,z\n{row}\n")
    with pytest.warns(CartctlWarning, match=unit):
        cal.read_table(path, cc.load("planar2R"))


# --- the report -------------------------------------------------------------------------------------------------------


def test_the_page_says_what_the_result_says(tmp_path: Path) -> None:
    data = measure(puma(), "table", 2, wild=4)
    result = cc.calibrate(puma(), data.q, data.poses, loss="tukey")
    check = cal.cross_validate(puma(), data.q, data.poses, loss="tukey")
    page = write_calibration_html(result, tmp_path / "sub" / "page.html", check.after).read_text()
    text = unescape(re.sub(r"<[^>]+>", " ", page))
    assert "not determined by itself" in text and str(result.unidentifiable[0]) in text
    assert f"{len(result.outliers)} outliers" in text and "without outliers" in text and "cross-validated" in text
    for name, unit, _, new, _ in result.table():
        assert re.search(rf"\b{name}\b.*{re.escape(f'{new:.6f} {unit}')}", text)
    assert f"rank {result.rank}" in text and str(result.outcome) in text
    with pytest.raises(ParameterError, match="folder"):
        write_calibration_html(result, tmp_path)


def test_names_from_a_urdf_cannot_write_html(tmp_path: Path) -> None:
    chain = cc.DHChain([1.0], [0.0], [0.0], name="<script>alert(1)</script>$x_1$")
    q = np.linspace(-1, 1, 8)[:, None]
    result = cc.calibrate(chain, q, chain.positions(q) * 1.01, kind="position", parameters="a1 theta1")
    page = write_calibration_html(result, tmp_path / "page.html").read_text()
    assert "<script" not in page and "&lt;script&gt;" in page


@pytest.mark.parametrize("kind", ["pose", "position", "distance"])
def test_figures_of_every_kind(kind: str) -> None:
    data = measure(puma(), "table", 3)
    values = {
        "pose": data.poses,
        "position": data.poses[:, :3, 3],
        "distance": np.linalg.norm(data.poses[:, :3, 3], axis=1),
    }
    for parameters in ("table", "theta", "a", "alpha1"):
        result = cc.calibrate(puma(), data.q, values[kind], kind=kind, parameters=parameters)
        figure = plot_calibration(result)
        titles = [axes.get_title(loc="left") for axes in figure.axes]
        assert ("Orientation error" in titles) == (kind == "pose")
        assert ("Lengths: changes, 95 %" in titles) == ("m" in result.units)
        figure.canvas.draw()


@needs_chromium
@pytest.mark.chromium
def test_the_report_looks_like_one(tmp_path: Path) -> None:
    data = measure(puma(), "table base", 4, wild=3)
    result = cc.calibrate(puma(), data.q, data.poses, parameters="table base", loss="huber")
    shot = shoot(write_calibration_html(result, tmp_path / "page.html"), size=(1200, 1600))
    assert shot.requests == [] and shot.console == []
    assert share(shot, (255, 255, 255)) > 0.6 and share(shot, (0, 114, 178)) > 1e-3  # the blue of the estimates
