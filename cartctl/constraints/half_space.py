"""A plane that the origin of a frame stays behind."""

from __future__ import annotations

from typing import Any

import numpy as np

from cartctl import checks
from cartctl.constraints.position import PositionConstraint
from cartctl.errors import ParameterError


class HalfSpace(PositionConstraint):
    """Keep the origin of ``frame`` behind a plane: ``n . p <= offset``, n (3,) in the world, offset in m.

    A normal of any length: ``normal . p <= offset`` is what holds, and both are divided by its length. deceleration
    (m/s^2), recovery_speed (m/s) and margin (m) as in :class:`cartctl.FrameBox`. Raises ShapeError, NonFiniteError,
    ParameterError; FrameNotFound when it meets a robot.
    """

    def __init__(
        self,
        frame: str,
        normal: Any,
        offset: Any,
        *,
        deceleration: float = 2.0,
        recovery_speed: float = 0.1,
        margin: float | None = None,
        name: str | None = None,
    ) -> None:
        n = checks.vector("normal", normal, 3)
        length = float(np.linalg.norm(n))
        if not (length > 0.0 and np.isfinite(length)):
            raise ParameterError(f"normal is {n}; expected a direction")
        upper = np.array([checks.number("offset", offset) / length])
        super().__init__(
            frame,
            n[None] / length,
            np.array([-np.inf]),
            upper,
            deceleration,
            recovery_speed,
            margin,
            name or f"half-space of {frame}",
        )
