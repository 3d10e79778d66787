"""Priorities in three flavours: strict, singularity-robust and reverse, each against its formula."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import null_space

from cartctl import Damped, Equation, Problem, SingularityRobustPriority, Status, TaskPriority, Truncated, solve
from tests import oracles
from tests import tolerances as tol

VARIANTS = ["task-priority", "singularity-robust-priority", "reverse-priority"]
STRICT = ["task-priority", "reverse-priority"]
every_variant = pytest.mark.parametrize("name", VARIANTS)


def ranked(matrices, commands, **more):
    return Problem(list(zip(matrices, commands, strict=True)), **more)


def pinv(A):
    return np.linalg.pinv(A, rcond=oracles.GAP) if A.size else np.zeros(A.T.shape)


def stacked_projector(matrices, n):
    """I - S# S of all rows at once."""
    S = np.vstack([np.zeros((0, n)), *matrices])
    return np.eye(n) - pinv(S) @ S


def recursive_projector(matrices, n):
    """P_k = P_{k-1} - (A_k P_{k-1})# A_k P_{k-1}, as it is printed."""
    P = np.eye(n)
    for A in matrices:
        AP = A @ P
        AP[np.abs(AP) < oracles.GAP] = 0.0
        P = P - pinv(AP) @ AP
    return P


def whitened(matrices, W, u0):
    """(matrices, u0, back) in coordinates where W is the identity."""
    n = matrices[0].shape[1]
    L = np.linalg.cholesky(oracles.full_metric(W, n))
    return [np.linalg.solve(L, A.T).T for A in matrices], L.T @ u0, lambda y: np.linalg.solve(L.T, y)


def independent(rng, sizes, n):
    """Tasks whose rows are all independent, together well-conditioned."""
    S = oracles.matrix(rng, sum(sizes), n)
    return np.split(S, np.cumsum(sizes)[:-1])


# ---------------------------------------------------------------- projectors


@pytest.mark.parametrize("name", ["task-priority", "singularity-robust-priority"])
@given(system=oracles.systems(levels=4, max_n=8))
def test_recursive_projector_equals_stacked_projector(name, system):
    """What is left of a reference after commands of zero is its part in the common null space, column by column."""
    _, matrices, commands = system
    n = matrices[0].shape[1]
    still = [np.zeros_like(c) for c in commands]
    ours = np.column_stack([solve(ranked(matrices, still, reference=e), name).u for e in np.eye(n)])
    np.testing.assert_allclose(ours, stacked_projector(matrices, n), atol=tol.ORACLE)
    np.testing.assert_allclose(ours, recursive_projector(matrices, n), atol=tol.ORACLE * 100)


# ---------------------------------------------------------------- strict


@given(oracles.systems(levels=4, max_n=9), oracles.METRICS)
def test_task_priority_against_null_space_least_squares(system, kind):
    """Level by level ``min ||A_k (u + N y) - c_k||`` with N of the stack above; conflicts and repetitions included."""
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    matrices, commands = [*matrices, matrices[0]], [*commands, commands[0] + 1.0]  # the first again, in conflict
    W, u0 = oracles.metric(rng, n, kind), rng.normal(size=n)
    u = solve(ranked(matrices, commands, metric=W, reference=u0), "task-priority").u
    expected = oracles.lexicographic(matrices, commands, W, u0)
    np.testing.assert_allclose(u, expected, atol=1e3 * tol.ORACLE * (1.0 + np.linalg.norm(expected)))
    floor, above = np.zeros(0), np.zeros((0, n))
    for A, c in zip(matrices, commands, strict=True):  # stationary: no direction that is left lessens the error
        N = null_space(above, rcond=oracles.GAP) if above.shape[0] else np.eye(n)
        np.testing.assert_allclose((A @ N).T @ (A @ u - c), 0.0, atol=1e-6 * (1.0 + np.linalg.norm(u)))
        above, floor = np.vstack([above, A]), np.append(floor, np.linalg.norm(A @ u - c))
    residuals = solve(ranked(matrices, commands, metric=W, reference=u0), "task-priority").residuals
    np.testing.assert_allclose(residuals, floor, atol=tol.ORACLE)


