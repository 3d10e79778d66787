"""The status as HTML for the panel: how the step went, how far the hand is off, how near each joint is to trouble."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from cartctl.algebra.solution import Status
from cartctl.report.html import quantity
from cartctl.report.palette import COLORS
from cartctl.viewer.reading import Joint, Reading

_GOOD, _ODD, _BAD = COLORS[2], "#b87a00", "#a01c1c"
_QUIET = (Status.OPTIMAL, Status.INEXACT, Status.DAMPED)
_WORST = (Status.INFEASIBLE, Status.YIELDED, Status.FAILED, Status.SKIPPED)
_TRACK = "position:relative;height:6px;border-radius:3px;background:rgba(128,140,152,.25)"
_MARK = "position:absolute;top:-2px;width:4px;height:10px;border-radius:2px"
_MANY = 14  # joints that are shown
_SPARK = (244, 44)  # width, height of the curve, px


def status_html(reading: Reading, step_us: float, speed: float, errors: Sequence[float]) -> str:
    """The block that is shown; errors: the hand's over the last seconds, m (or rad), oldest first."""
    parts = [_verdict(reading), _figures(reading, step_us, speed), _curve(errors), _joints(reading.joints)]
    return f'<div style="font-size:12.5px;line-height:1.45;padding:2px 10px 6px">{"".join(parts)}</div>'


def trouble_html(sentence: str) -> str:
    """A refusal in its own words, "" for none."""
    if not sentence:
        return ""
    style = f"font-size:12.5px;line-height:1.4;padding:6px 10px;color:{_BAD}"
    return f'<div style="{style}">{escape(sentence)}</div>'


def _verdict(reading: Reading) -> str:
    status = reading.status
    color = _GOOD if status in _QUIET else _BAD if status in _WORST else _ODD
    name, words = status.name, status.value
    if reading.stands and status in _QUIET:
        name, words, color = "AT REST", "The target cannot be reached; the robot stands where it can still stop.", _ODD
    badge = f"background:{color};color:#fff;border-radius:4px;padding:1px 7px;font-weight:600"
    explained = f'<span style="opacity:.75">{escape(words)}</span>'
    return f'<div style="min-height:55px"><span style="{badge}">{name}</span> {explained}</div>'


def _figures(reading: Reading, step_us: float, speed: float) -> str:
    cells = []
    for name, metre, radian in reading.errors:
        parts = [quantity(metre, ("m", "mm", "µm"))] if metre is not None else []
        parts += [quantity(radian, ("rad", "mrad", "µrad"))] if radian is not None else []
        if parts:
            cells.append((f"error, {name}" if len(reading.errors) > 1 else "error", " · ".join(parts)))
    cells.append(("scale", " · ".join("skipped" if math.isnan(s) else f"{100 * s:.0f} %" for s in reading.scales)))
    late = "" if speed > 0.95 else f" (runs at {100 * speed:.0f} % of real time)"
    cells.append(("step", f"{step_us:.0f} µs{late}"))
    rows = "".join(
        f'<tr><td style="opacity:.65;padding:0 10px 0 0;white-space:nowrap">{escape(name)}</td>'
        f'<td style="font-variant-numeric:tabular-nums">{escape(value)}</td></tr>'
        for name, value in cells
    )
    return f'<table style="border-collapse:collapse;margin:4px 0">{rows}</table>'


def _curve(errors: Sequence[float]) -> str:
    """The error as a curve over the last seconds, logarithmic."""
    if len(errors) < 2:
        return ""
    width, height = _SPARK
    top, low = 0.0, -6.0  # 1 m to 1 um
    points = []
    for k, error in enumerate(errors):
        level = min(max(math.log10(max(error, 1e-12)), low), top)
        points.append(f"{width * k / (len(errors) - 1):.1f},{height * (top - level) / (top - low):.1f}")
    lines = "".join(
        f'<line x1="0" x2="{width}" y1="{y}" y2="{y}" stroke="rgba(128,140,152,.25)"/>' for y in (0, height / 2, height)
    )
    labels = "".join(
        f'<text x="{width + 5}" y="{y}" font-size="9" fill="currentColor" opacity=".6">{text}</text>'
        for y, text in ((8, "1"), (height / 2 + 3, "10⁻³"), (height, "10⁻⁶"))
    )
    return (
        f'<svg viewBox="0 -1 {width + 34} {height + 2}" style="width:100%;display:block;margin:4px 0 8px" role="img" '
        f'aria-label="error over the last seconds">{lines}{labels}<polyline points="{" ".join(points)}" fill="none" '
        f'stroke="{COLORS[0]}" stroke-width="1.6" stroke-linejoin="round"/></svg>'
    )


def _joints(joints: Sequence[Joint]) -> str:
    """A line each: place within the limits, rate, torque; red where the command is at its bound."""
    shown = joints[:_MANY]
    driven = any(joint.torque is not None for joint in shown)
    heads = ["joint", "position", "rate", *(["torque"] if driven else [])]
    head = "".join(f'<td style="opacity:.65;padding-right:8px">{name}</td>' for name in heads)
    rows = "".join(_row(joint, driven) for joint in shown)
    more = f'<div style="opacity:.65">and {len(joints) - _MANY} more</div>' if len(joints) > _MANY else ""
    return f'<table style="width:100%;border-collapse:collapse;font-size:11.5px"><tr>{head}</tr>{rows}</table>{more}'


def _row(joint: Joint, driven: bool) -> str:
    color = _BAD if joint.saturated else "inherit"
    sign = {0: "", 1: " ▲", -1: " ▼"}[joint.saturated]
    name = joint.name if len(joint.name) <= 16 else "…" + joint.name[-15:]
    cells = [
        f'<td style="color:{color};white-space:nowrap;padding-right:8px">{escape(name)}{sign}</td>',
        _place(joint.position),
    ]
    cells += [_bar(joint.rate)] + ([_bar(joint.torque)] if driven else [])
    return f"<tr>{''.join(cells)}</tr>"


def _place(share: float | None) -> str:
    """A mark between the limits."""
    if share is None:
        return '<td style="opacity:.5">free</td>'
    near = share < 0.02 or share > 0.98
    left = 100 * min(max(share, 0.0), 1.0)
    color = _BAD if near else COLORS[0]
    mark = f"{_MARK};left:calc({left:.1f}% - 2px);background:{color}"
    return f'<td style="width:40%;padding-right:10px"><div style="{_TRACK}"><div style="{mark}"></div></div></td>'


def _bar(share: float | None) -> str:
    """A bar from the middle, towards the limit of its direction."""
    if share is None:
        return '<td style="opacity:.5">-</td>'
    size = 50 * min(abs(share), 1.0)
    color = _BAD if abs(share) > 0.98 else COLORS[2]
    side = "left" if share >= 0 else "right"
    bar = f"position:absolute;top:0;height:6px;border-radius:3px;{side}:50%;width:{size:.1f}%;background:{color}"
    return f'<td style="width:22%;padding-right:8px"><div style="{_TRACK}"><div style="{bar}"></div></div></td>'
