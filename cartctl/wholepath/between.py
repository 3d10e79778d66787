"""How far the tasks are missed between samples, where the velocities are held.

There q moves evenly, so that the error e(t), zero at both samples, has the second derivative ``r_ddot_d - J_dot v`` and
is at most ``h^2/8 max ||e_ddot||`` in between (the remainder of linear interpolation). The maximum is taken over both
ends and the middle of every interval, times a quarter more for what lies between these.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray
from cartctl.wholepath.trace import Trace

SAFETY = 1.25


class Bound(NamedTuple):
    """The largest error between samples, in m and in rad (None without such rows)."""

    m: float | None
    rad: float | None


def bound_between(trace: Trace) -> Bound:
    """The bound of the head of this file."""
    setting, robot, state = trace.setting, trace.setting.robot, trace.setting.state
    units = [unit for task in setting.tasks for unit in task.units(robot)]
    largest = np.zeros(2)
    groups = [np.array([u == unit for u in units]) for unit in ("m", "rad")]
    for k, v in enumerate(trace.V):
        for share in (0.0, 0.5, 1.0):
            t = float(setting.times[k] + share * setting.h)
            state.set(robot.integrate(trace.Q[k], share * setting.h * v), v, t)
            bend = []
            for task, anchor in zip(setting.tasks, setting.anchors, strict=True):
                wanted = task.reference(state, t, anchor).acceleration
                drift = task.drift(state)
                bend.append(-drift if wanted is None else wanted - drift)
            whole: FloatArray = np.concatenate(bend)
            largest = np.maximum(largest, [float(np.linalg.norm(whole[g])) for g in groups])
    sizes = SAFETY * setting.h**2 / 8.0 * largest
    return Bound(*(float(s) if g.any() else None for s, g in zip(sizes, groups, strict=True)))
