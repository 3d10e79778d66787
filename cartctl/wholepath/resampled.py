"""A joint path at other instants, and one whose ends are made to meet."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from cartctl.checks import FloatArray
from cartctl.model.robot import Robot


def resampled(robot: Robot, Q: FloatArray, times: FloatArray, wanted: FloatArray) -> FloatArray:
    """The path Q (S, nq) through ``times`` (S,) at the instants ``wanted``, smooth in the tangent space."""
    if len(times) == len(wanted) and np.array_equal(times, wanted):
        return Q
    steps = np.array([robot.difference(a, b) for a, b in zip(Q[:-1], Q[1:], strict=True)])
    travelled = np.concatenate([np.zeros((1, robot.nv)), np.cumsum(steps, axis=0)])
    if robot.single.all():
        at = np.atleast_2d(CubicSpline(times, travelled, axis=0)(wanted)) if len(times) > 2 else None
        if at is not None:
            return np.array([robot.integrate(Q[0], d) for d in at])
    k = np.clip(np.searchsorted(times, wanted, side="right") - 1, 0, len(times) - 2)
    share = (wanted - times[k]) / (times[k + 1] - times[k])
    return np.array([robot.integrate(Q[i], s * steps[i]) for i, s in zip(k, share, strict=True)])


def joined(robot: Robot, Q: FloatArray) -> FloatArray:
    """The path with the distance between its ends taken back evenly, so that the last sample is the first one."""
    gap = robot.difference(Q[0], Q[-1])
    shares = np.linspace(0.0, 1.0, len(Q))
    moved = np.array([robot.integrate(q, -s * gap) for q, s in zip(Q, shares, strict=True)])
    moved[-1] = moved[0]
    return moved
