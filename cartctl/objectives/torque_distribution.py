"""Torques of weight, payload and contact, spread over the joints: H = 1/2 ||D (g + J^T w)||^2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.gravity_torque import GravityTorque
from cartctl.spatial.rotations import cross, skew


@dataclass(frozen=True, eq=False, kw_only=True)
class TorqueDistribution(GravityTorque):
    """Postures that take little torque to carry a payload or press on something (minimised).

    ``H = 1/2 ||D tau||^2`` with ``tau = g(q) + J^T w(q)``, w the wrench (6,) that the hand exerts, linear part first,
    about the origin of ``frame`` (the tool if None): ``wrench``, and ``[-m g; R c x (-m g)]`` for a payload of
    ``payload`` kg whose centre of mass is at ``com`` (3,), c in the frame's axes, m. expressed_in: the axes of
    ``wrench``, ``"world"`` or ``"frame"``, in which case it turns with the hand. scale and gain as in
    :class:`cartctl.GravityTorque`. Exact through ``dJ^T/dq w`` and ``J^T dw/dq``.

    Raises ParameterError, ShapeError, NonFiniteError; FrameNotFound when a controller is made.
    """

    frame: str | None = None
    wrench: Any = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    payload: float = 0.0
    com: Any = (0.0, 0.0, 0.0)
    expressed_in: str = "world"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "wrench", checks.vector("wrench", self.wrench, 6))
        object.__setattr__(self, "payload", checks.number("payload", self.payload, low=0.0))
        object.__setattr__(self, "com", checks.vector("com", self.com, 3))
        checks.choice("expressed_in", self.expressed_in, ("world", "frame"))

    def check(self, robot: Robot) -> None:
        """The frame must exist, the scale must be this robot's."""
        super().check(robot)
        if self.frame is not None:
            robot.frame_id(self.frame)

    def torques(self, state: State) -> FloatArray:
        """``g + J^T w``, (nv,)."""
        lifting: FloatArray = state.jacobian(self._frame(state)).T @ self._exerted(state)
        return state.gravity + lifting

    def torques_gradient(self, state: State) -> FloatArray:
        """``dg/dq + (dJ/dq)^T w + J^T dw/dq``, (nv, nv)."""
        frame = self._frame(state)
        J, H = state.jacobian(frame), state.hessian(frame)
        bent: FloatArray = np.tensordot(self._exerted(state), H, axes=1)
        turned: FloatArray = J.T @ self._exerted_gradient(state, J)
        return state.gravity_gradient + bent + turned

    def _frame(self, state: State) -> str:
        return state.robot.tool if self.frame is None else self.frame

    def _exerted(self, state: State) -> FloatArray:
        """``w(q)``, (6,), world axes."""
        R, lift = state.rotation(self._frame(state)), -self.payload * state.robot.gravity
        w = np.concatenate([lift, cross(R @ self.com, lift)])
        if self.expressed_in == "frame":
            w += np.concatenate([R @ self.wrench[:3], R @ self.wrench[3:]])
        else:
            w += self.wrench
        return w

    def _exerted_gradient(self, state: State, J: FloatArray) -> FloatArray:
        """``dw/dq``, (6, nv): what is fixed to the hand turns with its angular velocity, d(R c) = omega x R c."""
        R, lift = state.rotation(self._frame(state)), -self.payload * state.robot.gravity
        D = np.concatenate([np.zeros((3, 3)), skew(lift) @ skew(R @ self.com)])
        if self.expressed_in == "frame":
            D -= np.concatenate([skew(R @ self.wrench[:3]), skew(R @ self.wrench[3:])])
        return D @ J[3:]
