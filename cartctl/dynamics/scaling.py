"""Uniform time scaling: the same path in another time, so that its torques keep their bounds (Hollerbach 1984).

A motion run k times slower, ``t -> k t``, has velocities ``v/k`` and accelerations ``a/k^2``. Its torques are
``tau(k) = static + viscous / k + inertial / k^2``: gravity and Coulomb friction do not scale, viscous friction once,
inertia, Coriolis and centrifugal torques twice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.robot import Robot


@dataclass(frozen=True, eq=False)
class TimeScaling:
    """The fastest uniform scaling of a motion; made by :func:`time_scaling`.

    factor: k, new duration over old; above 1 the motion must slow down, below 1 it may speed up, 0 if nothing ever
    stops it, nan where no k is feasible. torque: (N, n) at that k. sample, joint: where the bound is met, or what
    leaves no k if none is feasible; None if nothing stops the motion before ``at_least``.
    """

    factor: float
    torque: FloatArray
    sample: int | None
    joint: int | None

    @property
    def feasible(self) -> bool:
        """Whether some k meets the bounds."""
        return not math.isnan(self.factor)

    @property
    def slows_down(self) -> bool:
        """Whether the motion as it was asked too much."""
        return self.factor > 1.0

    def __str__(self) -> str:
        if not self.feasible:
            return f"no speed is slow enough: joint {self.joint} at sample {self.sample}"
        if self.joint is None:
            return "nothing stops it" if self.factor == 0.0 else f"{self.factor:.6g} times the duration, as asked for"
        verb = "slow down" if self.slows_down else "may speed up"
        return (
            f"{verb}: {self.factor:.6g} times the duration; joint {self.joint} meets its bound at sample {self.sample}"
        )


def time_scaling(
    torque: Any, static: Any, upper: Any, lower: Any = None, viscous: Any = None, at_least: float = 0.0
) -> TimeScaling:
    """The smallest k >= ``at_least`` with ``lower <= static + viscous / k + inertial / k^2 <= upper`` everywhere.

    torque: (N, n) of the motion as it is, N m or N, N samples of n joints, or (n,). static: as torque, the part that
    does not scale (gravity, Coulomb friction); ``inertial = torque - static - viscous``. upper, lower: (n,), lower is
    -upper if None, +-inf for none. viscous: as torque, none if None. at_least: 1.0 only ever slows down.

    A joint whose static torque lies beyond its bound is held up by the inertial part alone, which may leave an
    interval of k or none (``feasible``). Raises ShapeError, NonFiniteError, ParameterError.
    """
    total = _samples("torque", torque, None)
    n = total.shape[1]
    still = _samples("static", static, total.shape)
    drag = np.zeros_like(total) if viscous is None else _samples("viscous", viscous, total.shape)
    high = checks.vector("upper", upper, n, infinite=True)
    low = -high if lower is None else checks.vector("lower", lower, n, infinite=True)
    if not (low <= high).all():
        j = int(np.argmax(low > high))
        raise ParameterError(f"lower[{j}] is {low[j]:g}, above upper[{j}] = {high[j]:g}; expected lower <= upper")
    floor = checks.number("at_least", at_least, low=0.0)
    with np.errstate(over="ignore"):  # refused below
        inertial = total - still - drag
    if not np.isfinite(inertial).all():
        raise ParameterError("torque - static - viscous is beyond the largest number; expected torques in N m or N")
    y, row = _fastest(_forbidden(inertial, drag, still, low, high), 1.0 / floor if floor > 0.0 else math.inf)
    sample, joint = (None, None) if row is None else divmod(row % total.size, n)
    if y is None:
        return TimeScaling(math.nan, np.full_like(total, math.nan), sample, joint)
    if math.isinf(y):
        return TimeScaling(0.0, still.copy(), None, None)
    return TimeScaling(1.0 / y, still + drag * y + inertial * (y * y), sample, joint)


def motion_torques(robot: Robot, q: Any, v: Any, a: Any) -> tuple[FloatArray, FloatArray]:
    """``(torque, static)``, (N, nv) each, N m or N, along q (N, nq), v (N, nv), a (N, nv): rnea, and its gravity part.

    As :func:`time_scaling` takes them; add friction to both. Raises ShapeError, NonFiniteError, ConfigurationError,
    ParameterError.
    """
    if not isinstance(robot, Robot):
        raise ParameterError(f"robot is a {type(robot).__name__}; expected a Robot from cc.load(...)")
    postures = checks.matrix("q", q, None, robot.nq)
    rates = checks.matrix("v", v, len(postures), robot.nv)
    accelerations = checks.matrix("a", a, len(postures), robot.nv)
    torque, static = np.empty((2, len(postures), robot.nv))
    data = robot.model.createData()
    for i, posture in enumerate(postures):
        state = robot.state(posture, rates[i])
        torque[i] = pin.rnea(robot.model, data, state.q, state.v, accelerations[i])
        static[i] = state.gravity
    return torque, static


def _samples(name: str, value: Any, shape: tuple[int, ...] | None) -> FloatArray:
    """(N, n); one sample may come as (n,)."""
    array = checks.floats(name, value)
    if array.ndim == 1:
        array = array[None]
    rows, columns = (None, None) if shape is None else shape
    return np.ascontiguousarray(checks.matrix(name, array, rows, columns))


def _forbidden(
    inertial: FloatArray, viscous: FloatArray, static: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Open intervals ``(start, end)`` of y = 1/k > 0 where a torque is beyond a bound, and the entry it belongs to."""
    A = np.concatenate([inertial.ravel(), -inertial.ravel()])  # A y^2 + B y + C > 0 is forbidden
    B = np.concatenate([viscous.ravel(), -viscous.ravel()])
    C = np.concatenate([(static - high).ravel(), (low - static).ravel()])
    entry = np.arange(A.size)
    with np.errstate(all="ignore"):  # A = 0, infinite bounds: those rows are sorted out below
        root = np.sqrt(np.maximum(B * B - 4.0 * A * C, 0.0))
        sum_ = -0.5 * (B + np.copysign(root, B))
        first, second = sum_ / A, np.where(sum_ == 0.0, 0.0, C / sum_)
        real = B * B - 4.0 * A * C >= 0.0
        r1, r2 = np.fmin(first, second), np.fmax(first, second)
        line = -C / B
    none, all_ = np.zeros(A.size), np.full(A.size, np.inf)
    up, down, flat = A > 0.0, A < 0.0, A == 0.0
    # each entry forbids a stretch from zero, one to infinity, one between, or all of them
    before = np.where(up & real, r1, np.where(flat & (B < 0.0), line, none))
    after = np.where(up & real, r2, np.where(flat & (B > 0.0), line, all_))
    everything = (up & ~real) | (flat & (B == 0.0) & (C > 0.0))
    inside = down & real
    starts = np.concatenate([none, np.where(everything, 0.0, after), np.where(inside, r1, all_)])
    ends = np.concatenate([before, all_, np.where(inside, r2, all_)])
    bounded = np.tile(np.isfinite(C), 3)
    starts = np.maximum(starts, 0.0)
    kept = bounded & (ends > starts)
    return starts[kept], ends[kept], np.tile(entry, 3)[kept]


def _fastest(forbidden: tuple[FloatArray, FloatArray, FloatArray], most: float) -> tuple[float | None, int | None]:
    """The largest allowed y in (0, most] and the entry that stops it; y = None if there is none."""
    starts, ends, entries = forbidden
    y, entry = most, None
    while True:
        covers = (starts < y) & ((ends > y) | np.isinf(ends))
        if not covers.any():
            return y, entry
        lowest = np.flatnonzero(covers)[int(np.argmin(starts[covers]))]
        y, entry = float(starts[lowest]), int(entries[lowest])
        if y == 0.0:
            return None, entry
