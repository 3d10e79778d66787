"""What a plan is asked for, sampled: the robot, its tasks at every instant, its limits, its ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.model.limits import Limits
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.paths import Path
from cartctl.tasks.base import Task


class Remembered:
    """A path that works out each of a few instants once: a plan asks for the same ones again and again."""

    def __init__(self, path: Callable[[float], Any]) -> None:
        self._path = path
        self._known: dict[float, Any] = {}

    def __call__(self, t: float) -> Any:
        """The path's own sample."""
        found = self._known.get(t)
        if found is None:
            found = self._known[t] = self._path(t)
        return found


@dataclass(frozen=True, eq=False)
class Setting:
    """S samples at ``times`` (S,), s, evenly ``h`` apart, in the sense of :func:`cartctl.plan`.

    tasks: those met at every sample. soft: those with ``fit="least_squares"``, a part of the cost. anchors,
    soft_anchors: what each holds on to. start: q0 (nq,), None where it is free. closed: whether the last sample is the
    first one. rest: whether the motion starts and ends at rest.
    """

    robot: Robot
    tasks: tuple[Task, ...]
    soft: tuple[Task, ...]
    anchors: tuple[Any, ...]
    soft_anchors: tuple[Any, ...]
    times: FloatArray
    limits: Limits | None
    start: FloatArray | None
    closed: bool
    rest: bool
    state: State

    @property
    def h(self) -> float:
        """The time between two samples, s."""
        return float(self.times[1] - self.times[0])

    @property
    def size(self) -> int:
        """S, the number of samples."""
        return len(self.times)

    def coarser(self, samples: int) -> Setting:
        """The same with fewer samples."""
        return replace(self, times=np.linspace(self.times[0], self.times[-1], samples))

    def errors(self, k: int, q: FloatArray) -> FloatArray:
        """Target minus value of all tasks (m,) at sample k."""
        t = float(self.times[k])
        self.state.set(q, self._zero, t)
        parts = [
            task.reference(self.state, t, anchor).error for task, anchor in zip(self.tasks, self.anchors, strict=True)
        ]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def jacobian(self) -> FloatArray:
        """``J`` (m, nv) of all tasks where :meth:`errors` was last asked."""
        parts = [task.jacobian(self.state) for task in self.tasks]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    @property
    def _zero(self) -> FloatArray:
        return self.robot_rest

    @property
    def robot_rest(self) -> FloatArray:
        """A velocity of zeros (nv,)."""
        rest: FloatArray = self.robot._rest
        return rest

    @property
    def plain(self) -> bool:
        """Whether every coordinate of the tangent space is a joint of its own: differences are then exactly linear."""
        return bool(self.robot.single.all()) and not self.robot.mimics

    @cached_property
    def turning(self) -> NDArray[np.bool_]:
        """(nv,) which joints turn without a limit here: a whole turn changes nothing but their count."""
        robot = self.robot
        sliding = np.zeros(robot.nv, dtype=bool)
        for name in robot.single_joints:
            sliding[robot.dof(name)] = robot.is_prismatic(name)
        if self.limits is None:
            return robot.single & ~sliding
        bounded = np.isfinite(self.limits.position_lower) | np.isfinite(self.limits.position_upper)
        return robot.single & ~sliding & ~bounded

    def shortest(self, delta: FloatArray) -> FloatArray:
        """Displacements (..., nv) with whole turns of such joints left out."""
        turning = self.turning
        if turning.any():
            delta = np.array(delta)
            delta[..., turning] = (delta[..., turning] + np.pi) % (2.0 * np.pi) - np.pi
        return delta

    def apart(self, a: FloatArray, b: FloatArray) -> float:
        """The distance of two configurations, whole turns left out, rad or m."""
        return float(np.linalg.norm(self.shortest(self.robot.difference(a, b))))

    def differences(self, Q: FloatArray) -> FloatArray:
        """``(q_{k+1} (-) q_k) / h``, (S - 1, nv): the velocities held between the samples."""
        robot = self.robot
        if robot.has_plain_coordinates:
            return np.diff(Q, axis=0) / self.h
        return np.array([robot.difference(a, b) for a, b in zip(Q[:-1], Q[1:], strict=True)]) / self.h

    def moved(self, Q: FloatArray, delta: FloatArray) -> FloatArray:
        """``q_k (+) delta_k`` for every sample."""
        robot = self.robot
        if robot.has_plain_coordinates:
            return Q + delta
        return np.array([robot.integrate(q, d) for q, d in zip(Q, delta, strict=True)])

    def coordinates(self, Q: FloatArray) -> FloatArray:
        """(S, nv), comparable with position limits."""
        if self.robot.has_plain_coordinates:
            return Q
        return np.array([self.robot.coordinates(q) for q in Q])


def remembering(tasks: Sequence[Task]) -> tuple[Task, ...]:
    """The tasks with paths that remember; those of the caller stay as they are."""
    found = []
    for task in tasks:
        target = getattr(task, "target", None)
        if isinstance(target, Path) or (callable(target) and not isinstance(target, Remembered)):
            task = copy(task)
            task.take_target(Remembered(target), f"task {task.name!r}: target")
        found.append(task)
    return tuple(found)
