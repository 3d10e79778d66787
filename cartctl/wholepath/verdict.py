"""What stands in a plan's way, in words: which sample, which task or limit, by how much."""

from __future__ import annotations

import numpy as np

from cartctl.wholepath.manifold import newton
from cartctl.wholepath.report import PlanStatus
from cartctl.wholepath.rows import Rows
from cartctl.wholepath.setting import Setting
from cartctl.wholepath.sqp import Optimised
from cartctl.wholepath.trace import Trace

_TRIES = 40  # random postures tried at a sample that is missed
_UNITS = {"position": "{u}", "velocity": "{u}/s", "acceleration": "{u}/s^2"}


def judged(done: Optimised, rng: np.random.Generator) -> tuple[PlanStatus, str]:
    """Status and message of the best path there is."""
    trace = done.trace
    if not trace.met.all():
        return PlanStatus.OUT_OF_REACH, _missed(trace, rng)
    if done.excess > 0.0:
        return PlanStatus.LIMITS, _beyond(trace)
    status = PlanStatus.OPTIMAL if done.converged else PlanStatus.NOT_CONVERGED
    return status, status.value


def at(setting: Setting, k: int) -> str:
    """``sample 12 of 200 (t = 0.24 s)``."""
    return f"sample {k} of {setting.size} (t = {setting.times[k]:.4g} s)"


def _missed(trace: Trace, rng: np.random.Generator) -> str:
    setting = trace.setting
    k = int(np.flatnonzero(~trace.met)[0])
    robot = setting.robot
    starts = np.array([*(robot.random_configuration(rng) for _ in range(_TRIES)), robot.home])
    found, met = newton(setting, k, starts, rounds=60)
    if met.any():
        return (
            f"{at(setting, k)}: {_worst_task(trace, k)}; another posture reaches it there, but none that was found "
            "passes through all samples before: another q0, or q0=None, may help"
        )
    least = min(float(np.linalg.norm(setting.errors(k, q))) for q in [*found, trace.Q[k]])
    return (
        f"{at(setting, k)}: {_worst_task(trace, k)}: out of reach; of {_TRIES + 1} other postures none comes nearer "
        f"than {least:.3g} (m and rad together)"
    )


def _worst_task(trace: Trace, k: int) -> str:
    setting, rows = trace.setting, 0
    worst = ("", -1.0, "")
    for task in setting.tasks:
        units = task.units(setting.robot)
        error = trace.E[k, rows : rows + len(units)]
        rows += len(units)
        for unit in dict.fromkeys(units):
            size = float(np.linalg.norm(error[[u == unit for u in units]]))
            if size > worst[1]:
                worst = (task.name, size, unit)
    return f"task {worst[0]!r} is missed by {worst[1]:.3g} {worst[2]}".rstrip()


def _beyond(trace: Trace) -> str:
    setting, limits = trace.setting, trace.setting.limits
    assert limits is not None
    worst = Rows(limits).worst(trace)
    assert worst is not None
    name = setting.robot.dof_names[worst.joint]
    linear = name in setting.robot.single_joints and setting.robot.is_prismatic(name)
    unit = _UNITS[worst.kind].format(u="m" if linear else "rad")
    count = int((Rows(limits).excess(trace) > 0.0).sum())
    advice = "" if worst.kind == "position" else "; a longer duration may help"
    return (
        f"{at(setting, worst.sample)}: {worst.kind} of joint {name!r} would be {worst.value:.4g} {unit}, its limit is "
        f"{worst.limit:.4g}; in the least violating joint path found, {count} such limits are exceeded{advice}"
    )
