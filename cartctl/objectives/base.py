"""What an objective is, and how to add one: a value and its exact gradient."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from cartctl.checks import FloatArray
from cartctl.model.state import State


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

    def direction(self, state: State) -> FloatArray:
        """``u0``, (nv,), at the velocity level."""
        return (self.gain if self.maximise else -self.gain) * self.gradient(state)
