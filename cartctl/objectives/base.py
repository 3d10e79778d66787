"""What an objective is, and how to add one: a value and its exact gradient."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from cartctl.checks import FloatArray
from cartctl.model.state import State

_STEP = 6e-6  # cube root of the round-off: where a central difference is at its best


class Objective(ABC):
    """A scalar H(q) that the null space descends (or climbs, if ``maximise``): ``u0 = -k grad H`` (or +k).

    gain: k > 0, (rad/s) per unit of the gradient. Subclass it with ``value`` and ``gradient``.
    """

    gain: float
    maximise: ClassVar[bool] = False

    @abstractmethod
    def value(self, state: State) -> float:
        """``H(q)``."""

    @abstractmethod
    def gradient(self, state: State) -> FloatArray:
        """``dH/dq`` in the tangent space, (nv,)."""

    def hessian(self, state: State) -> FloatArray:
        """``d2H/dq2``, (nv, nv); central differences of the gradient unless a subclass knows better."""
        robot = state.robot
        columns = []
        for step in _STEP * np.eye(robot.nv):
            ends = [
                self.gradient(robot.state(robot.integrate(state.q, s * step), state.v, state.time)) for s in (1.0, -1.0)
            ]
            columns.append((ends[0] - ends[1]) / (2.0 * _STEP))
        return np.array(columns).T  # type: ignore[no-any-return]

    def direction(self, state: State) -> FloatArray:
        """``u0``, (nv,), at the velocity level."""
        return (self.gain if self.maximise else -self.gain) * self.gradient(state)
