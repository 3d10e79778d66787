"""A circle in any plane."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from cartctl.errors import PathError
from cartctl.paths.arguments import SMALLEST, direction, number, point_or_pose, positive, show
from cartctl.paths.loop import PlaneLoop, in_plane, plane_axes
from cartctl.paths.timing import TimingLaw

if TYPE_CHECKING:
    import pinocchio as pin
    from numpy.typing import ArrayLike


@dataclass(frozen=True, eq=False)
class Circle(PlaneLoop):
    """p = c + r (x cos a + y sin a), a = start_angle + 2 pi laps s; counter-clockwise about the normal.

    Fields:
        center: a point (3,) in m, or a pose (pin.SE3 or (4, 4)), whose x-y plane is then the circle's and
            whose rotation the orientation, unless ``normal``, ``x_axis`` or ``orientation`` say otherwise.
        radius: m.
        period: mean time of a lap, s; the whole takes laps * period and rests at both ends only.
        laps: how many times round.
        normal: (3,) of any length, world z by default; turn it over to go round the other way.
        orientation: (3, 3) held throughout; None leaves it open where the centre is a point.
        start_angle: rad from x_axis.
        timing: the name of a law, or a TimingLaw.
        x_axis: (3,) in the plane; by default world x (or the pose's) projected onto it, world y where x is
            too steep.

    Raises PathError unless radius and period are positive, the normal is not zero, x_axis is in the plane.

    >>> import cartctl as cc
    >>> circle = cc.Circle([1.0, 0.0, 0.0], radius=0.5, period=2.0)
    >>> print(circle(1.0).position.round(6))
    [0.5 0.  0. ]
    """

    center: ArrayLike | pin.SE3
    radius: float = 0.1
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
        centre = point_or_pose("Circle center", self.center)
        held = centre.rotation if self.orientation is None else self.orientation
        self._set_loop(self.period, self.laps, self.timing, held)
        x, y, n = plane_axes("Circle", centre, self.normal, self.x_axis)
        radius = positive("Circle radius", self.radius, "m")
        start = number("Circle start_angle", self.start_angle)
        self._set(center=centre.position, radius=radius, normal=n, x_axis=x, start_angle=start)
        self._set_curve(centre.position, radius * x, radius * y)

    @classmethod
    def starting_at(
        cls,
        start: ArrayLike | pin.SE3,
        radius: float = 0.1,
        *,
        towards: ArrayLike | None = None,
        normal: ArrayLike = (0.0, 0.0, 1.0),
        period: float = 4.0,
        laps: int = 1,
        timing: TimingLaw | str = "quintic",
    ) -> Circle:
        """Return the circle that begins at a pose or point, so that a hand already there has no error.

        The centre lies at ``radius`` from the start along ``towards`` (3,), projected onto the plane; by
        default towards the world's origin, where a fixed base stands: away from the edge of the workspace.
        A pose's orientation is held. Raises PathError where ``towards`` is parallel to the normal.
        """
        place = point_or_pose("Circle start", start)
        n = direction("Circle normal", normal)
        heading = -place.position if towards is None else direction("Circle towards", towards)
        if np.linalg.norm(np.cross(n, heading)) < max(SMALLEST, 1e-6 * float(np.linalg.norm(heading))):
            given = "from the start to the world's origin" if towards is None else show(towards)
            raise PathError(f"Circle towards ({given}) is parallel to the normal: give a direction in the plane")
        x = in_plane(-heading, n)
        centre = place.position - positive("Circle radius", radius, "m") * x
        return cls(centre, radius, period, laps, n, place.rotation, 0.0, timing, x)
