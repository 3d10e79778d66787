"""The picture of the behaviour benchmark: joint speeds of an arm whose target is out of reach."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from behaviour_runs import DT, figures_of, run
from matplotlib.figure import Figure

from cartctl.report.palette import COLORS

_PANELS = (
    ("dls", "clipped", "damped least squares, speeds clipped"),
    ("sns", "velocity", "sns, speed limits"),
    ("sns", "acceleration", "sns, speed and acceleration limits"),
)
_SECONDS = 3.0


def draw(where: Path) -> None:
    """Write the picture."""
    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    panels = figure.subplots(1, len(_PANELS), sharey=True)
    for panel, (solver, limits, title) in zip(panels, _PANELS, strict=True):
        found = figures_of(run("unreach", solver, limits))
        shares = (found.trace.v / found.top)[: round(_SECONDS / DT)]
        for joint, color in enumerate(COLORS[: shares.shape[1]]):
            panel.step(DT * np.arange(len(shares)), shares[:, joint], color=color, linewidth=0.9, label=f"{joint + 1}")
        for limit in (-1.0, 1.0):
            panel.axhline(limit, color="black", linewidth=0.8, linestyle="--")
        panel.set(xlabel="time, s", xlim=(0.0, _SECONDS), ylim=(-1.15, 1.15))
        panel.set_title(title, fontsize=10)
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(color="0.92", linewidth=0.8)
        panel.set_axisbelow(True)
        said = f"{found.flips()} reversals in the last 2 of 8 s" if found.flips() else "at rest from then on"
        panel.text(0.98, 0.03, said, transform=panel.transAxes, ha="right", fontsize=9)
    panels[0].set_ylabel("joint speed / its limit")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right", title="joint", frameon=False, fontsize=8)
    figure.savefig(where, dpi=130)
