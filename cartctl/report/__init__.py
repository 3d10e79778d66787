"""Reports of a Run, or of several side by side: one HTML file with the moving robots, one figure of their numbers.

Loaded on first use: the page needs meshcat, the figure matplotlib, and neither should wait for the other.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cartctl.report.comparison import Comparison as Comparison
    from cartctl.report.html import write_html as write_html
    from cartctl.report.planning import plot_plan as plot_plan
    from cartctl.report.plots import plot_run as plot_run

__all__ = ["Comparison", "plot_plan", "plot_run", "write_html"]

_HOMES = {
    "Comparison": "cartctl.report.comparison",
    "write_html": "cartctl.report.html",
    "plot_plan": "cartctl.report.planning",
    "plot_run": "cartctl.report.plots",
}


def __getattr__(name: str) -> Any:
    """Import a name when it is first asked for (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
