"""What a method page says of its solver, read from the code: abilities, parameters, figure, sources.

```{method-facts} sns      the facts           ```{method-figure} sns     the figure, its caption, its command
```{method-sources} sns    what to cite        ```{method-table}          all methods in one table
"""

from __future__ import annotations

import inspect
import json
import re
from dataclasses import MISSING, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import cartctl as cc
from cartctl.solvers import get_solver, solver_class
from cartctl.solvers.base import Solver
from results import table

PICTURES = Path(__file__).parents[1] / "_static" / "methods"
LEVELS = ("velocity", "acceleration", "torque")
_FIELD = re.compile(r"^  (\w+) = \{(.*?)\},$", re.MULTILINE | re.DOTALL)


def levels(name: str) -> tuple[str, ...]:
    """Where a method works: one that adds an objective's rows needs a level that has them."""
    return LEVELS[:1] if solver_class(name).extends else LEVELS


def abilities(name: str) -> dict[str, str]:
    """One row of the table of methods x levels."""
    kind, solver = solver_class(name), get_solver(name)
    ranked = {True: "stacked", False: "ranked"}[kind.stacks]
    mark = {True: "✓", False: "-"}
    return {
        "method": f"`{name}`",
        **{level: mark[level in levels(name)] for level in LEVELS},
        "several tasks": ranked,
        "bounds": mark["bounds" in kind.honours],
        "rows": mark["constraints" in kind.honours],
        "null space": "own rows" if kind.extends else mark["reference" in kind.honours],
        "metric": mark[solver.takes_metric],
        "slows down": mark[kind.scales],
    }


def facts(name: str) -> list[tuple[str, str]]:
    """What the page of a method begins with, as Markdown."""
    kind, solver = solver_class(name), get_solver(name)
    row = abilities(name)
    honours = [
        *(["bounds on u"] if "bounds" in kind.honours else []),
        *(["rows of C"] if "constraints" in kind.honours else []),
        *(["inequalities at any priority"] if "inequalities" in kind.honours else []),
        *(["a reference u0 for the null space"] if "reference" in kind.honours else []),
        *(["a metric W"] if solver.takes_metric else []),
    ]
    default = [f"`{f.name} = {_default(f)}`" for f in fields(kind)]  # type: ignore[arg-type]
    public = next(n for n in cc.__all__ if inspect.isclass(getattr(cc, n)) and getattr(cc, n) is kind)
    return [
        ("In code", f'`solver="{name}"`, or {{py:class}}`cc.{public} <cartctl.{public}>`'),
        ("Levels", ", ".join(levels(name))),
        (
            "Several tasks",
            {"stacked": "as one stack of rows, by weight", "ranked": "ranked strictly"}[row["several tasks"]],
        ),
        ("Honours", ", ".join(honours) or "nothing but equations"),
        ("Parameters", ", ".join(default) or "none"),
        *([("Near singularities", "any inverse policy, `policy=`")] if hasattr(solver, "policy") else []),
        *([("Slows commands down", "yes: a path waits for the hand")] if kind.scales else []),
        *([("Proves its answer", "`solution.certificate()`")] if kind.certify is not Solver.certify else []),
        ("Its file", f"`{kind.__module__.replace('.', '/')}.py`"),
    ]


def _default(f: Any) -> str:
    value = f.default if f.default is not MISSING else f.default_factory()
    return repr(value)


@lru_cache
def captions() -> dict[str, str]:
    """The captions that docs/figures.py wrote beside its pictures."""
    found: dict[str, str] = json.loads((PICTURES / "captions.json").read_text(encoding="utf-8"))
    return found


def plain(bibtex: str) -> str:
    """One entry as a reader wants it."""
    found = {key: " ".join(value.split()) for key, value in _FIELD.findall(bibtex)}
    words = {key: re.sub(r"\\[\"'`^~]|[{}$]|\^T", "", value) for key, value in found.items() if key != "doi"}
    authors = [" ".join(reversed(author.split(", "))) for author in words["author"].split(" and ")]
    where = words.get("journal") or words.get("booktitle") or words.get("institution", "")
    volume, number = words.get("volume", ""), words.get("number", "")
    issue = f" {volume}({number})" if number else f" {volume}".rstrip()
    pages = f", {words['pages'].replace('--', '–')}" if "pages" in words else ""
    link = f" [doi:{found['doi']}](https://doi.org/{found['doi']})" if "doi" in found else ""
    link = f" [arXiv:{found['eprint']}](https://arxiv.org/abs/{found['eprint']})" if "eprint" in found else link
    return f"{', '.join(authors)}: *{words['title']}*. {where}{issue}{pages}, {words['year']}.{link}"


class _Page(SphinxDirective):
    """A directive that writes Markdown."""

    required_arguments = 1

    def markdown(self, text: str) -> list[nodes.Node]:
        """The nodes of a text."""
        box = nodes.Element()
        self.state.nested_parse(StringList(text.splitlines(), source=self.get_source_info()[0]), 0, box)
        return box.children

    @property
    def name_given(self) -> str:
        """The method; an error where there is none of this name."""
        name: str = self.arguments[0]
        if name not in cc.solvers():
            raise self.error(f"no solver {name!r}")
        return name


class Facts(_Page):
    """The facts."""

    def run(self) -> list[nodes.Node]:
        """A field list."""
        box = nodes.container(classes=["facts"])
        rows = "\n".join(f"| {key} | {value} |" for key, value in facts(self.name_given))
        box += self.markdown(f"| | |\n|---|---|\n{rows}")
        return [box]


class Picture(_Page):
    """The figure, its caption and its command."""

    def run(self) -> list[nodes.Node]:
        """A figure."""
        name = self.name_given
        self.env.note_dependency(str(PICTURES / "captions.json"))
        figure = nodes.figure(classes=["method"])
        figure += nodes.image(uri=f"/_static/methods/{name}.svg", alt=captions()[name].replace("`", ""))
        paragraph = self.markdown(captions()[name])[0]
        figure += nodes.caption("", "", *paragraph.children)
        return [figure, *self.markdown(f"```sh\npython docs/figures.py {name}\n```")]


class Sources(_Page):
    """What to cite."""

    def run(self) -> list[nodes.Node]:
        """A list for readers, and the call that prints BibTeX."""
        name = self.name_given
        entries = "\n".join(f"- {plain(entry)}" for entry in cc.cite(name).split("\n\n"))
        return self.markdown(f'{entries}\n\n`cc.cite("{name}")` or `cartctl cite {name}` prints them as BibTeX.')


class Table(SphinxDirective):
    """All methods."""

    def run(self) -> list[nodes.Node]:
        """A table with links."""
        rows = [abilities(name) for name in cc.solvers()]
        made = table(list(rows[0]), [list(row.values()) for row in rows])
        for line in list(made.findall(nodes.row))[1:]:
            cell = line[0][0]
            name = cell.astext().strip("`")
            cell.clear()
            link = nodes.reference("", "", nodes.literal(text=name), refuri=f"{name}.html", internal=True)
            cell += link
        box = nodes.container(classes=["wide"])
        box += made
        return [box]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directives."""
    kinds: dict[str, type[Directive]] = {
        "method-facts": Facts, "method-figure": Picture, "method-sources": Sources, "method-table": Table,
    }  # fmt: skip
    for name, kind in kinds.items():
        app.add_directive(name, kind)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
