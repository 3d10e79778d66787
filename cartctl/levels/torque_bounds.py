"""Bounds on torques at the acceleration level: ``lower - h <= M a <= upper - h``, as rows of constraints."""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.constraints import Box
from cartctl.levels.loads import Loads
from cartctl.model.limits import Limits
from cartctl.model.state import State

Blocks = tuple[FloatArray, FloatArray, FloatArray]


def torque_box(limits: Limits) -> Box | None:
    """What the motors can give, None where nothing bounds it."""
    lower, upper = limits.torque_lower, limits.torque_upper
    return Box(lower, upper) if np.isfinite(lower).any() or np.isfinite(upper).any() else None


def torque_rows(loads: Loads, state: State, rows: Blocks | None, torque: Box) -> Blocks:
    """``rows`` on a, and below them those of the torques."""
    M, h = state.mass_matrix, loads.effects(state)
    low, high = torque.lower - h, torque.upper - h
    if rows is None:
        return M, low, high
    return np.concatenate([rows[0], M]), np.concatenate([rows[1], low]), np.concatenate([rows[2], high])