@every_variant
@given(seed=oracles.SEEDS, kind=oracles.METRICS)
def test_independent_tasks_are_met_alike(name, seed, kind):
    """Strict and reverse: all tasks met, nearest to u0 in the metric. The robust one meets the first only."""
    rng = np.random.default_rng(seed)
    matrices = independent(rng, (2, 1, 3), 8)
    commands, u0, W = [rng.normal(size=A.shape[0]) for A in matrices], rng.normal(size=8), oracles.metric(rng, 8, kind)
    solution = solve(ranked(matrices, commands, metric=W, reference=u0), name)
    if name in STRICT:
        expected = oracles.constrained_minimum(np.vstack(matrices), np.concatenate(commands), W, u0)
        np.testing.assert_allclose(solution.u, expected, atol=tol.ORACLE * 10)
        assert solution.status is Status.OPTIMAL
    else:
        assert solution.residuals[0] < tol.ORACLE < 1e-4 < solution.residuals[2]
        assert solution.status is not Status.OPTIMAL


@pytest.mark.parametrize("name", STRICT)
@given(seed=oracles.SEEDS)
def test_independent_tasks_have_no_order(name, seed):
    rng = np.random.default_rng(seed)
    matrices = independent(rng, (2, 1, 2), 7)
    commands = [rng.normal(size=A.shape[0]) for A in matrices]
    expected = solve(ranked(matrices, commands), "task-priority").u
    for order in permutations(range(3)):
        u = solve(ranked([matrices[k] for k in order], [commands[k] for k in order]), name).u
        np.testing.assert_allclose(u, expected, atol=tol.ORACLE * 10)


@every_variant
@given(seed=oracles.SEEDS)
def test_order_matters_where_tasks_conflict(name, seed):
    """Whoever comes first is met."""
    rng = np.random.default_rng(seed)
    A1, A2 = oracles.matrix(rng, 3, 5), oracles.matrix(rng, 3, 5)
    b1, b2 = rng.normal(size=3), rng.normal(size=3)
    one, other = solve(ranked([A1, A2], [b1, b2]), name), solve(ranked([A2, A1], [b2, b1]), name)
    for solution in (one, other):
        assert solution.residuals[0] < 1e-8 * (1.0 + np.linalg.norm(solution.u)) and solution.residuals[1] > 1e-7
        assert solution.status is not Status.OPTIMAL
    assert np.linalg.norm(one.u - other.u) > 1e-6


@every_variant
@given(seed=oracles.SEEDS)
def test_orthogonal_tasks_are_met_by_all(seed, name):
    """Where the rows of the tasks are orthogonal, the three methods and the pseudo-inverse agree."""
    rng = np.random.default_rng(seed)
    Q = np.linalg.qr(rng.normal(size=(8, 8)))[0]
    matrices = [rng.normal(size=(2, 2)) @ Q[:2], rng.normal(size=(1, 3)) @ Q[2:5], rng.normal(size=(2, 2)) @ Q[5:7]]
    commands = [rng.normal(size=A.shape[0]) for A in matrices]
    p = ranked(matrices, commands)
    expected = solve(p, "pinv").u
    np.testing.assert_allclose(solve(p, name).u, expected, atol=tol.ORACLE * (1.0 + np.linalg.norm(expected)) * 100)


# ---------------------------------------------------------------- singularity-robust


