"""Closed curves run through in laps, and those that are an ellipse in a plane."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any

import numpy as np

from cartctl.errors import PathError
from cartctl.paths.arguments import Array, Placement, count, direction, frozen, positive, rotation
from cartctl.paths.base import Path, PathSample
from cartctl.paths.timing import timing_law

TWO_PI = 2.0 * math.pi


class Loop(Path):
    """A closed curve over the phase 2 pi laps s: one timing law over all laps, at rest only at the two ends.

    ``period`` is the mean time of a lap: of three or more, the first and the last take longer than the rest.
    """

    period: float
    laps: int
    closed: bool
    _phase: float
    _rotation: Array | None

    @abstractmethod
    def _sample(self, phase: float, rate: float, rate_dot: float) -> PathSample:
        """Return the sample at a phase (rad), its rate and the derivative of that."""

    def __call__(self, t: float) -> PathSample:
        """Return the target at ``t`` seconds."""
        s, s_dot, s_ddot = self._progress(t)
        return self._sample(self._phase * s, self._phase * s_dot, self._phase * s_ddot)

    def cycle_times(self) -> Array:
        """Return the times (laps + 1,), s, at which laps begin and the last one ends: T s^-1(k/laps)."""
        return np.array([self.duration * self._law.inverse(k / self.laps) for k in range(self.laps + 1)])

    def polyline(self, samples: int = 200) -> Array:
        """Return points of one lap for drawing, (samples, 3) m, evenly spaced in phase."""
        phases = np.linspace(0.0, TWO_PI, count("polyline samples", samples, smallest=2)).tolist()
        return np.array([self._sample(phase, 0.0, 0.0).position for phase in phases])

    def _set_loop(self, period: Any, laps: Any, timing: Any, orientation: Any) -> None:
        kind = type(self).__name__
        period, laps, law = (
            positive(f"{kind} period", period, "s"),
            count(f"{kind} laps", laps),
            timing_law(timing),
        )
        held = None if orientation is None else rotation(f"{kind} orientation", orientation)
        self._set(period=period, laps=laps, timing=law, orientation=held, duration=laps * period, closed=True)
        self._set(_law=law, _phase=TWO_PI * laps, _rotation=held)


class PlaneLoop(Loop):
    """p = c + X cos(phase + start_angle) + Y sin(phase + start_angle), orientation constant or open."""

    start_angle: float
    _curve: tuple[float, ...]  # c, X, Y

    def _sample(self, phase: float, rate: float, rate_dot: float) -> PathSample:
        px, py, pz, ax, ay, az, bx, by, bz = self._curve
        phase += self.start_angle
        c, s = math.cos(phase), math.sin(phase)
        rx, ry, rz = ax * c + bx * s, ay * c + by * s, az * c + bz * s
        tx, ty, tz = bx * c - ax * s, by * c - ay * s, bz * c - az * s
        n = rate * rate
        return PathSample(
            np.array((px + rx, py + ry, pz + rz)),
            self._rotation,
            np.array((rate * tx, rate * ty, rate * tz, 0.0, 0.0, 0.0)),
            np.array((rate_dot * tx - n * rx, rate_dot * ty - n * ry, rate_dot * tz - n * rz, 0.0, 0.0, 0.0)),
        )

    def _set_curve(self, centre: Array, x: Array, y: Array) -> None:
        self._set(_curve=(*centre.tolist(), *x.tolist(), *y.tolist()))


def plane_axes(kind: str, centre: Placement, normal: Any, x_axis: Any) -> tuple[Array, Array, Array]:
    """Return unit x, y and normal of a loop's plane, each (3,), y = normal x x.

    The normal is, by default, the centre pose's z or world z; x is, by default, the pose's (or the world's)
    x projected onto the plane, or its y where x is within 30 degrees of the normal. Raises PathError unless
    x_axis is in the plane.
    """
    axes = np.eye(3) if centre.rotation is None else centre.rotation
    n = frozen(axes[:, 2]) if normal is None else direction(f"{kind} normal", normal)
    if x_axis is None:
        x = axes[:, 0] if abs(n @ axes[:, 0]) < math.cos(math.pi / 6) else axes[:, 1]
    else:
        x = direction(f"{kind} x_axis", x_axis)
        if abs(x @ n) > 1e-6:
            lean = math.degrees(math.asin(min(1.0, abs(float(x @ n)))))
            raise PathError(
                f"{kind} x_axis leans {lean:.3g} degrees out of the plane: expected orthogonal to the normal"
            )
    x = in_plane(x, n)
    return x, frozen(np.cross(n, x)), n


def in_plane(vector: Array, normal: Array) -> Array:
    """Return the unit vector along the part of ``vector`` orthogonal to a unit normal."""
    flat = vector - (vector @ normal) * normal
    return frozen(flat / np.linalg.norm(flat))
