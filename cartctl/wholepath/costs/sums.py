"""Sums of costs, and what stands for an objective: a name, an Objective of the state, or an integral."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives import InverseManipulability, JointRange, KineticEnergy, SelfClearance, WeightedSum
from cartctl.objectives.base import Objective
from cartctl.wholepath.blocks import Quadratic
from cartctl.wholepath.costs.base import PathCost
from cartctl.wholepath.costs.pointwise import Integral
from cartctl.wholepath.costs.speed import JointSpeed, PathEnergy
from cartctl.wholepath.costs.torque import SquaredTorque
from cartctl.wholepath.trace import Trace

NAMED: dict[str, Callable[[], PathCost]] = {
    "kinetic-energy": PathEnergy,
    "joint-speed": JointSpeed,
    "joint-range": lambda: Integral(JointRange()),
    "inverse-manipulability": lambda: Integral(InverseManipulability()),
    "self-clearance": lambda: Integral(SelfClearance()),
    "torque": SquaredTorque,
}


class CostSum(PathCost):
    """``sum_i w_i J_i``; sums of sums are sums of their terms."""

    def __init__(self, terms: Sequence[tuple[float, PathCost]]) -> None:
        flat: list[tuple[float, PathCost]] = []
        for weight, cost in terms:
            inner = cost.terms if isinstance(cost, CostSum) else ((1.0, cost),)
            flat += [(weight * w, c) for w, c in inner]
        self.terms: tuple[tuple[float, PathCost], ...] = tuple(flat)

    @property
    def name(self) -> str:
        """For reports."""
        return " + ".join(cost.name if weight == 1.0 else f"{weight:g} {cost.name}" for weight, cost in self.terms)

    def check(self, robot: Robot) -> None:
        """Each must fit the robot."""
        for _, cost in self.terms:
            cost.check(robot)

    def value(self, trace: Trace) -> float:
        """The weighted sum."""
        return sum(weight * cost.value(trace) for weight, cost in self.terms)

    def quadratic(self, trace: Trace) -> Quadratic:
        """The weighted sum."""
        full = Quadratic.zeros(trace.setting.size, trace.setting.robot.nv)
        for weight, cost in self.terms:
            full.add(cost.quadratic(trace), weight)
        return full

    def node(self, state: State) -> float:
        """The weighted sum."""
        return sum(weight * cost.node(state) for weight, cost in self.terms)

    def pace(self, state: State) -> FloatArray | None:
        """The weighted sum."""
        found = [(weight, cost.pace(state)) for weight, cost in self.terms]
        parts = [weight * W for weight, W in found if W is not None]
        return np.sum(parts, axis=0) if parts else None

    def __repr__(self) -> str:
        return " + ".join(f"{w:g} * {c!r}" for w, c in self.terms)


def weighed(given: PathCost | Objective) -> list[tuple[float, PathCost]]:
    """The terms of a sum; an objective counts with its gain."""
    if isinstance(given, CostSum):
        return list(given.terms)
    if isinstance(given, PathCost):
        return [(1.0, given)]
    pairs = given.terms if isinstance(given, WeightedSum) else ((1.0, given),)
    terms = []
    for weight, objective in pairs:
        if weight * objective.gain < 0.0:
            if isinstance(objective, KineticEnergy) and objective.velocity is None:
                raise ParameterError(
                    f"kinetic energy has the weight {weight:g}; expected more than 0: no path has most"
                )
            objective, weight = _Turned(objective), -weight
        terms.append((weight * objective.gain, integral_of(objective)))
    return terms


class _Turned(Objective):
    """An objective the other way round."""

    def __init__(self, inner: Objective) -> None:
        self.inner, self.gain, self.maximise = inner, inner.gain, not inner.maximise

    def value(self, state: State) -> float:
        return self.inner.value(state)

    def gradient(self, state: State) -> FloatArray:
        return self.inner.gradient(state)

    def check(self, robot: Robot) -> None:
        self.inner.check(robot)


def integral_of(objective: Objective) -> PathCost:
    """The integral of one objective, without its gain; the kinetic energy of the path's own motion."""
    if isinstance(objective, KineticEnergy) and objective.velocity is None:
        return PathEnergy()
    return Integral(objective)


def as_cost(given: Any) -> PathCost:
    """What ``objective=`` stands for; raises ParameterError."""
    if isinstance(given, PathCost):
        return given
    if isinstance(given, WeightedSum):
        return CostSum(weighed(given))
    if isinstance(given, Objective):
        return integral_of(given)
    if isinstance(given, str) and given in NAMED:
        return NAMED[given]()
    names = ", ".join(map(repr, NAMED))
    raise ParameterError(
        f"objective is {given!r}; expected one of {names}, an Objective such as cc.Clearance(scene), or a cost such as "
        "cc.JointSpeed(weights)"
    )
