"""A function of your own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ShapeError, TargetError
from cartctl.model.differences import central
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.tasks.base import Reference, Task
from cartctl.tasks.target import point_target


class FunctionTask(Task):
    """Bring ``value(state)`` (m,) to a target.

    value: State -> (m,) or a number. jacobian: State -> (m, nv); central differences in the tangent space if None.
    drift: State -> (m,), J_dot v; a central difference of J along v if None. target: (m,), a path
    t -> (value, rate, acceleration), or None (hold what the first step finds). unit: of all rows, for reports. gain
    (1/s), weight, fit, name as in :class:`cartctl.FrameTask`.

    Raises ShapeError and NonFiniteError at the first step that returns something else.
    """

    kind: ClassVar[str] = "function"

    def __init__(
        self,
        value: Callable[[State], Any],
        jacobian: Callable[[State], Any] | None = None,
        *,
        target: Any = None,
        drift: Callable[[State], Any] | None = None,
        unit: str = "",
        gain: Any = 10.0,
        weight: float = 1.0,
        fit: str = "scale",
        name: str | None = None,
    ) -> None:
        super().__init__(gain=gain, weight=weight, fit=fit, name=name or str(getattr(value, "__name__", "function")))
        self._value, self._jacobian, self._drift = value, jacobian, drift
        self.unit = checks.choice("unit", unit, ("", "m", "rad"))
        self.target = target

    def take_target(self, value: Any, label: str) -> None:
        """(m,), a path, or None."""
        self._point, self._path = point_target(value, label)

    def units(self, robot: Robot) -> list[str]:
        """The given unit, once a row; evaluates the function at home to count them."""
        return [self.unit] * len(self.value(robot.state(robot.home)))

    def check(self, robot: Robot) -> None:
        """Value, Jacobian and target must agree on m."""
        super().check(robot)
        state = robot.state(robot.home)
        m = len(self.value(state))
        self.jacobian(state)
        if self._point is not None and len(self._point) != m:
            raise TargetError(f"task {self.name!r}: target has shape {self._point.shape}; expected ({m},) as the value")

    def value(self, state: State) -> FloatArray:
        """The function's value (m,)."""
        return checks.vector(f"task {self.name!r}: value", np.atleast_1d(self._value(state)))

    def jacobian(self, state: State) -> FloatArray:
        """``J`` (m, nv)."""
        if self._jacobian is None:
            return central(state, self.value)
        J = checks.matrix(f"task {self.name!r}: jacobian", np.atleast_2d(self._jacobian(state)), columns=state.robot.nv)
        m = len(self.value(state))
        if J.shape[0] != m:
            raise ShapeError(
                f"task {self.name!r}: jacobian has shape {J.shape}; expected ({m}, {state.robot.nv}) as the value"
            )
        return J

    def size(self, state: State) -> float:
        """Where J is differenced: the size whose 1e-10 is the noise of differencing, some 1e-11 (1 + |value|)."""
        return 0.0 if self._jacobian is not None else 10.0 * (1.0 + float(np.linalg.norm(self.value(state))))

    def drift(self, state: State) -> FloatArray:
        """``J_dot v`` (m,)."""
        if self._drift is not None:
            return checks.vector(f"task {self.name!r}: drift", np.atleast_1d(self._drift(state)))
        speed = float(np.linalg.norm(state.v))
        if speed == 0.0:
            return np.zeros(len(self.value(state)))
        h = 1e-4 / speed  # J may itself be a difference, good to 1e-10
        ahead, behind = (self._moved(state, sign * h * state.v) for sign in (1.0, -1.0))
        return (self.jacobian(ahead) @ state.v - self.jacobian(behind) @ state.v) / (2.0 * h)

    def anchor(self, state: State) -> FloatArray:
        """The value at the first step."""
        return self.value(state)

    def reference(self, state: State, t: float, anchor: FloatArray | None) -> Reference:
        """Target minus value, and the target's rates."""
        value = self.value(state)
        if self._path is None:
            wanted = anchor if self._point is None else self._point
            return Reference(np.zeros_like(value) if wanted is None else wanted - value)
        parts: Sequence[Any] = self._path(t)
        if not isinstance(parts, Sequence) or len(parts) != 3:
            raise TargetError(
                f"task {self.name!r}: the path must return (value, rate, acceleration), each ({len(value)},)"
            )
        names = ("value", "rate", "acceleration")
        wanted, rate, acceleration = (
            checks.vector(f"task {self.name!r}: target {n}", np.atleast_1d(p), len(value))
            for n, p in zip(names, parts, strict=True)
        )
        return Reference(wanted - value, rate, acceleration)

    @staticmethod
    def _moved(state: State, displacement: FloatArray) -> State:
        return state.robot.state(state.robot.integrate(state.q, displacement), state.v, state.time)
