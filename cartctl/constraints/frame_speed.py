"""A limit on how fast a frame moves and turns."""

from __future__ import annotations

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.constraints.base import Constraint, Rows
from cartctl.constraints.intervals import Box
from cartctl.constraints.polyhedron import INSIDE_BALL
from cartctl.errors import ParameterError
from cartctl.model.robot import Robot
from cartctl.model.state import State


class FrameSpeed(Constraint):
    """Keep ``||V v|| <= linear`` (m/s) and ``||Omega v|| <= angular`` (rad/s), J = [V; Omega] of ``frame``.

    Either may be None, not both. The ball is replaced by a polyhedron inside it, fixed in the world, so that the rows
    ``|N V v| <= h linear`` imply the limit whatever the direction. facets: 12 (6 rows, h = 0.795), 6 (3 rows, 0.577) or
    32 (16 rows, 0.923); h is the share of the limit that is left in the worst direction.

    At the velocity level the limit holds for the commanded v at the configuration it was made for; until the step ends
    the frame's velocity changes by J_dot v dt. At the acceleration level the rows hold for the end of the step, up to
    second order in dt. deceleration: of the linear speed, m/s^2 > 0, and of the angular one, rad/s^2: at the
    acceleration level what is too fast slows by no more than this.

    Raises ParameterError, NonFiniteError; FrameNotFound when it meets a robot.
    """

    def __init__(
        self,
        frame: str,
        linear: float | None = None,
        angular: float | None = None,
        *,
        facets: int = 12,
        deceleration: float = 2.0,
        name: str | None = None,
    ) -> None:
        if linear is None and angular is None:
            raise ParameterError("linear and angular are both None; expected a limit for one of them at least")
        if not isinstance(facets, int) or facets not in INSIDE_BALL:
            raise ParameterError(f"facets is {facets!r}; expected one of {', '.join(map(str, INSIDE_BALL))}")
        self.frame, self.name, self.facets = frame, name or f"speed of {frame}", facets
        self.linear = None if linear is None else checks.number("linear", linear, low=0.0, strict=True)
        self.angular = None if angular is None else checks.number("angular", angular, low=0.0, strict=True)
        self.deceleration = checks.number("deceleration", deceleration, low=0.0, strict=True)
        self._normals, self._limit = self._rows()

    def _rows(self) -> tuple[FloatArray, FloatArray]:
        """Rows (r, 6) on a twist, and what they may come to."""
        normals, height = INSIDE_BALL[self.facets]
        blocks, limits = [], []
        for start, limit in ((0, self.linear), (3, self.angular)):
            if limit is not None:
                block = np.zeros((len(normals), 6))
                block[:, start : start + 3] = normals
                blocks.append(block)
                limits.append(np.full(len(normals), height * limit))
        return np.concatenate(blocks), np.concatenate(limits)

    def check(self, robot: Robot) -> None:
        """The frame must exist; raises FrameNotFound."""
        robot.frame_id(self.frame)

    def excess(self, state: State) -> float:
        """The larger of ``||V v|| - linear`` in m/s and ``||Omega v|| - angular`` in rad/s."""
        twist = state.twist(self.frame)
        parts = ((twist[:3], self.linear), (twist[3:], self.angular))
        return max(float(np.linalg.norm(part)) - limit for part, limit in parts if limit is not None)

    def velocity_rows(self, state: State, dt: float, box: Box | None = None) -> Rows:
        """``-h limit <= N J v <= h limit``."""
        return Rows(self._normals @ state.jacobian(self.frame), -self._limit, self._limit)

    def acceleration_rows(self, state: State, dt: float, box: Box | None = None) -> Rows:
        """``-h limit <= N (J v + dt (J a + J_dot v)) <= h limit``."""
        J = self._normals @ state.jacobian(self.frame)
        speed, drift = J @ state.v, self._normals @ state.drift(self.frame)
        low = np.minimum((-self._limit - speed) / dt, self.deceleration)
        high = np.maximum((self._limit - speed) / dt, -self.deceleration)
        return Rows(J, low - drift, high - drift)
