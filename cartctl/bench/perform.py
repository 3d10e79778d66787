"""One job, done: a row of the table, and every step of it if asked for. Never raises for what a method does."""

from __future__ import annotations

import json
import os
import platform
import tempfile
import warnings
from dataclasses import asdict
from datetime import datetime, timezone
from functools import cache
from importlib import metadata
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from cartctl.bench.building import Stage
from cartctl.bench.figures import measure
from cartctl.bench.jobs import Job
from cartctl.bench.peers import PeerUnavailable, roll
from cartctl.bench.schema import COLUMNS, VERSION
from cartctl.errors import CartctlError, ProblemError, UnderactuatedRobot, UnsupportedProblem
from cartctl.motion.run import Run
from cartctl.motion.simulate import simulate

_REFUSALS = (UnsupportedProblem, ProblemError, UnderactuatedRobot)
PACKAGES = ("cartctl", "pin", "numpy", "scipy", "numba", "daqp")


class Result(NamedTuple):
    """What a job came to. row: by column. steps: the run as a .npz file, b"" where it is not wanted."""

    row: dict[str, Any]
    steps: bytes = b""


def perform(job: Job) -> Result:
    """Do a job. What the method refuses or breaks is the row's outcome; Ctrl-C goes through."""
    row = {column.name: None for column in COLUMNS} | _identity(job)
    begun = perf_counter()
    steps = b""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            stage = Stage(job.scenario, job.seed, job.repeat)
            row |= {"robot": stage.robot.name, "q0": [float(x) for x in stage.start]}
            run = make_run(job, stage)
            row["q0"] = [float(x) for x in run.q[0]]
            row["outcome"] = "ran away" if run.interrupted else "done"
            if len(run):
                if job.keep:
                    steps = _npz(run)
                row |= measure(run, stage)
        except PeerUnavailable as error:
            row |= {"outcome": "skipped", "reason": str(error)}
        except _REFUSALS as error:
            row |= {"outcome": "refused", "reason": str(error)}
        except Exception as error:
            kind = "" if isinstance(error, CartctlError) else f"{type(error).__name__}: "
            row |= {"outcome": "failed", "reason": kind + " ".join(str(error).split())}
    texts = dict.fromkeys(" ".join(str(w.message).split()) for w in said if issubclass(w.category, UserWarning))
    row |= {"warnings": list(texts), "wall": perf_counter() - begun}
    if row["outcome"] != "done":
        row |= {"valid": False, "solved": False}
    return Result(row, steps)


def make_run(job: Job, stage: Stage) -> Run:
    """The rollout of a job; raises what the method raises."""
    if job.method.solver is None:
        return roll(job.method.name, stage, job.level)
    controller = stage.controller(job.method.solver, job.level)
    plant = stage.plant() if job.level == "torque" else None
    run = simulate(controller, stage.start, job.scenario.duration, plant=plant)
    if len(run):
        run.meta["path_time"] = controller.times(float(run.time[-1]))[0]
    return run


def _identity(job: Job) -> dict[str, Any]:
    scenario = job.scenario
    return {
        "schema": VERSION, "key": job.key, "set": job.group, "scenario": scenario.name, "digest": scenario.digest,
        "robot": scenario.robot, "solver": job.method.name, "parameters": job.method.parameters,
        "peer": job.method.peer, "level": job.level, "repeat": job.repeat, "seed": job.seed, "dt": scenario.dt,
        "valid": False, "solved": False, "scenario_json": json.dumps(asdict(scenario)),
        "started": datetime.now(timezone.utc).isoformat(timespec="seconds"), "machine": machine(),
        "versions": versions(),
    }  # fmt: skip


@cache
def machine() -> str:
    """Processor, cores and system, in one line."""
    model = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), model)
    except OSError:
        pass
    return f"{model}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}"


@cache
def versions() -> str:
    """Of the packages that count, and of Python, as JSON."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return json.dumps(found)


def _npz(run: Run) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return run.save(Path(folder) / "run.npz").read_bytes()
