"""``cartctl bench`` as its users meet it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from cartctl import bench
from cartctl.bench import engines, sets
from cartctl.bench.table import results, write
from cartctl.cli import bench as verbs
from cartctl.cli.app import app
from tests.bench_scenarios import toml


def cartctl(*args: str, columns: int = 80) -> Result:
    environment = {"COLUMNS": str(columns)}
    return CliRunner().invoke(app, ["bench", *map(str, args)], prog_name="cartctl", env=environment)


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A file of three scenarios in an empty working folder."""
    monkeypatch.chdir(tmp_path)
    toml(Path("mine.toml"))
    return "mine.toml"


def ran(mine: str, *more: str) -> Result:
    result = cartctl("run", "--scenarios", mine, "--solvers", "pinv,dls", *more)
    assert result.exit_code == 0, result.output
    return result


def assert_readable(text: str, width: int = 80) -> None:
    assert "\x1b" not in text and "…" not in text and max(map(len, text.splitlines())) <= width
    assert not re.search(r"\b(nan|inf|None)\b", text)


@pytest.mark.parametrize("verb", ["list", "run", "report", "plot", "check"])
def test_every_verb_has_help_with_an_example(verb: str) -> None:
    result = cartctl(verb, "--help")
    assert result.exit_code == 0 and f"Example:  cartctl bench {verb}" in result.stdout
    if verb == "run":
        for option in ("scenarios", "solvers", "levels", "repeat", "seed", "workers", "dask", "keep-steps", "out"):
            assert f"--{option} " in result.stdout


def test_list_shows_sets_solvers_and_peers() -> None:
    result = cartctl("list")
    assert result.exit_code == 0
    assert_readable(result.stdout)
    for word in (*sets.SHIPPED, "sns", "pink", "roboticstoolbox", "placo"):
        assert word in result.stdout
    some = cartctl("list", "--scenarios", "limits,lwr-flacco").stdout
    assert_readable(some)
    assert "fast-circle" in some and "lwr-flacco" in some and "panda-circle" not in some


def test_run_says_what_it_does_and_what_came_of_it(mine: str) -> None:
    result = ran(mine, "--repeat", "2", "--seed", "5")
    assert_readable(result.stdout)
    assert "3 of mine" in result.stdout and "12, 2 of each, seed 5, one after the other" in result.stdout
    assert re.search(r"^pinv +6 +6 +6 +6 +1\.00", result.stdout, re.MULTILINE)
    assert "12 runs made" in result.stdout and "cartctl bench report out/bench" in result.stdout
    again = ran(mine, "--repeat", "2", "--seed", "5")
    assert "0 runs made, 12 were there already" in again.stdout
    assert len(results(Path("out/bench"))) == 12


@pytest.mark.parametrize("columns", [60, 100, 200])
def test_the_overview_fits_the_terminal(mine: str, columns: int) -> None:
    ran(mine)
    result = cartctl("run", "--scenarios", mine, "--solvers", "pinv,dls", columns=columns)
    assert_readable(result.stdout, columns)


def test_options_reach_the_bench(mine: str) -> None:
    ran(mine, "--levels", "acceleration", "--keep-steps", "--workers", "2", "--out", "there")
    rows = results(Path("there"))
    assert {row["level"] for row in rows} == {"acceleration"}
    assert len(list(Path("there/steps").glob("*.npz"))) == len(rows) == 6


def test_report_and_plot_write_beside_the_results(mine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    ran(mine)
    asked: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda uri: (asked.append(uri), True)[1])
    result = cartctl("report", "--open")
    assert result.exit_code == 0, result.output
    assert_readable(result.stdout)
    assert {"report.html", "report.md", "profiles.png"} <= {p.name for p in Path("out/bench").iterdir()}
    assert asked == [Path("out/bench/report.html").resolve().as_uri()]
    drawn = cartctl("plot", "out/bench/results.parquet", "--figures", "rms_m,effort", "--out", "p.svg")
    assert drawn.exit_code == 0 and Path("p.svg").read_text().startswith("<?xml")
    assert cartctl("report", "out/bench", "--out", "elsewhere", "--replays", "0").exit_code == 0
    assert Path("elsewhere/report.html").is_file()


