"""Several runs of the same robot and tasks side by side: a table, a figure, a page."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from cartctl.errors import ParameterError
from cartctl.objectives import JointRange, Objective
from cartctl.report.figures import Figure, figures
from cartctl.report.numbers import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Plot

    from cartctl.motion.metrics import Metrics
    from cartctl.motion.run import Run

Cell = float | None


class Comparison:
    """Runs of at least one step each, under the name of each, and those that never came to be.

    runs: name -> Run, or a sequence of Runs named after their solvers; all of the same robot and tasks. refused: name
    -> reason. notes: name -> what else to say of it. objective: what the ends are judged by, whether a run was led by
    it or not; by default the distance of the joints from mid-range. Raises ParameterError.
    """

    def __init__(
        self,
        runs: Mapping[str, Run] | Sequence[Run],
        *,
        refused: Mapping[str, str] | None = None,
        notes: Mapping[str, str] | None = None,
        objective: Objective | None = None,
    ) -> None:
        self.runs: dict[str, Run] = dict(runs) if isinstance(runs, Mapping) else _named(runs)
        self.refused, self.notes = dict(refused or {}), dict(notes or {})
        self.objective: Objective = objective or JointRange()
        _check(self.runs)

    @property
    def first(self) -> Run:
        """The run that the others are laid over."""
        return next(iter(self.runs.values()))

    @cached_property
    def columns(self) -> list[Figure]:
        """What is compared."""
        return figures(self.first, self.objective)

    @cached_property
    def metrics(self) -> dict[str, Metrics]:
        """The metrics of each run."""
        return {name: run.metrics() for name, run in self.runs.items()}

    @cached_property
    def rows(self) -> dict[str, list[Cell]]:
        """Name -> one figure a column, None where there is none."""
        return {
            name: [column.value(run, self.metrics[name]) for column in self.columns] for name, run in self.runs.items()
        }

    def shown(self, name: str) -> list[str]:
        """A run's figures with three digits."""
        return [_text(column, value) for column, value in zip(self.columns, self.rows[name], strict=True)]

    def best(self, index: int) -> set[str]:
        """The names that are best in a column as it is shown; none where all are the same."""
        column, texts = self.columns[index], {name: self.shown(name)[index] for name in self.runs}
        values = {name: value for name in self.runs if (value := self.rows[name][index]) is not None}
        if not column.best or len(set(texts.values())) < 2 or not values:
            return set()
        top = (min if column.best == "low" else max)(values, key=lambda name: values[name])
        return {name for name, text in texts.items() if text == texts[top]}

    def wrong(self, name: str, index: int) -> bool:
        """Whether a figure lies beyond what it may be."""
        value, limit = self.rows[name][index], self.columns[index].limit
        return value is not None and limit is not None and value > limit * (1.0 + 1e-9)

    def remark(self, name: str) -> str:
        """How the steps went, and the notes; of a refused one the reason."""
        if name in self.refused:
            return f"refused: {self.refused[name]}"
        counts = sorted(self.metrics[name].status.items(), key=lambda item: -item[1])
        status = ", ".join(f"{word} {count}" for word, count in counts) if len(counts) > 1 else counts[0][0]
        early = "interrupted" if self.runs[name].interrupted else ""
        return "; ".join(filter(None, (status, early, self.notes.get(name, ""))))

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the table as CSV, in full precision."""
        from cartctl.report.tables import to_csv

        return to_csv(self, Path(path))

    def to_markdown(self, path: str | os.PathLike[str]) -> Path:
        """Write the table as Markdown, the best of each column in bold."""
        from cartctl.report.tables import to_markdown

        return to_markdown(self, Path(path))

    def plot(self, path: str | os.PathLike[str] | None = None) -> Plot:
        """A figure with the runs laid over each other; written to ``path`` if given."""
        from cartctl.report.overlay import plot_comparison
        from cartctl.report.saving import save_figure

        figure = plot_comparison(self)
        if path is not None:
            save_figure(figure, path)
        return figure

    def html(self, path: str | os.PathLike[str]) -> Path:
        """One self-contained HTML file: the robots of all runs in one scene, each to be switched on and off."""
        from cartctl.report.comparison_page import write_comparison_html

        return write_comparison_html(self, path)


def _named(runs: Sequence[Run]) -> dict[str, Run]:
    """Runs under the names of their solvers, numbered where a name comes again."""
    named: dict[str, Run] = {}
    for run in runs:
        name = solver = str(run.meta.get("solver", "run"))
        count = 1
        while name in named:
            count += 1
            name = f"{solver} ({count})"
        named[name] = run
    return named


def _check(runs: Mapping[str, Run]) -> None:
    if not runs:
        raise ParameterError("runs is empty; expected at least one Run to compare")
    kinds = {}
    for name, run in runs.items():
        if not len(run):
            raise ParameterError(f"run {name!r} holds no step; expected at least one")
        tasks = tuple((task.name, tuple(task.units)) for task in run.tasks)
        kinds[name] = (run.q.shape[1], tuple(run.robot.dof_names), tasks)
    first = next(iter(kinds))
    for name, kind in kinds.items():
        if kind != kinds[first]:
            raise ParameterError(f"runs {first!r} and {name!r} differ in robot or tasks; expected the same in all")


def _text(column: Figure, value: Cell) -> str:
    if value is not None and column.unit == "samples":
        return f"{value:.0f}"
    return number(value)
