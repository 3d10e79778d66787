"""The panels of one run's page: errors, joints against their limits, scales, singular values, time a step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cartctl.report import panels
from cartctl.report.axes import LIMIT
from cartctl.report.curves import Band, Curve, Panel, spans
from cartctl.report.mesh import Array
from cartctl.report.numbers import number
from cartctl.report.palette import COLORS, GREY, Pen, pens

if TYPE_CHECKING:
    from cartctl.motion.run import Run

_AT = 1.0 - 1e-6  # of a limit: from here on a joint counts as saturated
_ODD = "#e69f00"  # of steps at which something gave way


def run_panels(run: Run) -> list[Panel]:
    """Return what there is to see of ``run`` over time, in reading order."""
    if not len(run):
        return []
    time = run.time - run.time[0]
    joints = pens(run.robot.dof_names, panels.urgency(run))
    found: list[Panel | None] = [*_errors(run, time), _positions(run, time, joints), _rates(run, time, joints)]
    found += [_torques(run, time, joints), _scales(run, time), _singular(run, time), _times(run, time)]
    return [panel for panel in found if panel is not None and panel.curves]


def _errors(run: Run, time: Array) -> Iterator[Panel]:
    """The norm of each task's error; steps at which something gave way are shaded."""
    status = np.array(run.status, dtype=str)
    odd = ~np.isin(status, panels.QUIET)
    words = ", ".join(sorted({name.lower() for name in status[odd].tolist()}))
    band = Band(words, _ODD, spans(time[:-1], odd))
    for unit, (factor, title, shown) in panels.MARKED.items():
        records = [r for r in run.tasks if unit in r.units]
        looks = pens([r.name for r in records])
        curves = [_curve(r.name, p, time, factor * panels.norm(r, unit)) for r, p in zip(records, looks, strict=True)]
        yield Panel(title, shown, curves, log=True, bands=[band], legend=len(curves) > 1)


def _positions(run: Run, time: Array, joints: list[Pen]) -> Panel:
    """Each joint between its limits, 0 at the lower and 1 at the upper one."""
    limits, names = run.robot.limits, run.robot.dof_names
    span = limits.position_upper - limits.position_lower
    limited = np.flatnonzero(np.isfinite(span) & (span > 0)).tolist()
    share = (panels.coordinates(run)[:, limited] - limits.position_lower[limited]) / span[limited]
    curves = [_curve(names[i], joints[i], time, share[:, k]) for k, i in enumerate(limited)]
    at = (share >= _AT) | (share <= 1.0 - _AT)
    return Panel("Joint positions", "of range", curves, limits=(0.0, 1.0), low=0.0, high=1.0, legend=True,
                 bands=[_saturated(time, at)])  # fmt: skip


def _rates(run: Run, time: Array, joints: list[Pen]) -> Panel:
    """Each joint's velocity over its limit in that direction."""
    limited, share = panels.speed(run)
    names = [(run.robot.dof_names[i], joints[i]) for i in np.flatnonzero(limited)]
    return _shares("Joint rates", time, share, names, "")


def _torques(run: Run, time: Array, joints: list[Pen]) -> Panel | None:
    """The torque that drove each joint; of a kinematic run, the torque that its motion would take."""
    torque, title, note = run.torque, "Joint torques", ""
    if torque is None:
        torque = _needed(run)
        title, note = "Joint torques needed", "M a + h of this motion, by the model"
    if torque is None or not torque.any():
        return None
    limits = run.robot.limits
    bound = np.where(torque >= 0, limits.torque_upper, -limits.torque_lower)
    limited = np.isfinite(limits.torque_upper - limits.torque_lower) & (bound > 0).all(axis=0)
    share = torque[:, limited] / bound[:, limited]
    names = [(run.robot.dof_names[i], joints[i]) for i in np.flatnonzero(limited)]
    return _shares(title, time[:-1], share, names, note)


def _needed(run: Run) -> Array | None:
    """``M a + h`` (N, nv) with a from the rates of two samples; None without inertia, or for a base without motors."""
    model, dt = run.robot.model, float(run.meta.get("dt") or np.median(np.diff(run.time)))
    if not any(inertia.mass > 0.0 for inertia in model.inertias) or model.nv != len(run.robot.single_joints):
        return None
    data, a = model.createData(), np.diff(run.v, axis=0) / dt
    rows = [np.array(pin.rnea(model, data, q, v, b)) for q, v, b in zip(run.q[:-1], run.v[:-1], a, strict=True)]
    torque = np.array(rows)
    return torque if np.isfinite(torque).all() else None


def _shares(title: str, time: Array, share: Array, looks: list[tuple[str, Pen]], note: str) -> Panel:
    """Quantities over their limits: the limits are drawn where the curves come near them."""
    curves = [_curve(name, pen, time, share[:, k]) for k, (name, pen) in enumerate(looks)]
    peak = float(np.abs(share).max(initial=0.0))
    near = peak > 0.4
    words = ", ".join(filter(None, (note, f"peak {100 * peak:.3g} %")))
    return Panel(title, "of limit", curves, limits=(-1.0, 1.0) if near else (), low=-1.0 if near else None,
                 high=1.0 if near else None, note=words, bands=[_saturated(time, np.abs(share) >= _AT)])  # fmt: skip


def _saturated(time: Array, at: NDArray[np.bool_]) -> Band:
    """When any joint is at its limit."""
    return Band("a joint at its limit", LIMIT, spans(time, np.asarray(at.any(axis=1))))


def _scales(run: Run, time: Array) -> Panel:
    """What share of each task's command was delivered; a task that was skipped has none."""
    looks = pens([r.name for r in run.tasks])
    curves = [
        _curve(r.name, p, time[:-1], np.nan_to_num(r.scale, nan=0.0), steps=True)
        for r, p in zip(run.tasks, looks, strict=True)
    ]
    least = min((float(np.nan_to_num(r.scale).min()) for r in run.tasks), default=1.0)
    note = "never slowed down" if least >= 1.0 else f"least {100 * least:.3g} %"
    return Panel("Task scales", "of command", curves, low=0.0, high=1.0, note=note, legend=len(curves) > 1)


def _singular(run: Run, time: Array) -> Panel:
    """Each task's singular values, the smallest one strong."""
    curves = []
    records = [r for r in run.tasks if r.singular_values.size]
    for record, look in zip(records, pens([r.name for r in records]), strict=True):
        values = np.sort(record.singular_values, axis=1)
        curves += [Curve("", look.color, time, column, faint=True) for column in values[:, 1:].T]
        curves.append(Curve(record.name, look.color, time, values[:, 0], strong=True))
    note = "the smallest one is bold"
    return Panel("Singular values", "", curves, log=True, note=note, legend=len(records) > 1)


def _times(run: Run, time: Array) -> Panel:
    """Microseconds a step; the longest are thinned out last."""
    micro = 1e6 * run.solve_time
    median, late = np.percentile(micro, [50, 99])
    curve = Curve("step", COLORS[5], time[:-1], micro, dots=True)
    note = f"median {number(median)} µs, 99 % below {number(late)} µs"
    return Panel("Time of a step", "µs", [curve], log=True, note=note)


def _curve(name: str, pen: Pen, time: Array, values: Array, steps: bool = False) -> Curve:
    if pen.back:
        return Curve("", GREY, time, values, faint=True, steps=steps)
    return Curve(name, pen.color, time, values, dashed=pen.dashed, steps=steps)
