"""Limits as data: lower and upper apart for position, velocity, acceleration, jerk and torque, in the tangent space."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError


@dataclass(frozen=True, eq=False)
class Limits:
    """What each joint may do; every field is (nv,), +-inf where there is no limit.

    Positions in rad or m, in the coordinate of the joint (a continuous joint and a moving base have none); velocities,
    accelerations and jerks per s, s^2, s^3; torques in N m or N. Raises ShapeError, NonFiniteError, ParameterError.

    >>> import cartctl as cc
    >>> slow = cc.load("panda").limits.replace(velocity_lower=-0.5, velocity_upper=0.5)
    >>> print(slow.velocity_upper)
    [0.5 0.5 0.5 0.5 0.5 0.5 0.5]
    """

    position_lower: FloatArray
    position_upper: FloatArray
    velocity_lower: FloatArray
    velocity_upper: FloatArray
    acceleration_lower: FloatArray
    acceleration_upper: FloatArray
    jerk_lower: FloatArray
    jerk_upper: FloatArray
    torque_lower: FloatArray
    torque_upper: FloatArray

    def __post_init__(self) -> None:
        n = len(self.position_lower)
        for f in fields(self):
            object.__setattr__(self, f.name, checks.vector(f"limits.{f.name}", getattr(self, f.name), n, infinite=True))
        for quantity in ("position", "velocity", "acceleration", "jerk", "torque"):
            low, high = getattr(self, f"{quantity}_lower"), getattr(self, f"{quantity}_upper")
            bad = np.flatnonzero(low > high)
            if bad.size:
                i = int(bad[0])
                raise ParameterError(
                    f"limits.{quantity}_lower[{i}] = {low[i]:g} is above {quantity}_upper[{i}] = {high[i]:g}; "
                    "expected lower <= upper"
                )

    def replace(self, **changes: Any) -> Limits:
        """A copy with some fields changed; a number stands for the same limit on every joint."""
        known = {f.name: getattr(self, f.name) for f in fields(self)}
        for name, value in changes.items():
            if name not in known:
                raise ParameterError(f"limits have no field {name!r}; expected one of {', '.join(known)}")
            known[name] = np.full(len(self.position_lower), value) if np.ndim(value) == 0 else value
        return Limits(**known)

    @classmethod
    def of_model(
        cls,
        model: pin.Model,
        dof_names: list[str],
        acceleration: Mapping[str, float],
        jerk: Mapping[str, float],
    ) -> Limits:
        """The limits a model holds, with those of a data sheet, as name pattern -> symmetric limit."""
        low, high = _positions(model)
        # pin 4.1 reads a URDF's velocity limit into the lower bound with the sign of the upper one
        v_low, v_high = -_given(np.abs(model.lowerVelocityLimit)), _given(model.upperVelocityLimit)
        t_low, t_high = -_given(np.abs(model.lowerEffortLimit)), _given(model.upperEffortLimit)
        a, j = _by_pattern(acceleration, dof_names), _by_pattern(jerk, dof_names)
        return cls(low, high, v_low, v_high, -a, a, -j, j, t_low, t_high)


def _positions(model: pin.Model) -> tuple[FloatArray, FloatArray]:
    """Position limits in nv coordinates: only one-dof joints with nq = 1 have any."""
    low, high = np.full(model.nv, -np.inf), np.full(model.nv, np.inf)
    for joint in model.joints:
        if joint.nq == 1 and joint.nv == 1 and joint.idx_v >= 0:
            low[joint.idx_v] = model.lowerPositionLimit[joint.idx_q]
            high[joint.idx_v] = model.upperPositionLimit[joint.idx_q]
    return _open(low), _open(high)


def _open(limit: FloatArray) -> FloatArray:
    """Pinocchio writes the largest float where there is no limit."""
    return np.where(np.abs(limit) > 1e300, np.copysign(np.inf, limit), limit)


def _given(limit: FloatArray) -> FloatArray:
    """A URDF without the figure reads as 0: a joint that may not move would be fixed, so 0 means not given."""
    return _open(np.where(np.asarray(limit) == 0.0, np.inf, limit))


def _by_pattern(patterns: Mapping[str, float], names: list[str]) -> FloatArray:
    values = np.full(len(names), np.inf)
    for pattern, value in patterns.items():
        for i, name in enumerate(names):
            if fnmatchcase(name, pattern):
                values[i] = value
    return values
