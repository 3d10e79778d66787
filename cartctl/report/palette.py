"""Colours and lines that colour-blind eyes tell apart, and the thinning of long series.

Source: Okabe & Ito, Color Universal Design, 2008; their yellow is left out, it vanishes on white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl.report.mesh import Array

COLORS = ("#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9", "#000000")
GREY = "#b8bec5"
POINTS = 4000  # of a line that is drawn; more only slow the picture down
NAMED = 2 * len(COLORS)  # lines in one panel that get a colour or a dash of their own
STYLES = ("-", "--", ":", "-.")


@dataclass(frozen=True)
class Pen:
    """How one line is drawn; ``label`` is empty for one that the legend leaves out."""

    label: str
    color: str
    style: str = "-"
    back: bool = False

    @property
    def dashed(self) -> bool:
        """Whether the line has gaps."""
        return self.style != "-"

    def options(self) -> dict[str, Any]:
        """Return the keyword arguments of ``Axes.plot``."""
        look: dict[str, Any] = {"color": self.color, "linestyle": self.style, "linewidth": 1.3}
        if self.back:
            look |= {"linewidth": 0.8, "zorder": 1.5}
        return look | ({"label": self.label} if self.label else {})


def plain(name: str) -> str:
    """Return a name from elsewhere as text that matplotlib shows as it is: no formula, no hidden label."""
    short = name if len(name) <= 40 else name[:37] + "..."
    return short.replace("\\", "\\\\").replace("$", r"\$") if not short.startswith("_") else plain(" " + short)


def pen(index: int, name: str) -> Pen:
    """Return the pen of one of many lines: a colour each, then lighter and darker ones with a dash each."""
    return Pen(plain(name), color(index), STYLES[index // len(COLORS) % len(STYLES)])


def color(index: int) -> str:
    """Return "#rrggbb": the palette, then the same lighter, then darker."""
    base = COLORS[index % len(COLORS)]
    toward = (None, 255, 0)[index // len(COLORS) % 3]
    if toward is None:
        return base
    channels = [int(base[i : i + 2], 16) for i in (1, 3, 5)]
    return "#" + "".join(f"{round(0.55 * c + 0.45 * toward):02x}" for c in channels)


def pens(names: Sequence[str], urgency: Array | None = None) -> list[Pen]:
    """Return one pen a name: a colour each, then a dash each; where both run out, only the most urgent stand out.

    ``urgency`` (n,): how much each line deserves to be seen.
    """
    if len(names) <= NAMED:
        styles = [STYLES[i // len(COLORS)] for i in range(len(names))]
        return [Pen(plain(name), COLORS[i % len(COLORS)], styles[i]) for i, name in enumerate(names)]
    chosen = np.argsort(-(np.zeros(len(names)) if urgency is None else urgency), kind="stable")[: len(COLORS)]
    rank = {int(i): COLORS[k] for k, i in enumerate(sorted(chosen.tolist()))}
    return [Pen(plain(name), rank[i]) if i in rank else Pen("", GREY, back=True) for i, name in enumerate(names)]


def thinned(time: Array, values: Array, points: int = POINTS) -> tuple[Array, Array]:
    """Return ``time`` (n,) and ``values`` (n,) with at most ``points`` samples, every peak and trough kept.

    Each stretch of samples is replaced by its smallest and its largest, in the order of time.
    """
    if len(time) <= points:
        return time, values
    stretch = int(np.ceil(2 * len(time) / points))
    starts = np.arange(0, len(time), stretch)
    parts = [values[s : s + stretch] for s in starts]
    low = np.array([s + np.argmin(p) for s, p in zip(starts, parts, strict=True)])
    high = np.array([s + np.argmax(p) for s, p in zip(starts, parts, strict=True)])
    kept = np.unique(np.concatenate([low, high]))
    return time[kept], values[kept]
