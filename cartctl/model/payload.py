"""A load fixed to a robot: what its model gains by holding it."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import MetricError, ParameterError

if TYPE_CHECKING:
    from cartctl.model.robot import Robot

_SYMMETRY = 1e-9  # relative to the largest entry


@dataclass(frozen=True, eq=False)
class Payload:
    """A rigid body fixed to ``frame``: :meth:`cartctl.Robot.carrying` adds it to a robot's model.

    mass: kg >= 0. com: its centre of mass in the axes of the frame, (3,), m. inertia: about the centre of mass, in the
    axes of the frame, (3, 3), kg m^2; None for a point mass. frame: None for the robot's tool.

    Raises ShapeError, NonFiniteError, MetricError for an inertia that no body has, ParameterError, for numbers beyond
    1e9, too.
    """

    mass: float
    com: Any = (0.0, 0.0, 0.0)
    inertia: Any = None
    frame: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", checks.number("mass", self.mass, low=0.0, high=checks.LARGEST))
        object.__setattr__(self, "com", checks.vector("com", self.com, 3, largest=checks.LARGEST))
        if self.inertia is not None:
            object.__setattr__(self, "inertia", _checked(checks.matrix("inertia", self.inertia, 3, 3)))

    @property
    def body(self) -> pin.Inertia:
        """The same for Pinocchio."""
        return pin.Inertia(self.mass, np.array(self.com), np.zeros((3, 3)) if self.inertia is None else self.inertia)


def _checked(inertia: FloatArray) -> FloatArray:
    """An inertia: symmetric, and no principal moment above the sum of the others."""
    size = float(np.abs(inertia).max())
    if size > checks.LARGEST:
        raise ParameterError(f"inertia has an entry of size {size:g}; expected at most {checks.LARGEST:g} kg m^2")
    moments = np.linalg.eigvalsh(0.5 * (inertia + inertia.T))
    asymmetry = float(np.abs(inertia - inertia.T).max())
    slack = _SYMMETRY * size
    if asymmetry > slack or moments[0] < -slack or 2.0 * moments[2] > moments.sum() + slack:
        raise MetricError(
            f"inertia has the principal moments {moments}, and differs from its transpose by {asymmetry:.3g}; expected "
            "a symmetric matrix with moments of at least 0, none above the sum of the other two"
        )
    return inertia


def carrying(robot: Robot, payload: Payload) -> Robot:
    """A robot like ``robot`` whose model holds the payload, too; raises FrameNotFound, ParameterError."""
    if not isinstance(payload, Payload):
        raise ParameterError(f"payload is a {type(payload).__name__}; expected a cc.Payload")
    name = robot.tool if payload.frame is None else payload.frame
    frame = robot.model.frames[robot.frame_id(name)]
    loaded = copy.copy(robot)
    loaded.model = robot.model.copy()
    loaded.model.appendBodyToJoint(frame.parentJoint, payload.body, frame.placement)
    if robot.spec is not None:
        entry = {"mass": payload.mass, "com": payload.com.tolist(), "frame": name}
        entry["inertia"] = None if payload.inertia is None else payload.inertia.tolist()
        loaded.spec = {**robot.spec, "payloads": [*robot.spec.get("payloads", ()), entry]}
    return loaded
