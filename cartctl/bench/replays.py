"""Runs made again from their rows, to be watched."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path

from cartctl.bench.building import Stage
from cartctl.bench.jobs import Job
from cartctl.bench.journal import STEPS
from cartctl.bench.methods import Method, MethodNotFound, methods
from cartctl.bench.perform import make_run
from cartctl.bench.scenario import Scenario
from cartctl.bench.statistics import Row
from cartctl.errors import BenchError, CartctlError
from cartctl.motion.run import Run

FOLDER = "replays"
_NEEDED = ("key", "solver", "parameters", "scenario_json", "set", "level", "repeat", "seed")


def replay(row: Row, steps: str | Path | None = None) -> Run:
    """The run of a row: from its .npz in ``steps`` where that is, else made again; raises BenchError.

    Raises where the method is none of the registry with its default parameters, which cannot be made from a row.
    """
    missing = [name for name in _NEEDED if name not in row]
    if missing:
        raise BenchError(f"the row has no {missing[0]!r}; expected a row of cc.bench.results()")
    kept = None if steps is None else Path(steps) / f"{row['key']}.npz"
    if kept is not None and kept.is_file():
        return Run.load(kept)
    try:
        method: Method = methods([row["solver"]])[0]
    except MethodNotFound:
        raise BenchError(
            f"{row['solver']!r} is no solver of the registry; run with --keep-steps to replay it"
        ) from None
    if method.parameters != row["parameters"]:
        raise BenchError(f"{row['solver']!r} ran with {row['parameters']}; run with --keep-steps to replay it")
    scenario = Scenario.from_dict(json.loads(row["scenario_json"]))
    job = Job(row["set"], scenario, method, row["level"], row["repeat"], row["seed"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return make_run(job, Stage(scenario, row["seed"], row["repeat"]))


def write_replays(
    rows: Iterable[Row], folder: Path, tell: Callable[[str], None] | None = None
) -> tuple[dict[str, str], list[str]]:
    """Replays as HTML pages in ``folder``: key -> link from the folder above, and why others could not be made."""
    links: dict[str, str] = {}
    troubles: list[str] = []
    for row in rows:
        name = f"{row['key']}.html"
        if tell is not None:
            tell(f"replay of {row['scenario']} by {row['solver']}")
        try:
            if not (folder / name).is_file():
                replay(row, folder.parent / STEPS).html(folder / name)
        except CartctlError as error:
            troubles.append(f"{row['scenario']} by {row['solver']}: {error}")
        else:
            links[str(row["key"])] = f"{FOLDER}/{name}"
    return links, troubles
