"""What ``cartctl bench`` prints: sets, the plan, the overview, what became worse."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from cartctl.bench import contents
from cartctl.bench.contents import HEADS, SUMMED
from cartctl.bench.jobs import Grid
from cartctl.bench.peers import peers
from cartctl.bench.regressions import Verdict
from cartctl.bench.runner import Outcome
from cartctl.bench.sets import ScenarioSet
from cartctl.bench.statistics import present, scores, tallies
from cartctl.cli.console import columns, facts, number
from cartctl.solvers import solvers

_MOST = 30  # regressions that are listed
_REASONS = 6  # why a method did not do something
_SHORT = {"rms_m": "error\nposition", "rms_rad": "error\norientation", "effort": "effort", "jerk_rms": "jerk",
          "step_p50": "time\na step"}  # fmt: skip
assert set(_SHORT) == set(SUMMED) == set(HEADS)
_NARROW = 80  # letters below which means are left out


def listing(groups: Sequence[ScenarioSet], *, whole: bool) -> Iterator[RenderableType]:
    """Sets with their sizes, solvers and peers; or every scenario of the sets."""
    if not whole:
        for group in groups:
            yield Text(f"{group.name}: {group.title}", style="bold")
            yield facts([
                (s.name, ", ".join(filter(None, (s.robot, *s.levels, f"{s.duration:g} s", s.summary))))
                for s in group.scenarios
            ])  # fmt: skip
        return
    yield Text("Sets of scenarios", style="bold")
    yield facts([(g.name, f"{len(g.scenarios)} scenarios: {g.title}") for g in groups])
    yield Text("Solvers", style="bold")
    yield Text(", ".join(solvers()))
    yield Text("Peers", style="bold")
    yield facts([(name, peer.missing() or _there(peer.python)) for name, peer in peers().items()])
    yield Text("cartctl bench list --scenarios arms shows what is in a set.", style="dim")


def _there(python: str | None) -> str:
    return "here" if python is None else f"in {python}"


def plan(jobs: Grid, workers: int, dask: str | None, folder: Path) -> Table:
    """What is about to be done, defaults included."""
    names = list(dict.fromkeys(group for group, _ in jobs.scenarios))
    levels = list(dict.fromkeys(level for _, s in jobs.scenarios for level in jobs.levels or s.levels))
    where = f"on {dask}" if dask else "one after the other" if workers == 1 else f"{workers} processes"
    return facts([
        ("scenarios", f"{len(jobs.scenarios)} of {', '.join(names)}"),
        ("methods", ", ".join(method.name for method in jobs.methods)),
        ("levels", ", ".join(levels)),
        ("runs", f"{len(jobs)}, {jobs.repeat} of each, seed {jobs.seed}, {where}"),
        ("results", str(folder)),
    ])  # fmt: skip


def overview(rows: Sequence[dict[str, Any]], console: Console) -> Table:
    """By method: how many runs were done, valid, solved; means in multiples of the best where there is room."""
    there = present(rows)
    figures = [f for f in SUMMED if any(r["valid"] and r[f] is not None for r in there)]
    if console.width < _NARROW:
        figures = figures[:1]
    means = {f: scores(there, f).means() for f in figures}
    counts = tallies(there)
    order = sorted(
        counts,
        key=lambda name: (-counts[name].solved, -counts[name].valid, means[figures[0]][name] if figures else 0.0),
    )
    table = columns("method", "runs", "done", "valid", "solved", *(_SHORT[f] for f in figures))
    for name in order:
        tally = counts[name]
        cells = [Text(str(n), style="" if n else "bold red") for n in (tally.done, tally.valid, tally.solved)]
        table.add_row(name, str(tally.runs), *cells, *(_mean(means[f], name) for f in figures))
    if figures:
        table.caption = "error, effort, jerk, time: shifted geometric means, best = 1"
        table.caption_justify = "left"
    return table


def left_out(rows: Sequence[dict[str, Any]]) -> Table | None:
    """What was refused, skipped or failed, and why; None where nothing was."""
    found = contents.left_out(rows)
    more = [("...", f"and {len(found) - _REASONS} more; the report has them all")] if len(found) > _REASONS else []
    return facts([*found[:_REASONS], *more]) if found else None


def _mean(means: dict[str, float], name: str) -> Text:
    value = means[name]
    return Text(f"{value:.2f}" if value < 99.5 else number(value), style="bold" if value == min(means.values()) else "")


def after(done: Outcome, folder: Path) -> list[tuple[str, RenderableType]]:
    """Where the results are, and what to do with them."""
    found = f", {done.found} were there already" if done.found else ""
    return [
        (str(done.path), f"{done.made} runs made{found}"),
        ("next", f"cartctl bench report {folder}"),
    ]


def verdict(found: Verdict, tolerance: float) -> Iterator[RenderableType]:
    """What became worse, then a line on the rest."""
    worse, better = found.regressions, found.improvements
    if worse:
        table = columns("scenario", "method", "level", "figure", "before", "after")
        for each in worse[:_MOST]:
            table.add_row(each.scenario, each.solver, each.level, each.figure, _value(each.before), _value(each.after))
        for column in table.columns[1:4]:
            column.justify = "left"
        yield table
        if len(worse) > _MOST:
            yield Text(f"... and {len(worse) - _MOST} more", style="dim")
    share = f"{100 * tolerance:g} %"
    runs = f"{found.compared} runs compared, {found.gone} gone, {found.new} new"
    words = f"{len(worse)} figures worse by more than {share}, {len(better)} better; {runs}."
    yield Text(words, style="bold red" if worse else "green")


def _value(value: Any) -> str:
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return "-" if value is None else value if isinstance(value, str) else "yes" if value else "no"
    return number(float(value))
