"""A bench from start to end, or from where it was stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cartctl import checks
from cartctl.bench import table
from cartctl.bench.building import Stage
from cartctl.bench.engines import Engine, cluster, here, processes
from cartctl.bench.jobs import Grid
from cartctl.bench.journal import Journal, current
from cartctl.bench.methods import methods
from cartctl.bench.scenario import Scenario
from cartctl.bench.sets import ScenarioSet, select
from cartctl.errors import LevelNotFound, ParameterError
from cartctl.levels import levels as known_levels
from cartctl.solvers import Solver

Tell = Callable[[int, int, str | None], None]


@dataclass(frozen=True)
class Outcome:
    """What came of a bench: where its results are, runs made now, found finished, and in all."""

    path: Path
    made: int
    found: int
    total: int
    interrupted: bool = False


def grid(
    scenarios: str | Iterable[str | Scenario | ScenarioSet] = ("lectures",),
    solvers: str | Iterable[str] | Mapping[str, Solver | str] = ("all",),
    *,
    levels: str | Sequence[str] | None = None,
    repeat: int = 1,
    seed: int = 0,
    keep_steps: bool = False,
) -> Grid:
    """All jobs of a bench: arguments as :func:`run`, which raises the same."""
    checked = [("repeat", repeat, 1), ("seed", seed, 0)]
    for name, value, least in checked:
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise ParameterError(f"{name} is {value!r}; expected a whole number of at least {least}")
    if not isinstance(keep_steps, bool):
        raise ParameterError(f"keep_steps is {keep_steps!r}; expected True or False")
    levels = [levels] if isinstance(levels, str) else levels
    for level in checks.listed("levels", levels or ()):
        if level not in known_levels():
            raise LevelNotFound(level, known_levels())
    return Grid(_scenarios(scenarios), methods(solvers), levels or None, repeat, seed, keep_steps)


def run(
    scenarios: str | Iterable[str | Scenario | ScenarioSet] = ("lectures",),
    solvers: str | Iterable[str] | Mapping[str, Solver | str] = ("all",),
    *,
    out: str | Path = "out/bench",
    levels: str | Sequence[str] | None = None,
    repeat: int = 1,
    seed: int = 0,
    workers: int = 1,
    dask: str | None = None,
    keep_steps: bool = False,
    tell: Tell | None = None,
    engine: Engine | None = None,
) -> Outcome:
    """Put every solver to every scenario and write ``out/results.parquet``; what is finished already is not done again.

    scenarios: names of sets and scenarios, patterns, .toml files, Scenario objects. solvers: names, ``"all"``,
    ``"peers"``, or a mapping of names to solvers of one's own. levels: instead of the scenarios' own. repeat: runs of
    each, random starts differ. workers: processes of this machine; dask: the address of a scheduler instead.
    keep_steps: whether every step is kept, as ``out/steps/<key>.npz``. tell(k, n, doing): progress.

    Ctrl-C ends it with what is done; so does kill -9, but for the Parquet file, which the next call writes. Raises
    ScenarioError, ScenarioNotFound, MethodNotFound, LevelNotFound, ParameterError, BenchError, MissingDependencyError.
    """
    jobs = grid(scenarios, solvers, levels=levels, repeat=repeat, seed=seed, keep_steps=keep_steps)
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ParameterError(f"workers is {workers!r}; expected a whole number of at least 1")
    if not isinstance(out, (str, Path)):
        raise ParameterError(f"out is a {type(out).__name__}; expected the path of a folder")
    if tell is not None and not callable(tell):
        raise ParameterError(f"tell is a {type(tell).__name__}; expected a function of (done, total, words)")
    for group in _sets(scenarios):
        group.check()
    folder = Path(out)
    with Journal(folder) as journal:
        if engine is None:
            engine = cluster(dask) if dask else here if workers == 1 else processes(workers)
        wanted = {job.key for job in jobs.jobs()}
        found = len(wanted & journal.done)
        made, stopped = _work(jobs, journal, engine, found, tell or (lambda *_: None))
        path = table.write(current(folder), folder / table.FILE)
    return Outcome(path, made, found, len(wanted), stopped)


def _work(jobs: Grid, journal: Journal, engine: Engine, found: int, tell: Tell) -> tuple[int, bool]:
    """Do what is left; runs made, and whether Ctrl-C ended it."""
    made, total, before = 0, len(jobs), frozenset(journal.done)
    results = engine(job for job in jobs.jobs() if job.key not in before)
    tell(found, total, "starting (first use compiles)")
    try:
        for row, steps in results:
            made += journal.add(row, steps)
            tell(found + made, total, f"{row['scenario']}: {row['solver']}")
    except KeyboardInterrupt:
        return made, True
    finally:
        close: Any = getattr(results, "close", None)
        if close is not None:
            close()
    return made, False


def _sets(scenarios: Any) -> list[ScenarioSet]:
    """What is named, checked as files; objects are checked when they are made, and built here."""
    if isinstance(scenarios, (str, Scenario, ScenarioSet)):
        scenarios = [scenarios]
    given = checks.listed("scenarios", scenarios)
    names = [each for each in given if isinstance(each, str)]
    for each in given:
        if isinstance(each, Scenario):
            Stage(each)
        elif not isinstance(each, (str, ScenarioSet)):
            raise ParameterError(f"scenarios holds a {type(each).__name__}; expected names, Scenario objects or sets")
    return [*(select(names) if names else ()), *(each for each in given if isinstance(each, ScenarioSet))]


def _scenarios(scenarios: Any) -> list[tuple[str, Scenario]]:
    given = (
        [scenarios] if isinstance(scenarios, (str, Scenario, ScenarioSet)) else checks.listed("scenarios", scenarios)
    )
    chosen = [(group.name, scenario) for group in _sets(given) for scenario in group.scenarios]
    chosen += [("own", each) for each in given if isinstance(each, Scenario)]
    names = [scenario.name for _, scenario in chosen]
    if not chosen:
        raise ParameterError("scenarios is empty; expected a set such as 'lectures', or Scenario objects")
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ParameterError(f"two scenarios are called {twice!r}; expected names of their own")
    return chosen
