"""Velocity level: u = v, A = J, b = r_dot_ref + K e (closed-loop inverse kinematics)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from cartctl.algebra.problem import Equation, Problem
from cartctl.algebra.solution import Solution
from cartctl.checks import FloatArray
from cartctl.constraints import Box, Constraint, Rows
from cartctl.levels.approach import Approach
from cartctl.levels.base import UNCONFINED, Command, Confines, Level, Secondary, direction, require_finite
from cartctl.levels.bounds import JointBounds
from cartctl.levels.extremal import extremal_rows
from cartctl.levels.velocity_bounds import VelocityBounds
from cartctl.model.state import State
from cartctl.objectives.base import Objective
from cartctl.tasks.base import Reference, Task


class VelocityLevel(Level):
    """u = v (nv,), rad/s or m/s: ``J v = r_dot_ref + K e`` for every task, ``u0 = -k grad H``."""

    name: ClassVar[str] = "velocity"
    bounds: ClassVar[type[JointBounds] | None] = VelocityBounds
    approaching: ClassVar[type[Approach] | None] = Approach
    clocked: ClassVar[bool] = True

    def __init__(self) -> None:
        self._scratch: State | None = None

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
        """The problem of this instant, and the references it was made from; raises NonFiniteError."""
        equations: list[Equation] = []
        references: list[Reference] = []
        lower, upper, rows, approach, _ = confines
        if approach is not None:
            approach.begin(state, lower, upper, rows)
        for task, t, anchor in zip(tasks, times, anchors):  # noqa: B905 - equally long by construction, in a hot loop
            reference = task.reference(state, t, anchor)
            b = task.gain * reference.error
            if reference.rate is not None:
                b = b + reference.rate
            require_finite(b, f"the command of task {task.name!r}")
            J, size, drift = task.jacobian(state), task.size(state), None
            if approach is not None:
                b, _, pace, given = approach.command(task, state, J, reference, b)
                if given is not None:
                    b, drift = b - given, -given
                reference = reference if pace == 1.0 else reference._replace(pace=pace)
            equations.append(Equation.trusted(J, b, drift, task.fit, task.weight, task.name, size))
            references.append(reference)
        objective = secondary.objective
        if objective is None:
            return Problem.trusted(tuple(equations), metric, None, lower, upper, rows), references
        if secondary.extend is not None:
            equations.append(self._extremal(state, tasks, objective, secondary.extend))
            return Problem.trusted(tuple(equations), metric, None, lower, upper, rows), references
        u0 = secondary.share * direction(objective, state)
        if approach is not None:
            u0 = approach.slowed(u0)
        return Problem.trusted(tuple(equations), metric, u0, lower, upper, rows), references

    def _extremal(self, state: State, tasks: Sequence[Task], objective: Objective, gain: float) -> Equation:
        """``A_e v = -K Z^T grad H``."""
        if self._scratch is None or self._scratch.robot is not state.robot:
            self._scratch = State(state.robot)
        rows = extremal_rows(state, tasks, objective, self._scratch)
        require_finite(rows.A, "the objective's Hessian")
        return Equation.trusted(rows.A, -gain * rows.slope, None, "scale", 1.0, "extremal set", 0.0)

    def rows(self, constraint: Constraint, state: State, dt: float, box: Box | None) -> Rows:
        """The rows of a constraint on v."""
        return constraint.velocity_rows(state, dt, box)

    def command(self, solution: Solution, references: Sequence[Reference], state: State) -> Command:
        """U is the velocity."""
        return Command(solution, references, velocity=solution.u)
