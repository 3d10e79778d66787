"""What all figures look like, and how they are saved so that the same drawing is the same file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

OURS, OTHER, SECOND, THIRD, FAINT = "#0b63b5", "#8a8f98", "#c8501e", "#2a8c5a", "#d5d9df"
_STYLE = {
    "svg.hashsalt": "cartctl",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#9aa0a8",
    "axes.labelcolor": "#333333",
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e8eaee",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.7,
    "legend.frameon": False,
    "legend.fontsize": 8,
}
POINTS = 240  # of a curve: enough for the eye, little for the file


def drawn(draw: Callable[[], tuple[Figure, str]], file: Path) -> str:
    """Draw, save, and hand back the caption."""
    with plt.rc_context(_STYLE):
        figure, caption = draw()
        figure.savefig(file, metadata={"Date": None, "Creator": None}, bbox_inches="tight", pad_inches=0.06)
        plt.close(figure)
    return caption


def panels(*titles: str, widths: Sequence[float] | None = None) -> tuple[Figure, list[Axes]]:
    """Panels side by side."""
    figure, axes = plt.subplots(
        1, len(titles), figsize=(9.0, 2.7), layout="constrained", squeeze=False, width_ratios=widths
    )
    for ax, title in zip(axes[0], titles, strict=True):
        ax.set_title(title)
    return figure, list(axes[0])


def curve(ax: Axes, x, y, *args, **how) -> None:
    """A line of few points; peaks stay, for each of its bins keeps its largest."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    if len(x) > 2 * POINTS:
        bins = np.array_split(np.arange(len(x)), POINTS)
        keep = sorted({b[0] for b in bins} | {b[np.argmax(np.abs(y[b]))] for b in bins} | {len(x) - 1})
        x, y = x[keep], y[keep]
    ax.plot(x, y, *args, **how)


def arm(ax: Axes, robot, q, color: str = OURS, alpha: float = 1.0, width: float = 3.0) -> None:
    """A planar arm."""
    state = robot.state(q)
    names = [name for name in robot.frame_names if name.startswith("link")] + ["tool"]
    points = np.array([[0.0, 0.0], *(state.position(name)[:2] for name in names[1:])])
    ax.plot(*points.T, "-", color=color, alpha=alpha, lw=width, solid_capstyle="round", solid_joinstyle="round")
    ax.plot(*points[:-1].T, "o", color="white", mec=color, ms=4.5, mew=1.2, alpha=alpha)
    ax.plot(*points[-1], "s", color=color, ms=4, alpha=alpha)


def workspace(ax: Axes) -> None:
    """A plane in metres."""
    ax.set_aspect("equal")
    ax.set(xlabel="x, m", ylabel="y, m")
