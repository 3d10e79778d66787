"""A report as Markdown, and as one HTML file that asks the network for nothing."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

from cartctl.bench.contents import Cell, Section, Table, headline
from cartctl.bench.pictures import profiles, svg
from cartctl.bench.statistics import Row
from cartctl.files import whole_file
from cartctl.report.tables import escaped

TITLE = "cartctl bench"


def markdown(rows: Sequence[Row], sections: Sequence[Section], picture: str) -> str:
    """The report as Markdown; picture: where the profiles lie."""
    parts = [f"# {TITLE}\n", f"{headline(rows)}.\n"]
    for section in sections:
        parts.append(f"## {escaped(section.title)}\n")
        parts += [f"{escaped(text)}\n" for text in section.text]
        if section.figure:
            parts.append(f"![Performance profiles]({picture})\n")
        for table in section.tables:
            parts.append(_markdown_table(table))
        if section.bullets:
            parts.append("".join(f"- {escaped(text)}\n" for text in section.bullets))
    return "\n".join(parts)


def _markdown_table(table: Table) -> str:
    def cell(each: Cell) -> str:
        text = escaped(each.text)
        text = f"[{text}]({each.link})" if each.link else text
        return f"**{text}**" if each.mark == "best" else f"*{text}*" if each.mark == "wrong" else text

    lines = [f"| {' | '.join(escaped(head) for head in table.heads)} |", "|---" * len(table.heads) + "|"]
    lines += [f"| {' | '.join(cell(each) for each in row)} |" for row in table.rows]
    title = f"### {escaped(table.title)}\n\n" if table.title else ""
    note = f"\n{escaped(table.note)}\n" if table.note else ""
    return title + "\n".join(lines) + "\n" + note


def page(rows: Sequence[Row], sections: Sequence[Section]) -> str:
    """The report as one HTML file."""
    body = "".join(_section(rows, section, f"s{k}") for k, section in enumerate(sections))
    links = "".join(f'<a href="#s{k}">{escape(section.title)}</a>' for k, section in enumerate(sections))
    folder = files("cartctl.bench") / "page"
    template = Template((folder / "report.html").read_text(encoding="utf-8"))
    style = (folder / "report.css").read_text(encoding="utf-8")
    return template.substitute(title=TITLE, headline=escape(headline(rows)), style=style, links=links, body=body)


def _section(rows: Sequence[Row], section: Section, anchor: str) -> str:
    text = "".join(f"<p>{escape(each)}</p>" for each in section.text)
    figure = f"<figure>{svg(profiles(rows))}</figure>" if section.figure else ""
    tables = "".join(map(_table, section.tables))
    bullets = "".join(f"<li>{escape(each)}</li>" for each in section.bullets)
    listed = f"<ul>{bullets}</ul>" if bullets else ""
    return f'<section id="{anchor}"><h2>{escape(section.title)}</h2>{text}{figure}{tables}{listed}</section>'


def _table(table: Table) -> str:
    heads = "".join(f'<th scope="col">{escape(head)}</th>' for head in table.heads) if any(table.heads) else ""
    numeric = [k > 0 and all(_is_number(row[k].text) for row in table.rows) for k in range(len(table.heads))]
    lines = []
    for row in table.rows:
        first = f'<th scope="row"{_class(row[0].mark)}>{_cell(row[0])}</th>'
        rest = (f"<td{_class(c.mark, numeric[k])}>{_cell(c)}</td>" for k, c in enumerate(row[1:], start=1))
        lines.append(f"<tr>{first}{''.join(rest)}</tr>")
    note = f'<p class="note">{escape(table.note)}</p>' if table.note else ""
    head = f"<thead><tr>{heads}</tr></thead>" if heads else ""
    made = f'<div class="wide"><table>{head}<tbody>{"".join(lines)}</tbody></table></div>'
    if not table.fold:
        return made + note
    return f"<details><summary>{escape(table.title)}</summary>{note}{made}</details>"


def _cell(cell: Cell) -> str:
    text = escape(cell.text)
    return f'<a href="{escape(cell.link)}">{text}</a>' if cell.link else text


def _class(mark: str, numeric: bool = False) -> str:
    names = " ".join(filter(None, (mark, "n" if numeric else "")))
    return f' class="{names}"' if names else ""


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == "-"
    return True


def write(text: str, path: Path) -> Path:
    """Write a text file whole or not at all."""
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return path
