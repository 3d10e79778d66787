"""How several runs went, as tables that fit the terminal: as few as its width allows."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from cartctl.cli.console import columns
from cartctl.report import Comparison

_WORDS = -1  # stands for the column of words
_LONG = 20  # letters of a name on one line
_PLAIN = str.maketrans({"σ": "sigma", "µ": "u", "²": "^2"})  # for terminals that know ASCII only
_FOLDED = 40  # columns that words need at the least
_ENDLESS = 10_000


def tables(comparison: Comparison, console: Console) -> Iterator[Table]:
    """All figures of ``comparison``; columns that belong together stay together."""
    groups = [[i for i, _ in group] for _, group in groupby(enumerate(comparison.columns), lambda pair: pair[1].group)]
    block: list[int] = []
    plain = console.options.ascii_only
    for group in [*groups, [_WORDS]]:
        if block and _width(comparison, [*block, *group], console) > console.width:
            yield _table(comparison, block, plain)
            block = []
        block += group
    yield _table(comparison, block, plain)


def _width(comparison: Comparison, chosen: list[int], console: Console) -> int:
    """What a table would like to have; words can be folded."""
    numbers = _table(comparison, [i for i in chosen if i != _WORDS], plain=False)
    wanted = Measurement.get(console, console.options.update(width=_ENDLESS), numbers).maximum
    return wanted + (_WORDS in chosen) * _FOLDED


def _table(comparison: Comparison, chosen: list[int], plain: bool) -> Table:
    """Some of the columns; solvers that refused only where the words are."""
    numbers = [i for i in chosen if i != _WORDS]
    figures = [comparison.columns[i] for i in numbers]
    heads = [c.head if i == 0 or c.head != figures[i - 1].head else "" for i, c in enumerate(figures)]
    titles = ["\n".join((head, c.name, c.unit)) for head, c in zip(heads, figures, strict=True)]
    table = columns("solver", *(title.translate(_PLAIN) if plain else title for title in titles))
    rows = {name: [_cell(comparison, name, i) for i in numbers] for name in comparison.runs}
    if _WORDS in chosen:
        table.add_column("how it went", overflow="fold")
        rows |= {name: [Text("-") for _ in numbers] for name in comparison.refused}
        for name, cells in rows.items():
            cells.append(Text(comparison.remark(name)))
    for column in table.columns:
        column.vertical = "bottom" if numbers else "top"
    for name, cells in rows.items():
        table.add_row(_folded(name), *cells)
    return table


def _folded(name: str) -> str:
    """A long name in two lines, parted at a hyphen."""
    cut = name.rfind("-", 0, _LONG) + 1
    return name if len(name) <= _LONG or not cut else f"{name[:cut]}\n  {name[cut:]}"


def _cell(comparison: Comparison, name: str, index: int) -> Text:
    style = "bold red" if comparison.wrong(name, index) else "bold" if name in comparison.best(index) else ""
    return Text(comparison.shown(name)[index], style=style)
