"""What a plan minimises: an integral over the whole path, as a sum over its samples, and how to add one.

A cost knows its value on a :class:`Trace` and a local model of it, ``g . delta + 1/2 delta^T H delta`` in the samples'
displacements, with the exact gradient g and a positive semidefinite H (Gauss-Newton where it is a sum of squares).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective
from cartctl.wholepath.blocks import Quadratic
from cartctl.wholepath.trace import Trace


class PathCost(ABC):
    """An integral over a path, for ``cc.plan(objective=...)``.

    Costs and objectives add up: ``cc.JointSpeed() + 0.1 * cc.JointRange()``; in a sum an objective counts with its
    gain and its sense, as in :class:`cartctl.WeightedSum`.
    """

    __array_ufunc__ = None

    @property
    def name(self) -> str:
        """For reports."""
        return repr(self)

    def check(self, robot: Robot) -> None:
        """Refuse what does not fit the robot."""
        return

    @abstractmethod
    def value(self, trace: Trace) -> float:
        """The integral."""

    @abstractmethod
    def quadratic(self, trace: Trace) -> Quadratic:
        """The local model."""

    def node(self, state: State) -> float:
        """The integrand's part that depends on the configuration alone; coarse searches go by it."""
        return 0.0

    def pace(self, state: State) -> FloatArray | None:
        """W (nv, nv) of the integrand's part ``1/2 v^T W v``; None where there is none."""
        return None

    def __add__(self, other: Any) -> PathCost:
        """Both at once."""
        from cartctl.wholepath.costs.sums import CostSum, weighed

        if not isinstance(other, (PathCost, Objective)):
            return NotImplemented
        return CostSum([(1.0, self), *weighed(other)])

    __radd__ = __add__

    def __sub__(self, other: Any) -> PathCost:
        """An objective the other way round."""
        return self + -other if isinstance(other, Objective) else NotImplemented

    def __mul__(self, factor: float) -> PathCost:
        """``factor`` times as much; factor > 0."""
        from cartctl.wholepath.costs.sums import CostSum

        return CostSum([(checks.number("the factor of a cost", factor, low=0.0, strict=True), self)])

    __rmul__ = __mul__


def positive_weights(name: str, value: Any) -> Any:
    """None, or (nv,) numbers of at least 0 that are not all 0; raises ParameterError, ShapeError, NonFiniteError."""
    if value is None:
        return None
    weights = checks.vector(name, value)
    if (weights < 0.0).any() or not weights.any():
        raise ParameterError(f"{name} is {weights}; expected numbers of at least 0, not all 0")
    return weights
