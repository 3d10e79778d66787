"""Distance from the middle of the joint ranges: H = 1/(2n) sum ((q_i - mid_i) / (max_i - min_i))^2."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cartctl.checks import FloatArray
from cartctl.model.limits import Limits
from cartctl.model.state import State
from cartctl.objectives.base import Objective, checked_gain


@dataclass(frozen=True, eq=False)
class JointRange(Objective):
    """Keep the joints near mid-range (minimised; Liegeois 1977).

    ``H = 1/(2n) sum_i ((q_i - q_mid_i) / (q_max_i - q_min_i))^2`` over the n joints that have two position limits; the
    others contribute nothing. H is at most 1/8 within the limits. gain: k > 0 in ``q_dot_0 = -k grad H``; grad H is
    small, (q - mid) / (n range^2), so that k = 100 means time constants of seconds on an arm. limits: Limits to use
    instead of the robot's own.

    >>> import cartctl as cc
    >>> robot = cc.load("panda")
    >>> middle = (robot.limits.position_lower + robot.limits.position_upper) / 2
    >>> print(cc.JointRange().value(robot.state(middle)), cc.JointRange().gradient(robot.state(middle)).max())
    0.0 0.0
    """

    gain: float = 100.0
    limits: Limits | None = None
    _known: dict[int, tuple[FloatArray, FloatArray, bool]] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        checked_gain(self)

    def value(self, state: State) -> float:
        """``H(q)``, no unit."""
        gap, weight = self._terms(state)
        return 0.5 * float(gap @ (weight * gap))

    def gradient(self, state: State) -> FloatArray:
        """``(q_i - mid_i) / (n range_i^2)``, (nv,), 1/rad or 1/m."""
        gap, weight = self._terms(state)
        return weight * gap

    def hessian(self, state: State) -> FloatArray:
        """``diag(1 / (n range_i^2))``, (nv, nv)."""
        return np.diag(self._terms(state)[1])

    def _terms(self, state: State) -> tuple[FloatArray, FloatArray]:
        robot = state.robot
        limits = self.limits or robot.limits
        if id(limits) not in self._known:
            middle, weight = _middle_and_weight(limits)
            self._known[id(limits)] = (middle, weight, robot.nq == robot.nv)
        middle, weight, plain = self._known[id(limits)]
        return (state.q if plain else robot.coordinates(state.q)) - middle, weight


def _middle_and_weight(limits: Limits) -> tuple[FloatArray, FloatArray]:
    low, high = limits.position_lower, limits.position_upper
    bounded = np.isfinite(low) & np.isfinite(high) & (low < high)
    middle, weight = np.zeros(len(low)), np.zeros(len(low))
    middle[bounded] = 0.5 * (low[bounded] + high[bounded])
    weight[bounded] = 1.0 / (max(int(bounded.sum()), 1) * (high[bounded] - low[bounded]) ** 2)
    return middle, weight
