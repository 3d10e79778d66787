"""How well a run went, as tables of 80 columns."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from cartctl.algebra.solution import Status
from cartctl.cli.console import columns, facts, number
from cartctl.motion.metrics import JointMetrics, Metrics, TaskMetrics

_GAUGE = 14


def tables(metrics: Metrics, *, ascii_only: bool) -> Iterator[RenderableType]:
    """The hand, the joints, and the run as a whole; ascii_only for terminals that know no more."""
    for task in metrics.tasks:
        yield _hand(task)
    yield _joints(metrics.joints, ascii_only)
    yield _whole(metrics)


def strayed(metrics: Metrics, size: float) -> str | None:
    """What to try where the hand left its path by a tenth of the path's size (m) or more."""
    worst = max((task.max_m for task in metrics.tasks if task.max_m is not None), default=0.0)
    if worst < 0.1 * size:
        return None
    trouble = "the path may leave its reach, pass a singularity, or be too fast"
    remedy = "try a smaller --radius, a longer --period or a smaller --dt"
    return f"the hand strayed by {number(1e3 * worst)} mm: {trouble}; {remedy}"


def _hand(task: TaskMetrics) -> Table:
    table = columns("hand's error", "RMS", "largest", "at the end")
    for what, unit, figures in (
        ("position", "mm", (task.rms_m, task.max_m, task.final_m)),
        ("orientation", "mrad", (task.rms_rad, task.max_rad, task.final_rad)),
    ):
        if figures[0] is not None:
            table.add_row(what, *(f"{number(1e3 * x)} {unit}" for x in figures if x is not None))
    return table


def _joints(joints: list[JointMetrics], ascii_only: bool) -> Table:
    driven = any(joint.peak_torque is not None for joint in joints)
    last = ["torque", "outside"] if driven else ["outside"]
    table = columns("joint", "range used", "margin", "rate", "accel.", *last)
    for joint in joints:
        outside = Text(str(joint.violations), style="bold red") if joint.violations else Text("-")
        table.add_row(
            joint.name,
            _gauge(joint, ascii_only),
            number(joint.position_margin),
            _percent(joint.velocity_ratio),
            _percent(joint.acceleration_ratio),
            *([_percent(joint.torque_ratio)] if driven else []),
            outside,
        )
    return table


def _gauge(joint: JointMetrics, ascii_only: bool) -> Text:
    """The joint's range as a line, the part that was used as a thick one."""
    rail, used = "-=" if ascii_only else "─━"
    span = joint.upper - joint.lower
    if not math.isfinite(span) or span <= 0.0:
        return Text(" to ".join(f"{round(q, 2) + 0.0:.2f}" for q in (joint.q_min, joint.q_max)))
    ends = [min(max((q - joint.lower) / span, 0.0), 1.0) for q in (joint.q_min, joint.q_max)]
    begin = min(int(ends[0] * _GAUGE), _GAUGE - 1)
    end = max(math.ceil(ends[1] * _GAUGE), begin + 1)
    colour = "bold red" if joint.position_margin is not None and joint.position_margin < 0.0 else "bold cyan"
    return Text.assemble((rail * begin, "dim"), (used * (end - begin), colour), (rail * (_GAUGE - end), "dim"))


def _percent(ratio: float | None) -> Text:
    if ratio is None:
        return Text("-")
    return Text(
        f"{100 * ratio:.0f} %" if ratio < 100 else f"{100 * ratio:.0e} %", style="bold red" if ratio > 1.0 else ""
    )


def _whole(metrics: Metrics) -> Table:
    rows: list[tuple[str, RenderableType]] = []
    if metrics.path_drift is not None:
        drift = number(metrics.path_drift)
        rows.append(("drift over a lap", f"{drift} rad or m (distance of the joints between its start and end)"))
    sigma = min(task.min_singular_value for task in metrics.tasks)
    rows.append(("singular value", f"{number(sigma)} at the least"))
    scale = min(task.min_scale for task in metrics.tasks)
    if scale < 1.0:
        rows.append(("slowest", f"{100 * scale:.0f} % of the speed asked for"))
    if metrics.peak_torque is not None and metrics.energy is not None:
        most = f"{number(metrics.peak_torque)} N m or N at the most"
        rows.append(("torques", f"{most}; {number(metrics.energy)} J by motors that recover nothing"))
    rows.append(("time a step", f"{number(1e6 * metrics.step_p50)} us median, {number(1e6 * metrics.step_p99)} us p99"))
    counts = sorted(metrics.status.items(), key=lambda item: -item[1])
    rows.append(("status", ", ".join(f"{name} {count}" for name, count in counts) + f" of {metrics.steps} steps"))
    rows += [("", f"{name}: {Status[name].value}") for name, _ in counts if name != "OPTIMAL"]
    return facts(rows)
