"""Clearance: the smallest distance to obstacles, or of the robot's links from each other, smoothed over close pairs.

H is a distance, not its square, so that its gradient does not die away at contact; how it is smoothed is in
:mod:`cartctl.model.scene.smooth`. ``dH/dq = sum_i w_i n_i^T (J_p1 - J_p2)``, w_i >= 0.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.model.robot import Robot
from cartctl.model.scene import AroundItself, AroundScene, Arrangement, Contacts, Scene
from cartctl.model.scene.smooth import smallest
from cartctl.model.state import State
from cartctl.objectives.base import Objective

_NEGLIGIBLE = 40.0  # tau: what is farther than the closest by this weighs 4e-18


class SmoothClearance(Objective):
    """H in m, maximised; the classes below say between what.

    gain: k > 0 in ``u0 = k grad H``, so (rad/s) per (m/rad): with 1, an arm whose nearest point moves 0.5 m/rad turns
    at 0.5 rad/s. smoothing: tau > 0, m, over which pairs count as equally close. within: rho, m, where it sets in; inf
    counts every pair. Within one pair of shapes with corners the gradient jumps where the closest corner changes.
    """

    maximise = True

    def __init__(self, arranged: Callable[[Robot], Arrangement], gain: float, smoothing: float, within: float) -> None:
        self.arrangement = arranged  # the pairs of one robot, worked out once
        self.gain = checks.number("gain", gain, low=0.0, strict=True)
        self.smoothing = checks.number("smoothing", smoothing, low=0.0, strict=True)
        self.within = np.inf if within == np.inf else checks.number("within", within, low=0.0, strict=True)

    def value(self, state: State) -> float:
        """``H(q)``, m; ``within`` where nothing is near (the largest number there is, if that is inf)."""
        distance = self._near(state)[1]
        if not len(distance):
            return float(min(self.within, np.finfo(float).max))
        return smallest(distance, self.smoothing, self.within).value

    def gradient(self, state: State) -> FloatArray:
        """``dH/dq`` (nv,), m/rad."""
        arrangement, distance, contacts = self._near(state)
        if not len(distance):
            return np.zeros(state.robot.nv)
        weights = smallest(distance, self.smoothing, self.within).weights
        gradient: FloatArray = weights @ arrangement.gradients(state, contacts)
        return gradient

    def _near(self, state: State) -> tuple[Arrangement, FloatArray, Contacts]:
        arrangement = self.arrangement(state.robot)
        reach = self.within
        if reach == np.inf:
            closest = arrangement.closest(state).distance
            reach = float(closest[0]) + _NEGLIGIBLE * self.smoothing if len(closest) else 0.0
        contacts = arrangement.within(state, reach)
        return arrangement, contacts.distance, contacts


class Clearance(SmoothClearance):
    """Distance of the robot's links, or of ``points``, to the obstacles of a scene (Khatib 1986), maximised.

    points: names of frames, or a mapping of names to radii in m, to be watched instead of the links. gain, smoothing
    and within as in :class:`cartctl.objectives.SmoothClearance`. Raises ParameterError, NonFiniteError;
    FrameNotFound at the first state.
    """

    def __init__(
        self,
        scene: Scene,
        gain: float = 1.0,
        *,
        points: Any = None,
        smoothing: float = 0.02,
        within: float = 0.2,
    ) -> None:
        super().__init__(AroundScene(scene, points), gain, smoothing, within)
        self.scene, self.points = scene, points


class SelfClearance(SmoothClearance):
    """Distance of the robot's links from each other, maximised.

    srdf: a file whose disabled pairs are left out, beside those that :meth:`cartctl.AvoidSelf.excluded` names. gain,
    smoothing and within as in :class:`cartctl.objectives.SmoothClearance`. Raises ParameterError, NonFiniteError;
    UrdfError at the first state.
    """

    def __init__(self, gain: float = 1.0, *, srdf: Any = None, smoothing: float = 0.02, within: float = 0.2) -> None:
        super().__init__(AroundItself(srdf), gain, smoothing, within)
        self.srdf = srdf
