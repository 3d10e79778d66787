"""Jacobian transpose: u = alpha W^-1 A^T (b - d).

A gradient step on 1/2 ||b - d||^2 in joint space: it needs no inverse and is never singular, but delivers only part of
the command (Wolovich & Elliott 1984). alpha is fixed, or the steepest-descent step ``||A^T c||^2 / ||A A^T c||^2``, the
one that leaves the least residual along that direction (Buss 2004).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from cartctl import checks
from cartctl.algebra.problem import Problem
from cartctl.algebra.solution import Solution, Status
from cartctl.algebra.svd import norm, round_off, scale, singular_values
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.solvers.base import Answer, EquationSolver, System, stack, systems_of

_NOISE = 1e-10  # relative to the task's own matrix: a smaller slope says nothing of where to go


@dataclass(frozen=True)
class Transpose(EquationSolver):
    """Jacobian transpose of all equations stacked: a gradient step, fixed or steepest.

    alpha: > 0, in the units of 1/A^2 (rad/m)^2, or ``"steepest"``. Raises ParameterError.
    """

    stacks: ClassVar[bool] = True
    name: ClassVar[str] = "transpose"
    sources: ClassVar[tuple[str, ...]] = ("wolovich1984", "buss2004")
    alpha: float | Literal["steepest"] = "steepest"

    def __post_init__(self) -> None:
        if isinstance(self.alpha, str):
            if self.alpha != "steepest":
                raise ParameterError(f"alpha is {self.alpha!r}; expected a number above 0 or 'steepest'")
        else:
            object.__setattr__(self, "alpha", checks.number("alpha", self.alpha, low=0.0, strict=True))

    @property
    def damps(self) -> bool:
        """A gradient step delivers only part of a command."""
        return True

    def _impl(self, systems: list[System], problem: Problem, u0: FloatArray | None) -> Answer:
        A, c, size = stack(systems, problem.equations)
        slope = A.T @ c
        if not isinstance(self.alpha, str):
            return Answer(self.alpha * slope, False)
        lengths = scale(A), norm(c)
        if 0.0 in lengths or norm(slope) / lengths[0] / lengths[1] <= _NOISE * size:
            return Answer(np.zeros(A.shape[1]), False)
        moved = norm(A @ slope)
        ratio = norm(slope) / moved if moved > 0.0 else 0.0
        return Answer(ratio * ratio * slope, False)

    def grade(self, solution: Solution) -> Status:
        """SINGULAR where the stacked matrix lost rank, decided when somebody asks."""
        A, _, size = stack(systems_of(solution.problem), solution.problem.equations)
        s = singular_values(A)
        if s.shape[0] and s[-1] <= size * round_off(A):
            return Status.SINGULAR
        return super().grade(solution)
