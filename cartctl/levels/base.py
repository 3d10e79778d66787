"""What a level is: it turns tasks at a state into one Problem, and its Solution back into a command."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from cartctl.algebra.problem import Problem
from cartctl.algebra.solution import Solution
from cartctl.checks import FloatArray, is_finite
from cartctl.constraints import Box, Constraint, Rows
from cartctl.errors import NonFiniteError, ParameterError, ShapeError, UnsupportedProblem
from cartctl.levels.approach import Approach
from cartctl.levels.bounds import JointBounds
from cartctl.levels.loads import Loads
from cartctl.levels.metrics import KINEMATIC
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective
from cartctl.solvers import Solver
from cartctl.tasks.base import Reference, Task


class Command:
    """What a controller says: velocity (nv,), acceleration (nv,) or torque (nv,), None where the level has none.

    At the acceleration level ``torque`` is the computed torque ``M a + h``, worked out when asked for; None for a robot
    with joints that no motor drives. solution: the Solution behind it. references: each task's error and target rates
    at this step.
    """

    __slots__ = ("_torque", "acceleration", "references", "solution", "velocity")

    def __init__(
        self,
        solution: Solution,
        references: Sequence[Reference],
        velocity: FloatArray | None = None,
        acceleration: FloatArray | None = None,
        torque: FloatArray | Callable[[], FloatArray] | None = None,
    ) -> None:
        self.solution = solution
        self.references = references
        self.velocity = velocity
        self.acceleration = acceleration
        self._torque = torque

    @property
    def torque(self) -> FloatArray | None:
        """(nv,), N m or N."""
        if callable(self._torque):
            self._torque = self._torque()
        return self._torque

    @property
    def told(self) -> FloatArray:
        """The one quantity the robot is told, (nv,): velocity, acceleration or torque; raises ParameterError."""
        for quantity in (self.velocity, self.acceleration, self.torque):
            if quantity is not None:
                return quantity
        raise ParameterError("the command holds no velocity, acceleration or torque; expected one of them")


class Secondary(NamedTuple):
    """What the redundancy is spent on.

    share: of the objective, in [0, 1]. extend: K in 1/s of the rows that keep the objective extremal, None where the
    solver spends it through u0. weighing: the name of the metric, "" for the caller's own. spends: whether the solver
    takes a u0 at all.
    """

    objective: Objective | None = None
    share: float = 1.0
    extend: float | None = None
    weighing: str = ""
    spends: bool = True


class Confines(NamedTuple):
    """What confines u in this step: a box, each (nv,), and rows ``(C, c_lower, c_upper)``; None where nothing does.

    approach: what makes commands such that the robot can still stop, None where nothing is to be stopped for. torque:
    what motors can give, at the levels that know of inertia; None where nothing bounds it. There box and rows are on
    the acceleration, and the level makes bounds on its own u of them.
    """

    lower: FloatArray | None = None
    upper: FloatArray | None = None
    rows: tuple[FloatArray, FloatArray, FloatArray] | None = None
    approach: Approach | None = None
    torque: Box | None = None


UNCONFINED = Confines()


class Motion(NamedTuple):
    """What u means at an instant: ``a = T u + t``, ``tau = S u + s``; T, S (nv, nv), t, s (nv,)."""

    T: FloatArray
    t: FloatArray
    S: FloatArray
    s: FloatArray


class Level(ABC):
    """Velocity, acceleration or torque: what u is, and what A and b are made of."""

    name: ClassVar[str]
    bounds: ClassVar[type[JointBounds] | None] = None  # what turns a robot's limits into bounds on u
    approaching: ClassVar[type[Approach] | None] = None  # what keeps commands such that the robot can still stop
    clocked: ClassVar[bool] = False  # whether a path may wait for a hand that was slowed down
    stable_below: ClassVar[float] = 2.0  # gain times dt, from which on the sampled loop diverges
    limits_are_rows: ClassVar[bool] = False  # whether joint limits are rows of constraints, and not a box
    loads: Loads | None = None  # what the joints hold beside inertia, at the levels that know of it
    metrics: ClassVar[Mapping[str, Callable[[State], FloatArray] | None]] = KINEMATIC  # by name

    def check(self, solver: Solver) -> None:
        """Refuse a solver that the level has no use for, once, when a controller is made."""
        return

    def check_robot(self, robot: Robot) -> None:
        """Refuse a robot that the level cannot command, once, when a controller is made."""
        if self.loads is not None:
            self.loads.check(robot)

    @abstractmethod
    def problem(
        self,
        state: State,
        tasks: Sequence[Task],
        times: Sequence[float],
        anchors: Sequence[Any],
        secondary: Secondary,
        metric: FloatArray | None,
        confines: Confines = UNCONFINED,
    ) -> tuple[Problem, list[Reference]]:
        """The problem of this instant, and the references it was made from; times: one a task. NonFiniteError."""

    def rows(self, constraint: Constraint, state: State, dt: float, box: Box | None) -> Rows:
        """The rows of a constraint on this level's u; raises UnsupportedProblem where the level has none."""
        raise UnsupportedProblem(f"level {self.name!r} has no rows for a {type(constraint).__name__}")

    def motion(self, state: State) -> Motion:
        """Accelerations and torques by u, at the levels that know of inertia; raises UnsupportedProblem elsewhere."""
        raise UnsupportedProblem(f"level {self.name!r} knows of no torques; use level 'acceleration' or 'torque'")

    def stopping(self, state: State, dt: float) -> FloatArray:
        """The u that brings every joint to rest within a step, (nv,)."""
        return np.zeros(state.robot.nv)

    @abstractmethod
    def command(self, solution: Solution, references: Sequence[Reference], state: State) -> Command:
        """The command that the answer means at the state of its problem."""


def direction(objective: Objective, state: State) -> FloatArray:
    """``u0`` (nv,) of an objective; raises ShapeError, NonFiniteError naming it."""
    u0 = np.asarray(objective.direction(state), dtype=np.float64)
    name = f"the gradient of {type(objective).__name__}"
    if u0.shape != (state.robot.nv,):
        raise ShapeError(f"{name} has shape {u0.shape}; expected ({state.robot.nv},)")
    return require_finite(u0, name)


def require_finite(array: FloatArray, what: str) -> FloatArray:
    """``array``, or NonFiniteError naming ``what``: a target or function of the user's went astray."""
    if not is_finite(array.ravel()):
        raise NonFiniteError(f"{what} holds nan or inf: {array}; expected finite numbers")
    return array
