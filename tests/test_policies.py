"""Inverse policies in use: formulas, continuity, promised bounds, singular sweeps, and every solver that takes one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl import (
    SDLS,
    Damped,
    DLSManipulability,
    DLSSigma,
    Equation,
    ExtendedJacobian,
    MainVariables,
    ManipulabilityDamped,
    NumericalFiltering,
    NumericalFilteringSolver,
    Pinv,
    Problem,
    ProjectedGradient,
    SelectivelyDamped,
    SigmaDamped,
    SingularityRobustPriority,
    Status,
    TaskPriority,
    Truncated,
    solve,
)
from cartctl.algebra.inverses.selective import clamped_sum
from tests import oracles
from tests import tolerances as tol

ALL = [
    Truncated(),
    Truncated(1e-3),
    Damped(0.1),
    ManipulabilityDamped(),
    ManipulabilityDamped(0.3, 2.0),
    SigmaDamped(),
    SigmaDamped(0.2, 0.5),
    NumericalFiltering(),
    NumericalFiltering(0.2, 0.5, 0.0),
    SelectivelyDamped(),
    SelectivelyDamped(0.3),
]
every_policy = pytest.mark.parametrize("policy", ALL, ids=repr)
SOLVERS = [Pinv, ProjectedGradient, TaskPriority, SingularityRobustPriority, MainVariables]
WITH_REFERENCE = [ProjectedGradient, TaskPriority, SingularityRobustPriority]
EXPONENTS = range(-14, 0)
PARAMETER = oracles.magnitudes(1e-3, 2.0)


def adaptive(kind, damping, threshold):
    return kind(damping=damping, threshold=threshold)


def wide(rng, s, n=6):
    return oracles.matrix_with(rng, len(s), n, s)


def through_svd(A, b, phi):
    """V diag(phi(s)) U^T b with NumPy's own SVD."""
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    return Vt.T @ (phi(s) * (U.T @ b))


# ---------------------------------------------------------------- factors


@given(oracles.SEEDS, PARAMETER, PARAMETER)
def test_manipulability_damped_formula(seed, damping, threshold):
    """w = sqrt(det(A A^T)), from the determinant and not from singular values."""
    rng = np.random.default_rng(seed)
    A, b = wide(rng, 10.0 ** rng.uniform(-2, 0.5, 3)), rng.normal(size=3)
    w = math.sqrt(np.linalg.det(A @ A.T))
    squared = damping**2 * (1.0 - w / threshold) ** 2 if w < threshold else 0.0
    expected = A.T @ np.linalg.solve(A @ A.T + squared * np.eye(3), b)
    u = solve(Problem([(A, b)]), DLSManipulability(damping, threshold)).u
    np.testing.assert_allclose(u, expected, rtol=0.0, atol=tol.DAMPED * (1.0 + np.linalg.norm(expected)) / 1e-2)


@given(oracles.SEEDS, PARAMETER, PARAMETER)
def test_sigma_damped_formula(seed, damping, threshold):
    rng = np.random.default_rng(seed)
    A, b = wide(rng, 10.0 ** rng.uniform(-2, 0.5, 3)), rng.normal(size=3)
    low = math.sqrt(max(0.0, np.linalg.eigvalsh(A @ A.T)[0]))
    squared = damping**2 * (1.0 - (low / threshold) ** 2) if low < threshold else 0.0
    expected = A.T @ np.linalg.solve(A @ A.T + squared * np.eye(3), b)
    u = solve(Problem([(A, b)]), DLSSigma(damping, threshold)).u
    np.testing.assert_allclose(u, expected, rtol=0.0, atol=tol.DAMPED * (1.0 + np.linalg.norm(expected)) / 1e-2)


@given(oracles.SEEDS, PARAMETER, PARAMETER, st.sampled_from([0.0, 1e-4, 0.1]))
def test_numerical_filtering_formula(seed, damping, threshold, beta):
    """A^T (A A^T + beta^2 I + sum_i lambda_i^2 u_i u_i^T)^-1 b, the sum over the weak directions alone."""
    rng = np.random.default_rng(seed)
    A, b = wide(rng, 10.0 ** rng.uniform(-2, 0.5, 3)), rng.normal(size=3)
    squares, U = np.linalg.eigh(A @ A.T)
    weak = np.array([damping**2 * max(0.0, 1.0 - x / threshold**2) for x in squares])
    expected = A.T @ np.linalg.solve(A @ A.T + beta**2 * np.eye(3) + (U * weak) @ U.T, b)
    u = solve(Problem([(A, b)]), NumericalFilteringSolver(damping, threshold, beta)).u
    np.testing.assert_allclose(u, expected, rtol=0.0, atol=tol.DAMPED * (1.0 + np.linalg.norm(expected)) / 1e-2)


