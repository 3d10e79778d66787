"""Reports of a Run, of several side by side, or of a calibration: one HTML file, one figure of the numbers.

Loaded on first use: the page needs meshcat, the figure matplotlib, and neither should wait for the other.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cartctl.report.calibration_figure import plot_calibration as plot_calibration
    from cartctl.report.calibration_page import write_calibration_html as write_calibration_html
    from cartctl.report.comparison import Comparison as Comparison
    from cartctl.report.html import write_html as write_html
    from cartctl.report.planning import plot_plan as plot_plan
    from cartctl.report.plots import plot_run as plot_run
    from cartctl.report.saving import save_figure as save_figure

__all__ = [
    "Comparison",
    "plot_calibration",
    "plot_plan",
    "plot_run",
    "save_figure",
    "write_calibration_html",
    "write_html",
]

_HOMES = {
    "Comparison": "cartctl.report.comparison",
    "plot_calibration": "cartctl.report.calibration_figure",
    "write_calibration_html": "cartctl.report.calibration_page",
    "write_html": "cartctl.report.html",
    "plot_plan": "cartctl.report.planning",
    "plot_run": "cartctl.report.plots",
    "save_figure": "cartctl.report.saving",
}


def __getattr__(name: str) -> Any:
    """Import a name when it is first asked for (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
