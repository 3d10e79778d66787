"""The picture of the behaviour benchmark: joint speeds of an arm whose target is out of reach."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from behaviour_runs import DT, figures_of, run
from matplotlib.figure import Figure

from cartctl.report.palette import COLORS

_PANELS = (
    ("dls", "clipped", "damped least squares, speeds clipped"),
    ("hqp", "velocity", "hqp, speed limits"),
    ("sns", "velocity", "sns, speed limits: every step as far as it goes"),
    ("sns", "acceleration", "sns, speed and acceleration limits"),
)
_SECONDS = 5.0


def draw(where: Path) -> None:
    """Write the picture."""
    figure = Figure(figsize=(11.0, 6.2), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True).flat
    for panel, (solver, limits, title) in zip(panels, _PANELS, strict=True):
        found = figures_of(run("unreach", solver, limits))
        shares = (found.trace.v / found.top)[: round(_SECONDS / DT)]
        for joint, color in enumerate(COLORS[: shares.shape[1]]):
            panel.step(DT * np.arange(len(shares)), shares[:, joint], color=color, linewidth=0.9, label=f"{joint + 1}")
        for limit in (-1.0, 1.0):
            panel.axhline(limit, color="black", linewidth=0.8, linestyle="--")
        panel.set(xlim=(0.0, _SECONDS), ylim=(-1.3, 1.15))
        panel.set_title(title, fontsize=10)
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(color="0.92", linewidth=0.8)
        panel.set_axisbelow(True)
        moving = np.flatnonzero(found.speeds > 1e-3)[-1] + 1
        rest = f"below 1/1000 from {DT * moving:.1f} s on" if moving < len(found.speeds) else "never at rest"
        said = f"{rest}; cost {max(0.0, found.own()['excess_cost']):.1g} above the best pose's"
        panel.text(0.99, 0.02, said, transform=panel.transAxes, ha="right", fontsize=8.5)
    for side in (panels[0], panels[2]):
        side.set_ylabel("joint speed / its limit")
    for low in (panels[2], panels[3]):
        low.set_xlabel("time, s")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right", title="joint", frameon=False, fontsize=8)
    figure.savefig(where, dpi=130)
