"""What a force along one direction costs: one over the radius of the force ellipsoid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cartctl.checks import FloatArray
from cartctl.model.robot import Robot
from cartctl.objectives.directional import DirectionalMeasure
from cartctl.objectives.frame_measure import Spread
from cartctl.objectives.scaling import check_scale, reciprocal


@dataclass(frozen=True, eq=False)
class TorquePerForce(DirectionalMeasure):
    """The norm of the joint torques that a unit force in one direction takes (minimised; Chiu 1988).

    ``H = ||A^T d||`` with ``A = R J D``, d the unit direction: one over the force transmission ratio
    ``beta = (d^T A A^T d)^-1/2``, which is infinite where the structure itself carries the force and H is 0.
    ``dH/dq_i = (A^T d) . (dA_i^T d) / H``, and 0 where H is.

    scale: diag D weighs torques; ``"limits"`` is one over the torque limits. along: (m,), the direction, one number a
    row of ``axes``, any length but 0. frame, axes, length, gain as in :class:`cartctl.Manipulability`. Raises
    ParameterError, ShapeError, NonFiniteError.
    """

    def check(self, robot: Robot) -> None:
        """The frame must exist, the scale must be this robot's."""
        robot.frame_id(self._frame(robot))
        check_scale(self.scale, robot, robot.limits.torque_upper, "torque")

    def measure(self, spread: Spread) -> float:
        """``H``, N m per N (share of the limits per N)."""
        return float(np.linalg.norm(self._torques(spread)))

    def slope(self, spread: Spread) -> FloatArray:
        """``d (A^T d)^T / H``."""
        torques = self._torques(spread)
        size = float(np.linalg.norm(torques))
        unit: FloatArray = self._unit
        return unit[:, None] * (torques / size if size > 0.0 else torques)

    def _torques(self, spread: Spread) -> FloatArray:
        return spread.V @ (spread.s * (spread.U.T @ self._unit))  # type: ignore[no-any-return]

    def _columns(self, robot: Robot) -> FloatArray | None:
        return reciprocal(robot.limits.torque_upper) if isinstance(self.scale, str) else self.scale
