"""What a report says, whatever it is written as: sections of text, tables and one figure."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any, NamedTuple

from cartctl.bench.schema import BY_NAME
from cartctl.bench.statistics import PENALTY, Row, Tally, cell_of, present, ranking, scores, tallies
from cartctl.report.numbers import number

SUMMED = ("rms_m", "rms_rad", "effort", "jerk_rms", "step_p50")
HEADS = {
    "rms_m": "RMS error, position", "rms_rad": "RMS error, orientation", "effort": "effort", "jerk_rms": "RMS jerk",
    "step_p50": "time a step",
}  # fmt: skip
WORST = 10
LIMITATIONS = (
    "A kinematic robot does exactly what it is told; only the torque level has masses. Torques and energy of kinematic "
    "runs are what inverse dynamics says of the motion, jumps of the rates included.",
    "Methods that know no limits, rows or objective run without them. Their runs are valid where they happen to keep "
    "the limits, judged at samples: what happens between two samples is not seen.",
    "A path waits for a hand that a scaling method slows down. The error is then against the waiting path; the delay "
    "says what that cost, and belongs to the error as its price.",
    "Every method has its default parameters. A method that was tuned to a scenario would do better there.",
    "Times are those of one process on the machine named below, Python included, with whatever else it was doing.",
    "Peers have their own gains and their own way to the target: they are given the target after each step and every "
    "limit they can be told. Peers of their own environment are timed by their own clock.",
    f"In means a run that is not valid counts {PENALTY:g} times the worst valid one of its cell, so that nobody gains "
    "by refusing; that factor is a choice. Means and profiles depend on the scenarios that were chosen.",
)


class Cell(NamedTuple):
    """An entry of a table. mark: "best", "wrong" or "". link: where it leads."""

    text: str
    mark: str = ""
    link: str = ""


@dataclass
class Table:
    """heads: by column; rows of cells, the first the row's name. note: below it. fold: behind a title, where it can."""

    heads: Sequence[str]
    rows: list[list[Cell]]
    title: str = ""
    note: str = ""
    fold: bool = False


@dataclass
class Section:
    """A heading, what is said, tables; figure: whether the performance profiles belong here."""

    title: str
    text: Sequence[str] = ()
    tables: list[Table] = field(default_factory=list)
    bullets: Sequence[str] = ()
    figure: bool = False


class Shown(NamedTuple):
    """A column of the scenarios' tables. unit: as shown; factor: from SI."""

    figure: str
    head: str
    factor: float = 1.0
    best: str = "low"


_COLUMNS = (
    Shown("rms_m", "RMS mm", 1e3),
    Shown("max_m", "max mm", 1e3),
    Shown("rms_rad", "RMS mrad", 1e3),
    Shown("max_rad", "max mrad", 1e3),
    Shown("scale_mean", "scale", 1.0, "high"),
    Shown("delay", "delay s"),
    Shown("violations", "outside", 1.0, ""),
    Shown("margin", "margin", 1.0, "high"),
    Shown("velocity_share", "rate %", 1e2, ""),
    Shown("acceleration_share", "acc. %", 1e2, ""),
    Shown("clearance", "clear mm", 1e3, "high"),
    Shown("effort", "effort"),
    Shown("peak_torque", "peak N m"),
    Shown("energy", "energy J"),
    Shown("manipulability", "manip.", 1.0, "high"),
    Shown("jerk_rms", "jerk"),
    Shown("flips", "flips"),
    Shown("power_above_3hz", "> 3 Hz %", 1e2),
    Shown("drift", "drift"),
    Shown("null_motion", "null"),
    Shown("step_p50", "p50 us", 1e6),
    Shown("step_p99", "p99 us", 1e6),
)


def contents(rows: Sequence[Row], replays: Mapping[str, str]) -> list[Section]:
    """The sections of a report. replays: key -> where the run can be watched."""
    return [
        _overview(rows),
        _profiles(rows),
        _worst(rows, replays),
        *_sets(rows, replays),
        _not_done(rows),
        Section("Known limitations", bullets=[*LIMITATIONS, *_nobody(rows)]),
        _setting(rows),
    ]


def headline(rows: Sequence[Row]) -> str:
    """One line on what was run."""
    there = present(rows)
    counts = {name: len({row[name] for row in there}) for name in ("scenario", "solver", "robot", "level")}
    words = [f"{n} {name if name != 'solver' else 'method'}{'s' if n != 1 else ''}" for name, n in counts.items()]
    return f"{len(rows)} runs: " + ", ".join(words)