@given(oracles.systems(levels=4, max_n=8), oracles.METRICS, st.sampled_from([Truncated(), Damped(0.3)]))
def test_singularity_robust_formula(system, kind, policy):
    """A_1# c_1 + P_1 A_2# c_2 + P_12 A_3# c_3 + ... + P u0 with explicit projectors of the stacked higher tasks."""
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    W, u0 = oracles.metric(rng, n, kind), rng.normal(size=n)
    drifts = [rng.normal(size=c.shape) for c in commands]
    equations = [
        Equation(A, c + d, drift=d, weight=3.0) for A, c, d in zip(matrices, commands, drifts, strict=True)
    ]  # weights do not count
    u = solve(Problem(equations, metric=W, reference=u0), SingularityRobustPriority(policy)).u
    white, y0, back = whitened(matrices, W, u0)
    y = np.zeros(n)
    for k, (A, c) in enumerate(zip(white, commands, strict=True)):
        if isinstance(policy, Damped):
            step = A.T @ np.linalg.solve(A @ A.T + policy.damping**2 * np.eye(A.shape[0]), c)
        else:
            step = pinv(A) @ c
        y = y + stacked_projector(white[:k], n) @ step
    y = y + stacked_projector(white, n) @ y0
    np.testing.assert_allclose(u, back(y), atol=1e-7 * (1.0 + np.linalg.norm(y)))


@given(oracles.SEEDS, oracles.magnitudes(1e-14, 1e-1))
def test_no_algorithmic_singularity(seed, gap):
    """A second task that nearly repeats the first: strict priority grows as 1/gap, the robust one does not."""
    rng = np.random.default_rng(seed)
    A1, b1, b2 = oracles.matrix(rng, 2, 6), rng.normal(size=2), rng.normal(size=2)
    A2 = A1 + gap * oracles.matrix(rng, 2, 6)
    solution = solve(ranked([A1, A2], [b1, b2]), "singularity-robust-priority")
    own = np.linalg.norm(pinv(A1) @ b1) + np.linalg.norm(pinv(A2) @ b2)
    assert np.linalg.norm(solution.u) <= own * tol.PROMISE
    assert solution.status is not Status.SINGULAR and solution.residuals[0] < tol.ORACLE
    if 1e-8 < gap < 1e-3:
        assert np.linalg.norm(solve(ranked([A1, A2], [b1, b2]), "task-priority").u) > 0.01 / gap


@given(oracles.SEEDS)
def test_each_tasks_own_singularity_is_reported(seed):
    rng = np.random.default_rng(seed)
    low, full = oracles.matrix(rng, 2, 6, 1), oracles.matrix(rng, 2, 6)
    for name in VARIANTS:
        for pair in ([low, full], [full, low]):
            p = ranked(pair, [rng.normal(size=2), rng.normal(size=2)])
            assert solve(p, name).status is Status.SINGULAR


# ---------------------------------------------------------------- reverse


def reverse(matrices, commands, u0):
    """u_k = u_{k+1} + T_k (A_k T_k)# (c_k - A_k u_{k+1}), T_k the first m_k columns of pinv([A_k; ...; A_p])."""
    u = np.array(u0)
    for k in reversed(range(len(matrices))):
        A, c = matrices[k], commands[k]
        if A.shape[0] == 0:
            continue
        T = pinv(np.vstack(matrices[k:]))[:, : A.shape[0]]
        u = u + T @ pinv(A @ T) @ (c - A @ u)
    return u


@given(oracles.systems(levels=4, max_n=8), oracles.METRICS, st.booleans())
def test_reverse_priority_formula(system, kind, steered):
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    W, u0 = oracles.metric(rng, n, kind), rng.normal(size=n)
    drifts = [rng.normal(size=c.shape) for c in commands]
    equations = [Equation(A, c + d, drift=d, weight=2.0) for A, c, d in zip(matrices, commands, drifts, strict=True)]
    u = solve(Problem(equations, metric=W, reference=u0 if steered else None), "reverse-priority").u
    white, y0, back = whitened(matrices, W, u0)
    expected = back(reverse(white, commands, y0 if steered else np.zeros(n)))
    np.testing.assert_allclose(u, expected, atol=1e-6 * (1.0 + np.linalg.norm(expected)))


