"""Acceleration level: u = a, A = J, b = r_ddot_ref + K_d e_dot + K_p e, drift J_dot v (kinematic)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from cartctl import checks
from cartctl.algebra.problem import Equation, Problem
from cartctl.algebra.solution import Solution
from cartctl.checks import FloatArray
from cartctl.constraints import Box, Constraint, Rows
from cartctl.dynamics.friction import Friction
from cartctl.errors import UnsupportedProblem
from cartctl.levels.acceleration_bounds import AccelerationBounds
from cartctl.levels.approach import Approach
from cartctl.levels.base import UNCONFINED, Command, Confines, Level, Motion, Secondary, direction, require_finite
from cartctl.levels.bounds import JointBounds
from cartctl.levels.loads import Loads, actuated, later
from cartctl.levels.steering import Steered, Steering
from cartctl.levels.torque_bounds import torque_rows
from cartctl.model.state import State
from cartctl.model.wrench import Wrench
from cartctl.solvers import Solver
from cartctl.tasks.base import Reference, Task


class AccelerationLevel(Level):
    """u = a (nv,), rad/s^2 or m/s^2: ``J a + J_dot v = r_ddot_ref + K_d e_dot + K_p e`` for every task.

    ``K_p = k^2`` and ``K_d = 2 k`` with a task's gain k in 1/s, a number or one a row: on its own, an error decays
    critically damped, ``(1 + k t) exp(-k t)``. ``e_dot = r_dot_ref - J v`` is the twist error. A method that scales
    slows the command and never the drift. ``u0 = -k grad H - D v``; an objective's k is then in rad/s^2 per unit of the
    gradient.

    damping: D >= 0 in 1/s, a number or (nv,), of motion in the null space, which no task slows; needs a solver that
    honours a reference. None: under limits twice the largest gain (see :mod:`cartctl.levels.steering`), else 0. The
    robot has to move by ``q (+) (v dt + a dt^2/2), v + a dt``.

    Bounds on torques are rows ``lower - h <= M a <= upper - h``, where limits are in force, hold any, and every
    coordinate has a motor. friction, wrenches: what h knows of beside the robot's own (:mod:`cartctl.levels.loads`).
    Limits that contradict each other yield in the order of :mod:`cartctl.levels.yielding`.

    Raises ParameterError, NonFiniteError; ShapeError, FrameNotFound when a controller is made.
    """

    name: ClassVar[str] = "acceleration"
    bounds: ClassVar[type[JointBounds] | None] = AccelerationBounds
    approaching: ClassVar[type[Approach] | None] = Steering
    stable_below: ClassVar[float] = 1.0

    def __init__(
        self,
        damping: float | FloatArray | None = None,
        *,
        friction: Friction | None = None,
        wrenches: Wrench | Sequence[Wrench] = (),
    ) -> None:
        self.damping = None if damping is None else checks.amounts("damping", damping, checks.PER_SECOND)
        self._damps = self.damping is not None and bool(np.any(self.damping))
        self.loads: Loads = Loads(friction, wrenches)

    def check(self, solver: Solver) -> None:
        """Refuse a method that keeps an objective extremal, and damping with one that takes no reference."""
        check_solver(self.name, solver, self._damps)

    def problem(
        self,
        state: State,
        tasks: Sequence[Task],
        times: Sequence[float],
        anchors: Sequence[Any],
        secondary: Secondary,
        metric: FloatArray | None,
        confines: Confines = UNCONFINED,
    ) -> tuple[Problem, list[Reference]]:
        """The problem of this instant, and the references it was made from; raises NonFiniteError, ShapeError."""
        equations: list[Equation] = []
        references: list[Reference] = []
        lower, upper, rows, approach, torque = confines
        steering = approach if isinstance(approach, Steering) else None
        if steering is not None:
            steering.begin(state, lower, upper, rows)
        for task, t, anchor in zip(tasks, times, anchors, strict=True):
            reference = task.reference(state, t, anchor)
            J = task.jacobian(state)
            b = require_finite(_commanded(task, reference, J, state.v), f"the command of task {task.name!r}")
            drift = require_finite(task.drift(state), f"the drift of task {task.name!r}")
            if steering is not None:
                J, b, drift = steering.steered(task, t, anchor, Steered(J, b, drift))
            equations.append(Equation.trusted(J, b, drift, task.fit, task.weight, task.name, task.size(state)))
            references.append(reference)
        u0 = self._reference(state, secondary, 0.0 if steering is None else steering.damping(tasks))
        if steering is not None and u0 is not None:
            u0 = steering.calm_reference(u0, state.v)
        if torque is not None:
            rows = torque_rows(self.loads, state, rows, torque)
        return Problem.trusted(tuple(equations), metric, u0, lower, upper, rows), references

    def _reference(self, state: State, secondary: Secondary, otherwise: float) -> FloatArray | None:
        """``u0 = -k grad H - D v`` (nv,), None where there is neither; otherwise: D where none was chosen."""
        D = otherwise if self.damping is None else self.damping
        checks.fits("damping", D, state.robot.nv)
        braking = -D * state.v if (D if isinstance(D, float) else D.any()) else None
        if secondary.objective is None:
            return braking
        u0 = secondary.share * direction(secondary.objective, state)
        return u0 if braking is None else u0 + braking

    def rows(self, constraint: Constraint, state: State, dt: float, box: Box | None) -> Rows:
        """The rows of a constraint on a."""
        return constraint.acceleration_rows(state, dt, box)

    def motion(self, state: State) -> Motion:
        """U is the acceleration; torques are ``M a + h``."""
        n = state.robot.nv
        return Motion(np.eye(n), np.zeros(n), state.mass_matrix, self.loads.effects(state))

    def stopping(self, state: State, dt: float) -> FloatArray:
        """``-v/dt``."""
        return -state.v / dt

    def command(self, solution: Solution, references: Sequence[Reference], state: State) -> Command:
        """U is the acceleration; its torque is worked out when somebody asks."""
        u = solution.u
        if not actuated(state.robot):
            return Command(solution, references, acceleration=u)
        return Command(solution, references, acceleration=u, torque=later(self.loads, state, u))


def _commanded(task: Task, reference: Reference, J: FloatArray, v: FloatArray) -> FloatArray:
    """``r_ddot_ref + 2 k (r_dot_ref - J v) + k^2 e`` (m,)."""
    k = task.gain
    rate = -(J @ v) if reference.rate is None else reference.rate - J @ v
    b = k * (2.0 * rate + k * reference.error)
    return b if reference.acceleration is None else b + reference.acceleration


def check_solver(level: str, solver: Solver, damps: bool) -> None:
    """Refuse what neither this level nor that of torques has; level: the name of the one that asks."""
    if solver.extends:
        raise UnsupportedProblem(
            f"level {level!r} has no rows that keep an objective extremal; use level 'velocity', or a solver "
            "that spends the objective through u0, such as 'projected-gradient'"
        )
    if damps and "reference" not in solver.honours:
        raise UnsupportedProblem(
            f"solver {solver.name!r} takes no reference for the damping of the null space; use damping=0, or a "
            "solver that honours one, such as 'sns' or 'projected-gradient'"
        )
