"""One self-contained HTML file with the moving robot: opens anywhere, asks the network for nothing."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cartctl.errors import ParameterError
from cartctl.files import whole_file
from cartctl.report.document import Words, assemble, breakable
from cartctl.report.run_curves import run_panels

if TYPE_CHECKING:
    from cartctl.motion.run import Run


def write_html(run: Run, path: str | os.PathLike[str]) -> Path:
    """Write ``run`` to ``path`` as one HTML file and return its path; missing folders are made.

    The file appears only when it is complete. Raises ParameterError if ``path`` is a folder.
    """
    text = page(run)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return Path(path)


def page(run: Run) -> str:
    """Return the page of ``run`` as text; raises ParameterError for a run without a sample."""
    if not len(run.time):
        raise ParameterError("the run holds no sample; expected one that was simulated for at least a step")
    what = _subtitle(run)
    words = Words(f"{run.robot.name}: {what}", breakable(run.robot.name), what, _errors(run))
    return assemble([run], words, panels=run_panels(run))


def _subtitle(run: Run) -> str:
    """Return what was run, in one line."""
    steps = len(run.time) - 1
    parts = [str(run.meta.get("solver", "")), f"{run.meta['level']} level" if run.meta.get("level") else ""]
    parts.append(f"{float(run.time[-1] - run.time[0]):.2f} s in {steps} step{'' if steps == 1 else 's'}")
    parts.append("interrupted" if run.interrupted else "")
    return " · ".join(p for p in parts if p)


def _errors(run: Run) -> str:
    """Return a table of the tracking errors of the tasks that have a place in the world."""
    if not len(run):
        return ""
    rows = "".join(
        f'<tr><th scope="row">{breakable(task.name)}</th>{"".join(f"<td>{cell}</td>" for cell in _cells(task))}</tr>'
        for task in run.metrics().tasks
        if task.rms_m is not None or task.rms_rad is not None
    )
    head = "<tr><th>error</th><th>RMS</th><th>largest</th></tr>"
    return f"<table><thead>{head}</thead><tbody>{rows}</tbody></table>" if rows else ""


def _cells(task: Any) -> Iterator[str]:
    for metre, radian in ((task.rms_m, task.rms_rad), (task.max_m, task.max_rad)):
        pairs = ((metre, ("m", "mm", "µm", "nm")), (radian, ("rad", "mrad", "µrad", "nrad")))
        yield "<br>".join(quantity(value, units) for value, units in pairs if value is not None)


def quantity(value: float, units: tuple[str, ...]) -> str:
    """Return ``value`` with three digits, in the first unit that gives 1 or more.

    Each of ``units`` is a thousandth of the one before; ``value`` is in the first.
    """
    for k, unit in enumerate(units):
        if abs(value) * 1000**k >= 1 or k == len(units) - 1:
            number = value * 1000**k
            return f"{number:.3g} {unit}" if abs(number) >= 0.01 else f"0 {unit}"
    return ""
