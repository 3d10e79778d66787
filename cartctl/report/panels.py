"""The panels of a run's figure: each function draws one onto the axes it is given."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cartctl.report.axes import LEGEND, finish, line, logarithmic, mark_limits, note
from cartctl.report.mesh import Array
from cartctl.report.palette import COLORS, Pen, pens, plain, thinned

if TYPE_CHECKING:
    from cartctl.motion.run import Run, TaskRecord

MARKED = {"m": (1e3, "Position error", "mm"), "rad": (1e3, "Orientation error", "mrad"), "": (1.0, "Error", "")}
QUIET = ("OPTIMAL", "INEXACT", "DAMPED")  # statuses of a step that went as it should


def error(axes: Any, run: Run, unit: str) -> None:
    """Draw the norm of each task's rows in ``unit``, logarithmic; steps at which something gave way are shaded."""
    factor, title, shown = MARKED[unit]
    records = [r for r in run.tasks if unit in r.units]
    for record, pen in zip(records, pens([r.name for r in records]), strict=True):
        line(axes, run.time, factor * norm(record, unit), pen)
    if unit == "rad" and not {record.kind for record in records} <= {"frame", "relative"}:
        title = "Angular error"
    _trouble(axes, run)
    logarithmic(axes)
    finish(axes, title, shown)
    axes.legend(loc="best", **LEGEND)


def norm(record: TaskRecord, unit: str) -> Array:
    """Return the Euclidean norm (N+1,) of the rows of ``record.error`` that are in ``unit``."""
    rows = [i for i, u in enumerate(record.units) if u == unit]
    return np.asarray(np.linalg.norm(record.error[:, rows], axis=1))


def positions(axes: Any, run: Run, joints: Sequence[Pen]) -> None:
    """Draw each limited joint between its limits, 0 at the lower and 1 at the upper one."""
    limits = run.robot.limits
    span = limits.position_upper - limits.position_lower
    limited = np.isfinite(span) & (span > 0)
    values = coordinates(run)
    for i in np.flatnonzero(limited).tolist():
        line(axes, run.time, (values[:, i] - limits.position_lower[i]) / span[i], joints[i])
    mark_limits(axes, 0.0, 1.0)
    finish(axes, "Joint positions", "fraction of range")
    _absent(axes, run, limited, "position limits")


def rates(axes: Any, run: Run, joints: Sequence[Pen]) -> None:
    """Draw each joint's velocity over its limit in that direction."""
    limited, share = speed(run)
    for k, i in enumerate(np.flatnonzero(limited).tolist()):
        line(axes, run.time, share[:, k], joints[i])
    finish(axes, "Joint rates", "fraction of limit")
    if limited.any():
        ratio = np.abs(share)
        if ratio.max() > 0.4:
            mark_limits(axes, -1.0, 1.0)
        fastest = run.robot.dof_names[np.flatnonzero(limited)[int(ratio.max(axis=0).argmax())]]
        note(axes, f"peak {100 * ratio.max():.3g} % ({plain(fastest)})")
    _absent(axes, run, limited, "velocity limits")


def speed(run: Run) -> tuple[NDArray[np.bool_], Array]:
    """Return which joints (nv,) have velocity limits, and their rates (N+1, k) over the limit in that direction."""
    limits = run.robot.limits
    bound = np.where(run.v >= 0, limits.velocity_upper, -limits.velocity_lower)
    limited = (np.isfinite(limits.velocity_upper - limits.velocity_lower)) & (bound > 0).all(axis=0)
    return limited, run.v[:, limited] / bound[:, limited]


def torques(axes: Any, run: Run, joints: Sequence[Pen]) -> None:
    """Draw the torque that drove each joint, over its limit in that direction; held from sample to sample."""
    assert run.torque is not None
    limits, torque = run.robot.limits, run.torque
    bound = np.where(torque >= 0, limits.torque_upper, -limits.torque_lower)
    limited = np.isfinite(limits.torque_upper - limits.torque_lower) & (bound > 0).all(axis=0)
    share = torque[:, limited] / bound[:, limited]
    for k, i in enumerate(np.flatnonzero(limited).tolist()):
        line(axes, run.time[: len(share)], share[:, k], joints[i])
    finish(axes, "Joint torques", "fraction of limit")
    if share.size:
        ratio = np.abs(share)
        if ratio.max() > 0.4:
            mark_limits(axes, -1.0, 1.0)
        hardest = run.robot.dof_names[np.flatnonzero(limited)[int(ratio.max(axis=0).argmax())]]
        note(axes, f"peak {100 * ratio.max():.3g} % ({plain(hardest)})")
    _absent(axes, run, limited, "torque limits")


