"""Metrics W by name, as an array, or as a function of the state.

On velocities and accelerations, W = M is the metric of kinetic energy; on torques, M^-1 is, and the names differ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra.metric import as_metric
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.levels.inertia import inverse_inertia, inverse_inertia_squared
from cartctl.model.limits import Limits
from cartctl.model.state import State

Metric = FloatArray | Callable[[State], FloatArray] | None

_NEAREST = 1e-6  # of the range: how near a limit a joint may come before its weight stops growing


@dataclass(frozen=True, eq=False)
class JointLimitMetric:
    """Weights that hold back joints on their way to a limit (Chan & Dubey 1995), for ``Controller(metric=...)``.

    ``w_i = 1 + |dH/dq_i|`` while joint i moves towards the limit it is nearer to or stands still, 1 while it moves
    away, with ``H = sum_i 1/4 (q_max - q_min)^2 / ((q_max - q)(q - q_min))``. Whether it moves away is read from the
    state's velocity, so nothing is kept from step to step. Joints without two limits weigh 1. gain: >= 0, a factor on
    |dH/dq_i|. limits: instead of the robot's own.

    Raises ParameterError, NonFiniteError.
    """

    gain: float = 1.0
    limits: Limits | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", checks.number("gain", self.gain, low=0.0))
        if self.limits is not None and not isinstance(self.limits, Limits):
            raise ParameterError(f"limits is a {type(self.limits).__name__}; expected Limits such as robot.limits")

    def __call__(self, state: State) -> FloatArray:
        """The weights at ``state``, (nv,)."""
        slope = self.slope(state)
        return np.where(slope * state.v < 0.0, 1.0, 1.0 + self.gain * np.abs(slope))

    def slope(self, state: State) -> FloatArray:
        """``dH/dq_i = (q_max - q_min)^2 (2 q - q_max - q_min) / (4 (q_max - q)^2 (q - q_min)^2)``, (nv,).

        At a limit and beyond, its value at a millionth of the range before it.
        """
        limits = self.limits or state.robot.limits
        low, high = limits.position_lower, limits.position_upper
        bounded = np.isfinite(low) & np.isfinite(high) & (low < high)
        low, high = low[bounded], high[bounded]
        width = high - low
        q = state.robot.coordinates(state.q)[bounded]
        q = np.minimum(np.maximum(q, low + _NEAREST * width), high - _NEAREST * width)
        slope = np.zeros(state.robot.nv)
        slope[bounded] = width**2 * (2.0 * q - high - low) / (4.0 * (high - q) ** 2 * (q - low) ** 2)
        return slope


def _inertia(state: State) -> FloatArray:
    return state.mass_matrix


Named = Mapping[str, Callable[[State], FloatArray] | None]

KINEMATIC: Named = {"identity": None, "inertia": _inertia, "joint-limits": JointLimitMetric()}
DYNAMIC: Named = {
    "identity": None,
    "inverse-inertia": inverse_inertia,
    "inverse-inertia-squared": inverse_inertia_squared,
}


def as_state_metric(metric: Any, nv: int, named: Named = KINEMATIC) -> Metric:
    """``metric`` as None (identity), a checked array, or a function of the state whose answers are checked.

    named: the names that mean something at the level. Raises ParameterError, MetricError, ShapeError, NonFiniteError.
    """
    if metric is None:
        return None
    if isinstance(metric, str):
        return named[_known(metric, named)]
    if isinstance(metric, JointLimitMetric):
        return metric
    if callable(metric):
        return lambda state: as_metric(metric(state), nv)
    return as_metric(metric, nv)


def _known(name: str, named: Named) -> str:
    """``name`` if it is one of these; one that belongs to another level is refused in its own words."""
    if name not in named and (name in KINEMATIC or name in DYNAMIC):
        here, other = ("torques", "velocities and accelerations") if named is DYNAMIC else ("motion", "torques")
        raise ParameterError(
            f"metric {name!r} is one of {other}; expected one of {', '.join(map(repr, named))} at a level that "
            f"commands {here}"
        )
    return checks.choice("metric", name, tuple(named))