@given(oracles.SEEDS, PARAMETER, PARAMETER, st.integers(1, 6))
def test_continuous_across_the_threshold(seed, damping, threshold, count):
    """A hair below and a hair above where the damping sets in, the same factors."""
    rng = np.random.default_rng(seed)
    s = np.sort(rng.uniform(0.5, 2.0, count))[::-1]
    for policy, at in [
        (ManipulabilityDamped(damping, threshold), s * (threshold / np.prod(s)) ** (1.0 / count)),
        (SigmaDamped(damping, threshold), s * threshold / s[-1]),
        (NumericalFiltering(damping, threshold, 0.0), s * threshold / s[count // 2]),
    ]:
        below, above = (policy.factors(at * (1.0 + h), float(np.linalg.norm(at))) for h in (-1e-10, 1e-10))
        np.testing.assert_allclose(below, above, rtol=1e-5 * (1.0 + (damping / at[-1]) ** 2))
        if not isinstance(policy, NumericalFiltering):
            np.testing.assert_allclose(above, 1.0 / (at * (1.0 + 1e-10)), rtol=tol.EXACT)
            inside = policy.factors(0.5 * at, float(np.linalg.norm(at)))
            assert (inside < 2.0 / at).all()


@given(oracles.SEEDS, PARAMETER, PARAMETER, st.sampled_from([ManipulabilityDamped, SigmaDamped, NumericalFiltering]))
def test_damping_grows_towards_the_singularity(seed, damping, threshold, kind):
    """On the way in, the share phi sigma of the command that the weakest direction delivers falls steadily to 0."""
    rng = np.random.default_rng(seed)
    others = np.sort(rng.uniform(0.5, 2.0, 2))[::-1]
    policy = adaptive(kind, damping, threshold)
    shares = []
    for low in np.geomspace(0.45, 1e-9, 500):
        s = np.append(others, low)
        shares.append(low * policy.factors(s, float(np.linalg.norm(s)))[-1])
    assert (np.diff(shares) <= 1e-9).all()
    assert shares[-1] < 1e-6 and shares[0] <= 1.0


@given(oracles.SEEDS, PARAMETER, PARAMETER, oracles.magnitudes(1e-14, 1.0), st.integers(1, 5))
def test_promised_bounds(seed, damping, threshold, smallest, count):
    """What the factors can reach at most, from the formulas by hand."""
    rng = np.random.default_rng(seed)
    s = np.sort(np.append(rng.uniform(0.3, 3.0, count - 1), smallest))[::-1]
    A, b = wide(rng, s), rng.normal(size=count)
    command, largest = np.linalg.norm(b), s[0]
    root2 = math.sqrt(2.0)
    # sigma >= eps/sqrt2: phi <= sqrt2/eps; else lambda >= lambda_max/sqrt2: phi <= 1/(2 lambda)
    by_sigma = root2 * max(1.0 / threshold, 1.0 / (2.0 * damping))
    # w >= w0/2: sigma_min >= w / sigma_max^(m-1); else lambda >= lambda_max/2
    by_volume = max(1.0 / damping, 2.0 * largest ** (count - 1) / threshold)
    for policy, bound in [
        (SigmaDamped(damping, threshold), by_sigma),
        (NumericalFiltering(damping, threshold, 1e-4), by_sigma),
        (ManipulabilityDamped(damping, threshold), by_volume),
    ]:
        for solver in SOLVERS:
            if solver is MainVariables and smallest < 1e-10:
                continue  # the weak row is left out there, the rest is a smaller problem
            u = solve(Problem([(A, b)]), solver(policy)).u
            assert np.linalg.norm(u) <= command * bound * tol.PROMISE, (policy, solver)
    for limit in (damping, threshold):
        for solver in SOLVERS:
            u = solve(Problem([(A, b)]), solver(SelectivelyDamped(limit))).u
            assert np.abs(u).max() <= limit * tol.PROMISE


@pytest.mark.parametrize("kind", ["diagonal", "full"])
@given(seed=oracles.SEEDS, limit=oracles.magnitudes(1e-2, 1.0))
def test_the_selective_limit_under_a_metric(kind, seed, limit):
    """Where W = L L^T, it is the largest entry of L^T u."""
    rng = np.random.default_rng(seed)
    A, b, W = wide(rng, [1.0, 0.5, 1e-3]), 10.0 * rng.normal(size=3), 0.1 * oracles.metric(rng, 6, kind)
    L = np.linalg.cholesky(oracles.full_metric(W, 6))
    for solver in (Pinv(SelectivelyDamped(limit)), SDLS(limit)):
        u = solve(Problem([(A, b)], metric=W), solver).u
        assert 0.1 * limit < np.abs(L.T @ u).max() <= limit * tol.PROMISE


# ---------------------------------------------------------------- singular sweeps, zeros, no rows


@every_policy
@pytest.mark.parametrize("solver", SOLVERS, ids=lambda s: s.__name__)
def test_near_singular_sweep(policy, solver):
    """sigma_min = 1e-1 ... 1e-14, alone and below another task: finite, and no wilder than 1/sigma_min."""
    for exponent in EXPONENTS:
        rng = np.random.default_rng(100 - exponent)
        A, b = wide(rng, [2.0, 1.0, 10.0**exponent]), rng.normal(size=3)
        for equations in ([(A, b)], [(rng.normal(size=(2, 6)), rng.normal(size=2)), (A, b)]):
            solution = solve(Problem(equations), solver(policy))
            assert np.isfinite(solution.u).all() and np.isfinite(solution.residuals).all()
            assert solution.status is not Status.FAILED
            assert np.linalg.norm(solution.u) <= 1e3 * max(1.0, min(10.0**-exponent, 1e10))


@pytest.mark.parametrize("policy", [Truncated(), Truncated(1e-3), Damped(0.05)], ids=repr)
def test_all_solvers_call_the_same_matrix_singular(policy):
    """What the policy does not invert in earnest is a lost rank, whichever method was asked."""
    rng = np.random.default_rng(7)
    for exponent in EXPONENTS:
        A, b = wide(rng, [2.0, 1.0, 10.0**exponent]), rng.normal(size=3)
        square = oracles.matrix_with(rng, 3, 3, [2.0, 1.0, 10.0**exponent])
        expected = solve(Problem([(A, b)]), Pinv(policy)).status is Status.SINGULAR
        for solver, matrix in [*((s, A) for s in SOLVERS), (ExtendedJacobian, square)]:
            status = solve(Problem([(matrix, b)]), solver(policy)).status
            assert (status is Status.SINGULAR) == expected, (solver.__name__, exponent, status)


@every_policy
@given(seed=oracles.SEEDS, n=st.integers(1, 9), m=st.integers(1, 5), kind=oracles.METRICS)
def test_a_zero_matrix_and_no_rows(policy, seed, n, m, kind):
    rng = np.random.default_rng(seed)
    W, b, u0 = oracles.metric(rng, n, kind), rng.normal(size=m), rng.normal(size=n)
    for solver in SOLVERS:
        zero = solve(Problem([(np.zeros((m, n)), b)], metric=W), solver(policy))
        assert not zero.u.any() and zero.status is Status.SINGULAR
        none = solve(Problem([(np.zeros((0, n)), [])], metric=W), solver(policy))
        assert not none.u.any() and none.status is Status.OPTIMAL
    for solver in WITH_REFERENCE:
        for A, c in ((np.zeros((m, n)), b), (np.zeros((0, n)), [])):
            u = solve(Problem([(A, c)], metric=W, reference=u0), solver(policy)).u
            np.testing.assert_allclose(u, u0, atol=10 * tol.EXACT)


@every_policy
@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (4, 4), (9, 4), (4, 9)])
def test_shapes(policy, shape):
    rng = np.random.default_rng(sum(shape))
    for rank in range(min(shape) + 1):
        p = Problem([(oracles.matrix(rng, *shape, rank), rng.normal(size=shape[0]))])
        for solver in SOLVERS:
            solution = solve(p, solver(policy))
            assert np.isfinite(solution.u).all()
            if rank < min(shape):
                assert solution.status is Status.SINGULAR


