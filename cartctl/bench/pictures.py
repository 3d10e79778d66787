"""Performance profiles as a figure."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cartctl.bench.schema import BY_NAME, FIGURES
from cartctl.bench.statistics import Row, present, ranking, scores
from cartctl.errors import ParameterError
from cartctl.files import whole_file
from cartctl.report.palette import pen

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = ("rms_m", "effort", "jerk_rms", "step_p50")
TITLES = {
    "rms_m": "RMS position error", "rms_rad": "RMS orientation error", "effort": "effort", "jerk_rms": "RMS jerk",
    "step_p50": "median time of a step", "null_motion": "null-space motion", "drift": "drift over a lap",
}  # fmt: skip
_WIDEST = 1e4  # ratios beyond are as bad as any


def profiles(rows: Sequence[Row], figures: Sequence[str] = SHOWN) -> Figure:
    """One panel a figure: the share of cells in which a method is within tau times the best. Raises ParameterError."""
    from matplotlib.figure import Figure

    for name in figures:
        if name not in FIGURES:
            raise ParameterError(f"figure {name!r} is not one of {', '.join(FIGURES)}")
    columns = min(2, len(figures))
    high = -(-len(figures) // columns)
    names = ranking(present(rows), figures[0])  # the best have the clearest pens
    room = 0.35 + 0.21 * -(-len(names) // 4)  # inches below, for the legend
    size = (5.6 * columns, 3.3 * high + room)
    drawing = Figure(figsize=size)
    drawing.subplots_adjust(
        left=0.62 / size[0], right=1 - 0.12 / size[0], top=1 - 0.35 / size[1], bottom=(room + 0.45) / size[1],
        wspace=0.22, hspace=0.42,
    )  # fmt: skip
    for k, figure in enumerate(figures):
        _panel(drawing.add_subplot(high, columns, k + 1), rows, figure, names)
    handles, labels = drawing.axes[0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="lower center", ncol=4, fontsize=8, frameon=False)
    return drawing


def _panel(axes: Any, rows: Sequence[Row], figure: str, names: Sequence[str]) -> None:
    found = scores(present(rows), figure)
    ratios = found.ratios()
    finite = ratios[np.isfinite(ratios)]
    top = min(max(float(finite.max(initial=2.0)) * 1.1, 2.0), _WIDEST)
    taus = np.geomspace(1.0, top, 400)
    for k, name in enumerate(names):
        if name in found.solvers:
            axes.step(taus, found.profile(taus)[found.solvers.index(name)], where="post", **pen(k, name).options())
    from matplotlib.ticker import LogLocator

    column = BY_NAME[figure]
    axes.set_title(TITLES.get(figure, column.says.partition(",")[0]), loc="left", fontsize=10, fontweight="bold")
    axes.set_title(f"{len(found.cells)} cells", loc="right", fontsize=8, color="0.35")
    axes.set_xscale("log")
    axes.set_xlim(1.0, top)
    axes.set_ylim(0.0, 1.02)
    axes.set_xlabel("within this factor of the best", fontsize=9)
    axes.set_ylabel("share of cells", fontsize=9)
    if top < 100.0:  # within two decades powers of ten alone would say little
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0) if top < 10.0 else (1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_minor_formatter(lambda *_: "")
    axes.tick_params(labelsize=8)
    axes.grid(True, color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def svg(drawing: Figure) -> str:
    """The figure as SVG for a page: text as paths, ids that are the same every time."""
    import matplotlib

    text = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "cartctl", "svg.fonttype": "path"}):
        drawing.savefig(text, format="svg", metadata={"Date": None})
    return re.sub(r"^.*?(?=<svg)", "", text.getvalue(), flags=re.DOTALL)


def save(drawing: Figure, path: Path) -> Path:
    """Write the figure; the suffix says as what. Raises ParameterError."""
    kind = path.suffix[1:].lower() or "png"
    if kind not in drawing.canvas.get_supported_filetypes():
        raise ParameterError(f"path ends in {path.suffix!r}; expected .png, .svg or .pdf")
    with whole_file(path) as part:
        drawing.savefig(part, dpi=150, format=kind)
    return path
