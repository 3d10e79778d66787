"""What the micro-benchmarks share: interleaved rounds, tables, results with date and versions."""

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
from rich.console import Console
from rich.table import Table

ROUNDS, CALLS = 60, 300
# Rounds so short that a busy machine seldom interrupts one, each after calls that are not timed: for medians there.
SHORT = {"rounds": 500, "calls": 8, "warm": 8}


def interleaved(
    functions: dict[str, Callable[[], object]], rounds: int = ROUNDS, calls: int = CALLS, warm: int = 0
) -> dict[str, list[float]]:
    """Us a call, one figure a round; all functions take their turn in every round."""
    times: dict[str, list[float]] = {name: [] for name in functions}
    for function in functions.values():
        for _ in range(50):  # compile and warm up
            function()
    for _ in range(rounds):
        for name, function in functions.items():
            for _ in range(warm):
                function()
            start = perf_counter_ns()
            for _ in range(calls):
                function()
            times[name].append((perf_counter_ns() - start) / calls / 1e3)
    return times


def ratios(times: dict[str, list[float]], reference: str) -> list[dict[str, str]]:
    """One row a function: median and 90th percentile in us, median ratio to the reference of the same round."""
    return [
        {
            "what": name,
            "median_us": f"{statistics.median(values):.2f}",
            "p90_us": f"{np.percentile(values, 90):.2f}",
            "ratio": f"{statistics.median(v / r for v, r in zip(values, times[reference], strict=True)):.1f}",
        }
        for name, values in times.items()
    ]


def setting() -> dict[str, str]:
    """Date, machine and versions."""
    return {
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        **{name: version(name) for name in ("cartctl", "pin", "numpy", "scipy", "numba")},
    }


def show(title: str, rows: list[dict[str, str]]) -> None:
    """Print the rows as a table, and the setting below."""
    table = Table(*(key.replace("_", " ") for key in rows[0]), title=title)
    for row in rows:
        table.add_row(*row.values())
    console = Console()
    if not console.is_terminal:  # a table cut to the width of a pipe says nothing
        console = Console(width=400)
    console.print(table)
    console.print(", ".join(f"{k} {v}" for k, v in setting().items()), style="dim")


def save_rows(path: Path, rows: list[dict[str, str]], extra: dict[str, str]) -> None:
    """Write the rows as CSV, each with the setting."""
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [*rows[0], *extra])
        writer.writeheader()
        writer.writerows({**row, **extra} for row in rows)
    Console().print(f"written: {path.name}")


def one_table(words: str, results: Path, title: str, measured: Callable[[], list[dict[str, str]]]) -> None:
    """The command line of a script that measures one table: print it and, with --save, write it."""
    parser = argparse.ArgumentParser(description=words.splitlines()[0])
    parser.add_argument("--save", action="store_true", help=f"write {results.name}")
    save = parser.parse_args().save
    found = measured()
    show(title, found)
    if save:
        save_rows(results, found, setting())
