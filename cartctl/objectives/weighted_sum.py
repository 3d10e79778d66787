"""Several objectives at once, each with its gain and its sense: H = sum_i w_i s_i k_i H_i."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective


class WeightedSum(Objective):
    """``H = sum_i w_i s_i k_i H_i`` (minimised), k_i the gains, s_i = -1 of one that is maximised and +1 otherwise.

    So ``u0 = -grad H`` is the weighted sum of what each would ask for alone, whatever its units, and w_i < 0 turns one
    round. terms: pairs ``(weight, objective)``, at least one. ``2 * cc.JointRange() + cc.Manipulability()`` is short
    for one; sums of sums are sums of their terms.

    Raises ParameterError, NonFiniteError, ShapeError.
    """

    gain = 1.0

    def __init__(self, terms: Sequence[tuple[float, Objective]]) -> None:
        flat: list[tuple[float, Objective]] = []
        for k, term in enumerate(checks.listed("terms", terms)):
            weight, objective = _pair(term, k)
            inner = objective.terms if isinstance(objective, WeightedSum) else ((1.0, objective),)
            flat += [(weight * w, o) for w, o in inner]
        if not flat:
            raise ParameterError("terms is empty; expected pairs of a weight and an Objective")
        self.terms: tuple[tuple[float, Objective], ...] = tuple(flat)

    def check(self, robot: Robot) -> None:
        """Each must fit the robot, and have a gain of its own."""
        for _, objective in self.terms:
            checks.number(f"the gain of {type(objective).__name__}", objective.gain, low=0.0)
            objective.check(robot)

    def value(self, state: State) -> float:
        """``H(q)``, in (rad/s)^2 where every term is an objective of revolute joints."""
        return float(sum(_factor(w, o) * o.value(state) for w, o in self.terms))

    def gradient(self, state: State) -> FloatArray:
        """``sum_i w_i s_i k_i grad H_i``, (nv,)."""
        return np.sum([_factor(w, o) * o.gradient(state) for w, o in self.terms], axis=0)  # type: ignore[no-any-return]

    def hessian(self, state: State) -> FloatArray:
        """``sum_i w_i s_i k_i d2H_i/dq2``, (nv, nv)."""
        return np.sum([_factor(w, o) * o.hessian(state) for w, o in self.terms], axis=0)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        return " + ".join(f"{w:g} * {o!r}" for w, o in self.terms)


def _pair(term: Any, k: int) -> tuple[float, Objective]:
    weight, objective = checks.listed(f"terms[{k}]", term, 2)
    if not isinstance(objective, Objective):
        raise ParameterError(f"terms[{k}][1] is a {type(objective).__name__}; expected an Objective")
    return checks.number(f"terms[{k}][0]", weight), objective


def _factor(weight: float, objective: Objective) -> float:
    return weight * objective.gain * (-1.0 if objective.maximise else 1.0)
