"""Joint friction, viscous and Coulomb: ``M a + h + f(v) = tau`` with ``f(v) = D v + C tanh(v / w)``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError

if TYPE_CHECKING:
    from cartctl.model.robot import Robot

_WIDTH = 0.05  # rad/s or m/s


@dataclass(frozen=True, eq=False)
class Friction:
    """What the joints lose: ``f(v) = D v + C tanh(v / w)`` (nv,), N m or N, against the motion.

    viscous: D >= 0, N m s/rad. coulomb: C >= 0, N m. Each a number for all joints or (nv,). width: w > 0, rad/s or m/s:
    the sign of the textbook's ``C sign(v)``, which no step can follow through zero, is smoothed over it (Makkar et al.
    2005). A motion by steps of dt is stable only while ``C dt / w`` is below the joint's inertia.

    Raises ParameterError, ShapeError, NonFiniteError.
    """

    viscous: Any = 0.0
    coulomb: Any = 0.0
    width: float = _WIDTH

    def __post_init__(self) -> None:
        for name in ("viscous", "coulomb"):
            object.__setattr__(self, name, checks.amounts(name, getattr(self, name)))
        object.__setattr__(self, "width", checks.number("width", self.width, low=0.0, strict=True))

    @classmethod
    def of(cls, robot: Robot, width: float = _WIDTH) -> Friction:
        """What the robot's URDF says in ``<dynamics damping= friction=>``; zeros where it says nothing.

        Raises ParameterError for what is no Robot.
        """
        if not hasattr(robot, "model"):
            raise ParameterError(f"robot is a {type(robot).__name__}; expected a Robot from cc.load(...)")
        return cls(np.array(robot.model.damping), np.array(robot.model.friction), width)

    def check(self, nv: int) -> None:
        """Refuse coefficients of another robot; raises ShapeError."""
        for name in ("viscous", "coulomb"):
            checks.fits(f"friction: {name}", getattr(self, name), nv)

    def torque(self, v: FloatArray) -> FloatArray:
        """``f(v)`` (nv,), N m or N, for v (nv,), unchecked; ``f . v >= 0`` is the power that is lost."""
        return self.viscous * v + self.coulomb * np.tanh(v / self.width)  # type: ignore[no-any-return]
