"""How methods compare over many scenarios: performance profiles and shifted geometric means.

A cell is one scenario at one level, one repetition, one seed; there every method has one value t > 0 of a figure, less
is better (of a figure that should be high, t is one over it). Values below the figure's floor count as the floor. A
run that is not valid (refused, failed, outside limits, inside an obstacle) has none: t = infinity; a time it has if it
was done at all.

Profile of a method (Dolan & More 2002): rho(tau), the share of cells in which t <= tau times the best t of the cell.
Shifted geometric mean: exp(mean(log(t + s))) - s, s the median of all finite t, with PENALTY times the worst finite t
of its cell for infinity; shown in multiples of the best method's, which is 1.0. Cells in which no method has a value
are left out of both.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl.bench.schema import BY_NAME, TIMES
from cartctl.checks import FloatArray

PENALTY = 10.0
Row = Mapping[str, Any]
CellKey = tuple[str, str, int, int]


def cell_of(row: Row) -> CellKey:
    """Scenario, level, repetition, seed."""
    return str(row["scenario"]), str(row["level"]), int(row["repeat"]), int(row["seed"])


@dataclass(frozen=True)
class Scores:
    """Values of one figure: t (cells, methods), infinity where there is none; every cell has one at least."""

    figure: str
    solvers: tuple[str, ...]
    cells: tuple[CellKey, ...]
    t: FloatArray

    def ratios(self) -> FloatArray:
        """(cells, methods) over the best of the cell."""
        return self.t / self.t.min(axis=1, keepdims=True, initial=math.inf) if self.t.size else self.t

    def profile(self, taus: FloatArray) -> FloatArray:
        """The share rho (methods, taus) of cells."""
        if not len(self.cells):
            return np.zeros((len(self.solvers), len(taus)))
        return np.asarray((self.ratios()[:, :, None] <= taus * (1.0 + 1e-12)).mean(axis=0), dtype=np.float64)

    def means(self) -> dict[str, float]:
        """The shifted geometric mean of each method in multiples of the best; empty without a cell."""
        if not len(self.cells):
            return {}
        finite = np.isfinite(self.t)
        shift = float(np.median(self.t[finite]))
        worst = np.where(finite, self.t, 0.0).max(axis=1, keepdims=True)
        filled = np.where(finite, self.t, PENALTY * worst)
        mean = np.exp(np.log(filled + shift).mean(axis=0)) - shift
        return {name: float(m / mean.min()) for name, m in zip(self.solvers, mean, strict=True)}


def scores(rows: Iterable[Row], figure: str) -> Scores:
    """The values of ``figure`` in all cells where somebody has one."""
    column = BY_NAME[figure]
    cells: dict[CellKey, dict[str, float]] = {}
    solvers: dict[str, None] = {}
    for row in rows:
        solvers.setdefault(str(row["solver"]))
        values = cells.setdefault(cell_of(row), {})
        value = row[figure]
        counts = row["outcome"] == "done" if figure in TIMES else row["valid"]
        if counts and value is not None:
            low = max(float(value), column.floor)
            values[str(row["solver"])] = 1.0 / low if column.better == "high" else low
    kept = {cell: values for cell, values in cells.items() if values}
    t = np.array([[values.get(name, math.inf) for name in solvers] for values in kept.values()], dtype=np.float64)
    return Scores(figure, tuple(solvers), tuple(kept), t.reshape(len(kept), len(solvers)))


def present(rows: Sequence[Row]) -> list[Row]:
    """Rows of methods that were there at all: of a peer that is not installed nothing can be said."""
    there = {row["solver"] for row in rows if row["outcome"] != "skipped"}
    return [row for row in rows if row["solver"] in there]


@dataclass(frozen=True)
class Tally:
    """How many runs of a method went how."""

    runs: int
    done: int
    valid: int
    solved: int


def ranking(rows: Sequence[Row], figure: str | None) -> list[str]:
    """Methods by how many runs they solved, then how many are valid, then their mean of the figure."""
    counts = tallies(rows)
    means = {} if figure is None else scores(rows, figure).means()
    return sorted(counts, key=lambda name: (-counts[name].solved, -counts[name].valid, means.get(name, 0.0)))


def tallies(rows: Sequence[Row]) -> dict[str, Tally]:
    """By method."""
    names = dict.fromkeys(str(row["solver"]) for row in rows)
    mine = {name: [row for row in rows if row["solver"] == name] for name in names}
    return {
        name: Tally(
            len(some),
            sum(row["outcome"] == "done" for row in some),
            sum(bool(row["valid"]) for row in some),
            sum(bool(row["solved"]) for row in some),
        )
        for name, some in mine.items()
    }
