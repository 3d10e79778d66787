"""Null spaces: orthonormal, complete, and without a leak, whatever the shape, rank and scale."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import null_space

from cartctl import Problem, ProjectedGradient, TaskPriority, solve
from cartctl.algebra.nullspace import basis, null_part, projector
from cartctl.algebra.svd import numerical_rank, round_off, scale, singular_values, svd
from tests import oracles
from tests import tolerances as tol

SCALES = st.sampled_from([1e-150, 1e-6, 1.0, 1e6, 1e150])


@given(oracles.systems(max_n=40), SCALES)
def test_basis_is_orthonormal_complete_and_in_the_null_space(system, size):
    _, (A,), _ = system
    n = A.shape[1]
    Z = basis(A * size)
    expected = null_space(A, rcond=oracles.GAP) if A.size else np.eye(n)
    assert Z.shape == expected.shape
    np.testing.assert_allclose(Z.T @ Z, np.eye(Z.shape[1]), atol=tol.EXACT)
    np.testing.assert_allclose(Z @ Z.T, expected @ expected.T, atol=tol.EXACT * 10)
    assert np.abs(A @ Z).max(initial=0.0) <= tol.LEAK * max(np.linalg.norm(A), 1e-300)


@given(oracles.systems(max_n=40))
def test_projector_properties(system):
    _, (A,), _ = system
    P = projector(A)
    np.testing.assert_allclose(P, P.T, atol=tol.EXACT)
    np.testing.assert_allclose(P @ P, P, atol=tol.EXACT)
    np.testing.assert_allclose(P, np.eye(A.shape[1]) - np.linalg.pinv(A, rcond=oracles.GAP) @ A, atol=tol.PENROSE)
    rank = np.linalg.matrix_rank(A, tol=oracles.GAP) if A.size else 0
    assert np.trace(P) == pytest.approx(A.shape[1] - rank, abs=tol.PENROSE)


@given(oracles.systems(max_n=40), SCALES)
def test_null_part_agrees_with_the_projector(system, size):
    rng, (A,), _ = system
    u0 = rng.normal(size=A.shape[1])
    F = np.asfortranarray(A * size)
    part = null_part(svd(F), round_off(F), u0)
    np.testing.assert_allclose(part, projector(A) @ u0, atol=tol.PENROSE)
    assert np.linalg.norm(A @ part) <= tol.LEAK * np.linalg.norm(A) * np.linalg.norm(u0)


@given(oracles.SEEDS, st.integers(2, 12), oracles.magnitudes(1e-14, 1e-1))
def test_nothing_leaks_near_singularities(seed, n, smallest):
    """||A N u0|| <= 1e-12 ||A|| ||u0|| however small sigma_min is: projected gradient and task priority alike."""
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, n + 1))
    A = oracles.matrix_with(rng, m, n, np.append(rng.uniform(0.3, 3.0, m - 1), smallest))
    u0 = 10.0 * rng.normal(size=n)
    for solver in (ProjectedGradient(), TaskPriority()):
        u = solve(Problem([(A, np.zeros(m))], reference=u0), solver).u
        assert np.linalg.norm(A @ u) <= tol.LEAK * np.linalg.norm(A) * np.linalg.norm(u0)


@given(oracles.SEEDS, st.integers(2, 40))
def test_many_narrowings_do_not_leak(seed, n):
    """As many one-row tasks as fit: the last null space still leaves the first task alone."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    u0 = rng.normal(size=n)
    rows = [(A[k : k + 1], [0.0]) for k in range(n - 1)]
    u = solve(Problem(rows, reference=u0), "task-priority").u
    np.testing.assert_allclose(A[:-1] @ u, 0.0, atol=tol.LEAK * np.linalg.norm(A) * np.linalg.norm(u0))
    np.testing.assert_allclose(u, null_space(A[:-1])[:, 0] @ u0 * null_space(A[:-1])[:, 0], atol=tol.PENROSE)


@given(oracles.systems(max_n=40))
def test_svd_rebuilds_the_matrix(system):
    _, (A,), _ = system
    U, s, Vt = svd(np.asfortranarray(A))
    n, k = A.shape[1], min(A.shape)
    assert U.shape == (A.shape[0], k) and s.shape == (k,) and Vt.shape == (n, n)
    np.testing.assert_allclose((U * s) @ Vt[:k], A, atol=tol.EXACT)
    np.testing.assert_allclose(Vt @ Vt.T, np.eye(n), atol=tol.EXACT)
    assert (np.diff(s) <= 0.0).all()
    np.testing.assert_allclose(singular_values(np.asfortranarray(A)), s, atol=tol.EXACT)
    rank = np.linalg.matrix_rank(A, tol=oracles.GAP) if A.size else 0
    assert numerical_rank(s, round_off(A)) == rank


@given(oracles.SEEDS, st.integers(-300, 300))
def test_scale_is_the_frobenius_norm_at_any_magnitude(seed, exponent):
    """Squares over- and underflow long before the norm does; a scale of 0 or inf makes every rank decision wrong."""
    A = np.random.default_rng(seed).uniform(0.5, 1.0, (3, 5))
    size = 10.0**exponent
    assert scale(A * size) == pytest.approx(np.linalg.norm(A) * size, rel=tol.EXACT)