def test_check_ends_with_one_where_something_became_worse(mine: str) -> None:
    ran(mine)
    rows = results(Path("out/bench"))
    same = cartctl("check", "out/bench", "out/bench/results.parquet")
    assert same.exit_code == 0 and "0 figures worse by more than 5 %, 0 better; 6 runs compared" in same.stdout
    worse = [{**row, "effort": row["effort"] * 1.2} if row["solver"] == "dls" else row for row in rows]
    write(worse, Path("worse.parquet"))
    result = cartctl("check", "out/bench", "worse.parquet")
    assert result.exit_code == 1
    assert_readable(result.stdout)
    assert len(re.findall(r"^c\d +dls +velocity +effort ", result.stdout, re.MULTILINE)) == 3
    assert cartctl("check", "out/bench", "worse.parquet", "--tolerance", "0.3").exit_code == 0
    assert cartctl("check", "worse.parquet", "out/bench").exit_code == 0
    assert cartctl("check", "out/bench", "worse.parquet", "--figures", "rms_m").exit_code == 0
    slow = [{**row, "step_p50": row["step_p50"] * 3} for row in rows]
    write(slow, Path("slow.parquet"))
    assert cartctl("check", "out/bench", "slow.parquet").exit_code == 0
    assert cartctl("check", "out/bench", "slow.parquet", "--times").exit_code == 1
    write(rows[:4], Path("fewer.parquet"))
    assert cartctl("check", "out/bench", "fewer.parquet").exit_code == 1
    assert cartctl("check", "out/bench", "fewer.parquet", "--allow-missing").exit_code == 0


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["run", "--scenarios", "lecturs"], "unknown scenario or set 'lecturs'; did you mean 'lectures'"),
        (["run", "--solvers", "pinw"], "did you mean 'pinv' or 'pink'?"),
        (["run", "--levels", "velocty"], "did you mean 'velocity'?"),
        (["run", "--solvers", ","], "--solvers is ','"),
        (["run", "--scenarios", "broken.toml"], "broken.toml, line 3: dt: dt is -0.01"),
        (["run", "--scenarios", "mine.toml", "--out", "mine.toml/x"], "--out is 'mine.toml/x'"),
        (["report", "nowhere.parquet"], "no such file"),
        (["check", "mine.toml", "mine.toml"], "cannot be read as Parquet"),
        (["plot", "nothing"], "no such file"),
    ],
)
def test_trouble_is_one_line_and_leaves_nothing(mine: str, args: list[str], words: str) -> None:
    Path("broken.toml").write_text(Path(mine).read_text().replace("dt = 0.01", "dt = -0.01"))
    if "broken.toml" in args:
        text = Path("broken.toml").read_text()
        assert text.splitlines()[3] == "dt = -0.01"
        words = words.replace("line 3: dt", "line 4: scenario[0].dt")
    result = cartctl(*args)
    assert result.exit_code == 2, result.output
    (line,) = result.stderr.splitlines()
    assert line.startswith("error: ") and words in line
    assert sorted(p.name for p in Path().iterdir()) == ["broken.toml", "mine.toml"]


def test_ctrl_c_says_what_is_left_and_the_same_command_goes_on(mine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    turns, original = iter(range(99)), engines.perform

    def perform(job: Any) -> Any:
        if next(turns) == 4:
            raise KeyboardInterrupt
        return original(job)

    monkeypatch.setattr(engines, "perform", perform)
    result = cartctl("run", "--scenarios", mine, "--solvers", "pinv,dls")
    assert result.exit_code == 130
    assert result.stderr == "interrupted: 2 of 6 runs are left; the same command goes on\n"
    assert "4 runs made" in result.stdout
    monkeypatch.setattr(engines, "perform", original)
    assert "2 runs made, 4 were there already" in ran(mine).stdout


def test_progress_counts_what_was_there(mine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from contextlib import contextmanager

    told: list[tuple[int, int, str | None]] = []

    @contextmanager
    def listening(_: str) -> Any:
        yield lambda k, n, doing=None: told.append((k, n, doing))

    bench.run(mine, "pinv", out="out/bench")
    monkeypatch.setattr(verbs, "progress", listening)
    ran(mine)
    assert [(k, n) for k, n, _ in told] == [(3, 6), (4, 6), (5, 6), (6, 6)] and told[-1][2] == "c2: dls"


def test_a_peer_that_is_not_there_is_said(mine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CARTCTL_PEER_PLACO", "/no/python")
    result = cartctl("run", "--scenarios", mine, "--solvers", "placo")
    assert result.exit_code == 0 and "CARTCTL_PEER_PLACO is '/no/python'" in re.sub(r"\s+", " ", result.stdout)
    both = cartctl("run", "--scenarios", mine, "--solvers", "pinv,placo,extended-jacobian")
    assert re.search(r"^placo +skipped c0, c1, c2: CARTCTL_PEER_PLACO", both.stdout, re.MULTILINE)
    assert re.search(r"^extended-jacobian +refused c0, c1, c2: ", both.stdout, re.MULTILINE)
    assert_readable(both.stdout)
