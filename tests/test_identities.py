"""Identities of the pseudo-inverse and its filters, through the solvers applied to unit vectors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl import DLS, Damped, Pinv, Problem, Truncated, solve
from tests import oracles
from tests import tolerances as tol


def inverse(A, solver="pinv"):
    """A#, column by column."""
    return np.column_stack([solve(Problem([(A, e)]), solver).u for e in np.eye(A.shape[0])])


matrices = oracles.systems(max_n=10).filter(lambda s: s[1][0].size).map(lambda s: s[1][0])


@given(matrices, oracles.magnitudes(1e-6, 1e6))
def test_the_inverse_of_the_inverse(A, unit):
    """(A#)# = A, in any unit."""
    np.testing.assert_allclose(inverse(inverse(unit * A)) / unit, A, atol=100 * tol.PENROSE)


@given(matrices)
def test_transposed_before_or_after(A):
    """(A#)^T = (A^T)#."""
    np.testing.assert_allclose(inverse(A).T, inverse(A.T), atol=tol.PENROSE * 10)


@given(matrices)
def test_right_and_left_inverse(A):
    """A A# = 1 iff full row rank, A# A = 1 iff full column rank; in general both are projectors of that rank."""
    m, n = A.shape
    rank = np.linalg.matrix_rank(A, tol=oracles.GAP)
    P = inverse(A)
    assert (np.abs(A @ P - np.eye(m)).max() < 1e-9) == (rank == m)
    assert (np.abs(P @ A - np.eye(n)).max() < 1e-9) == (rank == n)
    assert np.trace(A @ P) == pytest.approx(rank, abs=1e-9) and np.trace(P @ A) == pytest.approx(rank, abs=1e-9)


@given(matrices, matrices)
def test_products_with_orthogonal_factors(A, B):
    """(Q A)# = A# Q^T for orthogonal Q; for general products it is false, so the test can fail."""
    rng = np.random.default_rng(A.shape[0] + 10 * B.shape[1])
    Q = np.linalg.qr(rng.normal(size=(A.shape[0], A.shape[0])))[0]
    np.testing.assert_allclose(inverse(Q @ A), inverse(A) @ Q.T, atol=tol.PENROSE * 10)


@given(oracles.SEEDS, st.integers(2, 6), oracles.magnitudes(1e-4, 0.1))
def test_truncation_leaves_the_kept_directions_exact(seed, count, cutoff):
    """Commands along kept left singular vectors are met to round-off; along the others nothing moves at all."""
    rng = np.random.default_rng(seed)
    kept = int(rng.integers(1, count))
    s = np.concatenate([rng.uniform(1.0, 2.0, kept), 1e-2 * cutoff * rng.uniform(0.1, 1.0, count - kept)])
    U, V = np.linalg.qr(rng.normal(size=(count, count)))[0], np.linalg.qr(rng.normal(size=(8, 8)))[0]
    A = (U * s) @ V[:, :count].T
    solver = Pinv(Truncated(cutoff))
    for i in range(count):
        solution = solve(Problem([(A, U[:, i])]), solver)
        if i < kept:
            assert solution.residuals[0] < 1e-11
            np.testing.assert_allclose(solution.u, V[:, i] / s[i], atol=1e-11)
        else:
            assert np.linalg.norm(solution.u) < 1e-10 / cutoff and solution.residuals[0] == pytest.approx(1.0)
    damped = solve(Problem([(A, U[:, 0])]), Pinv(Damped(0.1)))
    assert damped.residuals[0] > 1e-3  # what damping does not do


@given(matrices, oracles.SEEDS)
def test_the_damped_error_grows_with_the_damping(A, seed):
    """And ||u|| shrinks: the trade that lambda makes; at vanishing lambda, the pseudo-inverse's."""
    b = np.random.default_rng(seed).normal(size=A.shape[0])
    dampings = np.geomspace(1e-2, 1e2, 17)
    least = solve(Problem([(A, b)]), "pinv")
    for family in (DLS, lambda x: Pinv(Damped(x))):
        solutions = [solve(Problem([(A, b)]), family(x)) for x in dampings]
        errors = np.array([solution.residuals[0] for solution in solutions])
        norms = np.array([np.linalg.norm(solution.u) for solution in solutions])
        assert (np.diff(errors) >= -tol.ORACLE).all() and (np.diff(norms) <= tol.ORACLE).all()
        assert errors[0] == pytest.approx(least.residuals[0], abs=1e-2)
        if np.linalg.matrix_rank(A, tol=oracles.GAP):
            assert norms[-1] < norms[0] <= np.linalg.norm(least.u) * (1.0 + tol.ORACLE)
            assert errors[-1] >= errors[0] and np.linalg.norm(A.T @ b) > 0.0


@given(oracles.SEEDS, oracles.magnitudes(1e-3, 1e3))
def test_the_damped_error_along_each_direction(seed, damping):
    """lambda^2 / (sigma^2 + lambda^2) of the command along a singular direction is missing."""
    rng = np.random.default_rng(seed)
    s = np.array([2.0, 1.0, 0.3])
    A = oracles.matrix_with(rng, 3, 6, s)
    U = np.linalg.svd(A)[0]
    for i in range(3):
        missing = solve(Problem([(A, U[:, i])]), DLS(damping)).residuals[0]
        assert missing == pytest.approx(damping**2 / (s[i] ** 2 + damping**2), rel=1e-9, abs=1e-12)
