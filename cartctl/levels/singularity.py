"""A controller's guard against singularities: the commands of its tasks, as a policy leaves them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cartctl.algebra.inverses import InversePolicy
from cartctl.algebra.problem import Equation, Problem
from cartctl.algebra.svd import norm, scale, svd
from cartctl.checks import FloatArray
from cartctl.errors import UnsupportedProblem
from cartctl.levels.base import Level
from cartctl.levels.singularity_policies import AvoidSingularity, Halt, SlowDown, as_policy
from cartctl.levels.task_manipulability import TaskManipulability
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective
from cartctl.tasks.base import Task

_ALL = 1.0 - 1e-12  # a share of at least this takes nothing away


class Guarded(NamedTuple):
    """The problem that is left, whether a policy took something of its commands, and whether the robot is to stop."""

    problem: Problem
    acted: bool = False
    halted: bool = False


class Guard:
    """One policy for the tasks of one controller: see :mod:`cartctl.levels.singularity_policies`."""

    def __init__(self, singularity: Any, level: Level, robot: Robot, tasks: Sequence[Task]) -> None:
        self.policy, self._tasks = as_policy(singularity), tasks
        if isinstance(self.policy, SlowDown) and level.name != "velocity":
            raise UnsupportedProblem(
                f"level {level.name!r} commands no velocities that could be slowed down near a singularity; use "
                "singularity='damp', 'avoid' or 'halt', or level 'velocity'"
            )
        self.waits = isinstance(self.policy, SlowDown | Halt)  # whether a path had better wait for the hand
        self.acts = self.policy is not None and not isinstance(self.policy, AvoidSingularity)  # on commands
        self._robot = robot
        self.reset()

    def reset(self) -> None:
        """Go on, where it was halted."""
        self.halted = False

    def objective(self, given: Objective | None) -> Objective | None:
        """The controller's objective with what the policy adds to it."""
        if not isinstance(self.policy, AvoidSingularity):
            return given
        away = TaskManipulability(self._tasks[0], self.policy.gain, self._robot)
        return away if given is None else given + away

    def guard(self, problem: Problem, state: State) -> Guarded:
        """The problem with the commands that the policy leaves."""
        if not self.acts:
            return Guarded(problem)
        equations, acted = list(problem.equations), False
        for k, task in enumerate(self._tasks):
            J = task.jacobian(state)
            if not J.shape[0]:
                continue
            U, s, _ = svd(np.asfortranarray(J))
            if isinstance(self.policy, Halt):
                self.halted |= bool(s[-1] < self.policy.threshold)
                continue
            e = equations[k]
            left = self._left(U, s, e.rhs, max(scale(J), task.size(state)))
            if left is not None:
                acted = True
                b = left if e.drift is None else left + e.drift
                equations[k] = Equation.trusted(e.A, b, e.drift, e.fit, e.weight, e.name, e.size)
        if not acted:
            return Guarded(problem, self.halted, self.halted)
        bounds = (problem.lower, problem.upper, problem.constraints)
        return Guarded(Problem.trusted(tuple(equations), problem.metric, problem.reference, *bounds), True)

    def _left(self, U: FloatArray, s: FloatArray, c: FloatArray, size: float) -> FloatArray | None:
        """What is left of a command c (m,); None where all of it is."""
        if isinstance(self.policy, SlowDown):
            left = self.policy.left(U, s, c)
            return None if norm(left) >= _ALL * norm(c) else left
        assert isinstance(self.policy, InversePolicy)
        taken = 1.0 - s * self.policy.factors(s, size)
        return None if (np.abs(taken) <= 1.0 - _ALL).all() else c - U @ (taken * (U.T @ c))
