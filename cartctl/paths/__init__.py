"""Timed paths: t -> pose, twist and acceleration, at rest at both ends."""

from cartctl.paths.base import Path, PathSample
from cartctl.paths.circle import Circle
from cartctl.paths.ellipse import Ellipse, Lissajous
from cartctl.paths.line import Line
from cartctl.paths.polygon import Polygon
from cartctl.paths.timing import Quintic, SmoothTrapezoid, TimingLaw, TimingSample
from cartctl.paths.waypoints import Waypoints

__all__ = [
    "Circle",
    "Ellipse",
    "Line",
    "Lissajous",
    "Path",
    "PathSample",
    "Polygon",
    "Quintic",
    "SmoothTrapezoid",
    "TimingLaw",
    "TimingSample",
    "Waypoints",
]
