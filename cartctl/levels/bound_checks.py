"""Which limits no joint can keep, found when a controller is made instead of when it brakes.

At rest inside its limits a joint can stay where it is, and a joint that moves inside its bounds can come to rest. So a
set of limits is viable at any dt, position ranges of zero width included, unless it rules out standing still (zero
velocity) or braking (an acceleration, or jerk, of either sign).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cartctl.checks import FloatArray
from cartctl.errors import ParameterError, ShapeError
from cartctl.model.limits import Limits

_REPRESENTABLE = 1e150  # of limits in units of one step, and their inverse: their products must not overflow


def require_viable(limits: Limits, dt: float, jerk: bool, names: Sequence[str] | None) -> None:
    """Raise ParameterError naming the first joint whose limits cannot be kept; ShapeError if the names don't fit."""
    n = len(limits.position_lower)
    if names is not None and len(names) != n:
        raise ShapeError(f"names has {len(names)} entries; expected {n}, one a joint")
    quantities = {"velocity": 1, "acceleration": 2} | ({"jerk": 3} if jerk else {})
    for quantity, order in quantities.items():
        lower, upper = getattr(limits, f"{quantity}_lower"), getattr(limits, f"{quantity}_upper")
        for side, limit in (("lower", -lower), ("upper", upper)):  # both >= 0 where a joint may stand
            bad = np.flatnonzero(limit < 0.0 if quantity == "velocity" else limit <= 0.0)
            field = f"{quantity}_{side}"
            if bad.size:
                raise ParameterError(_sentence(limits, field, int(bad[0]), names))
            _require_representable(limit * dt**order, field, dt, names)
    outside = np.flatnonzero((limits.position_lower == np.inf) | (limits.position_upper == -np.inf))
    if outside.size:
        raise ParameterError(_sentence(limits, "position", int(outside[0]), names))


def _sentence(limits: Limits, field: str, i: int, names: Sequence[str] | None) -> str:
    quantity, _, side = field.partition("_")
    if quantity == "position":
        interval = f"[{limits.position_lower[i]:g}, {limits.position_upper[i]:g}]"
        return f"limits.position of {_joint(i, names)} are {interval}; expected an interval that holds a finite number"
    value = f"limits.{field} of {_joint(i, names)} is {getattr(limits, field)[i]:g}"
    sign = "below" if side == "lower" else "above"
    if quantity == "velocity":
        return f"{value}; expected 0 or {sign} it, because a joint must be able to stand still; move the limit past 0"
    towards = "upper" if side == "lower" else "lower"
    return (
        f"{value}; expected a number {sign} 0, or the joint cannot brake before its {towards} limits; widen it "
        f"({'-' if side == 'lower' else ''}inf for none), and list a joint that shall not move as disabled"
    )


def _require_representable(steps: FloatArray, field: str, dt: float, names: Sequence[str] | None) -> None:
    extreme = np.isfinite(steps) & (steps > 0.0) & ((steps > _REPRESENTABLE) | (steps < 1.0 / _REPRESENTABLE))
    if extreme.any():
        i = int(np.argmax(extreme))
        raise ParameterError(
            f"limits.{field} of {_joint(i, names)} allows {steps[i]:g} in a step of dt = {dt:g} s; expected what "
            f"numbers can hold, {1.0 / _REPRESENTABLE:g} to {_REPRESENTABLE:g}, or inf for no limit"
        )


def _joint(i: int, names: Sequence[str] | None) -> str:
    return f"joint {i}" if names is None else f"joint {i} ({names[i]})"
