"""Main variables: a largest set of independent rows, their pseudo-inverse, and what the dropped rows miss."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl import Equation, Problem, Status, solve
from cartctl.errors import UnsupportedProblem
from tests import oracles
from tests import tolerances as tol


def kept_rows(A, c, u):
    return np.abs(A @ u - c) <= 1e-7 * (1.0 + np.linalg.norm(c) + np.linalg.norm(u))


@given(oracles.systems(levels=3, max_n=9), oracles.METRICS)
def test_on_consistent_commands_it_is_the_pseudo_inverse(system, kind):
    rng, matrices, _ = system
    n = matrices[0].shape[1]
    x, W = rng.normal(size=n), oracles.metric(rng, n, kind)
    equations = [Equation(A, A @ x + (d := rng.normal(size=A.shape[0])), drift=d) for A in matrices]
    p = Problem(equations, metric=W)
    ours, expected = solve(p, "main-variables"), solve(p, "pinv")
    np.testing.assert_allclose(ours.u, expected.u, atol=1e-7 * (1.0 + np.linalg.norm(expected.u)))
    np.testing.assert_allclose(ours.residuals, 0.0, atol=1e-7)
    assert ours.status is expected.status


@given(oracles.systems(max_n=9), oracles.METRICS)
def test_independent_rows_are_met_and_the_others_reported(system, kind):
    """rank(A) independent rows hold to the last digit, u is their least-norm answer, the residual tells the rest."""
    rng, (A,), (c,) = system
    n = A.shape[1]
    W = oracles.metric(rng, n, kind)
    solution = solve(Problem([(A, c)], metric=W), "main-variables")
    rank = np.linalg.matrix_rank(A, tol=oracles.GAP) if A.size else 0
    kept = kept_rows(A, c, solution.u)
    assert kept.sum() >= rank
    if rank:
        assert np.linalg.matrix_rank(A[kept], tol=oracles.GAP) == rank
    np.testing.assert_allclose(
        solution.u, oracles.constrained_minimum(A[kept], c[kept], W), atol=1e-5 * (1.0 + np.linalg.norm(solution.u))
    )
    missed = np.linalg.norm(A[~kept] @ solution.u - c[~kept])
    np.testing.assert_allclose(solution.residuals, [missed], atol=1e-6 * (1.0 + np.linalg.norm(solution.u)))


@given(oracles.SEEDS, st.integers(2, 8), oracles.magnitudes(1e-6, 1e6))
def test_the_choice_is_rank_revealing(seed, n, unit):
    """Full-rank rows beside copies and sums of them: no near-copy is kept at the price of conditioning."""
    rng = np.random.default_rng(seed)
    r = int(rng.integers(1, n + 1))
    basis = oracles.matrix(rng, r, n)
    A = unit * np.vstack([basis, rng.uniform(-1.0, 1.0, (3, r)) @ basis])[rng.permutation(r + 3)]
    b = unit * rng.normal(size=r + 3)
    u = solve(Problem([(A, b)]), "main-variables").u
    assert np.linalg.norm(u) <= 1e2 * 2.0**r * np.linalg.norm(b) / unit
    assert kept_rows(A / unit, b / unit, u).sum() >= r


def test_by_hand():
    """x + y = 1, 2x + 2y = 3, z = 2: the larger of the dependent rows is kept, the smaller misses by 1/2."""
    A, b = [[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 1.0]], [1.0, 3.0, 2.0]
    solution = solve(Problem([(A, b)]), "main-variables")
    np.testing.assert_allclose(solution.u, [0.75, 0.75, 2.0], atol=tol.EXACT)
    assert solution.residuals == pytest.approx([0.5])
    assert solution.status is Status.SINGULAR
    least = solve(Problem([(A, b)]), "pinv")
    assert least.residuals[0] < solution.residuals[0]  # least squares spreads the miss


@given(oracles.SEEDS)
def test_statuses(seed):
    rng = np.random.default_rng(seed)
    wide, tall = oracles.matrix(rng, 3, 6), oracles.matrix(rng, 6, 3)
    assert solve(Problem([(wide, rng.normal(size=3))]), "main-variables").status is Status.OPTIMAL
    assert solve(Problem([(tall, tall @ rng.normal(size=3))]), "main-variables").status is Status.OPTIMAL
    missed = solve(Problem([(tall, rng.normal(size=6))]), "main-variables")
    assert missed.status is Status.INEXACT and kept_rows(tall, missed.problem.equations[0].b, missed.u).sum() == 3
    low = oracles.matrix(rng, 3, 6, 2)
    assert solve(Problem([(low, rng.normal(size=3))]), "main-variables").status is Status.SINGULAR


@pytest.mark.parametrize("exponent", range(-14, 0))
def test_near_singular_sweep(exponent):
    rng = np.random.default_rng(11)
    A, b = oracles.matrix_with(rng, 4, 7, [2.0, 1.0, 0.5, 10.0**exponent]), rng.normal(size=4)
    solution = solve(Problem([(A, b)]), "main-variables")
    assert np.isfinite(solution.u).all() and np.linalg.norm(solution.u) <= 1e2 * min(10.0**-exponent, 1e10)
    if exponent >= -9:
        np.testing.assert_allclose(A @ solution.u, b, atol=1e-13 * np.linalg.norm(solution.u) + tol.ORACLE)
    else:
        assert solution.status is Status.SINGULAR


def test_a_reference_is_refused():
    with pytest.raises(UnsupportedProblem, match="'main-variables'"):
        solve(Problem([([[1.0, 2.0]], [1.0])], reference=[1.0, 0.0]), "main-variables")
