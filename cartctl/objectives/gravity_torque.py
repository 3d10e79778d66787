"""Torques that hold the arm's own weight: H = 1/2 ||D g(q)||^2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl.checks import FloatArray
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective, checked_gain
from cartctl.objectives.scaling import check_scale, checked_scale, reciprocal


@dataclass(frozen=True, eq=False, kw_only=True)
class GravityTorque(Objective):
    """Postures that take little torque to hold (minimised).

    ``H = 1/2 ||D g(q)||^2``, ``dH/dq = (dg/dq)^T D^2 g``. scale: diag D (nv,), >= 0; None is 1 for joints of one dof
    and 0 for a moving base; ``"limits"`` is one over the torque limits, so that H counts shares of what motors can
    give. gain: k > 0, (rad/s) per unit of the gradient.

    Raises ParameterError, NonFiniteError; ShapeError for another robot's scale.
    """

    scale: Any = None
    gain: float = 1e-3

    def __post_init__(self) -> None:
        checked_gain(self)
        checked_scale(self)

    def check(self, robot: Robot) -> None:
        """The scale must be this robot's."""
        check_scale(self.scale, robot, robot.limits.torque_upper, "torque")

    def value(self, state: State) -> float:
        """``H(q)``, N^2 m^2 (N^2 of sliding joints), no unit where D is in 1/(N m)."""
        scaled = self._scale(state.robot) * self.torques(state)
        return 0.5 * float(scaled @ scaled)

    def gradient(self, state: State) -> FloatArray:
        """``(d tau/dq)^T D^2 tau``, (nv,)."""
        return self._scale(state.robot) ** 2 * self.torques(state) @ self.torques_gradient(state)

    def torques(self, state: State) -> FloatArray:
        """``tau(q)``, (nv,): what the joints hold, N m (N of sliding joints)."""
        return state.gravity

    def torques_gradient(self, state: State) -> FloatArray:
        """``d tau_j / dq_i``, (nv, nv) as [j, i]."""
        return state.gravity_gradient

    def _scale(self, robot: Robot) -> FloatArray:
        if self.scale is None:
            return robot.single.astype(np.float64)
        return reciprocal(robot.limits.torque_upper) if isinstance(self.scale, str) else self.scale
