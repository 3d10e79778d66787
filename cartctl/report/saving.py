"""Figures as files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from cartctl import checks
from cartctl.files import whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure, whole or not at all; the suffix says as what, PNG without one. Raises ParameterError."""
    kind = Path(path).suffix[1:].lower() or "png"
    checks.choice("the plot's file type", kind, sorted(figure.canvas.get_supported_filetypes()))
    with whole_file(path) as part:
        figure.savefig(part, dpi=150, format=kind)
