"""What stands in a plan's way, in words: which sample, which task or limit, by how much."""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.wholepath.manifold import newton
from cartctl.wholepath.report import PlanStatus
from cartctl.wholepath.rows import Rows
from cartctl.wholepath.setting import Setting
from cartctl.wholepath.sqp import Optimised
from cartctl.wholepath.trace import Trace

_TRIES = 40  # random postures tried at a sample that is missed
_POLISHED = 3  # of these, the nearest are brought as near as they come
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
            f"{at(setting, k)}: {_worst_task(setting, trace.E[k])}; another posture reaches it there, but none "
            "that was found passes through all samples before: another q0, or q0=None, may help"
        )
    near = sorted(found, key=lambda q: float(np.linalg.norm(setting.errors(k, q))))[:_POLISHED]
    best = min((closest(setting, k, q) for q in [*near, trace.Q[k]]), key=lambda e: float(np.linalg.norm(e)))
    return f"{at(setting, k)}: {_worst_task(setting, best)}: out of reach; of {_TRIES + 1} postures none comes nearer"


def closest(setting: Setting, k: int, q: FloatArray, rounds: int = 80) -> FloatArray:
    """The task errors (m,) at sample k where their norm is least near q, by Levenberg and Marquardt's method."""
    damping, e = 1e-2, setting.errors(k, q)
    J = setting.jacobian()
    for _ in range(rounds):
        step = np.linalg.solve(J.T @ J + damping * np.eye(J.shape[1]), J.T @ e)
        there = setting.robot.integrate(q, step)
        after = setting.errors(k, there)
        if np.linalg.norm(after) < np.linalg.norm(e):
            q, e, J, damping = there, after, setting.jacobian(), max(0.2 * damping, 1e-12)
        else:
            damping = min(5.0 * damping, 1e6)
    return e


def _worst_task(setting: Setting, errors: FloatArray) -> str:
    """Which task has the largest error, by how much."""
    rows = 0
    worst = ("", -1.0, "")
    for task in setting.tasks:
        units = task.units(setting.robot)
        error = errors[rows : rows + len(units)]
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
