"""How hard an arm at rest may push before a joint torque meets its limit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.algebra.metric import Whitening, as_metric
from cartctl.algebra.svd import ROUND_OFF, norm, scale
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError


class WrenchRange(NamedTuple):
    """The s for which the torques of the wrench ``s d`` keep their limits: lowest <= s <= highest.

    +-inf where the structure alone carries d. The joint that stops it at either end, -1 where none does. ``empty``
    (lowest > highest, inf and -inf) where no s does: the load alone is too much.
    """

    lowest: float
    highest: float
    lowest_joint: int
    highest_joint: int

    @property
    def empty(self) -> bool:
        """Whether there is no s."""
        return self.lowest > self.highest


class Capacity(NamedTuple):
    """The size of the largest wrench that may point anywhere, and the first joint at its limit (-1: none ever is)."""

    size: float
    joint: int


def wrench_range(J: Any, direction: Any, lower: Any, upper: Any, load: Any = None) -> WrenchRange:
    """Every s with ``lower <= load + s J^T d <= upper``: how hard the hand may push along d, and pull.

    J: (m, n). direction: d (m,), of any length but zero; s is in its units. lower, upper: (n,), +-inf where there is no
    limit, such as ``limits.torque_upper``. load: (n,), torques that are needed anyway, such as ``state.gravity``; zero.

    Raises ShapeError, NonFiniteError, ParameterError for the zero direction or crossed limits.
    """
    J, lower, upper, load = _checked(J, lower, upper, load)
    d = checks.vector("direction", direction, J.shape[0])
    if not d.any():
        raise ParameterError(f"direction is {d}; expected a vector that is not zero")
    slope = J.T @ d
    slope[np.abs(slope) <= ROUND_OFF * max(J.shape) * scale(J) * scale(d)] = 0.0
    still = slope == 0.0
    if ((load < lower) | (load > upper))[still].any():
        joint = int(np.argmax(still & ((load < lower) | (load > upper))))
        return WrenchRange(np.inf, -np.inf, joint, joint)
    ends = np.full((2, J.shape[1]), np.inf)
    ends[:, ~still] = np.array([lower - load, upper - load])[:, ~still] / slope[~still]
    ends[0, still] = -np.inf
    low, high = ends.min(axis=0), ends.max(axis=0)
    lowest, highest = low.max(initial=-np.inf), high.min(initial=np.inf)
    first = int(low.argmax()) if np.isfinite(lowest) else -1
    last = int(high.argmin()) if np.isfinite(highest) else -1
    if lowest > highest:
        return WrenchRange(np.inf, -np.inf, first, last)
    return WrenchRange(float(lowest), float(highest), first, last)


def wrench_capacity(J: Any, lower: Any, upper: Any, load: Any = None, metric: Any = None) -> Capacity:
    """The largest r such that every wrench with ``w^T W w <= r^2`` keeps ``lower <= load + J^T w <= upper``.

    ``r = min_i (distance of load_i from its limits) / |J_i|``, J_i column i in the metric: the largest ball inside the
    polytope of bearable wrenches. 0 where the load alone is too much, inf where no limit is ever met. metric: W, (m,)
    or (m, m), identity; weigh moments against forces as in :func:`balanced_wrench`. The rest, and errors, as of
    :func:`wrench_range`; MetricError.
    """
    J, lower, upper, load = _checked(J, lower, upper, load)
    columns = J.T
    if metric is not None:
        columns = Whitening(as_metric(metric, J.shape[0])).matrix(np.asfortranarray(columns))
    room = np.minimum(upper - load, load - lower)
    if (room < 0.0).any():
        return Capacity(0.0, int(room.argmin()))
    arms = np.array([norm(np.ascontiguousarray(column)) for column in columns])
    felt = arms > ROUND_OFF * max(J.shape) * scale(columns)
    sizes = np.full(J.shape[1], np.inf)
    sizes[felt] = room[felt] / arms[felt]
    size = float(sizes.min(initial=np.inf))
    return Capacity(size, int(sizes.argmin()) if size < np.inf else -1)


def _checked(J: Any, lower: Any, upper: Any, load: Any) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    J = checks.matrix("J", J)
    n = J.shape[1]
    lower = checks.vector("lower", lower, n, infinite=True)
    upper = checks.vector("upper", upper, n, infinite=True)
    if (lower > upper).any():
        i = int(np.argmax(lower > upper))
        raise ParameterError(f"lower[{i}] is {lower[i]:g}, above upper[{i}], {upper[i]:g}; expected lower <= upper")
    return J, lower, upper, np.zeros(n) if load is None else checks.vector("load", load, n)
