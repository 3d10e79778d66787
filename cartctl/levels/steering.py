"""Accelerations such that the robot can still stop: what :mod:`cartctl.levels.approach` does, one derivative up.

A robot that moves by ``q+ = q + v dt + a dt^2/2`` has a control point ``p = q + v dt/2`` that moves as a robot at the
velocity level does, ``p+ = p + y dt`` with the next velocity ``y = v + a dt``
(:mod:`cartctl.levels.acceleration_bounds`). So the velocity level's rules hold for y at p. A task's own law,

    ``J a + J_dot v = r_ddot_ref + 2 k (w - J v),   w = r_dot_ref + k e/2``,

follows the velocity w at the rate 2 k. Where the way to the target is too short, w is held back and followed as
before; at the edge of the workspace, where there is no time to follow, ``J y`` itself. A task of which anything is held
back asks for velocities, ``J_p y = s y_held``: slowing it down then means to stand, not to go on as before. The others
ask for what they always do.

In the null space nothing slows a motion down: it is damped by ``-D v`` with ``D = 2 k`` of the fastest task.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from cartctl.checks import FloatArray
from cartctl.levels.approach import Approach
from cartctl.levels.approach_kernel import steer
from cartctl.model.limits import Limits
from cartctl.model.state import State
from cartctl.solvers import Solver
from cartctl.tasks.base import Reference, Task


class Steered(NamedTuple):
    """``A a + drift = b`` (m,)."""

    A: FloatArray
    b: FloatArray
    drift: FloatArray


class Steering(Approach):
    """For one robot that is told accelerations; the same arguments."""

    def __init__(
        self,
        limits: Limits,
        dt: float,
        solver: Solver,
        waiting: Iterable[Task] = (),
    ) -> None:
        super().__init__(limits, dt, solver, waiting)
        self._point: State | None = None  # the control point
        self._takes_reference = "reference" in solver.honours
        self._steer = steer.compiled

    def begin(
        self,
        state: State,
        lower: FloatArray | None,
        upper: FloatArray | None,
        rows: tuple[FloatArray, FloatArray, FloatArray] | None,
    ) -> None:
        """Begin a step at ``state`` under a box and rows on the acceleration."""
        dt, v = self._dt, state.v
        if self._point is None or self._point.robot is not state.robot:
            self._point = State(state.robot)
        at = self._at = self._point
        at.set(pin.integrate(at.robot.model, state.q, 0.5 * dt * v), v, state.time)
        if rows is not None:
            C, c_lower, c_upper = rows
            begun = C @ v
            rows = C, begun + dt * c_lower, begun + dt * c_upper
        low = None if lower is None else v + dt * lower
        high = None if upper is None else v + dt * upper
        super().begin(at, low, high, rows)
        if self._box is not None and lower is not None and upper is not None:
            self._box = (lower, upper)

    def steered(self, task: Task, t: float, anchor: Any, given: Steered) -> Steered:
        """What a task asks for at time t: ``given`` (of the state itself), or velocities held back at p."""
        at, dt = self._at, self._dt
        J = task.jacobian(at)
        Jv = J @ at.v
        y = Jv + dt * (given.b - given.drift)
        held, edge, apart = y, math.inf, None
        if J.shape[0] and task.fit == "scale":
            reference = task.reference(at, t, anchor)
            held, edge = self._held_back(task, reference, J, y)
            held, beneath, apart = self._beneath(at, task, J, reference, held)
            edge = min(edge, beneath)
        held = self._above.calmed(J, held, self._box)
        self._above.add(J, held, edge, task)
        if apart is not None:
            return Steered(J, (held - apart) / dt, (Jv - apart) / dt)
        return given if held is y or held.tolist() == y.tolist() else Steered(J, held / dt, Jv / dt)

    def _held_back(self, task: Task, reference: Reference, J: FloatArray, y: FloatArray) -> tuple[FloatArray, float]:
        wanted = (0.5 * task.gain) * reference.error
        if reference.rate is not None:
            wanted = wanted + reference.rate
        found = self._along(task, self._at, J, reference, wanted, y)
        U, _, D, size, _ = found
        out = np.empty(y.shape)
        rests = self._rests(reference)
        edge = self._steer(y, np.atleast_1d(task.gain), U, D, self._dt, size, self._scales, rests, out)
        self._keep(reference, found, edge, y, out)
        return out, edge

    def damping(self, tasks: Sequence[Task]) -> float:
        """``D = 2 k`` in 1/s, at most what stops within a step; 0 for a solver that takes no reference."""
        if not self._takes_reference:
            return 0.0
        gains = [k if isinstance(k, float) else float(k.max(initial=0.0)) for k in (task.gain for task in tasks)]
        return min(2.0 * max(gains), 1.0 / self._dt)

    def calm_reference(self, u0: FloatArray, v: FloatArray) -> FloatArray:
        """``u0`` (nv,) such that ``v + u0 dt``, wanted of the null space, is no faster than the tasks leave to it."""
        y = v + self._dt * u0
        slowed = self.slowed(y)
        return u0 if slowed is y else (slowed - v) / self._dt
