"""Pseudo-inverse: least residual, then least W-norm; nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl import Damped, Equation, Pinv, Problem, Status, Truncated, solve
from tests import oracles
from tests import tolerances as tol


@given(oracles.systems(max_n=40), oracles.METRICS)
def test_least_weighted_norm(system, kind):
    rng, (A,), (c,) = system
    W = oracles.metric(rng, A.shape[1], kind)
    u = solve(Problem([(A, c)], metric=W), "pinv").u
    expected = oracles.constrained_minimum(A, c, W)
    np.testing.assert_allclose(u, expected, atol=tol.ORACLE * (1.0 + np.linalg.norm(expected)))


@given(oracles.SEEDS, st.integers(1, 12), oracles.METRICS)
def test_closed_form_of_full_row_rank(seed, n, kind):
    """W^-1 A^T (A W^-1 A^T)^-1 (b - d)."""
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, n + 1))
    A, b, d, W = oracles.matrix(rng, m, n), rng.normal(size=m), rng.normal(size=m), oracles.metric(rng, n, kind)
    F = np.linalg.inv(oracles.full_metric(W, n))
    solution = solve(Problem([Equation(A, b, drift=d)], metric=W), "pinv")
    np.testing.assert_allclose(solution.u, F @ A.T @ np.linalg.solve(A @ F @ A.T, b - d), atol=tol.ORACLE)
    assert solution.status is Status.OPTIMAL
    np.testing.assert_allclose(A @ solution.u + d, b, atol=tol.ORACLE)


@given(oracles.SEEDS, st.integers(1, 12))
def test_square_and_regular_is_the_inverse(seed, n):
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, n, n), rng.normal(size=n)
    np.testing.assert_allclose(solve(Problem([(A, b)]), "pinv").u, np.linalg.solve(A, b), atol=tol.ORACLE)


@given(oracles.systems(levels=3, max_n=8))
def test_several_equations_are_stacked_with_their_weights(system):
    """min sum_k w_k ||A_k u + d_k - b_k||^2, then least norm."""
    rng, matrices, commands = system
    weights = rng.uniform(0.2, 5.0, len(matrices))
    drifts = [rng.normal(size=c.shape) for c in commands]
    equations = [
        Equation(A, b, drift=d, weight=w) for A, b, d, w in zip(matrices, commands, drifts, weights, strict=True)
    ]
    u = solve(Problem(equations), "pinv").u
    roots = np.sqrt(weights)
    A = np.vstack([r * A for r, A in zip(roots, matrices, strict=True)])
    c = np.concatenate([r * (b - d) for r, b, d in zip(roots, commands, drifts, strict=True)])
    expected = oracles.constrained_minimum(A, c)
    np.testing.assert_allclose(u, expected, atol=tol.ORACLE * (1.0 + np.linalg.norm(expected)))


@given(oracles.SEEDS)
def test_an_equation_of_weight_zero_does_not_count(seed):
    """Neither in the answer nor in the status: no task has lost rank."""
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, 2, 6), rng.normal(size=2)
    off = Equation(rng.normal(size=(2, 6)), rng.normal(size=2), weight=0.0)
    solution = solve(Problem([Equation(A, b), off]), "pinv")
    np.testing.assert_allclose(solution.u, solve(Problem([(A, b)]), "pinv").u, atol=tol.EXACT)
    assert solution.status is not Status.SINGULAR
    assert solution.residuals[1] > 0.0


@given(oracles.SEEDS, oracles.magnitudes(1e-6, 1e6))
def test_units_of_the_task_do_not_matter(seed, unit):
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, 3, 6, int(rng.integers(1, 4))), rng.normal(size=3)
    expected = solve(Problem([(A, b)]), "pinv").u
    np.testing.assert_allclose(solve(Problem([(unit * A, unit * b)]), "pinv").u, expected, atol=tol.ORACLE)


@given(oracles.SEEDS, st.floats(-3.0, 3.0), oracles.METRICS)
def test_same_rates_in_rotated_axes(seed, angle, kind):
    """Rows in tool axes or in base axes: the same q_dot."""
    rng = np.random.default_rng(seed)
    A, b, W = oracles.matrix(rng, 6, 7), rng.normal(size=6), oracles.metric(rng, 7, kind)
    axis = rng.normal(size=3)
    turn = np.kron(np.eye(2), oracles.rotation(axis / np.linalg.norm(axis), angle))
    u = solve(Problem([(A, b)], metric=W), "pinv").u
    np.testing.assert_allclose(solve(Problem([(turn @ A, turn @ b)], metric=W), "pinv").u, u, atol=tol.ORACLE)


@pytest.mark.parametrize("policy", [Truncated(), Truncated(1e-3), Damped(1e-2)], ids=repr)
@pytest.mark.parametrize("exponent", range(-14, 0))
def test_near_singular_sweep(policy, exponent):
    """A planar 2R arm, ever straighter, pushed along itself."""
    stretch = 10.0**exponent
    A = oracles.planar_jacobian([1.0, 1.0], [0.3, stretch])
    b = np.array([np.cos(0.3), np.sin(0.3)])
    solution = solve(Problem([(A, b)]), Pinv(policy))
    s = np.linalg.svd(A, compute_uv=False)
    floor = policy.cutoff * np.linalg.norm(A) if isinstance(policy, Truncated) else policy.damping
    limit = 1.0 / floor if isinstance(policy, Truncated) else 1.0 / (2.0 * floor)
    assert np.linalg.norm(solution.u) <= limit * tol.PROMISE
    assert (solution.status is Status.SINGULAR) == (s[-1] <= floor)
    if isinstance(policy, Truncated) and s[-1] > floor:
        np.testing.assert_allclose(solution.u, np.linalg.solve(A, b), rtol=10 * tol.EPS * s[0] / s[-1])
    assert np.isfinite(solution.residuals).all()


@given(oracles.SEEDS)
def test_statuses(seed):
    rng = np.random.default_rng(seed)
    tall, b = oracles.matrix(rng, 5, 3), rng.normal(size=5)
    u = rng.normal(size=3)
    assert solve(Problem([(tall, tall @ u)]), "pinv").status is Status.OPTIMAL
    assert solve(Problem([(tall, b)]), "pinv").status is Status.INEXACT
    low = oracles.matrix(rng, 4, 5, 2)
    assert solve(Problem([(low, rng.normal(size=4))]), "pinv").status is Status.SINGULAR
    assert solve(Problem([(low, low @ rng.normal(size=5))]), "pinv").status is Status.SINGULAR
