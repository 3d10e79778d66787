"""The picture of the three norms: torque over time, on short and long motions, null space classical and damped."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cartctl.report.palette import COLORS


def draw(runs, path):
    """runs: by (kind, setting, weight); written to path."""
    figure = Figure(figsize=(9.0, 8.6), layout="constrained")
    axes = figure.subplots(3, 2)
    for i, setting in enumerate(("classical, no gravity", "classical", "damped")):
        for j, kind in enumerate(("short", "long")):
            ax = axes[i, j]
            for (k, other, weight), run in runs.items():
                if (k, other) == (kind, setting):
                    colour = COLORS[("I", "M^-1", "M^-2").index(weight)]
                    norm = np.linalg.norm(run.torque, axis=1)
                    stride = max(1, len(norm) // 2000)
                    label = {"I": "W = I", "M^-1": "W = M⁻¹", "M^-2": "W = M⁻²"}[weight]
                    ax.plot(run.time[:-1:stride], norm[::stride], color=colour, lw=1.1, label=label)
            what = "a line in 0.6 s" if kind == "short" else "circles for 10 s"
            ax.set_title(f"{what}: {setting}", fontsize=10, loc="left")
            ax.set_xlabel("s")
            ax.set_ylabel("‖τ‖  N m")
            ax.set_yscale("log")
            ax.grid(alpha=0.25)
            ax.spines[["top", "right"]].set_visible(False)
    axes[0, 0].legend(frameon=False, fontsize=9)
    figure.savefig(path, dpi=110)
