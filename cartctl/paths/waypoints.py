"""A path through a list of poses."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, cast

import numpy as np

from cartctl.errors import PathError
from cartctl.paths.arguments import SMALLEST, Array, Placement, flag, frozen, posed, positive, show
from cartctl.paths.base import Path, PathSample, at_rest, clock
from cartctl.paths.line import Line
from cartctl.paths.schedule import checked_times, chord, placements, spread
from cartctl.paths.spline import pose_spline
from cartctl.paths.timing import TimingLaw, timing_law


@dataclass(frozen=True, eq=False)
class Waypoints(Path):
    """Through every pose, at its time: a minimum-jerk spline without stops, or lines from stop to stop.

    Fields:
        poses: at least two points (3,), or at least two poses (pin.SE3 or (4, 4)); n of them.
        times: (n,) s, increasing, when each is passed; the first pose is held until times[0] >= 0. Or else
        duration: s; a spline then passes the poses when ``timing`` would on the chords from pose to pose (so
            that poses along a line give, with the quintic law, that line's own motion), and stop=True spends
            time on each segment in proportion to its chord.
        stop: rest at every pose, moving between them as a :class:`Line` does; equal neighbours are a wait.
        timing: a law's name or a TimingLaw: of each segment with stop=True, of the spacing with ``duration``.
        characteristic_length: l in m per rad, for chords sqrt(step^2 + (l turn)^2).
        passing_times: (n,) s, worked out; ``closed`` is worked out too: whether the last pose is the first.

    A spline may overshoot between poses whose times do not suit their distances. Raises PathError for fewer
    than two poses, points among poses, times that do not increase, and unless either times or duration is
    given.
    """

    poses: Iterable[Any]
    times: Any = None
    duration: float = cast(float, None)  # None stands for "from the times"; a number once constructed
    stop: bool = False
    timing: TimingLaw | str = "quintic"
    characteristic_length: float = 1.0
    passing_times: Array = field(init=False, repr=False)
    closed: bool = field(init=False, repr=False)
    _knots: list[float] = field(init=False, repr=False)
    _ends: tuple[Placement, Placement] = field(init=False, repr=False)
    _segments: list[Callable[[float], PathSample]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the fields, settle the times and build the segments."""
        law, stop = timing_law(self.timing), flag("Waypoints stop", self.stop)
        places = placements(self.poses)
        length = positive("Waypoints characteristic_length", self.characteristic_length, "m")
        chords = [chord(a, b, length) for a, b in pairwise(places)]
        if max(chords) < SMALLEST:
            here = show(places[0].position.tolist())
            raise PathError(f"Waypoints poses are all at {here}: expected different ones")
        given = None if self.times is None else checked_times(self.times, len(places))
        duration = self._checked_duration(given)
        times = frozen(spread(chords, duration, law, stop)) if given is None else given
        closed = chord(places[0], places[-1], length) < SMALLEST
        segments = _stops(places, chords, times, law) if stop else pose_spline(places, times)
        poses = tuple(posed(*place) for place in places)
        self._set(poses=poses, times=given, duration=duration, stop=stop, timing=law, _law=law)
        self._set(characteristic_length=length, passing_times=times, closed=closed, _segments=segments)
        self._set(_knots=times.tolist(), _ends=(places[0], places[-1]))

    def __call__(self, t: float) -> PathSample:
        """Return the target at ``t`` seconds."""
        t, knots = clock(t), self._knots
        if t <= knots[0]:
            return at_rest(*self._ends[0])
        if t >= knots[-1]:
            return at_rest(*self._ends[1])
        k = bisect_right(knots, t) - 1
        return self._segments[k](t - knots[k])

    def _checked_duration(self, times: Array | None) -> float:
        """Return the duration from itself or the times; both pass if they agree (a rebuilt path has both)."""
        if times is None:
            if self.duration is None:
                raise PathError("Waypoints has neither times nor duration: expected one of them")
            return positive("Waypoints duration", self.duration, "s")
        end = float(times[-1])
        if self.duration is None:
            return end
        duration = positive("Waypoints duration", self.duration, "s")
        if abs(duration - end) > 1e-9 * end:
            raise PathError(f"Waypoints duration is {duration:g} s, times end at {end:g} s: expected one of them")
        return end


class _Wait:
    """A segment between two equal poses."""

    def __init__(self, place: Placement) -> None:
        self._place = place

    def __call__(self, _: float) -> PathSample:
        return at_rest(*self._place)


def _stops(
    places: list[Placement], chords: list[float], times: Array, law: TimingLaw
) -> list[Callable[[float], PathSample]]:
    """Lines from stop to stop, and waits."""
    segments: list[Callable[[float], PathSample]] = []
    for (a, b), distance, gap in zip(pairwise(places), chords, np.diff(times).tolist(), strict=True):
        segments.append(_Wait(a) if distance < SMALLEST else Line(posed(*a), posed(*b), gap, law))
    return segments
