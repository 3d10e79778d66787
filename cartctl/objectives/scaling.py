"""The diagonal D that makes joints of unlike strength or speed comparable: given, from the limits, or none."""

from __future__ import annotations

from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.robot import Robot


def checked_scale(objective: Any) -> None:
    """``scale`` as None, ``"limits"`` or an array; raises ParameterError, ShapeError, NonFiniteError."""
    scale = objective.scale
    if scale is None:
        return
    if isinstance(scale, str):
        if scale != "limits":
            raise ParameterError(f"scale is {scale!r}; expected None, 'limits' or one number a joint")
        return
    array = checks.vector("scale", scale)
    if (array < 0.0).any() or not array.any():
        raise ParameterError(f"scale is {array}; expected numbers of at least 0, not all 0")
    object.__setattr__(objective, "scale", array)


def check_scale(scale: Any, robot: Robot, limit: FloatArray, what: str) -> None:
    """Whether a checked scale fits the robot; raises ShapeError, and ParameterError where a limit is missing."""
    if isinstance(scale, str):
        open_ended = robot.single & ~((limit > 0.0) & np.isfinite(limit))
        if open_ended.any():
            name = robot.dof_names[int(open_ended.argmax())]
            raise ParameterError(f"scale is 'limits', but joint {name!r} has no {what} limit; give one number a joint")
    elif scale is not None:
        checks.vector("scale", scale, robot.nv)


def reciprocal(limit: FloatArray) -> FloatArray:
    """``1 / limit``, 0 where there is no limit."""
    return np.divide(1.0, limit, out=np.zeros_like(limit), where=limit > 0.0)


def finite(limit: FloatArray) -> FloatArray:
    """``limit``, 0 where there is none."""
    return np.where(np.isfinite(limit), limit, 0.0)