# ---------------------------------------------------------------- selectively damped


def clamp(x, limit):
    """ClampMaxAbs of the paper."""
    largest = np.abs(x).max(initial=0.0)
    return x if largest <= limit else x * (limit / largest)


def buss_kim(J, e, limit):
    """Their algorithm for one end effector, N_i = ||u_i|| = 1, with the columns' lengths from J itself."""
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    lengths = np.linalg.norm(J, axis=0)
    total = np.zeros(J.shape[1])
    for u, sigma, v in zip(U.T, s, Vt, strict=True):
        if sigma <= 1e-12 * s[0]:
            continue
        M = (np.abs(v) @ lengths) / sigma
        total = total + clamp((u @ e) / sigma * v, min(1.0, 1.0 / M) * limit)
    return clamp(total, limit)


@given(oracles.SEEDS, oracles.magnitudes(1e-2, 10.0), st.integers(1, 6), st.integers(1, 9), st.booleans())
def test_buss_and_kim(seed, limit, m, n, deficient):
    rng = np.random.default_rng(seed)
    k = min(m, n)
    A = oracles.matrix_with(rng, m, n, 10.0 ** rng.uniform(-6, 0.5, k - 1 if deficient and k > 1 else k))
    e = 10.0 ** rng.uniform(-3, 2) * rng.normal(size=m)
    expected = buss_kim(A, e, limit)
    np.testing.assert_allclose(solve(Problem([(A, e)]), SDLS(limit)).u, expected, atol=1e-7 * limit)


