"""A plan in one figure: how its search converged, what it costs beside the local methods, how far each drifts a lap."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cartctl.report.axes import LEGEND, finish, logarithmic, note
from cartctl.report.mesh import Array
from cartctl.report.palette import COLORS, GREY, plain

if TYPE_CHECKING:
    from cartctl.wholepath.report import PlanReport
    from cartctl.wholepath.sqp import Iterate

_MOST = 5.0  # times the plan's cost: longer bars are cut
_OUT = "beyond"  # of bars that are cut


def plot_plan(report: PlanReport) -> Figure:
    """Return a figure of ``report``: its search on the left, costs and drifts beside the local methods on the right.

    It belongs to no window and leaves matplotlib's global state alone.
    """
    drifts = [m.drift for m in report.local]
    lapped = report.drift is not None and any(d is not None for d in drifts)
    figure = Figure(figsize=(11.0, 7.2), layout="constrained")
    figure.suptitle(
        f"plan  ·  {plain(report.objective)}  ·  {report.status.name.lower().replace('_', ' ')}",
        fontsize=12, fontweight="bold", x=0.01, ha="left",
    )  # fmt: skip
    right = ["costs", "drifts"] if lapped else ["costs", "costs"]
    places: dict[str, Any] = figure.subplot_mosaic([["cost", right[0]], ["steps", right[1]]])
    _cost(places["cost"], report)
    _steps(places["steps"], report)
    _costs(places["costs"], report)
    if lapped:
        _drifts(places["drifts"], report)
    return figure


def _cost(axes: Any, report: PlanReport) -> None:
    """The cost above the best one of its stage, iteration by iteration; a coarser stage has a cost of its own."""
    for k, (samples, numbers, stage) in enumerate(_stages(report)):
        values = np.array([i.cost for i in stage])
        above = (values - values.min()) / max(abs(float(values.min())), 1e-300)
        drawn = np.maximum(above, 1e-12)
        axes.plot(numbers, drawn, "o-", color=COLORS[k], markersize=4, label=f"{samples} samples")
    logarithmic(axes)
    finish(axes, "Cost above the best", "relative")
    note(axes, f"{report.iterations} iterations from all starts")
    _iterations(axes)


def _steps(axes: Any, report: PlanReport) -> None:
    """How far each step went, what it had to gain, and how well the path did its task."""
    shown = (("step, rad or m", "step"), ("slope, relative", "slope"), ("task error", "residual"))
    for samples, numbers, stage in _stages(report):
        del samples
        for k, (name, field) in enumerate(shown):
            values = np.maximum([getattr(i, field) for i in stage], 1e-12)
            axes.plot(numbers, values, "o-", color=COLORS[k], markersize=4, label=name if numbers[0] == 0 else None)
    logarithmic(axes)
    finish(axes, "Steps, slope and task error", "")
    _iterations(axes)


def _stages(report: PlanReport) -> list[tuple[int, Array, list[Iterate]]]:
    """(samples, iteration numbers, iterates) of every stage of the search."""
    found: list[tuple[int, Array, list[Iterate]]] = []
    for samples, group in groupby(report.history, key=lambda i: i.samples):
        stage = list(group)
        begin = sum(len(s) for _, _, s in found)
        found.append((samples, np.arange(begin, begin + len(stage), dtype=np.float64), stage))
    return found


def _iterations(axes: Any) -> None:
    axes.set_xlabel("iteration")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if axes.get_lines():
        axes.legend(loc="best", **LEGEND)


def _costs(axes: Any, report: PlanReport) -> None:
    """A bar each: the plan's cost, and that of the local methods; pale where one breaks task or limits."""
    names, values, colours = ["plan"], [report.cost], [COLORS[0] if report.feasible else GREY]
    for m in report.local:
        names.append(m.name)
        values.append(m.cost)
        colours.append(COLORS[1] if m.keeps else GREY)
    _bars(axes, names, values, colours)
    finish(axes, f"Cost: {plain(report.objective)}", "")
    note(axes, "grey: task missed, or beyond limits" if GREY in colours else "")


def _drifts(axes: Any, report: PlanReport) -> None:
    """A bar each: the largest distance of the joints over a lap."""
    pairs = [("plan", report.drift, COLORS[0]), *((m.name, m.drift, COLORS[1]) for m in report.local)]
    known = [(name, drift, colour) for name, drift, colour in pairs if drift is not None]
    _bars(axes, *(list(column) for column in zip(*known, strict=True)))
    finish(axes, "Drift of the joints over a lap", "")


def _bars(axes: Any, names: list[str], values: list[float], colours: list[str]) -> None:
    finite = [v for v in values if np.isfinite(v)]
    top = min(max(finite, default=1.0), _MOST * max(values[0], 1e-300)) if values[0] > 0.0 else max(finite, default=1.0)
    shown = [min(v, top) if np.isfinite(v) else top for v in values]
    axes.barh(range(len(names)), shown, color=colours)
    axes.set_yticks(range(len(names)), [plain(n) for n in names])
    axes.invert_yaxis()
    for row, (value, length) in enumerate(zip(values, shown, strict=True)):
        text = f" {value:.3g}" if np.isfinite(value) else f" {_OUT}"
        axes.text(max(length, 0.0), row, text, va="center", fontsize=8)
    axes.set_xlim(min(0.0, *shown) * 1.15, max(max(shown) * 1.18, 1e-12))
