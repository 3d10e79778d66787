"""Manipulability of any task: w = sqrt(det(J J^T)) of its masked Jacobian, over what is usual for the robot."""

from __future__ import annotations

import numpy as np

from cartctl.algebra.svd import svd
from cartctl.checks import FloatArray
from cartctl.model.differences import central
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective
from cartctl.objectives.frame_measure import Spread
from cartctl.objectives.manipulability import Manipulability
from cartctl.tasks.base import Task
from cartctl.tasks.frame import FrameTask

_POSTURES = 64


class TaskManipulability(Objective):
    """``H = w / w_0`` (maximised; Yoshikawa 1985), w_0 the median of w over random postures, so that k is in rad^2/s.

    The gradient is exact for a frame's rows in world axes; for other tasks it contracts central differences of J with
    the cofactors of :class:`cartctl.Manipulability`.
    """

    maximise = True

    def __init__(self, task: Task, gain: float, robot: Robot) -> None:
        self.gain, self._task = gain, task
        rows = task.rows if isinstance(task, FrameTask) else ()
        plain = isinstance(task, FrameTask) and task.expressed_in == "world" and task.orientation == "angle-axis"
        mask = [row in rows for row in range(6)]
        length = task.length if isinstance(task, FrameTask) else 1.0
        self._measure = Manipulability(task.frame, mask, length) if plain else Manipulability()
        self._plain, self._usual = plain, 1.0
        rng, state = np.random.default_rng(0), State(robot)
        values = []
        for _ in range(_POSTURES):
            state.set(robot.random_configuration(rng), state.v)
            values.append(self.value(state))
        self._usual = float(np.median(values)) or 1.0

    def value(self, state: State) -> float:
        """``w / w_0``, no unit."""
        w = self._measure.value(state) if self._plain else self._measure.measure(self._spread(state))
        return w / self._usual

    def gradient(self, state: State) -> FloatArray:
        """``grad w / w_0``, (nv,), 1/rad or 1/m."""
        if self._plain:
            return self._measure.gradient(state) / self._usual
        F = self._measure.slope(self._spread(state))
        turned: FloatArray = np.tensordot(F, central(state, self._task.jacobian), axes=2)
        return turned / self._usual

    def _spread(self, state: State) -> Spread:
        U, s, Vt = svd(np.asfortranarray(self._task.jacobian(state)))
        return Spread(U, s, Vt[: s.shape[0]].T)

    def __repr__(self) -> str:
        return f"TaskManipulability({self._task.name!r}, gain={self.gain:g})"
