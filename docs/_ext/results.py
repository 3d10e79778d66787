"""Numbers and tables that are read from benchmarks/results when the site is built, so that they cannot go stale.

    {result}`torque_norms.csv; motion=short; null_space=damped; weight=I; peak_torque_nm`

is one cell: the file, conditions that leave exactly one row, and a column. The directive ``results`` is a table:

    ```{results} torque_norms.csv
    :where: motion=long; null_space=damped
    :columns: weight, peak_torque_nm = peak torque (N m)
    ```
"""

from __future__ import annotations

import csv
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective, SphinxRole

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"


@lru_cache
def read(name: str) -> tuple[dict[str, str], ...]:
    """Every row of a file of results; raises FileNotFoundError."""
    with (RESULTS / name).open(newline="", encoding="utf-8") as file:
        return tuple(csv.DictReader(file))


def select(name: str, conditions: list[str]) -> list[dict[str, str]]:
    """The rows that meet every ``column=value``, or ``column=value|value``; raises KeyError."""
    rows = list(read(name))
    for condition in conditions:
        column, _, values = condition.partition("=")
        rows = [row for row in rows if row[column.strip()] in [value.strip() for value in values.split("|")]]
    return rows


def cell(text: str) -> str:
    """One number as the file has it; raises KeyError, ValueError where no row or several are left."""
    name, *conditions, column = (part.strip() for part in text.split(";"))
    rows = select(name, conditions)
    if len(rows) != 1:
        raise ValueError(f"{text!r}: {len(rows)} rows of {name} are left; expected one")
    return rows[0][column]


class Result(SphinxRole):
    """One cell."""

    def run(self) -> tuple[list[nodes.Node], list[Any]]:
        """The number, its file as a tooltip."""
        self.env.note_dependency(str(RESULTS / self.text.partition(";")[0].strip()))
        return [nodes.inline(self.rawtext, cell(self.text), classes=["result"])], []


class Results(SphinxDirective):
    """A table."""

    required_arguments = 1
    option_spec: ClassVar = {
        "where": directives.unchanged, "columns": directives.unchanged_required, "bold": directives.unchanged,
    }  # fmt: skip

    def run(self) -> list[nodes.Node]:
        """The rows that are left, and below them the file and when it was measured."""
        name = self.arguments[0]
        self.env.note_dependency(str(RESULTS / name))
        conditions = [part for part in self.options.get("where", "").split(";") if part.strip()]
        rows = select(name, conditions)
        if not rows:
            raise self.error(f"no row of {name} meets {conditions}")
        columns = [part.partition("=") for part in self.options["columns"].split(",")]
        heads = [(key.strip(), (head or key).strip()) for key, _, head in columns]
        cells = [[row[key] or "-" for key, _ in heads] for row in rows]
        box = nodes.container(classes=["wide"])
        box += table([head for _, head in heads], cells)
        measured = ", ".join(rows[0][key] for key in ("date", "machine") if key in rows[0])
        note = nodes.paragraph("", "", nodes.literal(text=f"benchmarks/results/{name}"), classes=["measured"])
        note += nodes.Text(f", {measured}")
        return [box, note]


def table(heads: list[str], rows: list[list[str]]) -> nodes.table:
    """A plain table of text."""
    group = nodes.tgroup(cols=len(heads))
    group.extend(nodes.colspec(colwidth=1) for _ in heads)

    def line(cells: list[str]) -> nodes.row:
        return nodes.row("", *(nodes.entry("", nodes.paragraph(text=text)) for text in cells))

    group += nodes.thead("", line(heads))
    group += nodes.tbody("", *(line(cells) for cells in rows))
    return nodes.table("", group, classes=["results"])


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the role ``result`` and the directive ``results``."""
    app.add_role("result", Result())
    app.add_directive("results", Results)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
