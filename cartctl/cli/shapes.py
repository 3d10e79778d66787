"""From options to a path: one of five shapes, in a plane and of a size that fit, without a jump at the start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.cli.choices import PATHS, PLANES, choice
from cartctl.cli.hand import LETTERS, Hand
from cartctl.paths import Circle, Ellipse, Lissajous, Path, Polygon


@dataclass(frozen=True)
class Shape:
    """A closed path by its name, as large as ``size`` (half its width, m), in a plane of two world axes."""

    kind: str
    plane: str
    size: float
    period: float
    laps: int

    @classmethod
    def fitting(
        cls, hand: Hand, axes: str, kind: str, plane: str | None, size: float | None, period: float, laps: int
    ) -> Shape:
        """Return what was asked for, the rest chosen to fit; raises UnknownChoice, ParameterError, NonFiniteError."""
        return cls(
            choice("path", kind, PATHS),
            hand.plane(axes) if plane is None else choice("plane", plane, PLANES),
            hand.size if size is None else checks.number("--radius", size, low=0.0, strict=True),
            checks.number("--period", period, low=0.0, strict=True),
            laps,
        )

    def path(self, hand: Hand) -> Path:
        """Return the path, from the hand's pose and back to it; raises as the paths do.

        It lies to the left of the line from shoulder to hand: neither does the arm stretch nor fold by much.
        """
        r, period, laps = self.size, self.period, self.laps
        x, y, n = _axes(self.plane, hand)
        start, R = hand.pose.translation, hand.pose.rotation
        centre = start - r * x
        if self.kind == "circle":
            return Circle.starting_at(hand.pose, r, towards=-x, normal=n, period=period, laps=laps)
        if self.kind == "ellipse":
            return Ellipse(centre, (r, 0.5 * r), period, laps, n, R, x_axis=x)
        if self.kind == "lissajous":
            axes = np.column_stack([x, y, n])
            return Lissajous(start, (r, 0.5 * r, 0.0), (1, 2, 0), (0, 0, 0), period, laps, R, axes=axes)
        if self.kind == "line":  # there and back, so that it closes as the others do
            return Polygon([start, start - 2.0 * r * x], laps * period, laps=laps, orientation=R)
        corners = [start, centre + r * y, centre - r * x, centre - r * y]
        return Polygon(corners, laps * period, blend=0.25 * r, laps=laps, orientation=R)

    def __str__(self) -> str:
        width, height = f"{2.0 * self.size:g}", f"{self.size:g}"
        what = {
            "circle": f"circle of radius {self.size:g} m",
            "line": f"line of {width} m, there and back",
            "ellipse": f"ellipse of {width} x {height} m",
            "lissajous": f"eight of {width} x {height} m",
            "polygon": f"square of {width} m across",
        }[self.kind]
        return f"{what} in {self.plane}, {self.laps} lap{'s' if self.laps > 1 else ''} of {self.period:g} s"


def _axes(plane: str, hand: Hand) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Axes x, y, n of the plane, (3,) each: y leads from the shoulder outwards, n is the normal."""
    a, b = (np.eye(3)[LETTERS.index(letter)] for letter in plane)
    n = np.cross(a, b)
    out = hand.pose.translation - hand.shoulder
    out = out - (out @ n) * n
    reach = float(np.linalg.norm(out))
    y = out / reach if reach > 1e-3 * hand.size else b
    return np.cross(y, n), y, n
