"""Kinetic energy of a motion that goes on: T = 1/2 v^T M(q) v."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective, checked_gain


@dataclass(frozen=True, eq=False)
class KineticEnergy(Objective):
    """Postures in which the motion carries little kinetic energy (minimised).

    ``H = 1/2 v^T M(q) v``, v held: the state's own, or ``velocity`` (nv,). ``dH/dq_i = 1/2 v^T (dM/dq_i) v``, the term
    of Lagrange's equations (Siciliano et al. 2009, section 7.1), exact through the derivatives of Newton-Euler
    (Carpentier & Mansard 2018). At rest, without ``velocity``, it asks for nothing. For the v of least kinetic energy
    at a given posture, use ``metric="inertia"``. gain: k > 0, (rad/s) per J/rad.

    Raises ParameterError, NonFiniteError; ShapeError for another robot's velocity.
    """

    velocity: Any = None
    gain: float = 1.0

    def __post_init__(self) -> None:
        checked_gain(self)
        if self.velocity is not None:
            object.__setattr__(self, "velocity", checks.vector("velocity", self.velocity, largest=checks.LARGEST))

    def check(self, robot: Robot) -> None:
        """The velocity must be this robot's."""
        if self.velocity is not None:
            checks.vector("velocity", self.velocity, robot.nv)

    def value(self, state: State) -> float:
        """``H(q)``, J."""
        v = self._held(state)
        return 0.5 * float(v @ (state.mass_matrix @ v))

    def gradient(self, state: State) -> FloatArray:
        """``1/2 v^T d(M v)/dq``, (nv,), J/rad or J/m."""
        v = self._held(state)
        return 0.5 * (v @ state.inertia_gradient(v))

    def _held(self, state: State) -> FloatArray:
        return state.v if self.velocity is None else self.velocity
