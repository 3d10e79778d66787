"""Reports of a Run: one HTML file with the moving robot, one figure of its numbers.

Loaded on first use: the page needs meshcat, the figure matplotlib, and neither should wait for the other.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cartctl.report.html import write_html as write_html
    from cartctl.report.plots import plot_run as plot_run

__all__ = ["plot_run", "write_html"]

_HOMES = {"write_html": "cartctl.report.html", "plot_run": "cartctl.report.plots"}


def __getattr__(name: str) -> Any:
    """Import ``write_html`` or ``plot_run`` when it is first asked for (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
