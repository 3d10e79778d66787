"""A distance that a robot keeps: from the obstacles of a scene, and of its links from each other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.constraints.base import Constraint, Rows
from cartctl.constraints.clearance_kernel import MOST_ERROR, REST, clearance_rows, mean_rates
from cartctl.constraints.curvature import joint_order
from cartctl.constraints.intervals import Box
from cartctl.model.robot import Robot
from cartctl.model.scene import AroundItself, AroundScene, Arrangement, Scene, excluded
from cartctl.model.state import State

_NEAR = 0.03  # m beyond the margin: where joints can stop within a step, what is farther need not be slowed yet


class Closest(NamedTuple):
    """The closest pair: what the two belong to, their distance in m, the closest points (3,) each."""

    first: str
    second: str
    distance: float
    points: tuple[FloatArray, FloatArray]


class ClearanceConstraint(Constraint):
    """``d >= margin`` for many pairs; the classes below say which.

    margin: m >= 0 that is kept free. deceleration: m/s^2 > 0, an approach ends with at most this, twice as much where
    it begins too fast; the joints must be able to deliver it. recovery_speed: m/s > 0, the way back from inside the
    margin is no faster. One row a pair of points that could come too near in this step, ``n^T (J_a - J_b) v >= -y(d)``
    with y the speed that can still stop; the velocity of obstacles that move is in it. Where rows contradict the
    joints' bounds, rows yield: the status of the solution is INFEASIBLE.
    """

    def __init__(
        self, arranged: Callable[[Robot], Arrangement], margin: Any, deceleration: Any, recovery_speed: Any, name: str
    ) -> None:
        self.arrangement = arranged  # the pairs of one robot, worked out once
        self.margin = checks.number("margin", margin, low=0.0)
        self.deceleration = checks.number("deceleration", deceleration, low=0.0, strict=True)
        self.recovery_speed = checks.number("recovery_speed", recovery_speed, low=0.0, strict=True)
        self.name = name
        self._robot: tuple[Robot, FloatArray, bool] | None = None

    def check(self, robot: Robot) -> None:
        """Whatever the scene hangs on must exist; raises FrameNotFound, ParameterError."""
        self.arrangement(robot)
        _ = clearance_rows.compiled, mean_rates.compiled  # they compile now, not at the first step

    def excess(self, state: State) -> float:
        """Margin less the smallest distance, m."""
        found = self.arrangement(state.robot).closest(state)
        return self.margin - float(found.distance[0]) if len(found.pairs) else -np.inf

    def closest(self, state: State) -> Closest | None:
        """The closest pair, whatever its distance; None where there is no pair."""
        arrangement = self.arrangement(state.robot)
        found = arrangement.closest(state)
        if not len(found.pairs):
            return None
        names = arrangement.names(int(found.pairs[0]))
        return Closest(*names, float(found.distance[0]), (found.first[0], found.second[0]))

    def velocity_rows(self, state: State, dt: float, box: Box | None = None) -> Rows:
        """``n^T (J_a - J_b) v >= n . v_obstacle - y(d - margin)``, and what a step bends."""
        limits = state.robot.limits
        low, high = (limits.velocity_lower, limits.velocity_upper) if box is None else (box.lower, box.upper)
        rates, nothing = np.empty((4, len(state.v))), np.zeros(len(state.v))
        own = (limits.velocity_lower, limits.velocity_upper)
        mean_rates.compiled(low, high, *own, state.v, nothing, state.v, 1.0, rates)
        return self._rows(state, dt, rates, 0.0, _NEAR if box is None or not self._gradual(state.robot) else np.inf)

    def acceleration_rows(self, state: State, dt: float, box: Box | None = None) -> Rows:
        """The same for the mean rate of a step, ``w = v + a dt/2``, m/s^2."""
        limits = state.robot.limits
        own = (limits.acceleration_lower, limits.acceleration_upper)
        low, high = own if box is None else (box.lower, box.upper)
        rates, nothing = np.empty((4, len(state.v))), np.zeros(len(state.v))
        mean_rates.compiled(low, high, *own, nothing, state.v, state.v, 0.5 * dt, rates)
        return self._rows(state, dt, rates, 1.0, np.inf)

    def _rows(self, state: State, dt: float, rates: FloatArray, level: float, near: float) -> Rows:
        arrangement, nv = self.arrangement(state.robot), state.robot.nv
        arrangement.update(state)
        ahead = arrangement.ahead(state, dt)
        haste = arrangement.haste(state, rates[[0, 2]], dt, ahead)
        margin = self.margin + REST
        found = arrangement.imminent(haste, margin, self.deceleration, dt, near, MOST_ERROR)
        if not len(found.pairs):
            return Rows(np.empty((0, nv)), np.empty(0), np.empty(0))
        settings = np.array([dt, self.deceleration, self.recovery_speed, margin, level, near])
        most = 64
        while True:
            C, lower = np.empty((most, nv)), np.empty(most)
            count = clearance_rows.compiled(
                arrangement.world,
                ahead,
                arrangement.table,
                arrangement.points,
                arrangement.indices,
                found.pairs,
                found.normal,
                state.spatial_jacobian,
                arrangement.support,
                self._ordered(state.robot),
                rates,
                haste,
                settings,
                C,
                lower,
                np.empty(nv),
                np.empty((6, nv)),
                np.empty((nv, nv)),
            )
            if count <= most:
                return Rows(C[:count], lower[:count], np.full(count, np.inf))
            most = count

    def _ordered(self, robot: Robot) -> FloatArray:
        return self._known_of(robot)[1]

    def _gradual(self, robot: Robot) -> bool:
        """Whether its accelerations are limited."""
        return self._known_of(robot)[2]

    def _known_of(self, robot: Robot) -> tuple[Robot, FloatArray, bool]:
        if self._robot is None or self._robot[0] is not robot:
            limits = robot.limits
            bounded = np.isfinite([limits.acceleration_lower, limits.acceleration_upper]).all()
            self._robot = (robot, joint_order(robot), bool(bounded))
        return self._robot


class Avoid(ClearanceConstraint):
    """Keep the robot's links ``margin`` away from the obstacles of a scene.

    A velocity damper (Faverjon & Tournassoud 1987) in a form that holds for whole steps. points: names of frames, or a
    mapping of names to radii in m, to be watched instead of the links. margin, deceleration and recovery_speed as in
    :class:`cartctl.constraints.ClearanceConstraint`.

    Raises ParameterError, NonFiniteError; FrameNotFound when it meets a robot.
    """

    def __init__(
        self,
        scene: Scene,
        margin: float = 0.01,
        *,
        points: Any = None,
        deceleration: float = 2.0,
        recovery_speed: float = 0.1,
        name: str = "clearance",
    ) -> None:
        super().__init__(AroundScene(scene, points), margin, deceleration, recovery_speed, name)
        self.scene, self.points = scene, points


class AvoidSelf(ClearanceConstraint):
    """Keep the robot's links ``margin`` away from each other.

    Not watched are links of one joint or of a joint and the next, pairs that touch at home or in every posture, and
    those that ``srdf`` (a file) disables; :meth:`excluded` names them. margin, deceleration and recovery_speed as in
    :class:`cartctl.constraints.ClearanceConstraint`. Raises ParameterError, NonFiniteError, UrdfError.
    """

    def __init__(
        self,
        margin: float = 0.01,
        *,
        srdf: Any = None,
        deceleration: float = 2.0,
        recovery_speed: float = 0.1,
        name: str = "self-clearance",
    ) -> None:
        super().__init__(AroundItself(srdf), margin, deceleration, recovery_speed, name)
        self.srdf = srdf

    @staticmethod
    def excluded(robot: Robot) -> dict[tuple[str, str], str]:
        """Pairs of links that are not watched, each with the reason: "adjacent", "home" or "always"."""
        return excluded(robot)
