"""Inverse policies: their filter factors, their promises, their parameters, and Penrose's four conditions."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl import Damped, Pinv, Problem, ProjectedGradient, TaskPriority, Truncated, solve
from cartctl.algebra.inverses import ManipulabilityDamped, NumericalFiltering, SelectivelyDamped, SigmaDamped
from cartctl.algebra.svd import scale, svd
from cartctl.errors import CartctlError, NonFiniteError, ParameterError
from tests import oracles
from tests import tolerances as tol

POLICIES = st.one_of(
    oracles.magnitudes(1e-12, 0.9).map(Truncated),
    oracles.magnitudes(1e-6, 10.0).map(Damped),
    st.just(Truncated()),
    st.just(Damped()),
)


ALL = [Truncated(), Damped(), ManipulabilityDamped(), SigmaDamped(), NumericalFiltering(), SelectivelyDamped()]
every_policy = pytest.mark.parametrize("policy", ALL, ids=lambda p: type(p).__name__)


def inverse(A, policy, W=None):
    """A#_W column by column: the solver applied to unit vectors."""
    solver = Pinv(policy=policy)
    return np.column_stack([solve(Problem([(A, e)], metric=W), solver).u for e in np.eye(A.shape[0])])


@given(oracles.systems(max_n=10).filter(lambda s: s[1][0].size))
def test_penrose(system):
    """A A# A = A, A# A A# = A#, both products symmetric: every shape and rank."""
    _, (A,), _ = system
    P = inverse(A, Truncated())
    for product, expected in [(A @ P @ A, A), (P @ A @ P, P), (A @ P, (A @ P).T), (P @ A, (P @ A).T)]:
        np.testing.assert_allclose(product, expected, atol=tol.PENROSE)


@given(oracles.systems(max_n=10).filter(lambda s: s[1][0].size), st.sampled_from(["diagonal", "full"]))
def test_weighted_penrose(system, kind):
    """With a metric the last condition becomes (W A# A)^T = W A# A: A# A is symmetric in the metric."""
    rng, (A,), _ = system
    W = oracles.metric(rng, A.shape[1], kind)
    F, P = oracles.full_metric(W, A.shape[1]), inverse(A, Truncated(), W)
    product = F @ P @ A
    for left, right in [(A @ P @ A, A), (P @ A @ P, P), (A @ P, (A @ P).T), (product, product.T)]:
        np.testing.assert_allclose(left, right, atol=10 * tol.PENROSE)


@given(oracles.SEEDS, st.integers(1, 10), st.integers(1, 10), POLICIES)
def test_factors_match_the_formula(seed, m, n, policy):
    rng = np.random.default_rng(seed)
    A = oracles.matrix_with(rng, m, n, 10.0 ** rng.uniform(-5, 0.5, min(m, n)))
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    if isinstance(policy, Truncated):
        floor = policy.cutoff * np.linalg.norm(A)
        if (np.abs(s / floor - 1.0) < 1e-9).any():
            return  # on the edge, either is right
        phi = np.array([1.0 / x if x > floor else 0.0 for x in s])
    else:
        phi = np.array([x / (x**2 + policy.damping**2) for x in s])
    b = rng.normal(size=m)
    expected = Vt.T @ (phi * (U.T @ b))
    F = np.asfortranarray(A)
    size = phi.max(initial=1.0) * np.linalg.norm(b)
    np.testing.assert_allclose(policy.solve(svd(F), b, scale(F)), expected, atol=tol.ORACLE * size)
    np.testing.assert_allclose(solve(Problem([(A, b)]), Pinv(policy)).u, expected, atol=tol.ORACLE * size)


def damping_squared(policy, s):
    """lambda_i^2 of each singular value, from the published formulas, one by one."""
    if isinstance(policy, Damped):
        return [policy.damping**2 for _ in s]
    full = policy.damping**2
    if isinstance(policy, ManipulabilityDamped):
        w, w0 = math.prod(s), policy.threshold
        return [full * (1.0 - w / w0) ** 2 if w < w0 else 0.0 for _ in s]
    if isinstance(policy, SigmaDamped):
        low, eps = min(s), policy.threshold
        return [full * (1.0 - (low / eps) ** 2) if low < eps else 0.0 for _ in s]
    eps = policy.threshold
    return [(full * (1.0 - (x / eps) ** 2) if x < eps else 0.0) + policy.beta**2 for x in s]


