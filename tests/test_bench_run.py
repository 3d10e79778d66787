"""Running a bench: everything once, whatever stops it, whoever does the work."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pyarrow.parquet as pq
import pytest

import cartctl as cc
from cartctl import bench
from cartctl.bench import engines, runner
from cartctl.bench.journal import Journal, read
from cartctl.bench.schema import COLUMNS, VERSION
from cartctl.bench.table import results
from cartctl.errors import BenchError, LevelNotFound, ParameterError, ResultFileError, ShapeError
from tests.bench_scenarios import SOLVERS, short, toml

ROOT = Path(__file__).resolve().parents[1]


def keys_of(folder: Path) -> list[str]:
    return [json.loads(line)["key"] for line in (folder / "runs.jsonl").read_text().splitlines()]


def environment() -> dict[str, str]:
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    return os.environ | {"PYTHONPATH": path, "OMP_NUM_THREADS": "1"}


def bench_process(folder: Path, file: Path, *more: str) -> subprocess.Popen[bytes]:
    """``cartctl bench run`` in a session of its own, so that its workers can be killed with it."""
    command = [sys.executable, "-m", "cartctl", "bench", "run", "--scenarios", str(file), "--out", str(folder)]
    with (folder.parent / "told").open("wb") as told:
        return subprocess.Popen(
            [*command, "--solvers", ",".join(SOLVERS), *more], env=environment(), start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=told,
        )  # fmt: skip


def wait_for_lines(folder: Path, count: int, process: subprocess.Popen[bytes], patience: float = 120.0) -> None:
    file, end = folder / "runs.jsonl", time.monotonic() + patience
    while not file.is_file() or file.read_bytes().count(b"\n") < count:
        assert process.poll() is None and time.monotonic() < end, "it ended, or did nothing"
        time.sleep(0.002)


def test_every_run_is_there_once_with_its_figures(tmp_path: Path) -> None:
    outcome = bench.run([short("a"), short("b", robot="planar4R")], SOLVERS, out=tmp_path, repeat=2, seed=3)
    assert (outcome.made, outcome.found, outcome.total, outcome.interrupted) == (12, 0, 12, False)
    rows = results(outcome.path)
    cases = {(r["scenario"], r["solver"], r["repeat"]) for r in rows}
    assert len(rows) == len(cases) == 12 and {r["seed"] for r in rows} == {3}
    assert all(r["outcome"] == "done" and r["rms_m"] < 1.0 and r["steps"] == 10 for r in rows)
    assert [r["key"] for r in rows] == keys_of(tmp_path)


def test_the_file_says_what_it_holds(tmp_path: Path) -> None:
    bench.run(short(), "pinv", out=tmp_path)
    schema = pq.read_schema(tmp_path / "results.parquet")
    assert schema.names == [c.name for c in COLUMNS]
    assert schema.metadata[b"cartctl.bench.schema"] == str(VERSION).encode()
    assert schema.field("rms_m").metadata[b"unit"] == b"m"
    (row,) = results(tmp_path / "results.parquet")
    assert row == results(tmp_path)[0] and cc.Scenario.from_dict(json.loads(row["scenario_json"])) == short()
    assert "cores" in row["machine"] and json.loads(row["versions"])["cartctl"] == cc.__version__


def test_a_second_call_does_only_what_is_new(tmp_path: Path) -> None:
    first = bench.run([short("a")], SOLVERS, out=tmp_path)
    again = bench.run([short("a")], SOLVERS, out=tmp_path)
    more = bench.run([short("a"), short("b")], [*SOLVERS, "sdls"], out=tmp_path)
    assert (first.made, again.made, again.found) == (3, 0, 3)
    assert (more.made, more.found) == (5, 3) and len(set(keys_of(tmp_path))) == len(keys_of(tmp_path)) == 8
    changed = bench.run([short("a", dt=0.02)], SOLVERS, out=tmp_path)
    assert changed.made == 3 and len(keys_of(tmp_path)) == 11
    dts = {(r["scenario"], r["solver"]): r["dt"] for r in results(tmp_path)}
    assert len(results(tmp_path)) == len(dts) == 7  # what was run of the old scenario is kept, and no longer shown
    assert {dt for (name, _), dt in dts.items() if name == "a"} == {0.02}


def test_seeds_are_kept_and_repeatable(tmp_path: Path) -> None:
    scenario = short(start={"random": 0.5})
    for folder, seed in (("one", 1), ("two", 1), ("three", 2)):
        bench.run(scenario, ["pinv", "dls"], out=tmp_path / folder, repeat=2, seed=seed)
    one, two, three = ([(r["q0"], r["rms_m"]) for r in results(tmp_path / f)] for f in ("one", "two", "three"))
    assert one == two and one != three
    assert one[0][0] == one[1][0] != one[2][0]  # the same start for every method, another in every repetition


@pytest.mark.parametrize("workers", [1, 2])
def test_kill_9_loses_no_finished_run_and_counts_none_twice(tmp_path: Path, workers: int) -> None:
    file, out = toml(tmp_path / "many.toml", 12, 0.3), tmp_path / "out"
    process = bench_process(out, file, "--workers", str(workers))
    wait_for_lines(out, 4, process)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    before = keys_of_torn(out)
    assert 4 <= len(before) < 36 and not (out / "results.parquet").exists()
    outcome = bench.run(str(file), SOLVERS, out=out)
    assert outcome.found == len(before) and outcome.made == 36 - len(before)
    after = keys_of(out)
    assert after[: len(before)] == before and len(set(after)) == len(after) == 36
    assert len(results(out / "results.parquet")) == 36


def keys_of_torn(folder: Path) -> list[str]:
    """Keys of the whole lines."""
    text = (folder / "runs.jsonl").read_bytes()
    return [json.loads(line)["key"] for line in text[: text.rfind(b"\n") + 1].splitlines()]


@pytest.mark.parametrize("cut", [1, 37, 400])
def test_a_line_that_was_cut_short_is_done_again(tmp_path: Path, cut: int) -> None:
    bench.run(short(), SOLVERS, out=tmp_path)
    file = tmp_path / "runs.jsonl"
    file.write_bytes(file.read_bytes()[:-cut])
    assert len(list(read(tmp_path))) == 2
    outcome = bench.run(short(), SOLVERS, out=tmp_path)
    assert (outcome.made, outcome.found) == (1, 2) and len(set(keys_of(tmp_path))) == len(keys_of(tmp_path)) == 3


def test_the_journal_does_not_write_a_run_twice(tmp_path: Path) -> None:
    row = {"key": "k", "schema": VERSION}
    with Journal(tmp_path) as journal:
        assert journal.add(row) and not journal.add(row)
    assert keys_of(tmp_path) == ["k"]


def test_two_benches_do_not_share_a_folder(tmp_path: Path) -> None:
    with Journal(tmp_path), pytest.raises(BenchError, match="another bench is writing"):
        Journal(tmp_path)
    Journal(tmp_path).__exit__()  # and it is free again


def test_results_of_another_version_are_refused(tmp_path: Path) -> None:
    (tmp_path / "runs.jsonl").write_text('{"key": "k", "schema": 99}\n')
    with pytest.raises(ResultFileError, match="line 1 has schema version 99; expected"):
        bench.run(short(), SOLVERS, out=tmp_path)
    (tmp_path / "runs.jsonl").write_text("nonsense\n")
    with pytest.raises(ResultFileError, match="line 1 is no run of a bench"):
        results(tmp_path)
    (tmp_path / "x.parquet").write_text("nonsense")
    with pytest.raises(ResultFileError, match="cannot be read as Parquet"):
        results(tmp_path / "x.parquet")
    cc.simulate(
        cc.Controller(cc.load("planar3R"), cc.FrameTask("tool", "xy"), "dls", limits=None), duration=0.01
    ).to_parquet(tmp_path / "run.parquet")
    with pytest.raises(ResultFileError, match="schema version none"):
        results(tmp_path / "run.parquet")
    with pytest.raises(ResultFileError, match="no such file"):
        results(tmp_path / "nowhere.parquet")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ResultFileError, match="holds no bench"):
        results(tmp_path / "empty")


def test_ctrl_c_keeps_what_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = iter(range(10))

    def perform(job: Any) -> Any:
        if next(done) == 2:
            raise KeyboardInterrupt
        return original(job)

    original = engines.perform
    monkeypatch.setattr(engines, "perform", perform)
    outcome = bench.run(short(), SOLVERS, out=tmp_path)
    assert outcome.interrupted and outcome.made == 2 and len(results(tmp_path / "results.parquet")) == 2
    monkeypatch.undo()
    assert bench.run(short(), SOLVERS, out=tmp_path).made == 1


@pytest.mark.parametrize("workers", [1, 2])
def test_a_real_ctrl_c_ends_it_in_order(tmp_path: Path, workers: int) -> None:
    """As a terminal sends it: to the process and its workers alike."""
    file, out = toml(tmp_path / "many.toml", 12, 0.3), tmp_path / "out"
    process = bench_process(out, file, "--workers", str(workers))
    wait_for_lines(out, 4, process)
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(timeout=120) == 130
    assert "Traceback" not in (tmp_path / "told").read_text()  # nor does a worker show one
    kept = keys_of(out)
    assert 4 <= len(kept) < 36 and [r["key"] for r in results(out / "results.parquet")] == kept
    assert bench.run(str(file), SOLVERS, out=out).found == len(kept)


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"scenarios": 3}, ShapeError, "scenarios is 3; expected a list"),
        ({"solvers": 3}, ShapeError, "solvers is 3; expected a list"),
        ({"solvers": []}, ParameterError, "solvers is empty"),
        ({"solvers": {}}, ParameterError, "solvers is empty"),
        ({"levels": "velcity"}, LevelNotFound, "did you mean 'velocity'"),
        ({"levels": 3}, ShapeError, "levels is 3; expected a list"),
        ({"keep_steps": "all"}, ParameterError, "keep_steps is 'all'"),
        ({"tell": 3}, ParameterError, "tell is a int"),
        ({"out": 3}, ParameterError, "out is a int"),
    ],
)
def test_what_is_no_argument_is_named(tmp_path: Path, given: Any, error: Any, words: str) -> None:
    with pytest.raises(error, match=words):
        bench.run(**{"scenarios": short(), "solvers": "pinv", "out": tmp_path / "out", **given})
    assert not (tmp_path / "out").exists()


def test_results_take_the_path_as_text(tmp_path: Path) -> None:
    bench.run(short(), "pinv", out=str(tmp_path), levels="velocity")
    assert len(results(str(tmp_path))) == 1
    with pytest.raises(ResultFileError, match="no such file"):
        results(str(tmp_path / "nowhere"))
    with pytest.raises(ParameterError, match="place is a int"):
        results(3)  # type: ignore[arg-type]


@pytest.mark.parametrize("rows", [[], "x", [{}], None])
def test_a_report_of_no_results_is_refused(tmp_path: Path, rows: Any) -> None:
    with pytest.raises(ParameterError, match=r"rows is .*; expected the rows of cc\.bench\.results"):
        bench.report(rows, tmp_path / "report")
    with pytest.raises(ParameterError, match="replays is -1"):
        bench.report(rows, tmp_path / "report", replays=-1)
    assert not (tmp_path / "report").exists()


def test_steps_are_kept_on_request(tmp_path: Path) -> None:
    bench.run(short(), "pinv", out=tmp_path, keep_steps=True)
    (row,) = results(tmp_path)
    run = cc.Run.load(tmp_path / "steps" / f"{row['key']}.npz")
    assert len(run) == row["steps"] == 10 and run.metrics().tasks[0].rms_m == row["rms_m"]
    assert np.array_equal(bench.replay(row, str(tmp_path / "steps")).q, run.q)
    assert np.array_equal(bench.replay(row).q, run.q)  # made again, to the last bit


@dataclass(frozen=True)
class Half(cc.Solver):
    """Half of what the pseudo-inverse says."""

    name: ClassVar[str] = "half"
    share: float = 0.5

    def _solve_impl(self, problem: cc.Problem) -> cc.Solution:
        return cc.Solution(
            problem, self.share * np.linalg.pinv(problem.equations[0].A) @ problem.equations[0].rhs, "half"
        )


@dataclass(frozen=True)
class Broken(cc.Solver):
    """It breaks."""

    name: ClassVar[str] = "broken"

    def _solve_impl(self, problem: cc.Problem) -> cc.Solution:
        raise ZeroDivisionError("as it was\nto be expected")


def test_ones_own_solver_stands_in_the_same_table(tmp_path: Path) -> None:
    outcome = bench.run(short(), {"mine": Half(), "less": Half(0.25), "broken": Broken(), "pinv": "pinv"}, out=tmp_path)
    rows = {r["solver"]: r for r in results(outcome.path)}
    assert rows["pinv"]["rms_m"] < rows["mine"]["rms_m"] < rows["less"]["rms_m"]
    assert json.loads(rows["less"]["parameters"]) == {"share": "0.25"}
    assert rows["broken"]["outcome"] == "failed"
    assert rows["broken"]["reason"] == "ZeroDivisionError: as it was to be expected"
    with pytest.raises(BenchError, match="no solver of the registry; run with --keep-steps"):
        bench.replay(rows["mine"])


def test_levels_repeat_and_order(tmp_path: Path) -> None:
    grid = runner.grid([short("a"), short("b")], SOLVERS, levels=["velocity", "acceleration"], repeat=3)
    jobs = list(grid.jobs())
    assert len(grid) == len(jobs) == len({job.key for job in jobs}) == 2 * 3 * 2 * 3
    assert [job.repeat for job in jobs] == sorted(job.repeat for job in jobs)
    bench.run(short(), "pinv", out=tmp_path, levels=["acceleration"])
    assert results(tmp_path)[0]["level"] == "acceleration"


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"scenarios": "lecturs"}, cc.CartctlError, "did you mean 'lectures'"),
        ({"solvers": "pinw"}, cc.CartctlError, "did you mean 'pinv'"),
        ({"levels": ["velocty"]}, LevelNotFound, "did you mean 'velocity'"),
        ({"repeat": 0}, ParameterError, "repeat is 0; expected a whole number of at least 1"),
        ({"seed": -1}, ParameterError, "seed is -1"),
        ({"workers": 0}, ParameterError, "workers is 0"),
        ({"scenarios": [3]}, ParameterError, "scenarios holds a int"),
        ({"scenarios": [short(), short()]}, ParameterError, "two scenarios are called 'short'"),
        ({"solvers": {"mine": 3}}, ParameterError, "solvers['mine'] is a int"),
        ({"out": "file/below"}, BenchError, "expected a folder that can be written"),
    ],
)
def test_misuse_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: dict[str, Any], error: type[Exception], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("")
    with pytest.raises(error) as caught:
        bench.run(**({"scenarios": short(), "solvers": "pinv", "out": "out"} | arguments))
    assert words in str(caught.value) and os.listdir() == ["file"]


def test_two_processes_find_what_one_does(tmp_path: Path) -> None:
    scenarios = [short("a", start={"random": 0.3}), short("b")]
    one = bench.run(scenarios, SOLVERS, out=tmp_path / "one", repeat=2)
    two = bench.run(scenarios, SOLVERS, out=tmp_path / "two", repeat=2, workers=2)
    figures = [{r["key"]: (r["rms_m"], r["effort"], r["q0"]) for r in results(o.path)} for o in (one, two)]
    assert figures[0] == figures[1] and two.made == 12


@dataclass(frozen=True)
class Deadly(Half):
    """Takes its process along the first time, or always."""

    name: ClassVar[str] = "deadly"
    mark: str = ""

    def _solve_impl(self, problem: cc.Problem) -> cc.Solution:
        if not self.mark or not Path(self.mark).exists():
            if self.mark:
                Path(self.mark).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super()._solve_impl(problem)


def test_a_worker_that_is_killed_takes_nothing_along(tmp_path: Path) -> None:
    solvers = {**dict(zip(SOLVERS, SOLVERS, strict=True)), "deadly": Deadly(mark=str(tmp_path / "mark"))}
    outcome = bench.run([short(f"s{k}") for k in range(4)], solvers, out=tmp_path / "out", workers=2)
    rows = results(outcome.path)
    assert (tmp_path / "mark").exists() and len(rows) == outcome.made == 16
    assert {r["outcome"] for r in rows} == {"done"}


def test_one_that_always_kills_its_worker_ends_the_bench_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match="died 3 times without a result, at work on .*deadly"):
        bench.run(short(), {"pinv": "pinv", "deadly": Deadly()}, out=tmp_path, workers=2)
    assert [r["solver"] for r in results(tmp_path)] == ["pinv"]


MEMORY = """
import sys, resource
from pathlib import Path
from cartctl import bench
from tests.bench_scenarios import short
def resident():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20
folder, first, second = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
scenario = short(duration=0.02, start={"random": 0.3})
bench.run(scenario, ["pinv", "dls"], out=folder, repeat=first // 2)
before = resident()
bench.run(scenario, ["pinv", "dls"], out=folder, repeat=second // 2)
print(resident() - before)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc")
def test_memory_does_not_grow_with_the_number_of_runs(tmp_path: Path) -> None:
    command = [sys.executable, "-c", MEMORY, str(tmp_path), "200", "1000"]
    done = subprocess.run(command, env=environment(), cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 16.0  # MiB for 800 more runs; kept in memory, a row alone is 10 kB
    assert len(keys_of(tmp_path)) == 1000
