"""Central differences in the tangent space: for what brings no derivative, and for joints that Pinocchio differs on."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from cartctl.checks import FloatArray

if TYPE_CHECKING:
    from cartctl.model.state import State

STEP = 6e-6  # cube root of the round-off: where a central difference is at its best


def central(state: State, function: Callable[[State], Any], step: float = STEP) -> FloatArray:
    """``(f(q (+) h e_i) - f(q (-) h e_i)) / 2h``, of any shape with i as a last axis; v is held."""
    robot, scratch = state.robot, type(state)(state.robot)
    columns = []
    for shift in step * np.eye(robot.nv):
        ends = []
        for signed in (shift, -shift):
            scratch.set(robot.integrate(state.q, signed), state.v, state.time)
            ends.append(np.array(function(scratch)))
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    return np.stack(columns, axis=-1)