def worst_cases(rows: Sequence[Row], count: int = WORST) -> list[tuple[Row, str]]:
    """The runs that went furthest wrong of those that moved, at most two a method, each with why it is here."""
    best: dict[Any, float] = {}
    for row in rows:
        if row["valid"] and row["rms_m"] is not None:
            key = cell_of(row)
            best[key] = min(best.get(key, row["rms_m"]), row["rms_m"])
    ranked: list[tuple[float, Row, str]] = []
    for row in rows:
        if row["rms_m"] is None or row["solved"]:
            continue
        error = float(row["rms_m"])
        ratio = max(error, 1e-6) / max(best.get(cell_of(row), error), 1e-6)
        why = [f"{number(1e3 * row['rms_m'])} mm RMS"]
        if ratio > 1.5:
            why.append(f"{number(ratio)} times the best valid run")
        if row["outcome"] == "ran away":
            why.append("ran away")
        if row["violations"]:
            why.append(f"{row['violations']} samples outside a limit")
        if row["clearance"] is not None and row["clearance"] < 0.0:
            why.append(f"{number(-1e3 * row['clearance'])} mm inside an obstacle")
        if len(why) > 1:
            badness = ratio * (1.0 + (row["violations"] or 0) + 1e3 * max(0.0, -(row["clearance"] or 0.0)))
            ranked.append((badness, row, ", ".join(why)))
    ranked.sort(key=lambda each: -each[0])
    chosen: list[tuple[Row, str]] = []
    for _, row, said in ranked:
        if sum(other["solver"] == row["solver"] for other, _ in chosen) < 2 and len(chosen) < count:
            chosen.append((row, said))
    return chosen


def _overview(rows: Sequence[Row]) -> Section:
    there = present(rows)
    figures = [name for name in SUMMED if any(row["valid"] and row[name] is not None for row in there)]
    means = {name: scores(there, name).means() for name in figures}
    counts = tallies(there)
    order = ranking(there, figures[0] if figures else None)
    table = Table(
        ["method", "runs", "done", "valid", "solved", *(HEADS[name] for name in figures)],
        [[Cell(name), *_counted(counts[name]), *(_mean(means[f], name) for f in figures)] for name in order],
        note="Done: not refused, not failed. Valid: done, inside all limits and clear of all obstacles. Solved: valid, "
        "and within the scenario's tolerance. Right of them shifted geometric means in multiples of the best (1.0).",
    )
    return Section("Overview", [], [table])


def _counted(tally: Tally) -> list[Cell]:
    rest = (tally.done, tally.valid, tally.solved)
    return [Cell(str(tally.runs)), *(Cell(str(n), "" if n else "wrong") for n in rest)]


def _mean(means: Mapping[str, float], name: str) -> Cell:
    value = means[name]
    text = f"{value:.2f}" if value < 99.5 else number(value)
    return Cell(text, "best" if value == min(means.values()) else "")


def _profiles(rows: Sequence[Row]) -> Section:
    text = (
        "The share of cells in which a method comes within a factor of the best one (Dolan & Moré 2002). Left: how "
        "often it is the best; right: how often it has a valid answer at all."
    )
    return Section("Performance profiles", [text], figure=True)


def _worst(rows: Sequence[Row], replays: Mapping[str, str]) -> Section:
    cases = worst_cases(rows)
    if not cases:
        return Section("Worst cases", ["None: every run that moved was solved, or close to it."])
    made = [
        [
            Cell(row["scenario"]), Cell(row["solver"]), Cell(row["level"]), Cell(why),
            Cell("watch", link=replays[row["key"]]) if row["key"] in replays else Cell("-"),
        ]
        for row, why in cases
    ]  # fmt: skip
    return Section("Worst cases", [], [Table(["scenario", "method", "level", "what went wrong", "replay"], made)])


def _sets(rows: Sequence[Row], replays: Mapping[str, str]) -> Iterable[Section]:
    there = sorted(present(rows), key=lambda row: list(dict.fromkeys(r["set"] for r in rows)).index(row["set"]))
    for name, some in groupby(there, key=lambda row: row["set"]):
        cases: dict[tuple[str, str], list[Row]] = {}
        for row in some:
            cases.setdefault((row["scenario"], row["level"]), []).append(row)
        yield Section(f"Set {name}", [], [_case(case, group, replays) for case, group in cases.items()])