@given(oracles.SEEDS, oracles.magnitudes(1e-14, 1e-1))
def test_what_is_not_asked_for_is_not_damped(seed, smallest):
    """Near a singularity, a command in the good directions is followed exactly."""
    rng = np.random.default_rng(seed)
    U, V = np.linalg.qr(rng.normal(size=(3, 3)))[0], np.linalg.qr(rng.normal(size=(6, 6)))[0]
    A = (U * [2.0, 1.0, smallest]) @ V[:, :3].T
    b = U[:, :2] @ (0.05 * rng.normal(size=2))
    solution = solve(Problem([(A, b)]), SDLS(3.0))
    np.testing.assert_allclose(A @ solution.u, b, atol=1e-9)
    damped = solve(Problem([(A, b)]), Pinv(Damped(0.1))).u
    assert np.linalg.norm(A @ damped - b) > 1e-6


@given(oracles.SEEDS)
def test_small_commands_are_the_pseudo_inverse(seed):
    rng = np.random.default_rng(seed)
    A, b, u0 = oracles.matrix(rng, 3, 7), 1e-3 * rng.normal(size=3), rng.normal(size=7)
    p = Problem([(A, b)], reference=u0)
    np.testing.assert_allclose(solve(p, SDLS(10.0)).u, solve(p, "projected-gradient").u, atol=tol.ORACLE)


@every_policy
@given(seed=oracles.SEEDS)
def test_ranked_tasks_have_no_joint_order(policy, seed):
    """Below another task the answer must not depend on which basis of the null space was taken."""
    rng = np.random.default_rng(seed)
    first, second = (
        (oracles.matrix(rng, 2, 7), rng.normal(size=2)),
        (wide(rng, [1.0, 0.02], 7), 5.0 * rng.normal(size=2)),
    )
    order = rng.permutation(7)
    for solver in (TaskPriority(policy), SingularityRobustPriority(policy)):
        u = solve(Problem([first, second]), solver).u
        permuted = Problem([(A[:, order], b) for A, b in (first, second)])
        np.testing.assert_allclose(solve(permuted, solver).u, u[order], atol=1e-7 * (1.0 + np.linalg.norm(u)))


def test_prepare_leaves_nothing_to_compile():
    """The first step of a loop must not wait for a compiler."""
    for solver in (SDLS(), Pinv(SelectivelyDamped())):
        clamped_sum.__dict__.pop("_compiled", None)
        solver.prepare()
        assert "_compiled" in clamped_sum.__dict__, solver


# ---------------------------------------------------------------- every solver takes every policy