@given(oracles.SEEDS, oracles.METRICS, st.integers(0, 3))
def test_the_first_task_is_met_whatever_is_below(seed, kind, rank):
    """Conflicts, repetitions, lost rank and algorithmic singularities between the lower tasks: task 1 holds exactly."""
    rng = np.random.default_rng(seed)
    A1, b1 = oracles.matrix(rng, 3, 7), rng.normal(size=3)
    A2 = oracles.matrix(rng, 3, 7, rank)
    A3 = rng.normal(size=(2, 3)) @ A2 + (0.0 if seed % 2 else rng.normal(size=(2, 3)) @ A1)
    commands = [b1, rng.normal(size=3), rng.normal(size=2), rng.normal(size=3)]
    p = ranked([A1, A2, A3, A2], commands, metric=oracles.metric(rng, 7, kind))
    solution = solve(p, "reverse-priority")
    assert solution.residuals[0] < 1e-9 * (1.0 + np.linalg.norm(solution.u))


@given(oracles.SEEDS, st.sampled_from([1e-3, 1.0, 1e3]))
def test_the_first_task_is_met_in_any_unit(seed, unit):
    """Metres beside millimetres or kilometres: a lower task repeats rows of the first and cannot make it negligible."""
    rng = np.random.default_rng(seed)
    A1, b1 = oracles.matrix(rng, 2, 6), rng.normal(size=2)
    A2, b2 = np.vstack([A1[0], rng.normal(size=6)]), rng.normal(size=2)
    solution = solve(ranked([unit * A1, A2], [unit * b1, b2]), "reverse-priority")
    assert solution.residuals[0] < 1e-6 * unit * np.linalg.norm(b1)
    assert np.linalg.norm(solution.u) < 1e6


@given(oracles.SEEDS, oracles.magnitudes(1e-14, 1e-1))
def test_near_an_algorithmic_singularity_of_the_lower_tasks(seed, gap):
    """Tasks 2 and 3 nearly repeat each other; task 1 keeps its accuracy, relative to the size of u."""
    rng = np.random.default_rng(seed)
    A1, A2 = independent(rng, (2, 2), 7)
    A3 = A2 + gap * oracles.matrix(rng, 2, 7)
    solution = solve(ranked([A1, A2, A3], [rng.normal(size=2) for _ in range(3)]), "reverse-priority")
    assert np.isfinite(solution.u).all()
    assert solution.residuals[0] <= 1e-12 * (1.0 + np.linalg.norm(solution.u)) * 10.0
    assert np.linalg.norm(solution.u) <= 1e3 * max(1.0, min(1.0 / gap, 1e10))


@every_variant
@given(seed=oracles.SEEDS, n=st.integers(1, 8))
def test_one_task_and_empty_tasks(name, seed, n):
    rng = np.random.default_rng(seed)
    m = int(rng.integers(0, n + 3))
    A, b, u0 = oracles.matrix(rng, m, n), rng.normal(size=m), rng.normal(size=n)
    expected = solve(ranked([A], [b], reference=u0), "projected-gradient").u
    none = np.zeros((0, n))
    for tasks, commands in (([A], [b]), ([none, A, none, none], [[], b, [], []])):
        np.testing.assert_allclose(solve(ranked(tasks, commands, reference=u0), name).u, expected, atol=tol.ORACLE * 10)


def test_a_policy_is_for_the_methods_that_take_one():
    """The robust and the strict one differ in what a damped policy does below."""
    rng = np.random.default_rng(0)
    matrices, commands = independent(rng, (2, 2), 6), [rng.normal(size=2), rng.normal(size=2)]
    answers = [solve(ranked(matrices, commands), s(Damped(0.2))).u for s in (TaskPriority, SingularityRobustPriority)]
    assert np.linalg.norm(answers[0] - answers[1]) > 1e-3
