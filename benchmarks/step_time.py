"""What one step costs: medians in us, and as ratios against raw calls made in the same run.

    python benchmarks/step_time.py            # print the table
    python benchmarks/step_time.py --save     # and write benchmarks/results/step_time.csv and the table in the README

Rounds of all candidates are interleaved, so that a machine that changes its pace changes it for all of them; the ratio
is the median of the rounds' ratios against Pinocchio's computeFrameJacobian.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import statistics
from collections.abc import Callable
from datetime import date
from importlib.metadata import version
from pathlib import Path
from time import perf_counter_ns

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "step_time.csv"
README = Path(__file__).parent.parent / "README.md"
REFERENCE = "pin.computeFrameJacobian"
ROUNDS, CALLS = 60, 300


def candidates() -> dict[str, Callable[[], object]]:
    """Panda, 7 dof, the pose of its tool: raw calls, then whole controller steps."""
    robot = cc.load("panda")
    q, v = np.array(robot.home + 0.01), np.zeros(robot.nv)
    data, frame = robot.model.createData(), robot.frame_id(robot.tool)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    J = np.array(pin.computeFrameJacobian(robot.model, data, q, frame, world))
    target = robot.state(robot.home).placement(robot.tool)
    found: dict[str, Callable[[], object]] = {
        REFERENCE: lambda: pin.computeFrameJacobian(robot.model, data, q, frame, world),
        "numpy.linalg.pinv alone": lambda: np.linalg.pinv(J),
    }
    for solver in ("dls", "pinv", "projected-gradient", "task-priority"):
        objective = cc.JointRange() if solver == "projected-gradient" else None
        tasks: list[cc.Task] = [cc.FrameTask(robot.tool, target=target)]
        if solver == "task-priority":
            tasks.append(cc.PostureTask())
        controller = cc.Controller(robot, tasks, solver=solver, objective=objective, limits=None)
        extra = {"projected-gradient": ", joint range", "task-priority": ", pose and posture"}.get(solver, "")
        found[f"Controller.step, {solver}{extra}"] = lambda c=controller: c.step(q, v, 0.0)
    circle = cc.Circle.starting_at(target, 0.1, period=4.0)
    moving = cc.Controller(robot, cc.FrameTask(robot.tool, target=circle), solver="dls", limits=None)
    found["Controller.step, dls, target on a circle"] = lambda: moving.step(q, v, 1.3)
    return found


def measure(functions: dict[str, Callable[[], object]]) -> dict[str, list[float]]:
    """Us a call, one figure a round."""
    times: dict[str, list[float]] = {name: [] for name in functions}
    for function in functions.values():
        for _ in range(50):  # compile and warm up
            function()
    for _ in range(ROUNDS):
        for name, function in functions.items():
            start = perf_counter_ns()
            for _ in range(CALLS):
                function()
            times[name].append((perf_counter_ns() - start) / CALLS / 1e3)
    return times


def rows(times: dict[str, list[float]]) -> list[dict[str, str]]:
    """One row a candidate."""
    reference = times[REFERENCE]
    return [
        {
            "what": name,
            "median_us": f"{statistics.median(values):.2f}",
            "p90_us": f"{np.percentile(values, 90):.2f}",
            "ratio": f"{statistics.median(v / r for v, r in zip(values, reference, strict=True)):.1f}",
        }
        for name, values in times.items()
    ]


def write_table(found: list[dict[str, str]], setting: dict[str, str]) -> None:
    """Put the figures into the README, between its markers."""
    lines = ["| what | median us | x computeFrameJacobian |", "|---|---|---|"]
    lines += [f"| {row['what']} | {row['median_us']} | {row['ratio']} |" for row in found]
    lines += ["", "Panda, 7 dof, 6D pose; " + ", ".join(f"{k} {v}" for k, v in setting.items()) + "."]
    begin, end = "<!-- table: step_time -->\n", "<!-- /table -->"
    head, _, rest = README.read_text().partition(begin)
    README.write_text(head + begin + "\n".join(lines) + "\n" + end + rest.partition(end)[2])


def main() -> None:
    """Measure, print and, if asked, save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help=f"write {RESULTS.name} and the README's table")
    save = parser.parse_args().save
    found = rows(measure(candidates()))
    setting = {
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        **{name: version(name) for name in ("cartctl", "pin", "numpy", "scipy", "numba")},
    }
    table = Table("what", "median us", "p90 us", f"x {REFERENCE}", title="One step on the Panda, 7 dof, 6D pose")
    for row in found:
        table.add_row(*row.values())
    console = Console()
    console.print(table)
    console.print(", ".join(f"{k} {v}" for k, v in setting.items()), style="dim")
    if save:
        RESULTS.parent.mkdir(exist_ok=True)
        with RESULTS.open("w", newline="") as file:
            writer = csv.DictWriter(file, [*found[0], *setting])
            writer.writeheader()
            writer.writerows({**row, **setting} for row in found)
        write_table(found, setting)
        console.print(f"written: {RESULTS.relative_to(Path.cwd()) if RESULTS.is_relative_to(Path.cwd()) else RESULTS}")


if __name__ == "__main__":
    main()
