"""A straight line, and the geodesic between two orientations."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from cartctl.errors import PathError
from cartctl.paths.arguments import SMALLEST, point_or_pose, posed, positive, show
from cartctl.paths.base import Path, PathSample
from cartctl.paths.so3 import Turn
from cartctl.paths.timing import TimingLaw, timing_law

if TYPE_CHECKING:
    import pinocchio as pin
    from numpy.typing import ArrayLike


@dataclass(frozen=True, eq=False)
class Line(Path):
    """From ``start`` to ``end``: p = p0 + s (p1 - p0), R = R0 exp(s phi), phi = log(R0^T R1).

    Fields:
        start, end: each a point (3,) in m, a pin.SE3 or a homogeneous (4, 4). Two points leave the
            orientation open; a pose and a point keep the pose's orientation; two poses turn about one axis,
            the shorter way (at exactly 180 degrees both ways are as short, and log picks one).
        duration: s.
        timing: the name of a law, or a TimingLaw.

    Raises PathError where the ends coincide; equal positions with different orientations are a turn in place.
    """

    start: ArrayLike | pin.SE3
    end: ArrayLike | pin.SE3
    duration: float
    timing: TimingLaw | str = "quintic"
    closed: bool = field(init=False, repr=False, default=False)
    _origin: list[float] = field(init=False, repr=False)
    _step: list[float] = field(init=False, repr=False)
    _turn: Turn | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the ends and work out what lies between them."""
        start, end = point_or_pose("Line start", self.start), point_or_pose("Line end", self.end)
        first = end.rotation if start.rotation is None else start.rotation
        last = first if end.rotation is None else end.rotation
        turn = None if first is None or last is None else Turn(first, last)
        step = end.position - start.position
        if np.linalg.norm(step) < SMALLEST and (turn is None or turn.angle < SMALLEST):
            raise PathError(f"Line end is its start, {show(start.position)}: expected two different points or poses")
        law = timing_law(self.timing)
        duration = positive("Line duration", self.duration, "s")
        self._set(start=posed(start.position, first), end=posed(end.position, last), duration=duration, timing=law)
        self._set(_law=law, _origin=start.position.tolist(), _step=step.tolist(), _turn=turn)

    def __call__(self, t: float) -> PathSample:
        """Return the target at ``t`` seconds."""
        s, v, a = self._progress(t)
        (x, y, z), (dx, dy, dz), turn = self._origin, self._step, self._turn
        wx, wy, wz = turn.vector if turn else (0.0, 0.0, 0.0)
        return PathSample(
            np.array((x + s * dx, y + s * dy, z + s * dz)),
            turn(s) if turn else None,
            np.array((v * dx, v * dy, v * dz, v * wx, v * wy, v * wz)),
            np.array((a * dx, a * dy, a * dz, a * wx, a * wy, a * wz)),
        )
