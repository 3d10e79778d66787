"""The panels of a comparison's page: the figure's, one curve a run, and what only several runs side by side show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cartctl.report.comparison import Comparison
from cartctl.report.curves import Curve, Panel
from cartctl.report.overlay import over_time
from cartctl.report.palette import COLORS

if TYPE_CHECKING:
    from cartctl.motion.run import Run


def comparison_panels(comparison: Comparison, colors: Sequence[str]) -> list[Panel]:
    """Return what is compared over time, in the colours of the table."""
    found = []
    runs = list(comparison.runs.items())
    for panel in over_time(comparison):
        curves = []
        for k, (name, run) in enumerate(runs):
            time, values = panel.values(run)
            dashed = k >= len(COLORS)
            curves.append(Curve(name, colors[k], time - run.time[0], values, dashed=dashed, run=k))
        top = max(float(curve.values.max(initial=0.0)) for curve in curves)
        near = panel.limit is not None and top > 0.4 * panel.limit
        limits = (panel.limit,) if near and panel.limit is not None else ()
        low = None if panel.logarithmic else min(0.0, *(float(c.values.min(initial=0.0)) for c in curves))
        found.append(Panel(panel.title, panel.unit, curves, log=panel.logarithmic, limits=limits, low=low))
    found.append(_scales(runs, colors))
    found.append(_times(runs, colors))
    return found


def _scales(runs: list[tuple[str, Run]], colors: Sequence[str]) -> Panel:
    curves = []
    for k, (name, run) in enumerate(runs):
        scale = np.min([np.nan_to_num(r.scale, nan=0.0) for r in run.tasks], axis=0)
        time = run.time[:-1] - run.time[0]
        curves.append(Curve(name, colors[k], time, scale, dashed=k >= len(COLORS), run=k, steps=True))
    return Panel("Least task scale", "of command", curves, low=0.0, high=1.0)


def _times(runs: list[tuple[str, Run]], colors: Sequence[str]) -> Panel:
    curves = [
        Curve(name, colors[k], run.time[:-1] - run.time[0], 1e6 * run.solve_time, run=k, dots=True)
        for k, (name, run) in enumerate(runs)
    ]
    return Panel("Time of a step", "µs", curves, log=True)
