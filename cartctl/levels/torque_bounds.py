"""Rows of constraints between accelerations and torques: ``lower - h <= M a <= upper - h``, and the way back."""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.constraints import Box
from cartctl.levels.inertia import by_inertia
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


def through_inertia_rows(state: State, h: FloatArray, rows: Blocks | None, outside: Blocks) -> Blocks:
    """``rows``, and below them those of constraints on a: ``l + C M^-1 h <= C M^-1 tau <= u + C M^-1 h``."""
    C = by_inertia(state, outside[0])
    shift = C @ h
    more = (C, outside[1] + shift, outside[2] + shift)
    if rows is None:
        return more
    return tuple(np.concatenate(pair) for pair in zip(rows, more, strict=True))  # type: ignore[return-value]
