"""What an objective is, and how to add one: a value and its exact gradient."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.model.differences import central
from cartctl.model.robot import Robot
from cartctl.model.state import State

if TYPE_CHECKING:
    from cartctl.objectives.weighted_sum import WeightedSum


class Objective(ABC):
    """A scalar H(q) that the null space descends (or climbs, if ``maximise``): ``u0 = -k grad H`` (or +k).

    gain: k > 0, (rad/s) per unit of the gradient; at the acceleration level (rad/s^2). Subclass it with ``value`` and
    ``gradient``. Objectives add up: ``a + b``, ``2.0 * a``, ``a - b``, each with its own gain and sense, are a
    :class:`cartctl.WeightedSum`.
    """

    gain: float
    maximise: bool = False
    __array_ufunc__ = None  # so that numpy's numbers leave ``factor * objective`` to __rmul__

    @abstractmethod
    def value(self, state: State) -> float:
        """``H(q)``."""

    @abstractmethod
    def gradient(self, state: State) -> FloatArray:
        """``dH/dq`` in the tangent space, (nv,)."""

    def check(self, robot: Robot) -> None:
        """Refuse what does not fit the robot, once, when a controller is made."""
        return

    def hessian(self, state: State) -> FloatArray:
        """``d2H/dq2``, (nv, nv); central differences of the gradient unless a subclass knows better."""
        return central(state, self.gradient)

    def direction(self, state: State) -> FloatArray:
        """``u0``, (nv,), at the velocity level."""
        return (self.gain if self.maximise else -self.gain) * self.gradient(state)

    def __mul__(self, factor: float) -> WeightedSum:
        """``factor`` times as strong; the other way round if it is negative."""
        from cartctl.objectives.weighted_sum import WeightedSum

        return WeightedSum([(factor, self)])

    __rmul__ = __mul__

    def __neg__(self) -> WeightedSum:
        """The same the other way round."""
        return self * -1.0

    def __add__(self, other: Objective) -> WeightedSum:
        """Both at once."""
        from cartctl.objectives.weighted_sum import WeightedSum

        return WeightedSum([(1.0, self), (1.0, other)]) if isinstance(other, Objective) else NotImplemented

    def __sub__(self, other: Objective) -> WeightedSum:
        """``self`` and the other one the other way round."""
        return self + -other if isinstance(other, Objective) else NotImplemented


def checked_gain(objective: Objective) -> None:
    """``gain`` as a positive number, of a frozen objective, too; raises ParameterError, NonFiniteError."""
    object.__setattr__(objective, "gain", checks.number("gain", objective.gain, low=0.0, strict=True))
