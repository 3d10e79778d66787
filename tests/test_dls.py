"""Damped least squares: the minimum of ||A u + d - b||^2 + lambda^2 ||u||_W^2, bounded everywhere."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl import DLS, Damped, Equation, Pinv, Problem, Status, solve
from cartctl.errors import CartctlError, NonFiniteError, ParameterError
from tests import oracles
from tests import tolerances as tol

DAMPINGS = oracles.magnitudes(3e-2, 3.0)


@given(oracles.systems(max_n=40), DAMPINGS, oracles.METRICS)
def test_normal_equations(system, lam, kind):
    """(A^T A + lambda^2 W) u = A^T c in every shape and rank."""
    rng, (A,), (c,) = system
    n = A.shape[1]
    W = oracles.metric(rng, n, kind)
    u = solve(Problem([(A, c)], metric=W), DLS(lam)).u
    left = (A.T @ A + lam**2 * oracles.full_metric(W, n)) @ u
    np.testing.assert_allclose(left, A.T @ c, atol=tol.ORACLE)


@given(oracles.systems(max_n=12), DAMPINGS, oracles.METRICS, st.booleans())
def test_against_a_taller_least_squares(system, lam, kind, steered):
    rng, (A,), (c,) = system
    n = A.shape[1]
    W, u0 = oracles.metric(rng, n, kind), rng.normal(size=n) if steered else None
    d = rng.normal(size=c.shape)
    u = solve(Problem([Equation(A, c + d, drift=d)], metric=W, reference=u0), DLS(lam)).u
    expected = oracles.damped(A, c, lam, W, u0)
    np.testing.assert_allclose(u, expected, atol=tol.DAMPED * (1.0 + np.linalg.norm(expected)))


@given(oracles.systems(levels=3, max_n=8), DAMPINGS)
def test_several_equations_are_stacked_with_their_weights(system, lam):
    rng, matrices, commands = system
    weights = rng.uniform(0.2, 5.0, len(matrices))
    equations = [Equation(A, b, weight=w) for A, b, w in zip(matrices, commands, weights, strict=True)]
    roots = np.sqrt(weights)
    A = np.vstack([r * A for r, A in zip(roots, matrices, strict=True)])
    c = np.concatenate([r * b for r, b in zip(roots, commands, strict=True)])
    expected = oracles.damped(A, c, lam)
    np.testing.assert_allclose(solve(Problem(equations), DLS(lam)).u, expected, atol=tol.DAMPED)


@given(oracles.SEEDS, st.integers(1, 9), st.integers(1, 9), DAMPINGS)
def test_the_same_as_the_damped_policy(seed, m, n, lam):
    """Two implementations, Cholesky and SVD, one formula."""
    rng = np.random.default_rng(seed)
    A, c = oracles.matrix(rng, m, n, int(rng.integers(0, min(m, n) + 1))), rng.normal(size=m)
    p = Problem([(A, c)])
    np.testing.assert_allclose(solve(p, DLS(lam)).u, solve(p, Pinv(Damped(lam))).u, atol=tol.DAMPED)


@pytest.mark.parametrize("smallest", [0.0, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("exponent", range(-12, 0))
def test_small_dampings_are_solved_as_exactly_as_large_ones(exponent, smallest):
    """A is known to eps ||A||; that much, through 1/lambda^2, is the error that any method may make.

    A Cholesky factorisation of A A^T + lambda^2 I alone loses another sigma/lambda: below lambda = 1e-6 sigma what
    is left of the digits goes fast, and at 1e-8 the bound on ||u|| with them.
    """
    lam = 10.0**exponent
    rng = np.random.default_rng(exponent + 100)
    for _ in range(20):
        m, n = (int(k) for k in rng.integers(2, 7, 2))
        k = min(m, n)
        U = np.linalg.qr(rng.normal(size=(m, m)))[0][:, :k]
        V = np.linalg.qr(rng.normal(size=(n, n)))[0][:, :k]
        s = np.append(rng.uniform(0.5, 2.0, k - 1), smallest)
        c = rng.normal(size=m)
        u = solve(Problem([((U * s) @ V.T, c)]), DLS(lam)).u
        expected = V @ (s / (s**2 + lam**2) * (U.T @ c))
        error = np.linalg.norm(u - expected)
        unavoidable = 20.0 * tol.EPS * np.linalg.norm(s) / lam**2 * np.linalg.norm(c)
        assert error <= tol.NEARLY_UNDAMPED * np.linalg.norm(expected) + unavoidable
        assert np.linalg.norm(u) <= np.linalg.norm(c) / (2.0 * lam) * tol.PROMISE


@given(oracles.SEEDS, st.sampled_from([1.0, 1e3, 1e6, 1e9]), st.sampled_from([1e-2, 1e-6, 1e-12]))
def test_rank_lost_to_round_off_is_singular(seed, size, lam):
    """Damping below the round-off of A leaves noise undamped; the answer may not be called optimal."""
    rng = np.random.default_rng(seed)
    A = oracles.matrix(rng, 3, 5, 2) * size
    c = rng.normal(size=3) * size
    solution = solve(Problem([(A, c)]), DLS(lam))
    assert solution.status is Status.SINGULAR
    assert np.linalg.norm(solution.u) <= np.linalg.norm(c) / (2.0 * lam) * tol.PROMISE


@given(oracles.SEEDS, oracles.magnitudes(1e-14, 1e-1), oracles.magnitudes(1e-3, 1.0))
def test_bounded_through_singularities(seed, smallest, lam):
    rng = np.random.default_rng(seed)
    m, n = (int(k) for k in rng.integers(2, 9, 2))
    A = oracles.matrix_with(rng, m, n, np.append(rng.uniform(0.3, 3.0, min(m, n) - 1), smallest))
    c = rng.normal(size=m)
    solution = solve(Problem([(A, c)]), DLS(lam))
    assert np.linalg.norm(solution.u) <= np.linalg.norm(c) / (2.0 * lam) * tol.PROMISE
    if smallest < 0.99 * lam:
        assert solution.status is Status.SINGULAR
    elif smallest > 1.01 * lam:
        assert solution.status is not Status.SINGULAR


@given(oracles.SEEDS, st.floats(-3.0, 3.0), oracles.METRICS)
def test_same_rates_in_rotated_axes(seed, angle, kind):
    rng = np.random.default_rng(seed)
    A, b, W = oracles.matrix(rng, 6, 7), rng.normal(size=6), oracles.metric(rng, 7, kind)
    axis = rng.normal(size=3)
    turn = np.kron(np.eye(2), oracles.rotation(axis / np.linalg.norm(axis), angle))
    u = solve(Problem([(A, b)], metric=W), DLS(0.05)).u
    np.testing.assert_allclose(solve(Problem([(turn @ A, turn @ b)], metric=W), DLS(0.05)).u, u, atol=tol.ORACLE)


@given(oracles.SEEDS, oracles.METRICS)
def test_the_reference_does_not_move_the_task(seed, kind):
    rng = np.random.default_rng(seed)
    A, b, u0 = oracles.matrix(rng, 3, 7), rng.normal(size=3), 10.0 * rng.normal(size=7)
    W = oracles.metric(rng, 7, kind)
    still = solve(Problem([(A, b)], metric=W), "dls").u
    moving = solve(Problem([(A, b)], metric=W, reference=u0), "dls").u
    np.testing.assert_allclose(A @ moving, A @ still, atol=100 * tol.LEAK)
    assert np.linalg.norm(moving - still) > 0.1


def test_what_damping_takes_is_not_called_optimal():
    """sigma = 2 lambda: a fifth of the command is missing; 'every equation is met' would be false."""
    solution = solve(Problem([([[1.0, 0.0], [0.0, 0.02]], [1.0, 1.0])]), DLS(1e-2))
    assert solution.residuals[0] == pytest.approx(0.2, rel=1e-3)
    assert solution.status is not Status.OPTIMAL


def test_a_weight_of_zero_is_not_a_singularity():
    on = Equation([[1.0, 2.0, 0.5]], [1.0])
    off = Equation([[0.0, 1.0, 1.0]], [1.0], weight=0.0)
    solution = solve(Problem([on, off]), "dls")
    np.testing.assert_allclose(solution.u, solve(Problem([on]), "dls").u, atol=tol.EXACT)
    assert solution.status is not Status.SINGULAR


@pytest.mark.parametrize(
    "value, error, words",
    [
        (0.0, ParameterError, ["damping", "0", "above 0"]),
        (-0.1, ParameterError, ["damping", "-0.1", "above 0"]),
        (float("nan"), NonFiniteError, ["damping", "nan", "finite"]),
        (float("inf"), NonFiniteError, ["damping", "inf", "finite"]),
        ("small", ParameterError, ["damping", "small", "number"]),
        (None, ParameterError, ["damping", "None", "number"]),
        (True, ParameterError, ["damping", "True", "number"]),
        (1j, ParameterError, ["damping", "1j", "number"]),
        ([0.1], ParameterError, ["damping", "[0.1]", "number"]),
    ],
)
def test_bad_damping_is_named_in_one_line(value, error, words):
    with pytest.raises(CartctlError) as caught:
        DLS(damping=value)
    assert isinstance(caught.value, error)
    line = str(caught.value)
    assert "\n" not in line and all(w in line for w in words), line


@pytest.mark.parametrize("number", [1, np.float32(1.0), np.int64(1), Decimal("1.0")], ids=repr)
def test_any_real_number_is_a_damping(number):
    p = Problem([([[1.0, 2.0]], [3.0])])
    np.testing.assert_array_equal(solve(p, DLS(number)).u, solve(p, DLS(1.0)).u)


def test_frozen():
    with pytest.raises(FrozenInstanceError):
        DLS().damping = 1.0