def _case(case: tuple[str, str], rows: Sequence[Row], replays: Mapping[str, str]) -> Table:
    """One scenario at one level; of several repetitions the medians."""
    by_solver: dict[str, list[Row]] = {}
    for row in rows:
        by_solver.setdefault(row["solver"], []).append(row)
    done = {name: [row for row in some if row["steps"]] for name, some in by_solver.items()}
    values = {name: {c.figure: _middle(some, c.figure) for c in _COLUMNS} for name, some in done.items() if some}
    columns = [c for c in _COLUMNS if any(v[c.figure] is not None for v in values.values())]
    made = []
    for name, figures in values.items():
        valid = all(row["valid"] for row in done[name])
        link = next((replays[row["key"]] for row in done[name] if row["key"] in replays), "")
        cells = [_figure(figures[c.figure], c, values, done, valid) for c in columns]
        made.append([Cell(name, "" if valid else "wrong", link), *cells])
    scenario = json.loads(rows[0]["scenario_json"])
    times = max(len(some) for some in by_solver.values())
    what = f"{rows[0]['robot']}, {scenario['duration']:g} s" + (f", medians of {times} runs" if times > 1 else "")
    summary = f"{scenario['summary']}; " if scenario["summary"] else ""
    return Table(
        ["method", *(c.head for c in columns)], made, title=f"{case[0]} · {case[1]} level", note=f"{summary}{what}",
        fold=True,
    )  # fmt: skip


def _middle(rows: Sequence[Row], figure: str) -> float | None:
    values = sorted(float(row[figure]) for row in rows if row[figure] is not None)
    return values[(len(values) - 1) // 2] if values else None


def _figure(value: float | None, column: Shown, values: Any, done: Any, valid: bool) -> Cell:
    text = number(None if value is None else column.factor * value)
    if value is None:
        return Cell(text)
    beyond = column.figure in ("violations", "velocity_share", "acceleration_share")
    if (beyond and value > (0.0 if column.figure == "violations" else 1.0 + 1e-9)) or (
        column.figure in ("margin", "clearance") and value < -1e-4
    ):
        return Cell(text, "wrong")
    rivals = [
        _text(column, v[column.figure])
        for name, v in values.items()
        if v[column.figure] is not None and all(row["valid"] for row in done[name])
    ]
    if not column.best or not valid or len(set(rivals)) < 2:
        return Cell(text)
    ends = sorted(rivals, key=float)
    top = ends[0] if column.best == "low" else ends[-1]
    return Cell(text, "best" if _text(column, value) == top else "")


def _text(column: Shown, value: float) -> str:
    """What is compared: as it is shown, and what counts as nothing is all the same."""
    return number(column.factor * max(value, BY_NAME[column.figure].floor))


def _not_done(rows: Sequence[Row]) -> Section:
    """Refusals, failures and skips: one line for each method and reason."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for row in rows:
        if row["outcome"] not in ("done", "ran away"):
            groups.setdefault((row["solver"], row["outcome"], row["reason"] or ""), []).append(row["scenario"])
    if not groups:
        return Section("Not done", ["Every method took every scenario."])
    made = [
        [Cell(solver), Cell(outcome, "wrong" if outcome == "failed" else ""), Cell(_some(names)), Cell(reason)]
        for (solver, outcome, reason), names in groups.items()
    ]
    return Section("Not done", [], [Table(["method", "outcome", "scenarios", "reason"], made)])


def left_out(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """Methods with what they did not do, and why, in words."""
    return [
        (str(row[0].text), f"{row[1].text} {row[2].text}: {row[3].text}")
        for t in _not_done(rows).tables
        for row in t.rows
    ]


def _some(names: Sequence[str]) -> str:
    names = list(dict.fromkeys(names))
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")


def _nobody(rows: Sequence[Row]) -> Iterable[str]:
    cells: dict[tuple[str, str], bool] = {}
    for row in rows:
        key = (row["scenario"], row["level"])
        cells[key] = cells.get(key, False) or bool(row["solved"])
    left = [f"{scenario} ({level})" for (scenario, level), solved in cells.items() if not solved]
    if left:
        yield f"Nobody solved {', '.join(left)}: no method here can, or the scenario asks too much."


def _setting(rows: Sequence[Row]) -> Section:
    def of(name: str) -> list[str]:
        return sorted({str(row[name]) for row in rows if row[name] is not None})

    versions = [", ".join(f"{k} {v}" for k, v in json.loads(text).items()) for text in of("versions")]
    lines = [
        ["machine", "; ".join(of("machine"))],
        ["versions", "; ".join(versions)],
        ["seeds", ", ".join(of("seed"))],
        ["repetitions", str(len(of("repeat")))],
        ["run", f"{of('started')[0]} to {of('started')[-1]}"],
        ["schema", f"version {', '.join(of('schema'))} of the results' columns"],
        ["digests", ", ".join(sorted({f"{row['scenario']} {row['digest']}" for row in rows}))],
    ]
    return Section("Machine, versions, seeds", [], [Table(["", ""], [[Cell(a), Cell(b)] for a, b in lines])])
