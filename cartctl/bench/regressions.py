"""Two benches of the same runs side by side: what became worse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from cartctl.bench.journal import case
from cartctl.bench.schema import BY_NAME, FIGURES, TIMES
from cartctl.errors import ParameterError

WATCHED = tuple(name for name in FIGURES if name not in TIMES)
_ORDER = {"done": 0, "ran away": 1, "refused": 2, "skipped": 2, "failed": 3}


class Regression(NamedTuple):
    """A run that became worse. figure: or "outcome", "valid", "solved", "gone"."""

    scenario: str
    solver: str
    level: str
    figure: str
    before: Any
    after: Any


class Verdict(NamedTuple):
    """What a comparison found. compared: runs of both; gone, new: of one of them alone."""

    regressions: list[Regression]
    improvements: list[Regression]
    compared: int
    gone: int
    new: int


def compare(
    before: Sequence[dict[str, Any]],
    after: Sequence[dict[str, Any]],
    tolerance: float = 0.05,
    figures: Sequence[str] = WATCHED,
    *,
    allow_missing: bool = False,
) -> Verdict:
    """What became worse, or better, by more than ``tolerance`` (a share) beyond the figure's floor; ParameterError.

    Runs are matched by scenario, method, level, repetition and seed. Gone runs are regressions unless allowed.
    """
    if not tolerance >= 0.0:
        raise ParameterError(f"tolerance is {tolerance!r}; expected a share of at least 0, such as 0.05")
    for name in figures:
        if name not in FIGURES:
            raise ParameterError(f"figure {name!r} is not one of {', '.join(FIGURES)}")
    old, new = ({case(row): row for row in rows} for rows in (before, after))
    worse: list[Regression] = []
    better: list[Regression] = []
    for which, row in old.items():
        if which in new:
            _weigh(row, new[which], tolerance, figures, worse, better)
        elif not allow_missing:
            worse.append(_entry(row, "gone", row["outcome"], "missing"))
    both = len(old.keys() & new.keys())
    return Verdict(worse, better, both, len(old) - both, len(new) - both)


def _entry(row: dict[str, Any], figure: str, before: Any, after: Any) -> Regression:
    return Regression(row["scenario"], row["solver"], row["level"], figure, before, after)


def _weigh(
    a: dict[str, Any],
    b: dict[str, Any],
    tolerance: float,
    figures: Sequence[str],
    worse: list[Regression],
    better: list[Regression],
) -> None:
    if _ORDER[a["outcome"]] != _ORDER[b["outcome"]]:
        list_ = worse if _ORDER[b["outcome"]] > _ORDER[a["outcome"]] else better
        list_.append(_entry(a, "outcome", a["outcome"], b["outcome"]))
        return
    for name in ("valid", "solved"):
        if a[name] != b[name]:
            (worse if a[name] else better).append(_entry(a, name, a[name], b[name]))
    for name in figures:
        x, y = a[name], b[name]
        if x is None and y is None:
            continue
        if x is None or y is None:
            (worse if y is None else better).append(_entry(a, name, x, y))
            continue
        column = BY_NAME[name]
        change = (y - x) if column.better == "low" else (x - y)
        if abs(change) > tolerance * abs(x) + column.floor:
            (worse if change > 0.0 else better).append(_entry(a, name, x, y))
