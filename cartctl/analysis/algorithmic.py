"""Algorithmic singularities: tasks that are each regular and still get in each other's way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra.svd import floor, numerical_rank, scale, singular_values, svd
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError, ShapeError


@dataclass(frozen=True)
class AlgorithmicSingularity:
    """Ranks of some tasks and of their stack; made by :func:`algorithmic_singularity`.

    rows, ranks: m_k and rank J_k, one a task. columns: n. stacked_rank: rank [J_1; J_2; ...]. closeness: the smallest
    singular value of the stack once the rows of each task are orthonormal, in [0, 1]; 0 at an algorithmic singularity,
    1 where the tasks move the joints in orthogonal directions.
    """

    rows: tuple[int, ...]
    ranks: tuple[int, ...]
    columns: int
    stacked_rank: int
    closeness: float

    def __bool__(self) -> bool:
        """It occurs."""
        return self.occurs

    @property
    def occurs(self) -> bool:
        """``rank [J_1; J_2; ...] < sum rank J_k``, each task of full rank, ``sum m_k <= n``."""
        return self.fits and self.regular and self.stacked_rank < sum(self.ranks)

    @property
    def fits(self) -> bool:
        """``sum m_k <= n``: there are joints enough for all tasks at once."""
        return sum(self.rows) <= self.columns

    @property
    def regular(self) -> bool:
        """Whether each task has full rank on its own."""
        return self.ranks == self.rows

    @property
    def reason(self) -> str:
        """What is the matter, in a sentence."""
        if not self.regular:
            k = next(k for k, (m, r) in enumerate(zip(self.rows, self.ranks, strict=True)) if r < m)
            return f"kinematic singularity of task {k + 1}: rank {self.ranks[k]} of {self.rows[k]}"
        if not self.fits:
            return f"more rows than joints: {sum(self.rows)} rows, {self.columns} joints; the tasks always conflict"
        if self.occurs:
            return f"algorithmic singularity: the stack has rank {self.stacked_rank} of {sum(self.ranks)}"
        return f"regular: the stack has rank {self.stacked_rank} of {sum(self.ranks)}"


def algorithmic_singularity(*jacobians: Any, tolerance: float | None = None) -> AlgorithmicSingularity:
    """How the tasks with Jacobians J_k (m_k, n), two or more, share the joints.

    tolerance: as in :func:`spectrum`; each task counts with its own scale, so that units do not matter. Raises
    ShapeError, NonFiniteError, ParameterError.
    """
    tasks = [checks.matrix(f"J{k}", J) for k, J in enumerate(jacobians, 1)]
    if len(tasks) < 2:
        raise ParameterError(f"{len(tasks)} Jacobian(s) given; expected at least two tasks that may conflict")
    n = tasks[0].shape[1]
    for k, J in enumerate(tasks, 1):
        if J.shape[1] != n:
            raise ShapeError(f"J{k} has shape {J.shape}; expected (m, {n}) as J1")
    ranks = tuple(numerical_rank(singular_values(J), floor(J, tolerance)) for J in tasks)
    stack = np.asfortranarray(np.vstack([_unit(J) for J in tasks]))
    stacked = numerical_rank(singular_values(stack), floor(stack, tolerance))
    return AlgorithmicSingularity(tuple(J.shape[0] for J in tasks), ranks, n, stacked, closeness(tasks))


def closeness(tasks: list[FloatArray]) -> float:
    """The smallest singular value of :func:`orthonormal_rows` of all tasks, stacked; 0 where they have m > n rows."""
    stack = np.asfortranarray(np.vstack([orthonormal_rows(J) for J in tasks]))
    m, n = stack.shape
    if m > n:
        return 0.0
    return float(singular_values(stack)[-1]) if m else 1.0


def orthonormal_rows(J: FloatArray) -> FloatArray:
    """``(J J^T)^-1/2 J`` (m, n): the orthonormal rows nearest to those of J, a smooth function of J.

    It takes a task's own singular values out of the stack: what is left are the angles between the tasks.
    """
    U, _, Vt = svd(np.asfortranarray(J))
    return U @ Vt[: U.shape[1]]


def _unit(J: FloatArray) -> FloatArray:
    size = scale(J)
    return J / size if size > 0.0 else J
