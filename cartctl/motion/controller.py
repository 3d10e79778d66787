"""The closed loop of one robot: tasks, solver and level, and all that lasts from step to step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from cartctl import checks
from cartctl.algebra.metric import as_metric
from cartctl.checks import FloatArray, is_finite
from cartctl.errors import NoTasksError, ParameterError, ProblemError, UnsupportedProblem
from cartctl.levels import Command, Level, get_level
from cartctl.model.limits import Limits
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.motion.limiting import ROBOT_LIMITS, RobotLimits, usable_limits
from cartctl.objectives.base import Objective
from cartctl.solvers import Solver, get_solver, solvers_that_honour
from cartctl.tasks.base import Task

_METRICS: Final = ("identity", "inertia")


class Controller:
    """A robot with tasks, highest priority first, resolved by one solver at one level.

    tasks: one Task or more. solver: a name from :func:`cartctl.solvers`, or an instance. level: ``"velocity"``. limits:
    Limits, None (off), or by default the robot's own where the solver honours bounds, else off with one warning.
    objective: an Objective for the null space. metric: None or ``"identity"``, ``"inertia"`` (least kinetic energy), an
    (nv,) or (nv, nv) array, or a function of the State that returns one. dt: s, the step it is called with.
    soft_start: s over which the objective rises to its full share, so that the null space does not start with a jump.

    Raises NoTasksError, ProblemError, TimeStepError, FrameNotFound, JointNotFound, SolverNotFound, LevelNotFound,
    UnsupportedProblem, MetricError, ParameterError, NonFiniteError.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Task | Sequence[Task],
        solver: str | Solver | type[Solver] = "pinv",
        level: str | Level = "velocity",
        limits: Limits | RobotLimits | None = ROBOT_LIMITS,
        objective: Objective | None = None,
        metric: str | FloatArray | Callable[[State], FloatArray] | None = None,
        dt: float = 1e-3,
        soft_start: float = 0.0,
    ) -> None:
        if not isinstance(robot, Robot):
            raise ParameterError(f"robot is a {type(robot).__name__}; expected a Robot from cc.load(...)")
        self.robot = robot
        self.tasks = _checked_tasks(tasks, robot)
        self.solver = get_solver(solver)
        self.level = get_level(level)
        self.limits = usable_limits(limits, robot, self.solver, self.level)
        self.objective = _checked_objective(objective, self.solver)
        self.metric = metric
        self.dt = checks.duration("dt", dt)
        self.soft_start = checks.number("soft_start", soft_start, low=0.0)
        self._metric = _metric(metric, robot)
        self.solver.prepare()
        self._state = State(robot)
        self._zeros = np.zeros(robot.nv)
        self._anchors: list[Any] | None = None
        self._started: float | None = None

    def reset(self) -> None:
        """Forget all that lasts from step to step, as before the first one."""
        self._anchors = None
        self._started = None

    def step(self, q: FloatArray, v: FloatArray | None = None, t: float = 0.0) -> Command:
        """The command at configuration q (nq,), velocity v (nv,) (zeros if None) and time t in s.

        Raises ShapeError, NonFiniteError, ConfigurationError, TargetError; afterwards the next good step works as if
        nothing had happened. A singularity is a status of ``command.solution``.
        """
        state = self.observe(q, v, t)
        anchors = self._anchors if self._anchors is not None else [task.anchor(state) for task in self.tasks]
        metric = self._metric if self._metric is None or isinstance(self._metric, np.ndarray) else self._metric(state)
        started = t if self._started is None else self._started
        rise = 1.0 if self.objective is None else self._rise(t - started)
        problem, references = self.level.problem(state, self.tasks, t, anchors, self.objective, rise, metric)
        self._anchors, self._started = anchors, started  # only now: a refused step leaves no trace
        return self.level.command(self.solver.solve(problem), references)

    def _rise(self, elapsed: float) -> float:
        """The share of the objective that counts: 3 x^2 - 2 x^3 over the soft start, then 1."""
        if elapsed >= self.soft_start:
            return 1.0
        x = max(elapsed, 0.0) / self.soft_start
        return x * x * (3.0 - 2.0 * x)

    def observe(self, q: FloatArray, v: FloatArray | None = None, t: float = 0.0) -> State:
        """The controller's own State, moved to (q, v); valid until the next call. Raises as :meth:`step`."""
        robot = self.robot
        if not (
            type(q) is np.ndarray
            and q.dtype == np.float64
            and q.shape == (robot.nq,)
            and is_finite(q)
            and robot.is_on_manifold(q)
        ):
            q = robot.check_configuration(q)
        if v is None:
            v = self._zeros
        elif not (type(v) is np.ndarray and v.dtype == np.float64 and v.shape == (robot.nv,) and is_finite(v)):
            v = checks.vector("v", v, robot.nv)
        if not (type(t) is float and math.isfinite(t)):
            checks.number("t", t)
        self._state.set(q, v)
        return self._state

    @property
    def anchors(self) -> list[Any]:
        """What each task holds on to since the first step."""
        return [None] * len(self.tasks) if self._anchors is None else self._anchors


def _checked_tasks(tasks: Task | Sequence[Task], robot: Robot) -> tuple[Task, ...]:
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


def _checked_objective(objective: Objective | None, solver: Solver) -> Objective | None:
    if objective is None:
        return None
    if not isinstance(objective, Objective):
        raise ParameterError(
            f"objective is a {type(objective).__name__}; expected an Objective such as cc.JointRange()"
        )
    if "reference" not in solver.honours:
        able = ", ".join(repr(s) for s in solvers_that_honour("reference"))
        raise UnsupportedProblem(
            f"solver {solver.name!r} has no null-space term for an objective; use {able}, or objective=None"
        )
    return objective


def _metric(metric: Any, robot: Robot) -> FloatArray | Callable[[State], FloatArray] | None:
    if metric is None or (isinstance(metric, str) and metric == "identity"):
        return None
    if isinstance(metric, str):
        checks.choice("metric", metric, _METRICS)
        return lambda state: state.mass_matrix
    if callable(metric):
        return lambda state: as_metric(metric(state), robot.nv)
    return as_metric(metric, robot.nv)
