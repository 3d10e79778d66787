"""One self-contained HTML file with the robots of several runs in one scene, and their table."""

from __future__ import annotations

import os
from html import escape
from pathlib import Path

from cartctl.files import whole_file
from cartctl.report.comparison import Comparison
from cartctl.report.comparison_curves import comparison_panels
from cartctl.report.document import Words, assemble, breakable
from cartctl.report.palette import COLORS, color


def write_comparison_html(comparison: Comparison, path: str | os.PathLike[str]) -> Path:
    """Write ``comparison`` to ``path`` as one HTML file and return its path; missing folders are made.

    The file appears only when it is complete. Raises ParameterError if ``path`` is a folder.
    """
    text = comparison_page(comparison)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return Path(path)


def comparison_page(comparison: Comparison) -> str:
    """Return the page as text: the first robot as it is, the others as ghosts, a table that switches them."""
    runs = list(comparison.runs.values())
    name, count = comparison.first.robot.name, len(runs)
    level = f" · {comparison.first.meta['level']} level" if comparison.first.meta.get("level") else ""
    longest = max(float(run.time[-1] - run.time[0]) for run in runs)
    what = f"{count} solver{'s' if count > 1 else ''}{level} · {longest:.2f} s"
    colors = [color(k) for k in range(count)]
    solid = next(iter(comparison.runs))
    caption = f"<p>{escape(solid)} is solid, the others are ghosts</p>" if count > 1 else ""
    traced = "" if count > 1 else "actual path"  # the table shows the colours
    below = _table(comparison, colors)
    words = Words(f"{name}: {what}", breakable(name), what, caption, below, traced)
    return assemble(runs, words, colors, comparison_panels(comparison, colors))


def _table(comparison: Comparison, colors: list[str]) -> str:
    """Return the table of all figures; a run's name is the switch that shows and hides its robot."""
    best = [comparison.best(index) for index in range(len(comparison.columns))]
    heads = "".join(
        f'<th scope="col">{"<br>".join(escape(line) for line in (c.head, c.name, c.unit))}</th>'
        for c in comparison.columns
    )
    rows = [
        f'<tr><th scope="row">{_switch(k, name, colors[k])}</th>{_cells(comparison, name, best)}'
        f"<td>{escape(comparison.remark(name))}</td></tr>"
        for k, name in enumerate(comparison.runs)
    ]
    for name in comparison.refused:
        reason = f'<td colspan="{len(best) + 1}">{escape(comparison.remark(name))}</td>'
        rows.append(f'<tr class="refused"><th scope="row">{escape(name)}</th>{reason}</tr>')
    head = f'<tr><th scope="col">{_everything(len(colors))}</th>{heads}<th scope="col">remark</th></tr>'
    return f'<section id="runs"><table><thead>{head}</thead><tbody>{"".join(rows)}</tbody></table></section>'


def _switch(index: int, name: str, tint: str) -> str:
    box = f'<input type="checkbox" data-run="{index}" autocomplete="off" checked>'
    dashed = ' class="dashed"' if index >= len(COLORS) else ""  # as its lines are in the figure
    return f'<label>{box}<i{dashed} style="color:{tint}"></i>{escape(name)}</label>'


def _everything(count: int) -> str:
    """Return the switch of all runs."""
    box = '<input type="checkbox" id="all" autocomplete="off" checked>'
    return f"<label>{box}solver</label>" if count > 1 else "solver"


def _cells(comparison: Comparison, name: str, best: list[set[str]]) -> str:
    cells = []
    for index, text in enumerate(comparison.shown(name)):
        kind = "wrong" if comparison.wrong(name, index) else "best" if name in best[index] else ""
        cells.append(f'<td class="{kind}">{escape(text)}</td>' if kind else f"<td>{escape(text)}</td>")
    return "".join(cells)
