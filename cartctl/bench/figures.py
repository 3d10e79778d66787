"""The figures of one run: what :meth:`cartctl.Run.metrics` knows, and what only a bench asks for."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl.bench.building import Stage
from cartctl.bench.schema import TASK_FIELDS
from cartctl.checks import FloatArray
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.motion.metrics import Metrics
from cartctl.motion.run import Run, TaskRecord

CHATTER_HZ = 3.0
STILL = 1e-3  # of a joint's largest rate in the run: slower is no motion that could reverse
TOUCH = 1e-4  # m: deeper than that inside an obstacle counts; rows hold to the step's second order
_RANK = 1e-9  # of the largest singular value


def measure(run: Run, stage: Stage) -> dict[str, Any]:
    """Every figure of ``run``, None where there is none; errors and violations after the scenario has settled."""
    scenario = stage.scenario
    run.robot = stage.judged
    after = _from(run, scenario.settle)
    whole, late = run.metrics(after=scenario.settle), after.metrics()
    first, record = whole.tasks[0], run.tasks[0]
    margins = [joint.position_margin for joint in late.joints if joint.position_margin is not None]
    scale = np.nan_to_num(record.scale, nan=0.0)
    figures: dict[str, Any] = {
        name: getattr(first, name) for name in ("rms_m", "max_m", "final_m", "rms_rad", "max_rad", "final_rad")
    }
    figures |= {
        "scale_mean": float(scale.mean()),
        "scale_min": float(scale.min()),
        "delay": None if (own := run.meta.get("path_time")) is None else max(0.0, float(run.time[-1]) - own),
        "violations": late.violations,
        "margin": min(margins) if margins else None,
        "velocity_share": _worst(late, "velocity_ratio"),
        "acceleration_share": _worst(late, "acceleration_ratio"),
        "torque_share": _worst(late, "torque_ratio"),
        "clearance": _clearance(run, stage),
        "effort": whole.effort,
        **_torques(run, whole),
        "manipulability": float(np.prod(record.singular_values, axis=1).min()) if record.singular_values.size else None,
        "sigma_min": min(task.min_singular_value for task in whole.tasks),
        **chatter(run.v, run.meta["dt"]),
        "drift": whole.path_drift,
        "null_motion": null_motion(run, stage),
        "step_p50": whole.step_p50,
        "step_p99": whole.step_p99,
        "status": [{"status": name, "steps": count} for name, count in sorted(whole.status.items())],
        "tasks": [{"name": task.name} | {name: asdict(task)[name] for name in TASK_FIELDS} for task in whole.tasks],
        "steps": whole.steps,
    }
    figures["valid"] = not run.interrupted and figures["violations"] == 0 and _clear(figures["clearance"])
    figures["solved"] = (
        figures["valid"]
        and (first.rms_m or 0.0) <= scenario.tolerance
        and (first.rms_rad or 0.0) <= scenario.tolerance_rad
    )
    return {name: _finite(value) for name, value in figures.items()}


def chatter(v: FloatArray, dt: float) -> dict[str, Any]:
    """Jerk, reversals, and the share of power above 3 Hz, of rates v (N+1, n) at every dt s.

    jerk: second differences of the rates over dt^2. A reversal is a sign change from one sample to the next, those
    slower than STILL of the joint's largest rate left out. Power: of the one-sided
    spectrum without its mean, Hann window.
    """
    top = np.abs(v).max(axis=0, initial=0.0)
    still = STILL * np.maximum(top, 1e-12)
    moving = [joint[np.abs(joint) > least] for joint, least in zip(v.T, still, strict=True)]
    flips = sum(int((joint[1:] * joint[:-1] < 0.0).sum()) for joint in moving)
    jerk = np.diff(v, n=2, axis=0) / dt**2
    return {
        "jerk_rms": float(np.sqrt(np.mean(jerk**2))) if jerk.size else 0.0,
        "jerk_peak": float(np.abs(jerk).max(initial=0.0)),
        "flips": flips,
        "power_above_3hz": _power_above(v, dt),
    }


def _power_above(v: FloatArray, dt: float) -> float:
    n = len(v)
    if n < 4:
        return 0.0
    centred = (v - v.mean(axis=0)) * np.hanning(n)[:, None]
    power = (np.abs(np.fft.rfft(centred, axis=0)) ** 2).sum(axis=1)
    total = float(power.sum())
    high = float(power[np.fft.rfftfreq(n, dt) > CHATTER_HZ].sum())
    return high / total if total > 0.0 else 0.0


def null_motion(run: Run, stage: Stage) -> float:
    """``integral ||(I - J^+ J) v|| dt`` of the first task's J, rad or m: motion that the task does not see."""
    state, task, length = State(stage.robot), stage.hand, 0.0
    for q, v in zip(run.q[:-1], run.v[1:], strict=True):
        state.set(q, v)
        J = task.jacobian(state)
        _, s, Vt = np.linalg.svd(J, full_matrices=False)
        kept = Vt[s > _RANK * max(float(s[0]), 1e-300)] if s.size else Vt[:0]
        length += float(np.linalg.norm(v - kept.T @ (kept @ v)))
    return length * float(run.meta["dt"])


