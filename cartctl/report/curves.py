"""Curves for the page: what a panel shows, thinned to what a screen can show, packed for the browser."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cartctl.report.mesh import Array
from cartctl.report.palette import thinned

POINTS = 1000  # of a curve
BANDS = 400  # of what is shaded


@dataclass(frozen=True)
class Curve:
    """values (n,) over time (n,) s from the run's start. strong: drawn on top and wider; faint: behind.

    run: the run it belongs to where several are shown. steps: each value holds until the next one. dots: no line.
    """

    label: str
    color: str
    time: Array
    values: Array
    dashed: bool = False
    strong: bool = False
    faint: bool = False
    run: int = 0
    steps: bool = False
    dots: bool = False

    def packed(self) -> dict[str, Any]:
        """Plain data: numbers in single precision, base64."""
        time, values = thinned(self.time, self.values, POINTS)
        kinds = [kind for kind in ("dashed", "strong", "faint", "steps", "dots") if getattr(self, kind)]
        return {"label": self.label, "color": self.color, "kinds": kinds, "run": self.run,
                "time": _base64(time), "values": _base64(values)}  # fmt: skip


@dataclass(frozen=True)
class Band:
    """Times (start, end) s that are shaded in ``color``; words: what they are."""

    words: str
    color: str
    spans: list[tuple[float, float]]


@dataclass(frozen=True)
class Panel:
    """One quantity over time. log: by decades. limits: values that are drawn as lines, what lies beyond is shaded.

    low, high: what is shown at least. legend: whether its curves are named below its title.
    """

    title: str
    unit: str
    curves: list[Curve]
    log: bool = False
    limits: tuple[float, ...] = ()
    low: float | None = None
    high: float | None = None
    note: str = ""
    bands: list[Band] = field(default_factory=list)
    legend: bool = False

    def packed(self) -> dict[str, Any]:
        """Plain data."""
        bands = [{"words": b.words, "color": b.color, "spans": b.spans} for b in self.bands if b.spans]
        return {"title": self.title, "unit": self.unit, "log": self.log, "limits": list(self.limits), "low": self.low,
                "high": self.high, "note": self.note, "legend": self.legend, "bands": bands,
                "curves": [curve.packed() for curve in self.curves]}  # fmt: skip


def spans(time: Array, on: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """The times between which ``on`` (n,) holds; a sample counts until the next one.

    Gaps that are too short to be seen are closed.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(np.int8)))
    ends = np.append(time, time[-1:])
    found: list[tuple[float, float]] = []
    least = float(np.ptp(time)) / BANDS if len(time) else 0.0
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        a, b = float(time[start]), float(ends[stop])
        if found and a - found[-1][1] < least:
            found[-1] = (found[-1][0], max(b, found[-1][1]))
        else:
            found.append((a, max(b, a + least / 2)))
    return found


def rounded(panels: Sequence[Panel]) -> list[dict[str, Any]]:
    """All panels that have a curve, as plain data."""
    return [panel.packed() for panel in panels if panel.curves]


def _base64(values: Array) -> str:
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")
