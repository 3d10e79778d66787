"""Where a search looks: the configurations of a robot inside its limits, or a box for functions of your own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError

if TYPE_CHECKING:
    from cartctl.model.robot import Robot


@dataclass(frozen=True, eq=False)
class Box:
    """``lower <= q <= upper`` (n,), finite, for Jacobians that are functions of q instead of a robot's State.

    Raises ShapeError, NonFiniteError, ParameterError.
    """

    lower: FloatArray
    upper: FloatArray

    def __post_init__(self) -> None:
        lower = checks.vector("lower", self.lower)
        upper = checks.vector("upper", self.upper, lower.shape[0])
        if (lower > upper).any():
            i = int(np.argmax(lower > upper))
            raise ParameterError(
                f"lower[{i}] = {lower[i]:g} is above upper[{i}] = {upper[i]:g}; expected lower <= upper"
            )
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)


class Space(Protocol):
    """Configurations with a tangent space of n coordinates, and Jacobians (m, n) at each."""

    n: int  # of the tangent space

    def sample(self, rng: np.random.Generator) -> FloatArray:
        """A configuration at random."""

    def room(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The least and the largest displacement from q that stays inside the limits, (n,) each, +-inf allowed."""

    def moved(self, q: FloatArray, displacement: FloatArray) -> FloatArray:
        """The configuration reached from q."""

    def jacobians(self, q: FloatArray) -> list[FloatArray]:
        """One (m_k, n) a task."""


def space_of(place: Robot | Box, tasks: Sequence[Any]) -> Space:
    """The space of a robot with Tasks or functions State -> (m, nv), or of a Box with functions q -> (m, n).

    Raises ParameterError; what a task's ``check`` raises.
    """
    if not tasks:
        raise ParameterError("tasks is empty; expected Tasks, or functions that return a Jacobian")
    in_box = isinstance(place, Box)
    for k, task in enumerate(tasks, 1):
        if not callable(task) and (in_box or not hasattr(task, "jacobian")):
            wanted = "a function q -> (m, n)" if in_box else "a Task or a function State -> (m, nv)"
            raise ParameterError(f"task {k} is {task!r}; expected {wanted}")
    if isinstance(place, Box):
        return _BoxSpace(place, tasks)
    if not hasattr(place, "random_configuration"):
        raise ParameterError(f"{place!r} is no place to search; expected a Robot or an analysis.Box")
    return _RobotSpace(place, tasks)


class _Rows:
    """Checks what tasks return: (m_k, n), with the same m_k at every configuration."""

    def __init__(self, n: int) -> None:
        self.n = n
        self._rows: dict[int, int] = {}

    def checked(self, k: int, value: Any) -> FloatArray:
        label = f"the Jacobian of task {k}"
        J = checks.matrix(label, np.atleast_2d(value), self._rows.get(k), self.n)
        self._rows[k] = J.shape[0]
        return J


class _BoxSpace(_Rows):
    def __init__(self, box: Box, tasks: Sequence[Any]) -> None:
        super().__init__(box.lower.shape[0])
        self._box, self._tasks = box, tasks

    def sample(self, rng: np.random.Generator) -> FloatArray:
        return rng.uniform(self._box.lower, self._box.upper)

    def room(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self._box.lower - q, self._box.upper - q

    def moved(self, q: FloatArray, displacement: FloatArray) -> FloatArray:
        return np.clip(q + displacement, self._box.lower, self._box.upper)

    def jacobians(self, q: FloatArray) -> list[FloatArray]:
        return [self.checked(k, task(q)) for k, task in enumerate(self._tasks, 1)]


class _RobotSpace(_Rows):
    def __init__(self, robot: Robot, tasks: Sequence[Any]) -> None:
        super().__init__(robot.nv)
        for task in tasks:
            if hasattr(task, "check"):
                task.check(robot)
        self._robot, self._state, self._still = robot, robot.state(robot.home), np.zeros(robot.nv)
        self._functions = [getattr(task, "jacobian", task) for task in tasks]

    def sample(self, rng: np.random.Generator) -> FloatArray:
        return self._robot.random_configuration(rng)

    def room(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        limits, at = self._robot.limits, self._robot.coordinates(q)
        return limits.position_lower - at, limits.position_upper - at

    def moved(self, q: FloatArray, displacement: FloatArray) -> FloatArray:
        return self._robot.integrate(q, displacement)

    def jacobians(self, q: FloatArray) -> list[FloatArray]:
        self._state.set(q, self._still)
        return [self.checked(k, jacobian(self._state)) for k, jacobian in enumerate(self._functions, 1)]
