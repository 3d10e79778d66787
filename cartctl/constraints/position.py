"""What bounds on a position share: n . p between two values for a few directions n, never crossed.

A step at mean rates w, ``q <- q (+) w dt`` (w = v at the velocity level, v + a dt/2 at the acceleration level), moves
n . p by ``n^T J w dt + 1/2 dt^2 w^T H w`` and a rest of third order. About the centre c of where w will lie,

    ``n . (p+ - p)/dt = (n^T J + dt c^T H) w - 1/2 dt c^T H c + 1/2 dt (w - c)^T H (w - c) + O(dt^2)``,

which is a row in w up to the last two terms. They move the frame by at most m, a bound over the box of w. Twice m is
held free: from d >= 2 m before the bound a step may go on to 2 m by its row, from there to m by its tangent's error;
between m and 2 m the row allows standing still, and only below m does it ask for a way back, to m. So no step crosses,
and at the bound a velocity of zero is feasible. At dt = 10 ms and full speed, m is some 10 micrometres where the box is
narrow (accelerations bounded); where velocities may turn round within a step it is ``1/2 dt^2 max u^T H u``,
millimetres. All of it holds as long as the command obeys rows and box: the joints must be able to deliver the
deceleration, and at the acceleration level braking is a command of its own, which slowing down a task does not give.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.braking import allowed_speed
from cartctl.checks import FloatArray
from cartctl.constraints.base import Constraint, Rows
from cartctl.constraints.curvature import curvatures, joint_order, largest_form, third_order
from cartctl.constraints.intervals import Box, ordered, spread
from cartctl.model.robot import Robot
from cartctl.model.state import State

_MOST = 0.025  # m: an error beyond this comes from steps or limits too long for a guarantee
_BRAKE = 2.0  # times the deceleration planned with: to make up for curvature, and for a start that was too fast


class Room(NamedTuple):
    """What is left before a bound, (k,) each, m: its distance, negative outside, and the error m of one step."""

    distance: FloatArray
    error: FloatArray


class Step(NamedTuple):
    """One step, seen along each direction: ``mean rate = A w - offset`` within what margins hold free."""

    A: FloatArray  # (k, nv) n^T J + dt c^T H
    offset: FloatArray  # (k,) 1/2 dt c^T H c, m/s
    below: Room
    above: Room


class PositionConstraint(Constraint):
    """``lower <= n . p <= upper`` for directions n; the classes below say which.

    deceleration: m/s^2 > 0, the approach ends with at most this; twice as much where curvature, or a start that was
    too fast, asks for it. The joints must be able to deliver it. recovery_speed: m/s > 0, the way back from outside is
    no faster than this, or than margin / (2 dt) where that is more. margin: m held free before the bound; None works
    it out so that no step crosses (with 0, one may by the part of its curvature that the row does not see).
    """

    def __init__(
        self,
        frame: str,
        normals: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        deceleration: Any,
        recovery_speed: Any,
        margin: Any,
        name: str,
    ) -> None:
        bounded = np.isfinite(lower) | np.isfinite(upper)
        self.frame, self.name = frame, name
        self._normals, self._lower, self._upper = normals[bounded], lower[bounded], upper[bounded]
        self.deceleration = checks.number("deceleration", deceleration, low=0.0, strict=True)
        self.recovery_speed = checks.number("recovery_speed", recovery_speed, low=0.0, strict=True)
        self._known: tuple[Robot, FloatArray] | None = None
        self.margin = None if margin is None else checks.number("margin", margin, low=0.0)

    def check(self, robot: Robot) -> None:
        """The frame must exist; raises FrameNotFound."""
        robot.frame_id(self.frame)

    def excess(self, state: State) -> float:
        """The largest distance outside, m."""
        at = self._normals @ state.position(self.frame)
        return float(np.maximum(self._lower - at, at - self._upper).max(initial=-np.inf))

    def velocity_rows(self, state: State, dt: float, box: Box | None = None) -> Rows:
        """``-y(room below) <= A v - offset <= y(room above)``, y the allowed speed, m/s."""
        centre, radius = spread(box, state.robot.limits.velocity_lower, state.robot.limits.velocity_upper, state.v)
        step = self._step(state, dt, centre, radius)
        low, high = -self._speed(step.below, 1.0, dt), self._speed(step.above, 1.0, dt)
        return Rows(step.A, *ordered(low + step.offset, high + step.offset))

    def _speed(self, room: Room, factor: float, dt: float) -> FloatArray:
        """The largest speed towards a bound, from the room before it; negative: the way back, by factor / dt."""
        free = room.distance - 2.0 * room.error
        fastest = np.maximum(self.recovery_speed, room.error / dt)
        back = np.minimum(np.maximum((room.distance - room.error) * (factor / dt), -fastest), 0.0)
        return np.where(free >= 0.0, allowed_speed(free, self.deceleration, dt), back)

    def acceleration_rows(self, state: State, dt: float, box: Box | None = None) -> Rows:
        """The same for the mean rate ``(s + y)/2`` of a step from speed s to y, ``w = v + a dt/2``, m/s^2.

        A contains the drift: ``A w - offset = n^T J v + dt/2 (n^T J a + n^T J_dot v) + O(dt^2)``.
        """
        limits = state.robot.limits
        still = np.zeros(state.robot.nv)
        centre, radius = spread(box, limits.acceleration_lower, limits.acceleration_upper, still)
        step = self._step(state, dt, state.v + 0.5 * dt * centre, 0.5 * dt * radius)
        speed = self._normals @ (state.jacobian(self.frame)[:3] @ state.v)
        begun = step.A @ state.v - step.offset
        low = -self._mean(step.below, -speed, dt) - begun
        high = self._mean(step.above, speed, dt) - begun
        return Rows(step.A, *ordered(low * (2.0 / dt), high * (2.0 / dt)))

    def _mean(self, room: Room, speed: FloatArray, dt: float) -> FloatArray:
        """The largest mean rate towards a bound of a step that begins at ``speed``, from the room before it."""
        end = self._speed(Room(room.distance - 0.5 * dt * speed, room.error), 2.0, dt)
        return 0.5 * (speed + np.maximum(end, speed - _BRAKE * self.deceleration * dt))

    def _step(self, state: State, dt: float, centre: FloatArray, radius: FloatArray) -> Step:
        J = state.jacobian(self.frame)
        H = curvatures(J, self._normals, self._order(state.robot))
        bend = centre @ H
        above, below = self._errors(J, H, centre, radius, dt)
        at = self._normals @ state.position(self.frame)
        return Step(
            A=self._normals @ J[:3] + dt * bend,
            offset=0.5 * dt * (bend @ centre),
            below=Room(at - self._lower, below),
            above=Room(self._upper - at, above),
        )

    def _order(self, robot: Robot) -> FloatArray:
        """Which joint comes before which, worked out once a robot."""
        if self._known is None or self._known[0] is not robot:
            self._known = (robot, joint_order(robot))
        return self._known[1]

    def _errors(
        self, J: FloatArray, H: FloatArray, centre: FloatArray, radius: FloatArray, dt: float
    ) -> tuple[FloatArray, FloatArray]:
        """How far one step may go beyond its row towards the upper and the lower bounds, (k,) each, m."""
        if self.margin is not None:
            fixed = np.full(len(H), 0.5 * self.margin)
            return fixed, fixed
        rest = third_order(J, np.abs(centre) + radius, dt)
        above, below = (0.5 * dt**2 * largest_form(form, radius) + rest for form in (H, -H))
        return np.minimum(above, _MOST), np.minimum(below, _MOST)
