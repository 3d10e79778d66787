"""From results to a report: Markdown, one HTML page, the profiles' figure, replays of the worst cases."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from cartctl import checks
from cartctl.bench import pictures, writing
from cartctl.bench.contents import contents, worst_cases
from cartctl.bench.replays import FOLDER, write_replays
from cartctl.bench.statistics import Row
from cartctl.errors import ParameterError

NAMES = ("report.html", "report.md", "profiles.png")


@dataclass(frozen=True)
class Report:
    """What was written: the files, and replays that could not be made, with the reason."""

    files: list[Path]
    replays: dict[str, str]
    troubles: list[str]


def report(
    rows: Sequence[Row], folder: str | Path, *, replays: int = 3, tell: Callable[[str], None] | None = None
) -> Report:
    """Write ``folder/report.html``, ``report.md``, ``profiles.png`` and the pages of the worst ``replays`` runs.

    rows: of :func:`cartctl.bench.results`. Raises FileError where the folder cannot be written, ParameterError.
    """
    folder, replays = Path(folder), checks.whole("replays", replays, 0)
    if not isinstance(rows, Sequence) or not rows or not all(isinstance(row, dict) and "key" in row for row in rows):
        raise ParameterError(f"rows is {rows!r:.60}; expected the rows of cc.bench.results(folder), at least one")
    cases = [row for row, _ in worst_cases(rows)[:replays]]
    links, troubles = write_replays(cases, folder / FOLDER, tell)
    sections = contents(rows, links)
    page, text, picture = (folder / name for name in NAMES)
    writing.write(writing.page(rows, sections), page)
    pictures.save(pictures.profiles(rows), picture)
    writing.write(writing.markdown(rows, sections, picture.name), text)
    return Report([page, text, picture], links, troubles)
