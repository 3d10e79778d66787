"""Damped least squares: u = A^T (A A^T + lambda^2 I)^-1 (b - d) + (I - A# A) u0.

The minimum of ||A u + d - b||^2 + lambda^2 ||u||_W^2 for u0 = 0 (Nakamura & Hanafusa 1986; Wampler 1986): u stays
bounded by ||b|| / (2 lambda) through singularities, at the price of an error lambda^2 / (sigma^2 + lambda^2) along
each singular direction. The smaller of the two normal systems, (m, m) or (n, n), is solved by Cholesky. A reference
u0 enters through the exact projector, for a damped one leaks into the task.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cartctl import checks
from cartctl.algebra.inverses.base import damped_factors
from cartctl.algebra.metric import Whitening
from cartctl.algebra.nullspace import null_part
from cartctl.algebra.problem import Problem
from cartctl.algebra.solution import Solution, Status
from cartctl.algebra.svd import round_off, singular_values, svd
from cartctl.checks import FloatArray
from cartctl.kernels import kernel
from cartctl.solvers.base import Answer, EquationSolver, System, stack, systems_of


@dataclass(frozen=True)
class DLS(EquationSolver):
    """Damped least squares over all equations stacked.

    damping: lambda > 0, in the units of the stacked matrix's singular values.
    """

    stacks: ClassVar[bool] = True
    name: ClassVar[str] = "dls"
    sources: ClassVar[tuple[str, ...]] = ("nakamura1986", "wampler1986")
    honours: ClassVar[frozenset[str]] = frozenset({"reference"})
    damping: float = 1e-2

    def __post_init__(self) -> None:
        object.__setattr__(self, "damping", checks.number("damping", self.damping, low=0.0, strict=True))

    def _impl(self, systems: list[System], problem: Problem, u0: FloatArray | None) -> Answer:
        A, c, ratio = stack(systems, problem.equations)
        u = damped_solve(A, c, self.damping * self.damping)
        if u0 is not None:
            u = u + null_part(svd(A), ratio * round_off(A), u0)
        return Answer(u, False)

    def prepare(self) -> None:
        """Compile the kernel, or fetch it from its cache."""
        _ = damped_kernel.compiled

    @property
    def damps(self) -> bool:
        """Always."""
        return True

    def grade(self, solution: Solution) -> Status:
        """SINGULAR where damping outweighs a direction, sigma_min < lambda, or round-off does; asked only now."""
        problem = solution.problem
        white = None if problem.metric is None else Whitening(problem.metric)
        A, _, ratio = stack(systems_of(problem, white), problem.equations)
        s = singular_values(A)
        if s.shape[0] and s[-1] < max(self.damping, ratio * round_off(A)):
            return Status.SINGULAR
        return super().grade(solution)


def damped_solve(A: FloatArray, c: FloatArray, squared: float) -> FloatArray:
    """``argmin ||A u - c||^2 + squared ||u||^2``, (n,), A (m, n), squared > 0."""
    u = np.empty(A.shape[1])
    if not damped_kernel.compiled(A, c, squared, u):
        return _by_filter(A, c, squared)  # a pivot near the round-off of A A^T: the filter factors are still exact
    return u


@kernel("bool(matrix, vector, float, out_vector)")
def damped_kernel(A: FloatArray, c: FloatArray, squared: float, u: FloatArray) -> bool:
    """Fill u by a Cholesky factorisation of the smaller normal matrix; False where a pivot is too small to trust."""
    m, n = A.shape
    k = min(m, n)
    G = np.empty((k, k))
    y = np.empty(k)
    for i in range(k):
        for j in range(i + 1):
            total = 0.0
            if m <= n:
                for a in range(n):
                    total += A[i, a] * A[j, a]
            else:
                for a in range(m):
                    total += A[a, i] * A[a, j]
            G[i, j] = total
        G[i, i] += squared
        if m <= n:
            y[i] = c[i]
        else:
            total = 0.0
            for a in range(m):
                total += A[a, i] * c[a]
            y[i] = total
    largest = 0.0
    for i in range(k):
        largest = max(largest, G[i, i])
    for i in range(k):  # L L^T = G and L y = rhs in one sweep
        for j in range(i + 1):
            total = G[i, j]
            for a in range(j):
                total -= G[i, a] * G[j, a]
            if i == j:
                if not total > 1e-8 * largest:
                    return False
                G[i, i] = np.sqrt(total)
            else:
                G[i, j] = total / G[j, j]
        for a in range(i):
            y[i] -= G[i, a] * y[a]
        y[i] /= G[i, i]
    for i in range(k - 1, -1, -1):
        for a in range(i + 1, k):
            y[i] -= G[a, i] * y[a]
        y[i] /= G[i, i]
    for j in range(n):
        if m <= n:
            total = 0.0
            for i in range(m):
                total += A[i, j] * y[i]
            u[j] = total
        else:
            u[j] = y[j]
    return True


def _by_filter(A: FloatArray, c: FloatArray, squared: float) -> FloatArray:
    decomposition = svd(A)
    s = decomposition.s
    k = s.shape[0]
    phi = damped_factors(s, squared, 0.0)
    return decomposition.Vt[:k].T @ (phi * (decomposition.U.T @ c))  # type: ignore[no-any-return]
