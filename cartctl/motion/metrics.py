"""How well a run went: tracking, limits, rates, singularities, drift over a cycle, time a step."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.limits import Limits
from cartctl.motion.run import Run, TaskRecord

_SLACK = 1e-9  # relative: a command that sits on its limit is not a violation


@dataclass(frozen=True)
class TaskMetrics:
    """One task: root-mean-square, largest and final error norm in m and in rad (None where it has no such rows)."""

    name: str
    rms_m: float | None
    max_m: float | None
    final_m: float | None
    rms_rad: float | None
    max_rad: float | None
    final_rad: float | None
    min_singular_value: float
    min_scale: float


@dataclass(frozen=True)
class JointMetrics:
    """One joint: its range, how close it came to its limits, peak rates, and how many samples lie outside a limit.

    Ratios are peak over limit, None where there is no limit; position_margin is negative outside. peak_torque: N m or
    N, None in a kinematic run.
    """

    name: str
    lower: float
    upper: float
    q_min: float
    q_max: float
    position_margin: float | None
    peak_velocity: float
    velocity_ratio: float | None
    peak_acceleration: float
    acceleration_ratio: float | None
    peak_torque: float | None
    torque_ratio: float | None
    violations: int


@dataclass(frozen=True)
class Metrics:
    """A run in figures.

    path_drift: largest joint distance over a closed cycle, rad or m, None without one. effort: integral of
    ``||v||^2 dt``, rad^2/s or m^2/s, each command held over its step: v constant in it at the velocity level, linear
    above it. peak_torque: of any joint, N m or N; torque_effort: integral of ``||tau||^2 dt``; energy: integral of
    ``sum |tau_i v_i| dt``, J, what motors spend that recover nothing; energy_residual: the largest imbalance of the
    books, J. The four are None in a kinematic run.
    """

    tasks: list[TaskMetrics]
    joints: list[JointMetrics]
    path_drift: float | None
    effort: float
    peak_torque: float | None
    torque_effort: float | None
    energy: float | None
    energy_residual: float | None
    step_p50: float
    step_p99: float
    status: dict[str, int]
    steps: int

    @property
    def violations(self) -> int:
        """Samples outside a limit, summed over the joints."""
        return sum(j.violations for j in self.joints)


def measure(run: Run, after: float = 0.0) -> Metrics:
    """The metrics of ``run``; tracking errors from ``after`` s past the start. Raises ParameterError."""
    if not len(run):
        raise ParameterError("the run holds no step; expected at least one")
    start = run.time[0] + checks.number("after", after, low=0.0)
    kept = run.time >= start - 1e-12
    if not kept.any():
        raise ParameterError(f"after is {after:g} s; expected less than the run's {run.time[-1] - run.time[0]:g} s")
    p50, p99 = np.percentile(run.solve_time, [50, 99])
    return Metrics(
        tasks=[_task(task, kept) for task in run.tasks],
        joints=_joints(run),
        path_drift=_drift(run),
        effort=_effort(run),
        **_torques(run),
        step_p50=float(p50),
        step_p99=float(p99),
        status=dict(Counter(run.status)),
        steps=len(run),
    )


def _effort(run: Run) -> float:
    """``integral ||v||^2 dt``, exactly: of a line from v0 to v1 it is ``(v0 v0 + v0 v1 + v1 v1) dt/3``."""
    before, after = run.v[:-1], run.v[1:]
    square = after**2 if run.meta.get("level") == "velocity" else (before**2 + before * after + after**2) / 3.0
    return float(np.sum(square) * run.meta["dt"])


def _torques(run: Run) -> dict[str, float | None]:
    """Figures of a run with dynamics; v linear in each step."""
    torque, books, dt = run.torque, run.energy, run.meta["dt"]
    if torque is None or books is None:
        return dict.fromkeys(("peak_torque", "torque_effort", "energy", "energy_residual"))
    return {
        "peak_torque": float(np.abs(torque).max()),
        "torque_effort": float(np.sum(torque**2) * dt),
        "energy": float(np.sum(np.abs(torque * (run.v[:-1] + run.v[1:]))) * 0.5 * dt),
        "energy_residual": float(np.abs(books.residual).max()),
    }


def _task(task: TaskRecord, kept: NDArray[np.bool_]) -> TaskMetrics:
    norms = {unit: _norms(task, unit) for unit in ("m", "rad")}
    figures = {}
    for unit, norm in norms.items():
        figures[f"rms_{unit}"] = None if norm is None else float(np.sqrt(np.mean(norm[kept] ** 2)))
        figures[f"max_{unit}"] = None if norm is None else float(norm[kept].max())
        figures[f"final_{unit}"] = None if norm is None else float(norm[-1])
    smallest = float(task.singular_values.min()) if task.singular_values.size else 0.0
    return TaskMetrics(name=task.name, min_singular_value=smallest, min_scale=float(task.scale.min()), **figures)


def _norms(task: TaskRecord, unit: str) -> FloatArray | None:
    rows = [i for i, u in enumerate(task.units) if u == unit]
    return np.linalg.norm(task.error[:, rows], axis=1) if rows else None


def _joints(run: Run) -> list[JointMetrics]:
    robot, limits = run.robot, run.robot.limits
    q = np.array([robot.coordinates(sample) for sample in run.q])
    v = run.v
    a = np.diff(v, axis=0) / run.meta["dt"]
    outside = _outside(q, limits, "position") | _outside(v, limits, "velocity")
    outside[1:] |= _outside(a, limits, "acceleration")
    torque = run.torque
    if torque is not None:
        outside[1:] |= _outside(torque, limits, "torque")
    return [
        JointMetrics(
            name=name,
            lower=float(limits.position_lower[i]),
            upper=float(limits.position_upper[i]),
            q_min=float(q[:, i].min()),
            q_max=float(q[:, i].max()),
            position_margin=_finite(
                min(q[:, i].min() - limits.position_lower[i], limits.position_upper[i] - q[:, i].max())
            ),
            peak_velocity=float(np.abs(v[:, i]).max()),
            velocity_ratio=_ratio(v[:, i], limits.velocity_lower[i], limits.velocity_upper[i]),
            peak_acceleration=float(np.abs(a[:, i]).max()),
            acceleration_ratio=_ratio(a[:, i], limits.acceleration_lower[i], limits.acceleration_upper[i]),
            peak_torque=None if torque is None else float(np.abs(torque[:, i]).max()),
            torque_ratio=None
            if torque is None
            else _ratio(torque[:, i], limits.torque_lower[i], limits.torque_upper[i]),
            violations=int(outside[:, i].sum()),
        )
        for i, name in enumerate(robot.dof_names)
    ]


def _outside(values: FloatArray, limits: Limits, quantity: str) -> NDArray[np.bool_]:
    low, high = getattr(limits, f"{quantity}_lower"), getattr(limits, f"{quantity}_upper")
    room = _SLACK * np.maximum(1.0, np.where(np.isfinite(high - low), high - low, 0.0))
    return (values < low - room) | (values > high + room)  # type: ignore[no-any-return]


def _ratio(values: FloatArray, low: float, high: float) -> float | None:
    ratios = [
        float(peak / limit)
        for peak, limit in ((values.max(), high), (-values.min(), -low))
        if np.isfinite(limit) and limit > 0
    ]
    return max(0.0, *ratios) if ratios else None


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _drift(run: Run) -> float | None:
    """The largest ``||q(end of a lap) (-) q(its start)||``."""
    cycles = np.asarray(run.meta.get("cycles", []), dtype=np.float64)
    dt = run.meta["dt"]
    samples = np.round((cycles - run.time[0]) / dt).astype(int)
    samples = samples[(samples >= 0) & (samples < len(run.time))]
    if len(samples) < 2:
        return None
    laps = zip(samples[:-1], samples[1:], strict=True)
    return max(float(np.linalg.norm(run.robot.difference(run.q[i], run.q[j]))) for i, j in laps)