def _torques(run: Run, metrics: Metrics) -> dict[str, Any]:
    """Of driven runs their own; of kinematic ones what inverse dynamics says of the motion, motors only."""
    if metrics.peak_torque is not None:
        return {
            "peak_torque": metrics.peak_torque,
            "torque_effort": metrics.torque_effort,
            "energy": metrics.energy,
            "torque_source": "driven",
        }
    dt = run.meta["dt"]
    torque = _needed(run.robot, run.q[:-1], 0.5 * (run.v[1:] + run.v[:-1]), np.diff(run.v, axis=0) / dt)
    rates = (0.5 * (run.v[1:] + run.v[:-1]))[:, run.robot.single]
    return {
        "peak_torque": float(np.abs(torque).max(initial=0.0)),
        "torque_effort": float(np.sum(torque**2) * dt),
        "energy": float(np.sum(np.abs(torque * rates)) * dt),
        "torque_source": "inverse dynamics",
    }


def _needed(robot: Robot, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """``M a + c + g`` (N, motors)."""
    data = robot.model.createData()
    rows = [pin.rnea(robot.model, data, *sample)[robot.single] for sample in zip(q, v, a, strict=True)]
    return np.array(rows).reshape(len(q), int(robot.single.sum()))


def _clearance(run: Run, stage: Stage) -> float | None:
    """The least distance of all samples after settling, m."""
    if stage.avoid is None:
        return None
    state, least, still = State(stage.robot), math.inf, np.zeros(stage.robot.nv)
    for q, t in zip(run.q, run.time, strict=True):
        if t >= stage.scenario.settle:
            state.set(q, still, float(t))
            closest = stage.avoid.closest(state)
            least = min(least, math.inf if closest is None else closest.distance)
    return least


def _clear(clearance: float | None) -> bool:
    return clearance is None or clearance >= -TOUCH


def _worst(metrics: Metrics, name: str) -> float | None:
    ratios = [ratio for joint in metrics.joints if (ratio := getattr(joint, name)) is not None]
    return max(ratios) if ratios else None


def _from(run: Run, seconds: float) -> Run:
    """The run from that time on; at least its last step."""
    k = min(int(np.searchsorted(run.time, run.time[0] + seconds - 1e-12)), len(run) - 1)
    if k == 0:
        return run
    tasks = [
        TaskRecord(
            task.name, task.kind, task.frame, task.units, task.error[k:], task.scale[k:], task.singular_values[k:],
            None, None,
        )
        for task in run.tasks
    ]  # fmt: skip
    return Run(
        meta=run.meta, time=run.time[k:], q=run.q[k:], v=run.v[k:], command=run.command[k:], status=run.status[k:],
        solve_time=run.solve_time[k:], tasks=tasks, torque=None if run.torque is None else run.torque[k:],
        robot=run.robot,
    )  # fmt: skip


def _finite(value: Any) -> Any:
    """None for what is no number, however deep."""
    if isinstance(value, list):
        return [_finite(each) for each in value]
    if isinstance(value, dict):
        return {name: _finite(each) for name, each in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
