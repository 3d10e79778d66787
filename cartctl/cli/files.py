"""The files of a run: named after what was run, written one by one, shown as they lie."""

from __future__ import annotations

import re
import webbrowser
from collections.abc import Callable
from pathlib import Path

from cartctl.cli.console import busy, say
from cartctl.errors import ParameterError
from cartctl.motion.run import Run
from cartctl.report import Comparison

_PICTURES = (".html", ".png")


class Files:
    """Where a run's files go: ``<folder>/<robot>-<path>-<solver>.*``; makes the folder, raises ParameterError."""

    def __init__(self, folder: Path, *parts: str) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            reason = error.strerror or error
            raise ParameterError(f"--out is {str(folder)!r}: {reason}; expected a folder that can be written") from None
        self._folder, self._parts = folder, [_safe(part) for part in parts]

    def at(self, suffix: str) -> Path:
        """The file with this suffix."""
        return self._folder / ("-".join(self._parts) + suffix)

    def sibling(self, last: str, suffix: str) -> Path:
        """The same with another last part."""
        return self._folder / ("-".join([*self._parts[:-1], last]) + suffix)

    def write(self, run: Run, *, csv: bool, parquet: bool) -> list[tuple[str, str]]:
        """Write ``run`` and return (path, what it is); pictures need more than one sample."""
        writers: list[tuple[str, Callable[[Path], object], str]] = [(".npz", run.save, "every step, for cc.Run.load")]
        if len(run.time) > 1:
            writers.insert(0, (".html", run.html, "the moving robot, for your browser"))
            writers.append((".png", run.plot, "the figures over time"))
        if csv:
            writers.append((".csv", run.to_csv, "every step as text"))
        if parquet:
            writers.append((".parquet", run.to_parquet, "every step as a table"))
        return self._written(writers)

    def write_comparison(self, comparison: Comparison) -> list[tuple[str, str]]:
        """Write ``comparison`` and return (path, what it is)."""
        return self._written([
            (".html", comparison.html, "the moving robots, for your browser"),
            (".png", comparison.plot, "the figures over time"),
            (".md", comparison.to_markdown, "the table, to be read"),
            (".csv", comparison.to_csv, "the table, to be worked on"),
        ])  # fmt: skip

    def _written(self, writers: list[tuple[str, Callable[[Path], object], str]]) -> list[tuple[str, str]]:
        # Data first: they cannot be made again. Then what takes no time.
        for suffix, write, _ in sorted(writers, key=lambda writer: (writer[0] != ".npz", writer[0] in _PICTURES)):
            with busy(f"writing {self.at(suffix)}"):
                write(self.at(suffix))
        return [(str(self.at(suffix)), what) for suffix, _, what in writers]


def show(page: Path) -> None:
    """Open a page in the user's browser, or say that there is none."""
    if not webbrowser.open(page.resolve().as_uri()):
        say("warning", f"no browser found; open {page} yourself", "bold yellow")


def _safe(name: str) -> str:
    """A name as part of a file name: a URDF may call its robot ``../../x``."""
    return re.sub(r"[^\w.+-]+", "_", name).strip("._") or "robot"
