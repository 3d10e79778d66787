"""Distance from a posture: H = 1/2 ||q (-) q_rest||_W^2 on the tangent space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective, checked_gain


@dataclass(frozen=True, eq=False)
class Posture(Objective):
    """Stay near a posture (minimised).

    ``H = 1/2 e^T W e`` with ``e = q (-) q_rest`` (nv,), W diagonal. target: q_rest (nq,), the robot's home if None.
    weights: diag W (nv,), >= 0; by default 1 for joints of one dof and 0 for a moving base. A continuous joint takes
    the short way round. gain: k > 0; alone on a joint, e decays as exp(-k w t).

    Raises ParameterError, NonFiniteError; ShapeError, ConfigurationError for another robot's target.
    """

    target: Any = None
    weights: Any = None
    gain: float = 1.0

    def __post_init__(self) -> None:
        checked_gain(self)
        if self.target is not None:
            object.__setattr__(self, "target", checks.vector("target", self.target, largest=checks.LARGEST))
        if self.weights is not None:
            object.__setattr__(self, "weights", checks.vector("weights", self.weights))
            if (self.weights < 0.0).any():
                raise ParameterError(f"weights is {self.weights}; expected numbers of at least 0")

    def check(self, robot: Robot) -> None:
        """Target and weights must be this robot's."""
        if self.target is not None:
            robot.check_configuration(self.target, "target")
        if self.weights is not None:
            checks.vector("weights", self.weights, robot.nv)

    def value(self, state: State) -> float:
        """``H(q)``, rad^2 (or m^2)."""
        e = self._error(state)
        return 0.5 * float(e @ (self._weights(state.robot) * e))

    def gradient(self, state: State) -> FloatArray:
        """``(de/dq)^T W e``, (nv,); de/dq is the identity but on a moving base."""
        weighed = self._weights(state.robot) * self._error(state)
        if state.robot.nq == state.robot.nv:
            return weighed
        return self._error_jacobian(state).T @ weighed  # type: ignore[no-any-return]

    def _error(self, state: State) -> FloatArray:
        return state.robot.difference(self._rest(state.robot), state.q)

    def _error_jacobian(self, state: State) -> FloatArray:
        """``de/dq``, (nv, nv)."""
        robot = state.robot
        d = pin.dDifference(robot.model, self._rest(robot), state.q, pin.ArgumentPosition.ARG1)
        return np.asarray(d).reshape(robot.nv, robot.nv)

    def _rest(self, robot: Robot) -> FloatArray:
        rest: FloatArray = robot.home if self.target is None else self.target
        return rest

    def _weights(self, robot: Robot) -> FloatArray:
        return robot.single.astype(np.float64) if self.weights is None else self.weights