def singular_values(axes: Any, run: Run) -> None:
    """Draw each task's singular values, the smallest one strong."""
    records = [r for r in run.tasks if r.singular_values.size]
    for record, pen in zip(records, pens([r.name for r in records]), strict=True):
        values = np.sort(record.singular_values, axis=1)
        for column in values[:, 1:].T:
            line(axes, run.time, column, Pen("", pen.color, pen.style, back=True), alpha=0.45)
        line(axes, run.time, values[:, 0], Pen(f"{pen.label} (smallest bold)", pen.color, pen.style), linewidth=2.0)
    logarithmic(axes)
    finish(axes, "Singular values of the task Jacobians", "")
    if records:
        axes.legend(loc="best", **LEGEND)


def step_time(axes: Any, run: Run) -> None:
    """Draw the time each step took, with its median and 99th percentile; rare long ones are only named."""
    finish(axes, "Time of a control step", "µs")
    if not len(run.solve_time):
        return
    micro = 1e6 * run.solve_time
    axes.plot(*thinned(run.time[: len(micro)], micro), ".", markersize=2, color=COLORS[5], alpha=0.6, rasterized=True)
    median, late = np.percentile(micro, [50, 99])
    for name, level, style in (("p50", median, "-"), ("p99", late, "--")):
        axes.axhline(level, color="black", linestyle=style, linewidth=1.1, label=f"{name}  {level:.3g} µs")
    logarithmic(axes, top=10 * late)
    if micro.max() > 10 * late:
        note(axes, f"longest {micro.max():.3g} µs")
    axes.legend(loc="upper right", **LEGEND)


def coordinates(run: Run) -> Array:
    """Return the joint coordinates (N+1, nv) of every sample, comparable with the position limits."""
    return np.array([run.robot.coordinates(q) for q in run.q])


def urgency(run: Run) -> Array:
    """Return how near each joint (nv,) comes to a limit of position or rate: 1 at the limit."""
    limits = run.robot.limits
    low, high = limits.position_lower, limits.position_upper
    bound = np.minimum(limits.velocity_upper, -limits.velocity_lower)
    with np.errstate(invalid="ignore", divide="ignore"):  # without limits: 0 / 0, inf - inf
        place = np.abs(2 * coordinates(run) - (low + high)).max(axis=0) / (high - low)
        speed = np.abs(run.v).max(axis=0) / bound
    return np.asarray(np.fmax(*(np.nan_to_num(x, nan=0.0, posinf=0.0) for x in (place, speed))))


def _absent(axes: Any, run: Run, limited: Any, what: str) -> None:
    """Name the joints that the panel leaves out because they have no limits."""
    names = [name for name, there in zip(run.robot.dof_names, limited, strict=True) if not there]
    if not limited.any():
        axes.text(0.5, 0.5, f"no joint has {what}", transform=axes.transAxes, ha="center", va="center", color="0.4")
        axes.set_yticks([])
    elif names:
        listed = ", ".join(map(plain, names[:3])) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
        axes.set_xlabel(f"no limit, not shown: {listed}", loc="right", fontsize=8, color="0.35")


def _trouble(axes: Any, run: Run) -> None:
    """Shade the steps at which something gave way: a rank, a scale. A least-squares remainder is nothing special."""
    status = np.array(run.status, dtype=str)
    odd = ~np.isin(status, QUIET)
    if not odd.any():
        return
    names, counts = np.unique(status[odd], return_counts=True)
    label = ", ".join(f"{name.lower()} ({count} steps)" for name, count in zip(names, counts, strict=True))
    axes.fill_between(
        run.time[:-1], 0, 1, where=odd, step="post", transform=axes.get_xaxis_transform(),
        color="#e69f00", alpha=0.15, linewidth=0, label=label,
    )  # fmt: skip
