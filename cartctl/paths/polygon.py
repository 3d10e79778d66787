"""Straight edges between vertices, with corners to stop at or to round off."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import numpy as np

from cartctl.errors import PathError
from cartctl.paths.arguments import Array, array, count, flag, positive, rotation
from cartctl.paths.base import Path, PathSample, clock
from cartctl.paths.corners import Piece, checked_blend, edges_between, rounded, straight
from cartctl.paths.timing import TimingLaw, timing_law

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True, eq=False)
class Polygon(Path):
    """Edges between vertices, over sigma, the length run along the sharp polygon (m).

    A corner at V, from direction u to w, is rounded from ``blend`` before V to ``blend`` after it. There,
    with x = (sigma - begin)/(2 blend),

        p = V - blend u + 2 blend (u x + (w - u) (x^3 - x^4/2)),   dp/dsigma = u + (w - u) (3 x^2 - 2 x^3),

    so that p(sigma) is C2, stays in the triangle of the corner, passes V at 3/16 blend |w - u|, and slows
    down to |dp/dsigma| = cos(half the turn) there. A timing law drives sigma from rest to rest: over each lap
    with a blend, over each edge without one (a stop at every corner). A closed polygon starts, stops and ends
    its laps at its first vertex, which therefore stays sharp.

    Fields:
        vertices: (n, 3) m, n >= 2; a closed polygon does not repeat the first one.
        duration: s, of all laps; or else give ``speed``, the mean along the edges, m/s.
        blend: m; at most the edge's length, half of it where both of its corners are rounded.
        closed: whether to return to the first vertex.
        laps: how many times round, for closed polygons.
        orientation: (3, 3) held throughout, or None: open.
        timing: the name of a law, or a TimingLaw.

    Raises PathError for coinciding neighbours, a blend too large, and unless duration or speed is given.
    """

    vertices: ArrayLike
    duration: float = cast(float, None)  # None stands for "from the speed"; a number once constructed
    speed: float | None = None
    blend: float = 0.0
    closed: bool = True
    laps: int = 1
    orientation: ArrayLike | None = None
    timing: TimingLaw | str = "quintic"
    _rotation: Array | None = field(init=False, repr=False)
    _pieces: list[Piece] = field(init=False, repr=False)
    _begins: list[float] = field(init=False, repr=False)  # sigma at which each piece begins
    _stops: list[float] = field(init=False, repr=False)  # sigma at which a lap rests, both ends included
    _times: list[float] = field(init=False, repr=False)  # s of every stop, over all laps

    def __post_init__(self) -> None:
        """Check the fields, lay out edges and corners, and settle the time."""
        closed, laps = flag("Polygon closed", self.closed), count("Polygon laps", self.laps)
        if laps > 1 and not closed:
            raise PathError(f"Polygon laps is {laps} and closed is False: expected one lap, or closed=True")
        vertices = array("Polygon vertices", self.vertices, ("n", 3))
        held = None if self.orientation is None else rotation("Polygon orientation", self.orientation)
        law, edges = timing_law(self.timing), edges_between(vertices, closed)
        blend = checked_blend(self.blend, edges)
        length = edges[-1].end
        pieces = rounded(edges, blend) if blend else [straight(edge, edge.begin) for edge in edges]
        stops = [0.0, length] if blend else [0.0, *(edge.end for edge in edges)]
        duration = self._checked_duration(laps * length)
        times = [duration / laps * (lap + stop / length) for lap in range(laps) for stop in stops[:-1]]
        self._set(vertices=vertices, duration=duration, blend=blend, closed=closed, laps=laps, timing=law)
        self._set(orientation=held, _rotation=held, _law=law, _stops=stops, _times=[*times, duration])
        self._set(_pieces=pieces, _begins=[piece.begin for piece in pieces])

    def __call__(self, t: float) -> PathSample:
        """Return the target at ``t`` seconds."""
        sigma, rate, rate_dot = self._travel(clock(t))
        position, tangent, bend = self._pieces[bisect_right(self._begins, sigma) - 1].at(sigma)
        n = rate * rate
        velocity = [rate * d for d in tangent]
        acceleration = [n * b + rate_dot * d for b, d in zip(bend, tangent, strict=True)]
        return PathSample(
            np.array(position),
            self._rotation,
            np.array((*velocity, 0.0, 0.0, 0.0)),
            np.array((*acceleration, 0.0, 0.0, 0.0)),
        )

    def cycle_times(self) -> Array:
        """Return the times (laps + 1,), s, at which laps begin and the last one ends; (0,) if open."""
        return np.array(self._times[:: len(self._stops) - 1]) if self.closed else np.empty(0)

    def _travel(self, t: float) -> tuple[float, float, float]:
        """Return sigma (m, within its lap) and its two derivatives."""
        if not 0.0 < t < self.duration:
            return (0.0 if t <= 0.0 else self._stops[-1]), 0.0, 0.0
        leg = bisect_right(self._times, t) - 1
        begin, end = self._times[leg], self._times[leg + 1]
        leg %= len(self._stops) - 1
        sigma, length = self._stops[leg], self._stops[leg + 1] - self._stops[leg]
        s, s_dot, s_ddot = self._law((t - begin) / (end - begin))
        rate = 1.0 / (end - begin)
        return sigma + length * s, length * s_dot * rate, length * s_ddot * rate * rate

    def _checked_duration(self, length: float) -> float:
        """Return the duration from itself or the speed; both pass if they agree (a rebuilt path has both)."""
        duration, speed = self.duration, self.speed
        if speed is None:
            if duration is None:
                raise PathError("Polygon has neither duration nor speed: expected one of them")
            return positive("Polygon duration", duration, "s")
        implied = positive("Polygon duration", length / positive("Polygon speed", speed, "m/s"), "s")
        if duration is None:
            return implied
        if abs(positive("Polygon duration", duration, "s") - implied) > 1e-9 * implied:
            raise PathError(
                f"Polygon duration is {duration:g} s, but {length:g} m at a speed of {speed:g} m/s take "
                f"{implied:g} s: expected one of them"
            )
        return implied
