"""A function of your own as an objective."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.differences import central
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective


class FunctionObjective(Objective):
    """``H = value(state)``, in whatever unit it returns.

    value: State -> a number. gradient: State -> (nv,), dH/dq in the tangent space; central differences there if None,
    good to some 1e-10 (1 + |H|), at 2 nv evaluations. gain: k > 0, (rad/s) per unit of the gradient. maximise: climb
    instead of descend.

    Raises ParameterError; ShapeError and NonFiniteError, when a controller is made or at the first step that returns
    something else.
    """

    def __init__(
        self,
        value: Callable[[State], Any],
        gradient: Callable[[State], Any] | None = None,
        *,
        gain: float = 1.0,
        maximise: bool = False,
    ) -> None:
        for name, function in (("value", value), ("gradient", gradient)):
            if not (callable(function) or (function is None and name == "gradient")):
                raise ParameterError(f"{name} is {function!r}; expected a function of the State")
        self._value, self._gradient = value, gradient
        self.gain = checks.number("gain", gain, low=0.0, strict=True)
        if not isinstance(maximise, bool):
            raise ParameterError(f"maximise is {maximise!r}; expected True or False")
        self.maximise = maximise
        self.name = str(getattr(value, "__name__", "function"))

    def check(self, robot: Robot) -> None:
        """Value and gradient must be numbers at home."""
        state = robot.state(robot.home)
        self.value(state)
        self.gradient(state)

    def value(self, state: State) -> float:
        """``H(q)``."""
        return checks.number(f"objective {self.name!r}: value", self._value(state))

    def gradient(self, state: State) -> FloatArray:
        """``dH/dq``, (nv,)."""
        if self._gradient is None:
            return central(state, self.value)
        return checks.vector(f"objective {self.name!r}: gradient", self._gradient(state), state.robot.nv)

    def __repr__(self) -> str:
        return f"FunctionObjective({self.name}, gain={self.gain}, maximise={self.maximise})"
