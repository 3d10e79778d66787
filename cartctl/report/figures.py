"""The figures by which runs are compared: each a column of a table."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cartctl.objectives import Objective

if TYPE_CHECKING:
    from cartctl.model.robot import Robot
    from cartctl.motion.metrics import Metrics, TaskMetrics
    from cartctl.motion.run import Run, TaskRecord

_SPREADS = (("m", "mm", "position"), ("rad", "mrad", "orientation"))
_PARTS = (("rms", "RMS"), ("max", "largest"), ("final", "end"))


@dataclass(frozen=True)
class Figure:
    """One figure of a run.

    group: columns of one group stay together. head, name, unit: the three lines of its heading. value: of a run and
    its metrics, None where there is none. best: "low" or "high" where one end is better. limit: beyond it something is
    wrong.
    """

    group: str
    head: str
    name: str
    unit: str
    value: Callable[[Run, Metrics], float | None]
    best: str = ""
    limit: float | None = None

    @property
    def title(self) -> str:
        """The heading in one line."""
        return f"{self.head} {self.name}".strip() + (f" ({self.unit})" if self.unit else "")


def figures(run: Run, objective: Objective) -> list[Figure]:
    """The columns that fit ``run`` and all runs of the same robot and tasks."""
    unit = joint_unit(run.robot)
    square = "rad²/s" if unit == "rad" else "m²/s" if unit == "m" else ""
    head, _, name = objective_name(objective).rpartition(" ")
    end = "high" if objective.maximise else "low"
    return [
        *(column for index, record in enumerate(run.tasks) for column in _errors(index, record, len(run.tasks) > 1)),
        Figure("limits", "outside", "limits", "samples", lambda _, m: m.violations, limit=0.0),
        Figure("limits", "peak", "rate", "%", _peak_rate, limit=100.0),
        Figure("joints", "least", "σ", "", lambda _, m: _least(m), "high"),
        Figure("joints", "drift", "a lap", unit, lambda _, m: m.path_drift, "low"),
        Figure("cost", "", "effort", square, lambda _, m: m.effort, "low"),
        Figure("cost", head, name, "at end", lambda r, _: final_value(r, objective), end),
        Figure("cost", "median", "step", "µs", lambda _, m: 1e6 * m.step_p50, "low"),
    ]


def joint_unit(robot: Robot) -> str:
    """The unit that all joints share, "" where they do not."""
    linear = [name not in robot.single_joints or robot.is_prismatic(name) for name in robot.dof_names]
    return "rad" if not any(linear) else "m" if all(linear) and robot.single_joints else ""


def objective_name(objective: Objective) -> str:
    """``joint range`` for JointRange."""
    name = type(objective).__name__
    return "".join(f" {c.lower()}" if c.isupper() and i else c.lower() for i, c in enumerate(name))


def final_value(run: Run, objective: Objective) -> float:
    """The objective where the run ended."""
    return float(objective.value(run.robot.state(run.q[-1])))


def _errors(index: int, record: TaskRecord, named: bool) -> Iterator[Figure]:
    """A task's error in each of its units: root mean square, largest, last."""
    for unit, shown, what in _SPREADS:
        if unit in record.units:
            head = f"{record.name} {what}" if named else what
            for part, word in _PARTS:
                yield Figure(head, head, word, shown, _error(index, f"{part}_{unit}"), "low")


def _error(index: int, field: str) -> Callable[[Run, Metrics], float | None]:
    def value(_: Run, metrics: Metrics) -> float | None:
        task: TaskMetrics = metrics.tasks[index]
        error: float | None = getattr(task, field)
        return None if error is None else 1e3 * error

    return value


def _peak_rate(_: Run, metrics: Metrics) -> float | None:
    ratios = [joint.velocity_ratio for joint in metrics.joints if joint.velocity_ratio is not None]
    return 100.0 * max(ratios) if ratios else None


def _least(metrics: Metrics) -> float | None:
    return float(np.min([task.min_singular_value for task in metrics.tasks])) if metrics.tasks else None
