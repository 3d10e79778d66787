"""An answer that holds its problem and grades itself."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import norm
from cartctl.checks import FloatArray


class Status(Enum):
    """How a step went; the value is a sentence for the user."""

    OPTIMAL = "Every equation is met and the cost is minimal."
    INEXACT = "The equations cannot all be met at once; the residuals say by how much the least-squares answer misses."
    DAMPED = "Damping holds back part of the commands; the residuals say how much."
    SINGULAR = (
        "A task lost rank here: motion in the lost directions is left out or damped; "
        "move away from the singularity or drop an axis."
    )
    FAILED = "The numbers over- or underflowed; u was set to zero. Check the scale of the matrices."

    def __str__(self) -> str:
        return self.name


class Solution:
    """The answer of one solver to one problem.

    u: (n,). scales: (p,) in [0, 1], 1 where the method does not scale. saturated: (n,) -1 at the lower bound, +1 at
    the upper, 0 free; saturated_rows the same for constraint rows. lost_rank: whether a task's matrix lost rank.
    residuals, status and bound_violation are worked
    out when asked for and kept.
    """

    __slots__ = (
        "_grade",
        "_residuals",
        "_saturated",
        "_scales",
        "_status",
        "lost_rank",
        "problem",
        "solver",
        "u",
    )

    def __init__(
        self,
        problem: Problem,
        u: FloatArray,
        solver: str,
        grade: Callable[[Solution], Status] | None = None,
        status: Status | None = None,
        lost_rank: bool = False,
        scales: FloatArray | None = None,
        saturated: NDArray[np.int8] | None = None,
    ) -> None:
        self.problem = problem
        self.u = u
        self.solver = solver
        self._grade = grade
        self._status = status
        self.lost_rank = lost_rank
        self._scales = scales
        self._saturated = saturated
        self._residuals: FloatArray | None = None

    @property
    def scales(self) -> FloatArray:
        """(p,) the share s_k of each command that is delivered."""
        if self._scales is None:
            self._scales = np.ones(len(self.problem.equations))
        return self._scales

    @property
    def residuals(self) -> FloatArray:
        """(p,) ``||A_k u + d_k - s_k b_k||``."""
        if self._residuals is None:
            pairs = zip(self.problem.equations, self.scales, strict=True)
            rows = [e.A @ self.u + (0.0 if e.drift is None else e.drift) - s * e.b for e, s in pairs]
            self._residuals = np.nan_to_num([norm(r) for r in rows], nan=np.inf, posinf=np.inf)
        return self._residuals

    @property
    def saturated(self) -> NDArray[np.int8]:
        """(n,) -1 at lower, +1 at upper, 0 free."""
        if self._saturated is None:
            self._saturated = np.zeros(self.problem.n, dtype=np.int8)
        return self._saturated

    @property
    def saturated_rows(self) -> NDArray[np.int8]:
        """(r,) the same for the rows of the constraints."""
        rows = 0 if self.problem.constraints is None else self.problem.constraints[0].shape[0]
        return np.zeros(rows, dtype=np.int8)

    @property
    def status(self) -> Status:
        """How it went, as a Status."""
        if self._status is None:
            self._status = Status.OPTIMAL if self._grade is None else self._grade(self)
        return self._status

    def bound_violation(self) -> float:
        """The largest amount by which u leaves the problem's bounds or constraint rows; 0 inside."""
        p = self.problem
        gaps = [0.0]
        if p.lower is not None:
            gaps.append(float((p.lower - self.u).max()))
        if p.upper is not None:
            gaps.append(float((self.u - p.upper).max()))
        if p.constraints is not None and p.constraints[0].shape[0]:
            C, low, high = p.constraints
            gaps += [float((low - C @ self.u).max()), float((C @ self.u - high).max())]
        return max(gaps)

    def __repr__(self) -> str:
        return f"Solution({self.solver}, {self.status.name}, u={np.array2string(self.u, precision=5)})"
