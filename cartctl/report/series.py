"""What is drawn of a run over time: each function returns times (k,) in s and values (k,)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from cartctl.model.state import State
from cartctl.report import panels
from cartctl.report.mesh import Array

if TYPE_CHECKING:
    from cartctl.motion.run import Run
    from cartctl.objectives import Objective

STATES = 400  # of a run at which an objective is worked out
Series = Callable[["Run"], tuple[Array, Array]]


def error(index: int, unit: str) -> Series:
    """The norm of a task's rows in one unit, as it is shown: mm, mrad."""
    factor = panels.MARKED[unit][0]
    return lambda run: (run.time, factor * panels.norm(run.tasks[index], unit))


def objective(run: Run, goal: Objective) -> tuple[Array, Array]:
    """The objective at some of the samples, the last one included."""
    state = State(run.robot)
    chosen = np.unique(np.linspace(0, len(run.time) - 1, STATES).astype(int))
    values = []
    for k in chosen:
        state.set(run.q[k], run.v[k])
        values.append(goal.value(state))
    return run.time[chosen], np.array(values)


def smallest_singular_value(run: Run) -> tuple[Array, Array]:
    """The smallest one of all tasks; 0 without a task."""
    values = [record.singular_values.min(axis=1) for record in run.tasks if record.singular_values.size]
    return (run.time, np.min(values, axis=0)) if values else (run.time, np.zeros(len(run.time)))


def rate_norm(run: Run) -> tuple[Array, Array]:
    """The Euclidean norm of the joint rates."""
    return run.time, np.linalg.norm(run.v, axis=1)


def fastest(run: Run) -> tuple[Array, Array]:
    """The joint nearest to its velocity limit, as a share of it; 0 where no joint has one."""
    _, share = panels.speed(run)
    return run.time, np.abs(share).max(axis=1, initial=0.0)
