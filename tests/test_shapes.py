"""Every solver at every size: n = 1 ... 60, from no row to more rows than joints."""

from __future__ import annotations

import numpy as np
import pytest

from cartctl.algebra.problem import Problem
from cartctl.errors import UnsupportedProblem
from cartctl.solvers import get_solver, solve, solvers

EXACT = (
    "pinv",
    "projected-gradient",
    "task-priority",
    "singularity-robust-priority",
    "reverse-priority",
    "task-scaling",
    "main-variables",
)


@pytest.mark.parametrize("n", [1, 2, 3, 7, 20, 41, 60])
@pytest.mark.parametrize("name", sorted(solvers()))
def test_every_solver_at_every_size(name: str, n: int) -> None:
    rng = np.random.default_rng(n)
    for m in sorted({0, 1, n // 2, max(n - 1, 0), n, n + 1, n + 5}):
        A = rng.normal(size=(m, n))
        b = A @ rng.normal(size=n)  # consistent, so that more rows than joints can be met too
        try:
            solution = solve(Problem([(A, b)]), name)
        except UnsupportedProblem:
            assert get_solver(name).extends and m < n
            continue
        assert solution.u.shape == (n,) and np.isfinite(solution.u).all()
        if name in EXACT:
            expected = np.linalg.lstsq(A, b, rcond=None)[0] if m else np.zeros(n)
            np.testing.assert_allclose(solution.u, expected, atol=1e-8 * (1.0 + np.linalg.norm(expected)))
        if name in EXACT or name in ("reduced-gradient", "extended-jacobian"):
            assert solution.residuals[0] <= 1e-8 * (1.0 + np.linalg.norm(b))
