"""Several runs in one figure, laid over each other: how they track, what it costs, how near they come to trouble."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cartctl.report import panels, series
from cartctl.report.axes import LEGEND, LIMIT, finish, line, logarithmic
from cartctl.report.comparison import Comparison
from cartctl.report.figures import joint_unit, objective_name
from cartctl.report.palette import Pen, pen, plain

WIDEST, THINNEST = 3.8, 1.1  # points; the first line is the widest, so that equal ones show as stripes


def plot_comparison(comparison: Comparison) -> Figure:
    """Return a figure of all runs: errors, objective, rates, singular values and step times, one colour a run.

    It belongs to no window and leaves matplotlib's global state alone.
    """
    looks = _looks(list(comparison.runs))
    drawn = list(over_time(comparison))
    rows = _rows([str(k) for k in range(len(drawn))])
    heights = [2.6] * len(rows) + [0.75 + 0.24 * len(looks)]  # inches
    figure = Figure(figsize=(11.0, sum(heights) + 1.0), layout="constrained")
    figure.suptitle(_title(comparison), fontsize=12, fontweight="bold", x=0.01, ha="left")
    places: dict[str, Any] = figure.subplot_mosaic([*rows, ["step time"] * 2], height_ratios=heights)
    for k, panel in enumerate(drawn):
        panel.draw(places[str(k)], comparison, looks)
    _step_times(places["step time"], comparison, looks)
    figure.align_ylabels([places[row[0]] for row in rows])
    _legend(figure, looks)
    return figure


@dataclass(frozen=True)
class Overlay:
    """One quantity of all runs over time."""

    title: str
    unit: str
    values: series.Series
    logarithmic: bool = False
    limit: float | None = None

    def draw(self, axes: Any, comparison: Comparison, looks: list[_Look]) -> None:
        """Draw one line a run; a limit where the lines come near it."""
        top = 0.0
        for run, look in zip(comparison.runs.values(), looks, strict=True):
            time, values = self.values(run)
            top = max(top, float(values.max(initial=0.0)))
            line(axes, time - run.time[0], values, look.pen, linewidth=look.width)
        if self.logarithmic:
            logarithmic(axes)
        else:
            axes.set_ylim(bottom=0.0)
        finish(axes, self.title, self.unit)
        axes.set_xlabel("s")
        if self.limit is not None and top > 0.4 * self.limit:
            axes.set_ylim(0.0, max(1.06 * self.limit, 1.06 * top))
            axes.axhline(self.limit, color=LIMIT, linewidth=1.1, zorder=1.8)
            axes.axhspan(self.limit, axes.get_ylim()[1], color=LIMIT, alpha=0.08, linewidth=0, zorder=0.5)


@dataclass(frozen=True)
class _Look:
    """How one run's lines are drawn."""

    pen: Pen
    width: float


def _looks(names: list[str]) -> list[_Look]:
    widths = np.linspace(WIDEST, THINNEST, len(names)) if len(names) > 1 else np.array([1.5])
    return [_Look(pen(i, name), float(width)) for i, (name, width) in enumerate(zip(names, widths, strict=True))]


def over_time(comparison: Comparison) -> Iterator[Overlay]:
    """What is drawn over time, in reading order."""
    records = comparison.first.tasks
    for index, record in enumerate(records):
        for unit, (_, title, shown) in panels.MARKED.items():
            if unit in record.units:
                whole = f"{title} of {plain(record.name)}" if len(records) > 1 else title
                yield Overlay(whole, shown, series.error(index, unit), logarithmic=True)
    unit = joint_unit(comparison.first.robot)
    goal = comparison.objective
    yield Overlay(f"Objective: {objective_name(goal)}", "H(q)", lambda run: series.objective(run, goal))
    yield Overlay("Smallest singular value", "", series.smallest_singular_value, logarithmic=True)
    yield Overlay("Norm of the joint rates", f"{unit}/s" if unit else "", series.rate_norm)
    yield Overlay("Largest joint rate", "fraction of limit", series.fastest, limit=1.0)


def _step_times(axes: Any, comparison: Comparison, looks: list[_Look]) -> None:
    """Draw a box a run: quartiles, median, and whiskers from the 1st to the 99th percentile."""
    micro = [1e6 * run.solve_time for run in comparison.runs.values()]
    boxes = axes.boxplot(
        micro, orientation="horizontal", whis=(1, 99), showfliers=False, patch_artist=True, widths=0.6,
        medianprops={"color": "white", "linewidth": 1.6},
    )  # fmt: skip
    for box, look in zip(boxes["boxes"], looks, strict=True):
        box.set(facecolor=look.pen.color, edgecolor=look.pen.color)
    axes.set_yticks(range(1, len(looks) + 1), [look.pen.label for look in looks], fontsize=9)
    axes.invert_yaxis()
    finish(axes, "Time of a control step", "")
    axes.set_xlabel("µs (box: middle half, line: median, whiskers: 1 % to 99 %)")
    axes.set_xlim(0.0, 1.03 * max(float(np.percentile(times, 99)) for times in micro))
    axes.grid(False, axis="y")


def _rows(names: list[str]) -> list[list[str]]:
    """Return the names two a row; an odd first one has the row to itself."""
    odd = len(names) % 2
    return [names[:1] * 2] * odd + [names[k : k + 2] for k in range(odd, len(names), 2)]


def _title(comparison: Comparison) -> str:
    first = comparison.first
    count = len(comparison.runs)
    parts = [first.robot.name, f"{count} solver{'s' if count > 1 else ''}", f"{first.meta.get('level', '')} level"]
    return "  ·  ".join(plain(part) for part in parts)


def _legend(figure: Figure, looks: list[_Look]) -> None:
    """Put one legend below all panels."""
    handles = [Line2D([], [], **(look.pen.options() | {"linewidth": 2.6})) for look in looks]
    longest = max(len(look.pen.label) for look in looks)
    room = max(min(150 // (longest + 8), 7), 1)
    lines = -(-len(looks) // room)
    figure.legend(handles=handles, loc="outside lower center", ncols=-(-len(looks) // lines), **LEGEND)
