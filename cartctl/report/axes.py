"""What the panels of all figures share: lines, titles, logarithms, the marks of a limit."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from cartctl.report.mesh import Array
from cartctl.report.palette import Pen, thinned

LIMIT = "#7a1f1f"  # of the lines that mark a limit
DECADES = 9  # shown at most on a logarithmic axis, counted from its top
LEGEND = {"fontsize": 8, "framealpha": 0.85, "edgecolor": "0.85", "handlelength": 1.6, "borderpad": 0.35}


def line(axes: Any, time: Array, values: Array, pen: Pen, **options: Any) -> None:
    """Draw ``values`` (n,) over ``time`` (n,), thinned to what a picture can show."""
    axes.plot(*thinned(time, values), **(pen.options() | options))


def finish(axes: Any, title: str, unit: str) -> None:
    """Give a panel its title and unit, and take away what only distracts."""
    axes.set_title(title, loc="left", fontsize=10, fontweight="bold")
    axes.set_ylabel(unit)
    axes.grid(True, which="major", color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.margins(x=0)
    axes.spines[["top", "right"]].set_visible(False)


def logarithmic(axes: Any, top: float = np.inf) -> None:
    """Scale y by decades, at most ``DECADES`` of them and up to ``top``; with nothing but zeros it stays linear."""
    values = np.concatenate([np.zeros(1), *(np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines())])
    positive = values[values > 0]
    if not positive.size:
        return
    top = min(positive.max(), top)
    low = max(np.percentile(positive, 1), top / 10.0**DECADES)  # the zero from which a run starts has no place here
    axes.set_ylim(low / 1.6, top * 2.5)  # first: a curve of one value has no range of its own that a scale could take
    axes.set_yscale("log", nonpositive="mask")
    if top / low < 30:  # within a decade or so, powers of ten alone would say little
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def mark_limits(axes: Any, low: float, high: float) -> None:
    """Mark two limits and shade what lies beyond them."""
    bottom, top = axes.get_ylim()
    pad = 0.06 * (high - low)
    bottom, top = min(bottom, low - pad), max(top, high + pad)
    for limit, edge in ((low, bottom), (high, top)):
        axes.axhline(limit, color=LIMIT, linewidth=1.1, zorder=1.8)
        axes.axhspan(*sorted((limit, edge)), color=LIMIT, alpha=0.08, linewidth=0, zorder=0.5)
    axes.set_ylim(bottom, top)


def note(axes: Any, text: str) -> None:
    """Add a remark at the right end of the title's line."""
    axes.set_title(text, loc="right", fontsize=8, color="0.35")
