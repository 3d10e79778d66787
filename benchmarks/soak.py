"""Random problems and random closed-loop steps on all cores, every answer checked by its certificate.

    make soak MINUTES=10
    python benchmarks/soak.py --minutes 10 --parts 6 4 1    # of the time: problems, closed loops, compiled rollouts
    python benchmarks/soak.py --problem SEED INDEX          # one problem again
    python benchmarks/soak.py --scene SEED INDEX            # one closed loop again
    python benchmarks/soak.py --rollouts SEED INDEX         # one controller's compiled rollouts again

A line with counts, rates and worst figures is appended to benchmarks/results/soak.csv, on Ctrl-C too.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from pathlib import Path
from time import perf_counter, time_ns

import numpy as np
from harness import setting
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from soaking import batch, loops, rollouts
from soaking.problems import make
from soaking.tally import Tally, append

RESULTS = Path(__file__).parent / "results" / "soak.csv"
BATCH, SECONDS, SCENES = 20_000, 2.0, 10_000  # problems of one job, time and most scenes of the other kind
KINDS = ("problems", "loops", "rollouts")
TOLD = 5  # failures of each kind
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")  # in each worker


def job(kind: str, seed: int, first: int) -> tuple[str, object, float]:
    """What one process does at a time."""
    started = perf_counter()
    if kind == "problems":
        return kind, batch.run(seed, first, BATCH), perf_counter() - started
    found, _ = (loops if kind == "loops" else rollouts).run(seed, first, SECONDS, SCENES)
    return kind, found, perf_counter() - started


def soak(minutes: float, parts: list[float], seed: int, jobs: int) -> Tally:
    """Until the time is over, or somebody interrupts."""
    tally, console = Tally(), Console()
    os.environ.update(ONE_THREAD)
    console.print("compiling, or fetching from the cache: minutes, the first time")
    batch.prepare()
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    pool = ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"))
    started, turn, pending = perf_counter(), dict.fromkeys(KINDS, 0), set()
    shares = dict(zip(KINDS, np.array(parts) / sum(parts), strict=True))
    try:
        with Progress(*columns, console=console) as progress:
            bar = progress.add_task("soaking", total=60.0 * minutes)
            while pending or perf_counter() - started < 60.0 * minutes:
                while len(pending) < 2 * jobs and perf_counter() - started < 60.0 * minutes:
                    kind = _behind(shares, tally.seconds, turn)
                    first = turn[kind] * (BATCH if kind == "problems" else SCENES)
                    turn[kind] += 1
                    pending.add(pool.submit(job, kind, seed, first))
                done, pending = wait(pending, timeout=1.0, return_when=FIRST_COMPLETED)
                for future in done:
                    _add(tally, console, *future.result())
                steps = tally.steps + tally.rolled
                words = f"{tally.problems:,} problems, {steps:,} steps, {tally.failed} failures"
                progress.update(bar, completed=perf_counter() - started, description=words)
    except KeyboardInterrupt:
        console.print("interrupted: what was done is kept")
    except Exception as error:  # a worker died, or a scene could not be made: a finding, and what was done is kept
        tally.add_failure(batch.Failure(f"{type(error).__name__}: {error}", np.nan, f"--seed {seed}"))
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
    minutes = (perf_counter() - started) / 60.0
    append(RESULTS, {**setting(), **tally.row(minutes, seed, jobs)})
    return tally


def _behind(shares: dict[str, float], spent: dict[str, float], turn: dict[str, int]) -> str:
    """The kind whose share of the time is spent least; those that were not yet asked for come first."""
    return min(
        (kind for kind in KINDS if shares[kind] > 0.0), key=lambda kind: (turn[kind] > 0, spent[kind] / shares[kind])
    )


def _add(tally: Tally, console: Console, kind: str, found: object, seconds: float) -> None:
    """One result; its failures are told with what shows them again."""
    known, told = len(tally.failures), tally.kinds()
    if kind == "problems":
        tally.add_batch(found, seconds)
    else:
        tally.add_loops(found, seconds, kind)
    for failure in tally.failures[known:]:
        told[failure.kind] += 1
        if told[failure.kind] <= TOLD:
            what = f"{failure.what}, {failure.size:.2g}"
            console.print(f"{what}: python benchmarks/soak.py {failure.command}", soft_wrap=True, markup=False)


def again(problem: list[int] | None, scene: list[int] | None, rolled: list[int] | None) -> int:
    """One problem or scene once more, with all there is to see."""
    np.set_printoptions(linewidth=120)
    if problem:
        found = batch.run(problem[0], problem[1], 1)
        for name, value in zip(made_names(), make.inner(*problem)[0], strict=True):
            print(f"{name} = {value!r}")
    else:
        found, _ = loops.run(*scene, 0.0) if scene else rollouts.run(*rolled, 0.0)
    print(found)
    return len(found.failures)


def made_names() -> tuple[str, ...]:
    """The arrays of a problem."""
    from soaking.problems import Made

    return Made._fields


def main() -> int:
    """Soak, or show one failure again; 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0, help="how long; Ctrl-C keeps what was done")
    shares = "of the time: problems, closed loops, compiled rollouts"
    parser.add_argument("--parts", type=float, nargs=3, default=[5.0, 4.0, 1.0], help=shares)
    parser.add_argument("--seed", type=int, default=time_ns() // 1_000_000_000, help="of all that is random; the time")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes; one a core")
    parser.add_argument("--problem", type=int, nargs=2, metavar=("SEED", "INDEX"), help="one problem again")
    parser.add_argument("--scene", type=int, nargs=2, metavar=("SEED", "INDEX"), help="one closed loop again")
    parser.add_argument("--rollouts", type=int, nargs=2, metavar=("SEED", "INDEX"), help="one controller's again")
    given = parser.parse_args()
    again_of = (given.problem, given.scene, given.rollouts)
    for name, value in zip(("--problem", "--scene", "--rollouts", "--seed"), (*again_of, [given.seed]), strict=True):
        if value and min(value) < 0:
            parser.error(f"{name} is {value}; expected numbers of at least 0")
    if any(again_of):
        return min(again(*again_of), 1)
    if not (min(given.parts) >= 0.0 and 0.0 < sum(given.parts) < np.inf):
        parser.error(f"--parts are {given.parts}; expected three numbers, none negative, and not all zero")
    if not 0.0 < given.minutes < np.inf or given.jobs < 1:
        parser.error(
            f"--minutes is {given.minutes:g} and --jobs {given.jobs}; expected more than 0 minutes and a job or more"
        )
    tally = soak(given.minutes, given.parts, given.seed, given.jobs)
    row = tally.row(given.minutes, given.seed, given.jobs)
    Console().print("\n".join(f"{key.replace('_', ' ')}: {value}" for key, value in row.items()), highlight=False)
    return 1 if tally.failed else 0


if __name__ == "__main__":
    sys.exit(main())
