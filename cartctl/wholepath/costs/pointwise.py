"""Integrals of functions of the configuration: ``integral +-H(q) dt`` by the trapezoidal rule; - for one to maximise.

Their H: exact where the objective knows its Hessian, else central differences of the gradient along the free
directions; negative curvature counts by its size, so that a step leads away from a saddle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl.checks import FloatArray
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective
from cartctl.tasks.base import Task
from cartctl.wholepath.blocks import Quadratic
from cartctl.wholepath.costs.base import PathCost
from cartctl.wholepath.trace import Trace

_STEP = 1e-5  # rad or m: of central differences of exact gradients


@dataclass(frozen=True, eq=False)
class Integral(PathCost):
    """``integral s H(q) dt``, s = -1 of an objective that is maximised, else +1."""

    objective: Objective

    @property
    def name(self) -> str:
        """For reports."""
        words = "".join(f" {c.lower()}" if c.isupper() else c for c in type(self.objective).__name__).strip()
        return f"negative {words}" if self.objective.maximise else words

    @property
    def sign(self) -> float:
        """What turns the objective into a cost."""
        return -1.0 if self.objective.maximise else 1.0

    def check(self, robot: Robot) -> None:
        """The objective must fit."""
        self.objective.check(robot)

    def value(self, trace: Trace) -> float:
        """The integral."""
        pairs = zip(trace.weights.tolist(), trace.states(), strict=True)
        return float(self.sign * sum(w * self.objective.value(state) for w, state in pairs))

    def quadratic(self, trace: Trace) -> Quadratic:
        """Gradient and curvature of every sample."""
        full = Quadratic.zeros(trace.setting.size, trace.setting.robot.nv)
        exact = type(self.objective).hessian is not Objective.hessian
        for k, state in enumerate(trace.states()):
            full.g[k] = trace.weights[k] * self.sign * self.objective.gradient(state)
            if exact:
                H = self.sign * self.objective.hessian(state)
            else:
                H = self.sign * self._along(state, trace.Z[k], trace.setting.state)
            upright = _upright(H)
            full.H0[k] = trace.weights[k] * upright
            full.X0[k] = trace.weights[k] * (H - upright)
        return full

    def node(self, state: State) -> float:
        """+-H."""
        return self.sign * self.objective.value(state)

    def _along(self, state: State, Z: FloatArray, moving: State) -> FloatArray:
        """``Z Z^T (d2H/dq2) Z Z^T``."""
        robot, q, v, t = state.robot, state.q, state.v, state.time
        columns = []
        for z in Z.T:
            ends = []
            for sign in (1.0, -1.0):
                moving.set(robot.integrate(q, sign * _STEP * z), v, t)
                ends.append(self.objective.gradient(moving))
            columns.append((ends[0] - ends[1]) / (2.0 * _STEP))
        inner = Z.T @ np.array(columns).T if columns else np.zeros((0, 0))
        return np.asarray(Z @ inner @ Z.T)


@dataclass(frozen=True, eq=False)
class TaskMiss(PathCost):
    """``integral w/2 ||e||^2 dt`` of a task with ``fit="least_squares"``, w its weight."""

    task: Task
    anchor: Any

    @property
    def name(self) -> str:
        """For reports."""
        return f"miss of {self.task.name}"

    def value(self, trace: Trace) -> float:
        """The integral."""
        pairs = zip(trace.weights.tolist(), trace.states(), strict=True)
        return 0.5 * self.task.weight * sum(float(w * np.sum(self._error(state) ** 2)) for w, state in pairs)

    def quadratic(self, trace: Trace) -> Quadratic:
        """Gauss-Newton: the task's Jacobian alone."""
        full = Quadratic.zeros(trace.setting.size, trace.setting.robot.nv)
        for k, state in enumerate(trace.states()):
            w = trace.weights[k] * self.task.weight
            J, e = self.task.jacobian(state), self._error(state)
            full.g[k] = -w * (J.T @ e)
            full.H0[k] = w * (J.T @ J)
        return full

    def node(self, state: State) -> float:
        """w/2 ||e||^2."""
        return 0.5 * self.task.weight * float(np.sum(self._error(state) ** 2))

    def _error(self, state: State) -> FloatArray:
        return self.task.reference(state, state.time, self.anchor).error


def _upright(H: FloatArray) -> FloatArray:
    """The matrix with the same eigenvectors and the sizes of the eigenvalues."""
    values, vectors = np.linalg.eigh(0.5 * (H + H.T))
    return np.asarray((vectors * np.abs(values)) @ vectors.T)
