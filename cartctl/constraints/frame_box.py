"""A box that the origin of a frame stays in."""

from __future__ import annotations

from typing import Any

import numpy as np

from cartctl import checks
from cartctl.constraints.position import PositionConstraint
from cartctl.errors import ParameterError

_ORTHONORMAL = 1e-6


class FrameBox(PositionConstraint):
    """Keep the origin of ``frame`` in a box: ``lower <= R^T p <= upper`` (3,), m, +-inf where it is open.

    axes: ``"world"``, or a rotation R (3, 3) whose columns are the box's axes in the world (origin: the world's).
    deceleration (m/s^2), recovery_speed (m/s) and margin (m) as in :class:`cartctl.constraints.PositionConstraint`:
    with the margin worked out, no step of the exact integrators crosses as long as the command obeys its rows and its
    box. Raises ShapeError, NonFiniteError, ParameterError; FrameNotFound when it meets a robot.
    """

    def __init__(
        self,
        frame: str,
        lower: Any,
        upper: Any,
        *,
        axes: Any = "world",
        deceleration: float = 2.0,
        recovery_speed: float = 0.1,
        margin: float | None = None,
        name: str | None = None,
    ) -> None:
        low = checks.vector("lower", lower, 3, infinite=True)
        high = checks.vector("upper", upper, 3, infinite=True)
        if not (low <= high).all() or (low == np.inf).any() or (high == -np.inf).any():
            raise ParameterError(f"lower is {low} and upper is {high}; expected lower <= upper, with room between")
        super().__init__(
            frame, _axes(axes).T, low, high, deceleration, recovery_speed, margin, name or f"box of {frame}"
        )


def _axes(axes: Any) -> checks.FloatArray:
    if isinstance(axes, str):
        checks.choice("axes", axes, ("world",))
        return np.eye(3)
    R = checks.matrix("axes", axes, 3, 3)
    if np.abs(R.T @ R - np.eye(3)).max() > _ORTHONORMAL:
        raise ParameterError(f"axes are {R.tolist()}; expected 'world' or a rotation matrix")
    return R
