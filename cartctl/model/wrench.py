"""A wrench from outside that acts on a frame of the robot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import NonFiniteError, ParameterError
from cartctl.model.robot import Robot
from cartctl.model.state import State


class Wrench:
    """A wrench that the surroundings exert on the robot at the origin of ``frame``: ``J^T w`` (nv,) on its joints.

    value: w = (force, moment), (6,), N and N m, or a function of t in s that returns it; may be assigned while running,
    as a force sensor's reading. expressed_in: the axes of w, ``"world"`` or a frame, such as ``frame`` itself.

    Given to a level, the controller knows of it; given to a Plant, the robot only feels it.

    Raises ShapeError, NonFiniteError, ParameterError; FrameNotFound when a controller or a rollout begins.
    """

    def __init__(self, frame: str, value: Any, expressed_in: str = "world") -> None:
        if not isinstance(frame, str) or not isinstance(expressed_in, str):
            raise ParameterError(f"frame is {frame!r} and expressed_in {expressed_in!r}; expected names of frames")
        self.frame, self.expressed_in = frame, expressed_in
        self.value = value

    @property
    def value(self) -> FloatArray | Callable[[float], Any]:
        """The wrench, or the function of t that gives it."""
        return self._value

    @value.setter
    def value(self, value: Any) -> None:
        self._value = value if callable(value) else checks.vector(f"the wrench on {self.frame!r}", value, 6)

    def check(self, robot: Robot) -> None:
        """Its frames must exist; raises FrameNotFound."""
        robot.frame_id(self.frame)
        if self.expressed_in != "world":
            robot.frame_id(self.expressed_in)

    def at(self, t: float) -> FloatArray:
        """``w`` (6,) at time t; raises ShapeError, NonFiniteError for what a function returns."""
        value = self._value
        return checks.vector(f"the wrench on {self.frame!r} at t = {t:g} s", value(t), 6) if callable(value) else value

    def torque(self, state: State, t: float = 0.0) -> FloatArray:
        """``J^T w`` (nv,), N m or N; raises NonFiniteError."""
        w = self.at(t)
        if self.expressed_in != "world":
            R = state.rotation(self.expressed_in)
            w = np.concatenate([R @ w[:3], R @ w[3:]])
        torque: FloatArray = state.jacobian(self.frame).T @ w
        if not checks.is_finite(torque):
            raise NonFiniteError(f"the wrench on {self.frame!r} is {w}; expected one whose torques are finite")
        return torque
