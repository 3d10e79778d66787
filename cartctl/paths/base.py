"""What every path is: time in, pose, twist and acceleration out, all in world axes."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from cartctl.errors import NonFiniteError
from cartctl.paths.arguments import Array, count, number
from cartctl.paths.timing import TimingLaw


@dataclass(frozen=True, slots=True, eq=False)
class PathSample:
    """The target at one instant, in world axes (LOCAL_WORLD_ALIGNED: origin at the target, world axes).

    Fields:
        position: (3,) m.
        rotation: (3, 3), target axes in the world; None where the path leaves the orientation open.
        twist: (6,) linear, angular; m/s, rad/s.
        acceleration: (6,) classical linear (second derivative of ``position``), angular; m/s^2, rad/s^2.

    Arrays are fresh, or read-only where a path shares one between samples (a constant rotation).
    """

    position: Array
    rotation: Array | None
    twist: Array
    acceleration: Array


class Path(ABC):
    """A timed curve that starts and ends at rest: before 0 and after ``duration`` it holds its end poses.

    To write one: a frozen dataclass that sets ``duration`` (s), ``closed`` and ``_law`` in ``__post_init__``
    (with :meth:`_set`) and whose ``__call__`` starts with :meth:`_progress`, which checks and clamps
    the time. Velocity and acceleration must be the derivatives of the pose and vanish at both ends.
    """

    duration: float
    closed: bool
    _law: TimingLaw

    @abstractmethod
    def __call__(self, t: float) -> PathSample:
        """Return the target at ``t`` seconds; raises NonFiniteError for NaN or infinity."""

    @property
    def has_orientation(self) -> bool:
        """Whether the path prescribes the orientation as well as the position."""
        return self(0.0).rotation is not None

    def cycle_times(self) -> Array:
        """Return the times (laps + 1,), s, at which laps begin and the last one ends; (0,) if open."""
        return np.array([0.0, self.duration]) if self.closed else np.empty(0)

    def polyline(self, samples: int = 200) -> Array:
        """Return points for drawing, (samples, 3) m, evenly spaced in time; one lap of a closed path."""
        laps = self.cycle_times()
        end = float(laps[1]) if laps.size else self.duration
        times = np.linspace(0.0, end, count("polyline samples", samples, smallest=2)).tolist()
        return np.array([self(t).position for t in times])

    def _progress(self, t: float) -> tuple[float, float, float]:
        """Return s, ds/dt, d2s/dt2 of the timing law over the whole duration; at rest outside of it."""
        t = clock(t)
        if 0.0 < t < self.duration:
            rate = 1.0 / self.duration
            s, s_dot, s_ddot = self._law(t / self.duration)
            return s, s_dot * rate, s_ddot * rate * rate
        return (1.0 if t > 0.0 else 0.0), 0.0, 0.0

    def _set(self, **values: object) -> None:
        """Set attributes of a frozen dataclass; for ``__post_init__`` alone."""
        for name, value in values.items():
            object.__setattr__(self, name, value)


def clock(t: float) -> float:
    """Return t as a finite float; the common case costs one type comparison."""
    if type(t) is not float:
        return number("path time t", t)
    if not math.isfinite(t):
        raise NonFiniteError(f"path time t is {t}: expected a finite time in s")
    return t


def at_rest(position: Array, rotation: Array | None) -> PathSample:
    """Return a sample that holds a pose: copies of it, and zero twist and acceleration."""
    held = None if rotation is None else rotation.copy()
    return PathSample(position.copy(), held, np.zeros(6), np.zeros(6))


def linear(vector: Array) -> Array:
    """Return (6,) with a linear part (3,) and no angular one."""
    full = np.zeros(6)
    full[:3] = vector
    return full