@given(
    oracles.SEEDS,
    st.floats(0.01, 2.0),
    st.floats(0.01, 2.0),
    st.floats(0.0, 0.1),
    st.sampled_from([Damped, ManipulabilityDamped, SigmaDamped, NumericalFiltering]),
)
def test_damping_formulas(seed, damping, threshold, beta, kind):
    rng = np.random.default_rng(seed)
    s = np.sort(10.0 ** rng.uniform(-3, 0.5, int(rng.integers(1, 6))))[::-1]
    more = {} if kind is Damped else {"threshold": threshold}
    more |= {"beta": beta} if kind is NumericalFiltering else {}
    policy = kind(damping=damping, **more)
    squared = damping_squared(policy, s.tolist())
    expected = [x / (x**2 + d) for x, d in zip(s, squared, strict=True)]
    np.testing.assert_allclose(policy.factors(s, float(np.linalg.norm(s))), expected, rtol=tol.ORACLE)
    assert policy.rank(s, float(np.linalg.norm(s))) == sum(x**2 > d for x, d in zip(s, squared, strict=True))


@given(oracles.SEEDS, st.floats(0.05, 5.0))
def test_selective_damping_step_by_step(seed, limit):
    """Buss & Kim's steps, loop by loop."""
    rng = np.random.default_rng(seed)
    m, n = int(rng.integers(1, 6)), int(rng.integers(1, 8))
    A = oracles.matrix_with(rng, m, n, 10.0 ** rng.uniform(-3, 0.5, min(m, n)))
    b = rng.normal(size=m)
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    total = np.zeros(n)
    for i in range(len(s)):
        reach = sum(abs(Vt[i, j]) * np.linalg.norm(A[:, j]) for j in range(n)) / s[i]
        gamma = limit * min(1.0, 1.0 / reach)
        step = Vt[i] * (U[:, i] @ b) / s[i]
        total += step * min(1.0, gamma / np.abs(step).max())
    total *= min(1.0, limit / np.abs(total).max())
    u = solve(Problem([(A, b)]), Pinv(SelectivelyDamped(limit))).u
    np.testing.assert_allclose(u, total, atol=tol.ORACLE * limit)
    assert np.abs(u).max() <= limit * tol.PROMISE


@every_policy
@given(seed=oracles.SEEDS, unit=st.sampled_from([1e-6, 1.0, 1e3, 1e6]))
def test_round_off_is_never_inverted(policy, seed, unit):
    """Six rows of rank five, in metres or millimetres: the sixth singular value is noise and stays out."""
    rng = np.random.default_rng(seed)
    A, b = unit * oracles.matrix(rng, 6, 8, 5), unit * rng.normal(size=6)
    for solver in (Pinv(policy), ProjectedGradient(policy), TaskPriority(policy)):
        u = solve(Problem([(A, b)]), solver).u
        assert np.linalg.norm(u) <= np.linalg.norm(b) / (0.3 * unit) * 1.01


@every_policy
@given(seed=oracles.SEEDS)
def test_a_doubled_task_is_not_inverted(policy, seed):
    """The second task is the first again: projected, it is noise."""
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, 3, 7), rng.normal(size=3)
    alone = solve(Problem([(A, b)]), TaskPriority(policy)).u
    both = solve(Problem([(A, b), (1e3 * A, 1e3 * rng.normal(size=3))]), TaskPriority(policy)).u
    np.testing.assert_allclose(both, alone, atol=1e-4)  # inverted, it would be 1e13


