"""Clearance as a task with a priority: keep a distance, where it is about to be lost.

With h rising from 0 at ``distance + band`` to 1 at ``distance``, the task asks for the distance's own rate, ``h k (d* -
d) + (1 - h) d_dot``: at the outer edge nothing but what happens anyway, so that it comes and goes without a jump
(intermediate desired values, Lee, Mansard & Park 2012), and at d* a stop. Beyond the band it asks for nothing, and its
row is zero.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import TargetError
from cartctl.model.robot import Robot
from cartctl.model.scene import AroundScene, Arrangement, Contacts, Scene
from cartctl.model.scene.smooth import smallest
from cartctl.model.state import State
from cartctl.tasks.base import Reference, Task

_SMOOTH, _FADE = 0.2, 5.0  # tau in bands; how many tau beyond the band distances fade out
_STEP = 1e-5  # rad or m along v, s at rest: the drift's difference; gradients are exact to 1e-9


class Nearest(NamedTuple):
    """The smallest distance, m, its gradient (nv,), its rate from obstacles that move, m/s, and the share h."""

    distance: float
    gradient: FloatArray
    coming: float
    share: float


class ClearanceTask(Task):
    """Hold the smallest distance between the robot and a scene's obstacles at ``distance``, m, or more.

    ``d_dot = sum_i w_i n_i^T (J_p1 - J_p2) v``, smoothed over close pairs by a fifth of the band
    (:mod:`cartctl.model.scene.smooth`). band: m > 0 beyond ``distance`` in which the task sets in. points:
    names of frames, or a mapping of names to radii, instead of the links. Where the null space of what ranks above
    cannot give the rate, it yields: for a guarantee use :class:`cartctl.Avoid`. gain (1/s), weight, fit, name as in
    :class:`cartctl.FrameTask`.

    Raises ParameterError, NonFiniteError; FrameNotFound when a controller is made.
    """

    kind: ClassVar[str] = "clearance"

    def __init__(
        self,
        scene: Scene,
        distance: float = 0.05,
        gain: Any = 10.0,
        *,
        band: float = 0.05,
        points: Any = None,
        weight: float = 1.0,
        fit: str = "least_squares",
        name: str = "clearance",
    ) -> None:
        super().__init__(gain=gain, weight=weight, fit=fit, name=name)
        self.scene, self.points = scene, points
        self._arranged = AroundScene(scene, points)
        self.band = checks.number("band", band, low=0.0, strict=True)
        self.target = distance
        self._last: tuple[State, int, Arrangement, Nearest] | None = None

    def take_target(self, value: Any, label: str) -> None:
        """The distance to keep, m >= 0."""
        if callable(value):
            raise TargetError(f"{label} is a path; expected a distance in m")
        self._distance = checks.number(label, value, low=0.0)
        self._last = None

    def units(self, robot: Robot) -> list[str]:
        """One row, m."""
        return ["m"]

    def check(self, robot: Robot) -> None:
        """Whatever the scene hangs on must exist; raises FrameNotFound, ParameterError."""
        super().check(robot)
        self._arranged(robot)

    def distance(self, state: State) -> float:
        """The smallest distance, m; the distance to keep and its band where nothing is nearer."""
        return self._nearest(state).distance

    def jacobian(self, state: State) -> FloatArray:
        """``dd/dq`` (1, nv) of the closest pair; zero beyond the band."""
        found = self._nearest(state)
        return found.gradient[None] if found.share > 0.0 else np.zeros((1, state.robot.nv))

    def size(self, state: State) -> float:
        """1 m/rad: by what a zero row is zero."""
        return 1.0

    def drift(self, state: State) -> FloatArray:
        """The distance's second derivative at zero joint acceleration (1,), m/s^2, by a difference along the motion."""
        if self._nearest(state).share == 0.0:
            return np.zeros(1)
        h = _STEP / max(float(np.linalg.norm(state.v)), 1.0)
        ends = []
        for sign in (1.0, -1.0):
            q = state.robot.integrate(state.q, sign * h * state.v)
            found = self._measured(state.robot.state(q, state.v, state.time + sign * h))
            ends.append(float(found.gradient @ state.v) + found.coming)
        return np.array([(ends[0] - ends[1]) / (2.0 * h)])

    def reference(self, state: State, t: float, anchor: Any) -> Reference:
        """``h (d* - d)``, and ``(1 - h) d_dot`` less what the obstacles do themselves."""
        found = self._nearest(state)
        if found.share == 0.0:
            return Reference(np.zeros(1))
        own = float(found.gradient @ state.v)
        rate = (1.0 - found.share) * own - found.share * found.coming
        return Reference(np.array([found.share * (self._distance - found.distance)]), np.array([rate]))

    def _nearest(self, state: State) -> Nearest:
        last, arrangement = self._last, self._arranged(state.robot)
        if last is not None and last[0] is state and last[1] == state.stamp and last[2] is arrangement:
            return last[3]
        found = self._measured(state)
        self._last = (state, state.stamp, arrangement, found)
        return found

    def _measured(self, state: State) -> Nearest:
        arrangement, tau = self._arranged(state.robot), _SMOOTH * self.band
        edge = self._distance + self.band
        contacts = arrangement.within(state, edge + _FADE * tau)
        if not len(contacts.pairs):
            return Nearest(edge, np.zeros(state.robot.nv), 0.0, 0.0)
        value, weights = smallest(contacts.distance, tau, edge + _FADE * tau)
        coming = np.array([self._coming(arrangement, state, contacts, k) for k in range(len(weights))])
        x = min(max((edge - value) / self.band, 0.0), 1.0)
        gradient = weights @ arrangement.gradients(state, contacts)
        return Nearest(value, gradient, float(weights @ coming), x * x * (3.0 - 2.0 * x))

    @staticmethod
    def _coming(arrangement: Arrangement, state: State, contacts: Contacts, k: int) -> float:
        """The rate of contact k's distance from an obstacle on a path, m/s."""
        obstacle = arrangement.parts[arrangement.pairs[int(contacts.pairs[k])][1]].obstacle
        if obstacle is None or not obstacle.moves:
            return 0.0
        here = obstacle.pose(state.time).actInv(contacts.second[k])
        ahead, behind = (obstacle.pose(state.time + h).act(here) for h in (_STEP, -_STEP))
        return -float(contacts.normal[k] @ (ahead - behind)) / (2.0 * _STEP)
