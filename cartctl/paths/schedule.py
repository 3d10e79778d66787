"""Which poses a path of waypoints passes, and when."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl.errors import ParameterError, PathError, ShapeError
from cartctl.paths.arguments import SMALLEST, Array, Placement, array, point_or_pose, show
from cartctl.paths.timing import TimingLaw


def spread(chords: list[float], duration: float, law: TimingLaw, stop: bool) -> list[float]:
    """Return passing times (n,) for a duration; raises PathError where two neighbours coincide."""
    for k, distance in enumerate(chords):
        if distance < SMALLEST:
            raise PathError(f"Waypoints poses {k} and {k + 1} coincide: expected times=, to say how long to wait there")
    way = np.cumsum([0.0, *chords])
    shares = np.minimum(way / way[-1], 1.0).tolist()
    times = [duration * (share if stop else law.inverse(share)) for share in shares]
    _increasing(times)
    return times


def checked_times(times: Any, size: int) -> Array:
    """Return (n,) increasing times from zero or later, s; raises PathError."""
    checked = array("Waypoints times", times, (size,))
    if checked[0] < 0.0:
        raise PathError(f"Waypoints times begin at {checked[0]:g} s: expected zero or later")
    _increasing(checked.tolist())
    return checked


def _increasing(times: list[float]) -> None:
    for k, (before, after) in enumerate(pairwise(times)):
        if after - before < SMALLEST:
            raise PathError(
                f"Waypoints times {k} and {k + 1} are {before:g} and {after:g} s: expected increasing times, "
                f"at least {SMALLEST:g} s apart"
            )


def placements(poses: Iterable[Any]) -> list[Placement]:
    """Return at least two points, or two poses; raises PathError, and ShapeError for a mixture."""
    if isinstance(poses, str | pin.SE3) or not isinstance(poses, Iterable):
        raise ParameterError(f"Waypoints poses is {show(poses)}: expected a list of points or of poses")
    places = [point_or_pose(f"Waypoints pose {k}", pose) for k, pose in enumerate(poses)]
    if len(places) < 2:
        raise PathError(f"Waypoints poses has {len(places)} of them: expected at least 2")
    for k, place in enumerate(places):
        if (place.rotation is None) != (places[0].rotation is None):
            kinds = ("a point", "a pose") if places[0].rotation is None else ("a pose", "a point")
            raise ShapeError(f"Waypoints pose 0 is {kinds[0]}, pose {k} {kinds[1]}: expected all of one kind")
    return places


def chord(a: Placement, b: Placement, length: float) -> float:
    """Return the distance (m) between two poses or points, a turn counting ``length`` m per rad."""
    step = float(np.linalg.norm(b.position - a.position))
    if a.rotation is None or b.rotation is None:
        return step
    return math.hypot(step, length * float(np.linalg.norm(pin.log3(a.rotation.T @ b.rotation))))
