"""A comparison as a table in a file: CSV in full precision, Markdown to be read."""

from __future__ import annotations

import csv
from pathlib import Path

from cartctl.files import whole_file
from cartctl.report.comparison import Comparison


def to_csv(comparison: Comparison, path: Path) -> Path:
    """Write one row a solver; those that refused have no figures."""
    with whole_file(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["solver", *(column.title for column in comparison.columns), "remark"])
        writer.writerows([name, *values, comparison.remark(name)] for name, values in comparison.rows.items())
        empty = [None] * len(comparison.columns)
        writer.writerows([name, *empty, comparison.remark(name)] for name in comparison.refused)
    return path


def to_markdown(comparison: Comparison, path: Path) -> Path:
    """Write the same with three digits, the best of each column in bold."""
    best = [comparison.best(index) for index in range(len(comparison.columns))]
    lines = [["solver", *(escaped(column.title) for column in comparison.columns), "remark"]]
    lines.append(["---", *(["---:"] * len(best)), "---"])
    for name in comparison.runs:
        cells = (f"**{text}**" if name in best[i] else text for i, text in enumerate(comparison.shown(name)))
        lines.append([escaped(name), *cells, escaped(comparison.remark(name))])
    lines += [[escaped(name), *("" for _ in best), escaped(comparison.remark(name))] for name in comparison.refused]
    with whole_file(path) as part:
        part.write_text("".join(f"| {' | '.join(line)} |\n" for line in lines), encoding="utf-8", newline="\n")
    return path


def escaped(text: str) -> str:
    """A cell of a Markdown table: nothing in it ends the cell or starts an element."""
    for sign in "\\|<>*_`[]":
        text = text.replace(sign, "\\" + sign)
    return " ".join(text.split())
