"""An ellipse in any plane, and Lissajous figures in space."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from cartctl.errors import PathError, ShapeError
from cartctl.paths.arguments import (
    SMALLEST,
    Array,
    array,
    count,
    frozen,
    number,
    point_or_pose,
    positive,
    rotation,
)
from cartctl.paths.base import PathSample, linear
from cartctl.paths.loop import Loop, PlaneLoop, plane_axes
from cartctl.paths.timing import TimingLaw

if TYPE_CHECKING:
    import pinocchio as pin
    from numpy.typing import ArrayLike


@dataclass(frozen=True, eq=False)
class Ellipse(PlaneLoop):
    """p = c + a x cos E + b y sin E, E = start_angle + 2 pi laps s, the eccentric anomaly.

    ``semi_axes`` (a, b) in m lie along x_axis and normal x x_axis; all other fields are those of
    :class:`Circle`.
    """

    center: ArrayLike | pin.SE3
    semi_axes: tuple[float, float]
    period: float = 4.0
    laps: int = 1
    normal: ArrayLike | None = None
    orientation: ArrayLike | None = None
    start_angle: float = 0.0
    timing: TimingLaw | str = "quintic"
    x_axis: ArrayLike | None = None
    duration: float = field(init=False, repr=False)
    closed: bool = field(init=False, repr=False, default=True)

    def __post_init__(self) -> None:
        """Check the fields, bring them into canonical form and precompute the curve."""
        centre = point_or_pose("Ellipse center", self.center)
        held = centre.rotation if self.orientation is None else self.orientation
        self._set_loop(self.period, self.laps, self.timing, held)
        x, y, n = plane_axes("Ellipse", centre, self.normal, self.x_axis)
        axes = array("Ellipse semi_axes", self.semi_axes, (2,)).tolist()
        a, b = (positive("Ellipse semi_axes", axis, "m") for axis in axes)
        start = number("Ellipse start_angle", self.start_angle)
        self._set(center=centre.position, semi_axes=(a, b), normal=n, x_axis=x, start_angle=start)
        self._set_curve(centre.position, a * x, b * y)


@dataclass(frozen=True, eq=False)
class Lissajous(Loop):
    """p = c + axes [A_i sin(2 pi laps f_i s + phase_i)], i = x, y, z: closed, since the f are integers.

    Fields:
        center: a point (3,) in m; or a pose, whose axes the figure then has and whose rotation is held.
        amplitudes: (3,) m.
        frequencies: (3,) integers, oscillations a lap; (1, 2, 0) draws an eight.
        phases: (3,) rad; all zero starts at the centre.
        period, laps, orientation, timing: as for :class:`Circle`. A lap is the common period; a figure whose
            frequencies share a factor, or that crosses itself, passes its start more often than once a lap.
        axes: (3, 3) rotation of the figure; the centre pose's, or the world's.

    Raises PathError where no axis has both an amplitude and a frequency.
    """

    center: ArrayLike | pin.SE3
    amplitudes: ArrayLike
    frequencies: tuple[int, int, int]
    phases: ArrayLike = (0.0, 0.0, 0.0)
    period: float = 4.0
    laps: int = 1
    orientation: ArrayLike | None = None
    timing: TimingLaw | str = "quintic"
    axes: ArrayLike | None = None
    duration: float = field(init=False, repr=False)
    closed: bool = field(init=False, repr=False, default=True)
    _waves: list[tuple[float, int, float]] = field(init=False, repr=False)
    _frame: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the fields, bring them into canonical form and precompute the figure."""
        centre = point_or_pose("Lissajous center", self.center)
        held = centre.rotation if self.orientation is None else self.orientation
        self._set_loop(self.period, self.laps, self.timing, held)
        amplitudes = array("Lissajous amplitudes", self.amplitudes, (3,))
        phases = array("Lissajous phases", self.phases, (3,))
        frequencies = _integers(self.frequencies)
        if not any(abs(a) >= SMALLEST and f > 0 for a, f in zip(amplitudes, frequencies, strict=True)):
            raise PathError(
                f"Lissajous amplitudes {amplitudes.tolist()} m at frequencies {frequencies} stand still: "
                "expected an axis with both different from zero"
            )
        turned = centre.rotation if self.axes is None else rotation("Lissajous axes", self.axes)
        frame = frozen(np.eye(3) if turned is None else turned)
        self._set(center=centre.position, amplitudes=amplitudes, frequencies=frequencies, phases=phases, axes=frame)
        waves = list(zip(amplitudes.tolist(), frequencies, phases.tolist(), strict=True))
        self._set(_waves=waves, _frame=frozen(frame.T))

    def _sample(self, phase: float, rate: float, rate_dot: float) -> PathSample:
        rows: tuple[list[float], list[float], list[float]] = ([], [], [])
        for amplitude, frequency, offset in self._waves:
            angle, speed = frequency * phase + offset, frequency * rate
            sine, cosine = amplitude * math.sin(angle), amplitude * math.cos(angle)
            rows[0].append(sine)
            rows[1].append(cosine * speed)
            rows[2].append(cosine * frequency * rate_dot - sine * speed * speed)
        position, velocity, acceleration = np.array(rows) @ self._frame
        position += self.center
        return PathSample(position, self._rotation, linear(velocity), linear(acceleration))


def _integers(frequencies: tuple[int, int, int]) -> tuple[int, int, int]:
    shape = np.shape(frequencies)
    if shape != (3,):
        raise ShapeError(f"Lissajous frequencies has shape {shape}: expected three integers (3,)")
    x, y, z = (count("Lissajous frequencies", f, smallest=0) for f in frequencies)
    return x, y, z