@every_policy
@given(seed=oracles.SEEDS, kind=oracles.METRICS)
def test_one_task_one_answer(policy, seed, kind):
    """For a single task all SVD-based methods are the same formula."""
    rng = np.random.default_rng(seed)
    A, b, W = wide(rng, [2.0, 0.4, 0.03]), rng.normal(size=3), oracles.metric(rng, 6, kind)
    d = rng.normal(size=3)
    p = Problem([Equation(A, b, drift=d)], metric=W)
    L = np.linalg.cholesky(oracles.full_metric(W, 6))
    white = np.linalg.solve(L, A.T).T
    if isinstance(policy, SelectivelyDamped):
        expected = np.linalg.solve(L.T, buss_kim(white, b - d, policy.limit)) if W is None else None
    else:
        expected = np.linalg.solve(
            L.T, through_svd(white, b - d, lambda s: policy.factors(s, float(np.linalg.norm(white))))
        )
    first = solve(p, Pinv(policy)).u
    if expected is not None:
        np.testing.assert_allclose(first, expected, atol=tol.ORACLE * (1.0 + np.linalg.norm(expected)))
    for solver in SOLVERS[1:]:
        np.testing.assert_allclose(solve(p, solver(policy)).u, first, atol=tol.ORACLE * (1.0 + np.linalg.norm(first)))


@every_policy
@given(seed=oracles.SEEDS)
def test_extended_jacobian_takes_any_policy(policy, seed):
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix_with(rng, 5, 5, [3.0, 1.0, 0.5, 0.05, 1e-3]), rng.normal(size=5)
    p = Problem([(A[:3], b[:3]), (A[3:], b[3:])])
    expected = solve(Problem([(A, b)]), Pinv(policy)).u
    np.testing.assert_allclose(
        solve(p, ExtendedJacobian(policy)).u, expected, atol=tol.ORACLE * np.linalg.norm(expected)
    )


NAMED = [
    ("dls-manipulability", ManipulabilityDamped()),
    ("dls-sigma", SigmaDamped()),
    ("numerical-filtering", NumericalFiltering()),
    ("sdls", SelectivelyDamped()),
    (DLSManipulability(0.3, 1.5), ManipulabilityDamped(0.3, 1.5)),
    (DLSSigma(0.3, 1.5), SigmaDamped(0.3, 1.5)),
    (NumericalFilteringSolver(0.3, 1.5, 0.01), NumericalFiltering(0.3, 1.5, 0.01)),
    (SDLS(0.2), SelectivelyDamped(0.2)),
]


@pytest.mark.parametrize("solver, policy", NAMED, ids=[repr(p) for _, p in NAMED])
@given(system=oracles.systems(levels=3, max_n=8), kind=oracles.METRICS)
def test_named_methods_are_the_projected_gradient(solver, policy, system, kind):
    """Any shape and rank, weights, metric, drift and reference: the same answer and the same status."""
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    equations = [
        Equation(A, b, drift=rng.normal(size=b.shape), weight=rng.uniform(0.2, 5.0))
        for A, b in zip(matrices, commands, strict=True)
    ]
    for u0 in (None, rng.normal(size=n)):
        p = Problem(equations, metric=oracles.metric(rng, n, kind), reference=u0)
        ours, expected = solve(p, solver), solve(p, ProjectedGradient(policy))
        np.testing.assert_array_equal(ours.u, expected.u)
        assert ours.status is expected.status


@every_policy
@pytest.mark.parametrize("solver", WITH_REFERENCE, ids=lambda s: s.__name__)
def test_the_projector_is_exact(policy, solver):
    """||A N u0|| <= 1e-12 ||A|| ||u0|| with every policy, however singular, in every metric."""
    for exponent in EXPONENTS:
        rng = np.random.default_rng(-exponent)
        for kind in ("identity", "diagonal", "full"):
            A, u0 = wide(rng, [2.0, 1.0, 10.0**exponent]), 10.0 * rng.normal(size=6)
            p = Problem([(A[:2], [0.0, 0.0]), (A[2:], [0.0])], metric=oracles.metric(rng, 6, kind), reference=u0)
            u = solve(p, solver(policy)).u
            slack = 1.0 if kind == "identity" else 10.0  # the metric's own condition number
            assert np.linalg.norm(A @ u) <= slack * tol.LEAK * np.linalg.norm(A) * np.linalg.norm(u0)
            if kind == "identity":
                expected = oracles.constrained_minimum(A, np.zeros(3), u0=u0) if exponent > -7 else u
                np.testing.assert_allclose(u, expected, atol=1e-6)
