"""Velocity level: u = v, A = J, b = r_dot_ref + K e (closed-loop inverse kinematics)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from cartctl.algebra.problem import Equation, Problem
from cartctl.algebra.solution import Solution
from cartctl.checks import FloatArray
from cartctl.levels.base import Command, Level, require_finite
from cartctl.model.state import State
from cartctl.objectives.base import Objective
from cartctl.tasks.base import Reference, Task


class VelocityLevel(Level):
    """u = v (nv,), rad/s or m/s: ``J v = r_dot_ref + K e`` for every task, ``u0 = -k grad H``."""

    name: ClassVar[str] = "velocity"

    def problem(
        self,
        state: State,
        tasks: Sequence[Task],
        t: float,
        anchors: Sequence[Any],
        objective: Objective | None,
        rise: float,
        metric: FloatArray | None,
    ) -> tuple[Problem, list[Reference]]:
        """The problem of this instant, and the references it was made from; raises NonFiniteError."""
        equations: list[Equation] = []
        references: list[Reference] = []
        for task, anchor in zip(tasks, anchors):  # noqa: B905 - equally long by construction, and this is the hot loop
            reference = task.reference(state, t, anchor)
            b = task.gain * reference.error
            if reference.rate is not None:
                b = b + reference.rate
            require_finite(b, f"the command of task {task.name!r}")
            equations.append(Equation.trusted(task.jacobian(state), b, None, task.fit, task.weight, task.name))
            references.append(reference)
        u0 = None
        if objective is not None:
            u0 = rise * require_finite(objective.direction(state), "the objective's gradient")
        return Problem.trusted(tuple(equations), metric, u0), references

    def command(self, solution: Solution, references: Sequence[Reference]) -> Command:
        """U is the velocity."""
        return Command(solution, references, velocity=solution.u)
