"""A calibration in one figure: errors before and after, what changed and how surely, what the data could see."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from cartctl.report.axes import LEGEND, LIMIT, finish, logarithmic, note
from cartctl.report.palette import COLORS, GREY, plain

if TYPE_CHECKING:
    from cartctl.calibration.result import Calibration

_SHOWN = {"m": (1e3, "mm", "Position error", "Lengths"), "rad": (1e3, "mrad", "Orientation error", "Angles")}
_MOST = 60  # parameters in one panel; more could not be read
_LEAST = 1e-3  # mm or mrad: on a logarithmic axis, smaller ones are drawn there


def plot_calibration(result: Calibration) -> Figure:
    """Return a figure of ``result``: residuals of each measurement, estimates with 95 % intervals, singular values.

    It belongs to no window and leaves matplotlib's global state alone.
    """
    units = list(result.data.parts)
    kinds: list[str] = [unit for unit in ("m", "rad") if unit in result.units]
    most = max(min(result.units.count(unit), _MOST) for unit in kinds)
    heights = [2.6, max(2.4, 0.19 * most + 0.9), 2.4]
    figure = Figure(figsize=(11.0, sum(heights) + 0.6), layout="constrained")
    rows = [_pair("error", units), _pair("change", kinds), ["singular values", "spread"]]
    places: dict[str, Any] = figure.subplot_mosaic(rows, height_ratios=heights)
    for unit in units:
        _errors(places[f"error {unit}"], result, unit)
    for unit in kinds:
        _changes(places[f"change {unit}"], result, unit)
    _singular_values(places["singular values"], result)
    _spread(places["spread"], result)
    return figure


def _pair(what: str, units: list[str]) -> list[str]:
    names = [f"{what} {unit}" for unit in units]
    return names * 2 if len(names) == 1 else names


def _errors(axes: Any, result: Calibration, unit: str) -> None:
    """Draw the norm of each measurement's residual, before and after, and mark the outliers."""
    factor, shown, title, _ = _SHOWN[unit]
    part = result.data.parts[unit]
    before, after = (factor * np.linalg.norm(e[:, part], axis=1) for e in (result.before, result.residuals))
    number = np.arange(len(after))
    size = 5.0 if len(number) <= 300 else 2.0
    style: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": size}
    axes.plot(number, np.maximum(before, _LEAST * 1e-3), color=GREY, label="nominal", **style)
    axes.plot(number, np.maximum(after, _LEAST * 1e-3), color=COLORS[0], label="calibrated", **style)
    if len(result.outliers):
        wild = {**style, "marker": "x", "markersize": size + 3}
        axes.plot(
            result.outliers, np.maximum(after[result.outliers], _LEAST * 1e-3), color=LIMIT, label="outlier", **wild
        )
    logarithmic(axes)
    finish(axes, title, shown)
    axes.margins(x=0.02)
    axes.set_xlabel("measurement")
    note(axes, f"RMS {_rms(before):.3g} -> {_rms(after):.3g} {shown}")
    axes.legend(loc="best", **LEGEND)


def _changes(axes: Any, result: Calibration, unit: str) -> None:
    """Draw each estimate's distance from nominal with its interval; hollow where it is not determined by itself."""
    factor, shown, _, title = _SHOWN[unit]
    chosen = [k for k, u in enumerate(result.units) if u == unit]
    left_out = len(chosen) - _MOST
    if left_out > 0:
        chosen = sorted(sorted(chosen, key=lambda k: -abs(float(result.delta[k])))[:_MOST])
    delta, interval = factor * result.delta, factor * result.interval()
    for row, k in enumerate(chosen):
        if result.determined[k] and np.isfinite(interval[k]).all():
            axes.plot(interval[k], [row, row], color=COLORS[0], linewidth=1.6, solid_capstyle="butt")
        filled = COLORS[0] if result.determined[k] else "white"
        axes.plot([delta[k]], [row], marker="o", markersize=4.5, color=COLORS[0], markerfacecolor=filled)
    axes.axvline(0.0, color="0.6", linewidth=0.8)
    axes.set_yticks(
        range(len(chosen)), [plain(result.names[k]) for k in chosen], fontsize=8 if len(chosen) < 30 else 6.5
    )
    axes.set_ylim(len(chosen) - 0.4, -0.6)
    finish(axes, f"{title}: changes, 95 %", "")
    axes.margins(x=0.04)
    axes.set_xlabel(shown)
    hollow = any(not result.determined[k] for k in chosen)
    words = ["hollow: not determined alone"] * hollow + [f"{left_out} smaller ones left out"] * (left_out > 0)
    note(axes, ", ".join(words))


def _singular_values(axes: Any, result: Calibration) -> None:
    """Draw the singular values of the column-scaled regressor; those beyond the rank are grey."""
    values = np.maximum(result.seen.values, 1e-17)
    number = np.arange(1, len(values) + 1)
    kept = number <= result.rank
    axes.plot(number[kept], values[kept], "o", color=COLORS[0], markersize=4, label="seen")
    if not kept.all():
        axes.plot(number[~kept], values[~kept], "o", color=GREY, markersize=4, label="not seen: held at nominal")
    axes.set_yscale("log")
    finish(axes, "Singular values, columns scaled", "")
    axes.margins(x=0.03)
    note(axes, f"rank {result.rank} of {len(values)}, condition {result.condition:.3g}")
    axes.legend(loc="best", **LEGEND)


def _spread(axes: Any, result: Calibration) -> None:
    """Draw whitened residuals as a histogram beside the normal density that the intervals assume."""
    sigma = np.array(
        [result.noise[unit] for unit, part in result.data.parts.items() for _ in range(part.start, part.stop)]
    )
    white = np.clip((result.residuals / sigma).ravel(), -6.0, 6.0)
    edges = np.linspace(-6.0, 6.0, 49)
    axes.hist(white, bins=edges, density=True, color=COLORS[5], label="residuals")
    x = np.linspace(-6.0, 6.0, 241)
    axes.plot(x, np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi), color=COLORS[3], linewidth=1.3, label="normal")
    finish(axes, "Residuals / sigma", "density")
    beyond = int((np.abs(white) >= 6.0).sum())
    note(axes, f"{beyond} beyond 6, drawn at the edge" if beyond else "")
    axes.legend(loc="best", **LEGEND)


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(values**2)))