@given(oracles.SEEDS, oracles.magnitudes(1e-14, 1e-1), POLICIES)
def test_promised_bounds_hold_through_singularities(seed, smallest, policy):
    """Truncated: ||u|| <= ||b|| / (cutoff ||A||). Damped: ||u|| <= ||b|| / (2 lambda)."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    m = int(rng.integers(2, n + 1))
    A = oracles.matrix_with(rng, m, n, np.append(rng.uniform(0.3, 3.0, m - 1), smallest))
    b = rng.normal(size=m)
    bound = np.linalg.norm(b) / (
        policy.cutoff * np.linalg.norm(A) if isinstance(policy, Truncated) else 2.0 * policy.damping
    )
    for solver in (Pinv(policy), ProjectedGradient(policy), TaskPriority(policy)):
        u = solve(Problem([(A, b)]), solver).u
        assert np.isfinite(u).all() and np.linalg.norm(u) <= bound * tol.PROMISE


@given(oracles.SEEDS, POLICIES, st.integers(-150, 150))
def test_factors_are_finite_even_at_zero(seed, policy, exponent):
    s = np.sort(np.append(np.random.default_rng(seed).uniform(0.1, 3.0, 3), 0.0))[::-1] * 10.0**exponent
    phi = policy.factors(s, float(np.linalg.norm(s)))
    assert phi.shape == s.shape and np.isfinite(phi).all() and (phi >= 0.0).all() and phi[-1] == 0.0
    assert 0 <= policy.rank(s, float(np.linalg.norm(s))) <= 3
    empty = np.zeros(0)
    assert policy.factors(empty, 0.0).shape == (0,) and policy.rank(empty, 0.0) == 0


def test_the_vanishingly_damped_zero_is_zero():
    assert Damped(1e-170).factors(np.array([1.0, 0.0]), 1.0) == pytest.approx([1.0, 0.0])


@pytest.mark.parametrize(
    "build, error, words",
    [
        (lambda: Truncated(0.0), ParameterError, ["cutoff", "0", "1e-13"]),
        (lambda: Truncated(-1e-3), ParameterError, ["cutoff", "-0.001", "1e-13"]),
        (lambda: Truncated(1e-16), ParameterError, ["cutoff", "1e-16", "1e-13"]),
        (lambda: Truncated(1.0), ParameterError, ["cutoff", "1"]),
        (lambda: Truncated(float("nan")), NonFiniteError, ["cutoff", "nan"]),
        (lambda: Truncated("small"), ParameterError, ["cutoff", "small", "number"]),
        (lambda: Damped(0.0), ParameterError, ["damping", "0", "above 0"]),
        (lambda: Damped(-1.0), ParameterError, ["damping", "-1", "above 0"]),
        (lambda: Damped(float("inf")), NonFiniteError, ["damping", "inf"]),
        (lambda: Damped(None), ParameterError, ["damping", "None", "number"]),
        (lambda: ManipulabilityDamped(damping=0.0), ParameterError, ["damping", "0", "above 0"]),
        (lambda: ManipulabilityDamped(threshold=-1.0), ParameterError, ["threshold", "-1", "above 0"]),
        (lambda: SigmaDamped(threshold=0.0), ParameterError, ["threshold", "0", "above 0"]),
        (lambda: SigmaDamped(damping=float("nan")), NonFiniteError, ["damping", "nan"]),
        (lambda: NumericalFiltering(beta=-1e-3), ParameterError, ["beta", "-0.001", "at least 0"]),
        (lambda: NumericalFiltering(threshold="x"), ParameterError, ["threshold", "'x'", "number"]),
        (lambda: SelectivelyDamped(limit=0.0), ParameterError, ["limit", "0", "above 0"]),
        (lambda: Pinv(policy="truncated"), CartctlError, ["policy", "truncated"]),
        (lambda: Pinv(policy=Truncated), CartctlError, ["policy", "Truncated"]),
        (lambda: ProjectedGradient(policy=None), CartctlError, ["policy", "None"]),
        (lambda: TaskPriority(policy=1e-3), CartctlError, ["policy", "0.001"]),
    ],
)
def test_bad_parameters_are_named_in_one_line(build, error, words):
    with pytest.raises(CartctlError) as caught:
        build()
    assert isinstance(caught.value, error)
    line = str(caught.value)
    assert "\n" not in line and all(w in line for w in words), line


def test_policies_are_frozen_and_take_any_real_number():
    with pytest.raises(FrozenInstanceError):
        Damped(0.1).damping = 0.2
    with pytest.raises(FrozenInstanceError):
        Truncated().cutoff = 0.2
    p = Problem([([[1.0, 2.0]], [3.0])])
    expected = solve(p, Pinv(Damped(0.5))).u
    for number in (np.float32(0.5), np.float64(0.5), Decimal("0.5")):
        np.testing.assert_array_equal(solve(p, Pinv(Damped(number))).u, expected)
