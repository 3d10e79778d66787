"""The picture of the LWR benchmark: completion times, and what each method makes of the joints' speeds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from hexagon_runs import SPEEDS
from matplotlib.figure import Figure

from cartctl.report.palette import COLORS, GREY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hexagon_runs import Race

_LOOKS = {
    "pinv": (GREY, "s", "pinv, no limits"),
    "task-scaling": (COLORS[1], "^", "task-scaling"),
    "sns-greedy": (COLORS[5], "v", "sns-greedy"),
    "sns": (COLORS[0], "o", "sns"),
    "hqp": (COLORS[3], "D", "hqp (leaves the path)"),
}
_SHOWN = 2.0  # m/s, the tip speed of the right panel


def draw(
    races: Mapping[tuple[str, str, float], Race], published: Mapping[str, tuple[float, ...]], dt: float, where: Path
) -> None:
    """Write the picture."""
    figure = Figure(figsize=(10.5, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for method, (color, marker, label) in _LOOKS.items():
        limits = "none" if method == "pinv" else "velocity"
        times = [races[limits, method, v].completion for v in SPEEDS]
        left.plot(SPEEDS, times, color=color, marker=marker, label=label, linewidth=1.6, markersize=5)
        if method in published and method != "pinv":
            left.plot(SPEEDS, published[method], color=color, linestyle=":", linewidth=1.2, label=f"{label}, published")
    left.set(xscale="log", xticks=SPEEDS, xticklabels=[f"{v:g}" for v in SPEEDS], ylim=(0.0, 11.0))
    left.minorticks_off()
    left.set(xlabel="tip speed asked for, m/s", ylabel="completion time, s", title="4.57 m in six straight lines")
    for method in ("pinv", "task-scaling", "sns"):
        color, _, label = _LOOKS[method]
        speeds = races["none" if method == "pinv" else "velocity", method, _SHOWN].speeds[1:]
        right.plot(dt * np.arange(speeds.size), speeds, color=color, label=label, linewidth=1.2)
    right.axhline(1.0, color="black", linewidth=0.8, linestyle="--")
    right.set(xlabel="time, s", ylabel="fastest joint's speed / its limit", ylim=(0.0, 4.2), xlim=(0.0, None))
    right.set_title(f"tip speed {_SHOWN:g} m/s")
    for panel in (left, right):
        panel.legend(frameon=False, fontsize=8)
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(color="0.92", linewidth=0.8)
        panel.set_axisbelow(True)
    figure.savefig(where, dpi=130)
