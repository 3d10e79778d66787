"""What a controller is given, checked once: tasks, switches, an objective."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.errors import CartctlWarning, NoTasksError, ParameterError, ProblemError, UnsupportedProblem
from cartctl.levels import Level
from cartctl.model.robot import Robot
from cartctl.objectives.base import Objective
from cartctl.solvers import Solver, solvers_that_honour
from cartctl.tasks.base import Task


def checked_tasks(tasks: Task | Sequence[Task], robot: Robot) -> tuple[Task, ...]:
    """One Task or more, each fit for the robot; raises ProblemError, NoTasksError and what a task's check raises."""
    if isinstance(tasks, Task):
        tasks = (tasks,)
    if not isinstance(tasks, Sequence):
        raise ProblemError(f"tasks is a {type(tasks).__name__}; expected a Task or a sequence of tasks")
    if not tasks:
        raise NoTasksError("tasks is empty; expected at least one Task, such as cc.FrameTask(robot.tool)")
    for k, task in enumerate(tasks):
        if not isinstance(task, Task):
            raise ProblemError(f"tasks[{k}] is a {type(task).__name__}; expected a Task")
        task.check(robot)
    return tuple(tasks)


def checked_switches(**switches: Any) -> None:
    """True, False, or of path_clock None; raises ParameterError."""
    for name, value in switches.items():
        if not (isinstance(value, bool) or (value is None and name == "path_clock")):
            raise ParameterError(f"{name} is {value!r}; expected True or False")


def clocked(asked: bool | None, tasks: Sequence[Task], slowed: bool, level: Level) -> list[bool]:
    """Which tasks have a path that waits: by default every one, where commands are slowed and the level can."""
    if asked and not level.clocked:
        raise UnsupportedProblem(f"level {level.name!r} has no path clock; use level 'velocity', or path_clock=False")
    waits = level.clocked and (slowed if asked is None else asked)
    return [bool(waits) for _ in tasks]


def checked_objective(
    objective: Objective | None, solver: Solver, robot: Robot, otherwise: str = "objective=None"
) -> Objective | None:
    """An objective that the solver has a use for, or None; raises ProblemError, ParameterError, UnsupportedProblem."""
    if objective is None:
        if solver.extends:
            raise ProblemError(
                f"solver {solver.name!r} has no objective to keep extremal; give one, as cc.JointRange()"
            )
        return None
    if not isinstance(objective, Objective):
        raise ParameterError(
            f"objective is a {type(objective).__name__}; expected an Objective such as cc.JointRange()"
        )
    checks.number(f"the gain of {type(objective).__name__}", objective.gain, low=0.0)
    if "reference" not in solver.honours and not solver.extends:
        able = ", ".join(repr(s) for s in solvers_that_honour("reference"))
        raise UnsupportedProblem(
            f"solver {solver.name!r} has no null-space term for an objective; use {able}, or {otherwise}"
        )
    objective.check(robot)
    return objective


def warn_of_unstable_gains(tasks: Sequence[Task], dt: float, limit: float) -> None:
    """A sampled error shrinks by (1 - k dt) a step: above k dt = 2 it grows, with two integrators above 1."""
    for task in tasks:
        gain = float(np.max(task.gain, initial=0.0))
        if gain * dt >= limit:
            warnings.warn(
                f"task {task.name!r}: gain {gain:g} 1/s times dt {dt:g} s is {gain * dt:.3g}; the loop is unstable "
                f"from {limit:g} on; use a gain below {0.5 * limit / dt:g}, or a smaller dt",
                CartctlWarning,
                stacklevel=3,
            )
