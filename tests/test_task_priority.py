"""Task priority against null-space least squares: conflicts, repetitions, singularities, any number of tasks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl import Damped, Equation, Problem, Status, TaskPriority, Truncated, solve
from tests import oracles
from tests import tolerances as tol


def ranked(matrices, commands, **more):
    return Problem(list(zip(matrices, commands, strict=True)), **more)


@given(oracles.systems(levels=4, max_n=10), oracles.METRICS, st.booleans())
def test_lexicographic_least_squares(system, kind, steered):
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    W, u0 = oracles.metric(rng, n, kind), rng.normal(size=n) if steered else None
    drifts = [rng.normal(size=c.shape) for c in commands]
    equations = [Equation(A, c + d, drift=d) for A, c, d in zip(matrices, commands, drifts, strict=True)]
    u = solve(Problem(equations, metric=W, reference=u0), "task-priority").u
    expected = oracles.lexicographic(matrices, commands, W, u0)
    np.testing.assert_allclose(u, expected, atol=1e3 * tol.ORACLE * (1.0 + np.linalg.norm(expected)))


@given(oracles.SEEDS)
def test_two_tasks_by_the_textbook(seed):
    """u = A1# b1 + (A2 P1)# (b2 - A2 A1# b1)."""
    rng = np.random.default_rng(seed)
    A1, A2 = oracles.matrix(rng, 2, 7), oracles.matrix(rng, 3, 7)
    b1, b2 = rng.normal(size=2), rng.normal(size=3)
    first = np.linalg.pinv(A1)
    P1 = np.eye(7) - first @ A1
    expected = first @ b1 + np.linalg.pinv(A2 @ P1, rcond=1e-10) @ (b2 - A2 @ first @ b1)
    solution = solve(ranked([A1, A2], [b1, b2]), "task-priority")
    np.testing.assert_allclose(solution.u, expected, atol=tol.ORACLE * (1.0 + np.linalg.norm(expected)))
    assert solution.status is Status.OPTIMAL


@given(oracles.systems(levels=3, max_n=8), oracles.SEEDS)
def test_what_comes_below_never_touches_what_is_above(system, seed):
    """Another task at the end, in conflict or not, leaves every residual above it as it was."""
    _, matrices, commands = system
    rng = np.random.default_rng(seed)
    n = matrices[0].shape[1]
    extra = rng.normal(size=(n, n))
    before = solve(ranked(matrices, commands), "task-priority")
    after = solve(ranked([*matrices, extra], [*commands, 10.0 * rng.normal(size=n)]), "task-priority")
    size = 1.0 + np.linalg.norm(before.u) + np.linalg.norm(after.u)
    for A in matrices:
        np.testing.assert_allclose(A @ after.u, A @ before.u, atol=100 * tol.LEAK * size)


@given(oracles.SEEDS, oracles.magnitudes(1e-8, 1e8))
def test_a_repeated_task_is_not_inverted_again(seed, unit):
    """A2 P1 is zero up to round-off; |u| must not grow, whatever the second task asks and in whatever unit."""
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, 3, 7), rng.normal(size=3)
    once = solve(ranked([A], [b]), "task-priority").u
    again = unit * rng.normal(size=(2, 3)) @ A
    u = solve(ranked([A, again], [b, unit * rng.normal(size=2)]), "task-priority")
    np.testing.assert_allclose(u.u, once, atol=tol.ORACLE)
    assert u.status is Status.SINGULAR


@given(oracles.SEEDS, oracles.METRICS)
def test_an_agreeing_repetition_changes_nothing(seed, kind):
    rng = np.random.default_rng(seed)
    A, b, W = oracles.matrix(rng, 3, 7), rng.normal(size=3), oracles.metric(rng, 7, kind)
    once = solve(ranked([A], [b], metric=W), "task-priority").u
    u = solve(ranked([A, A, A[:2]], [b, b, b[:2]], metric=W), "task-priority")
    np.testing.assert_allclose(u.u, once, atol=tol.ORACLE)
    np.testing.assert_allclose(u.residuals, 0.0, atol=tol.ORACLE)


@given(oracles.SEEDS, st.integers(1, 40))
def test_projected_to_zero_stays_bounded(seed, n):
    """A random square task above fills the space: nothing below it, however loud, adds anything."""
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, n, n), rng.normal(size=n)
    loud = [b, 1e6 * rng.normal(size=3)]
    u = solve(ranked([A, rng.normal(size=(3, n))], loud, reference=rng.normal(size=n)), "task-priority")
    np.testing.assert_allclose(u.u, np.linalg.solve(A, b), atol=tol.ORACLE)


@given(oracles.SEEDS, oracles.magnitudes(1e-14, 1e-1), st.sampled_from([Truncated(), Truncated(1e-4), Damped(1e-2)]))
def test_near_an_algorithmic_singularity(seed, gap, policy):
    """The second task nearly repeats the first: bounded as the policy promises, the first task untouched."""
    rng = np.random.default_rng(seed)
    A1, b1, b2 = oracles.matrix(rng, 2, 6), rng.normal(size=2), rng.normal(size=2)
    A2 = A1 + gap * rng.normal(size=(2, 6))
    alone = solve(ranked([A1], [b1]), TaskPriority(policy)).u
    u = solve(ranked([A1, A2], [b1, b2]), TaskPriority(policy)).u
    left = np.linalg.norm(b2 - A2 @ alone)
    floor = 2.0 * policy.damping if isinstance(policy, Damped) else policy.cutoff * np.linalg.norm(A2)
    assert np.linalg.norm(u - alone) <= left / floor * tol.PROMISE
    assert np.linalg.norm(A1 @ (u - alone)) <= tol.LEAK * np.linalg.norm(A1) * np.linalg.norm(u)


@given(oracles.SEEDS, st.integers(1, 40))
def test_one_task_is_the_projected_gradient(seed, n):
    rng = np.random.default_rng(seed)
    m = int(rng.integers(0, n + 3))
    A, b, u0 = oracles.matrix(rng, m, n), rng.normal(size=m), rng.normal(size=n)
    p = ranked([A], [b], reference=u0)
    np.testing.assert_allclose(solve(p, "task-priority").u, solve(p, "projected-gradient").u, atol=tol.ORACLE)


@given(oracles.SEEDS, oracles.magnitudes(1e-6, 1e6))
def test_units_and_weights_of_the_tasks_do_not_matter(seed, unit):
    """Ranked tasks are not weighed: metres beside millimetres, heavy beside light, the same answer."""
    rng = np.random.default_rng(seed)
    A1, A2, A3 = oracles.matrix(rng, 2, 7), oracles.matrix(rng, 2, 7, 1), oracles.matrix(rng, 4, 7)
    b1, b2, b3 = rng.normal(size=2), rng.normal(size=2), rng.normal(size=4)
    expected = solve(ranked([A1, A2, A3], [b1, b2, b3]), "task-priority").u
    scaled = [Equation(A1, b1), Equation(unit * A2, unit * b2, weight=7.0), Equation(A3, b3, weight=0.1)]
    np.testing.assert_allclose(solve(Problem(scaled), "task-priority").u, expected, atol=1e3 * tol.ORACLE)


@given(oracles.SEEDS)
def test_statuses(seed):
    rng = np.random.default_rng(seed)
    A1, b1 = oracles.matrix(rng, 3, 5), rng.normal(size=3)
    A2 = oracles.matrix(rng, 4, 5)  # full rank in the two directions left, too many rows for them
    solution = solve(ranked([A1, A2], [b1, rng.normal(size=4)]), "task-priority")
    assert solution.status is Status.INEXACT and solution.residuals[0] < tol.ORACLE < solution.residuals[1]
    u = rng.normal(size=5)
    assert solve(ranked([A1, A2], [A1 @ u, A2 @ u]), "task-priority").status is Status.OPTIMAL
    low = oracles.matrix(rng, 2, 5, 1)
    assert solve(ranked([A1, low], [b1, rng.normal(size=2)]), "task-priority").status is Status.SINGULAR
    assert solve(ranked([low, A1[:1]], [[1.0, 2.0], [1.0]]), "task-priority").status is Status.SINGULAR


def test_no_room_left_is_inexact_not_optimal():
    """The space is used up before the last task is even looked at."""
    solution = solve(ranked([np.eye(3), [[1.0, 2.0, 3.0]]], [[1.0, 1.0, 1.0], [0.0]]), "task-priority")
    assert solution.residuals == pytest.approx([0.0, 6.0])
    assert solution.status is Status.INEXACT


@given(oracles.SEEDS, st.integers(2, 10))
def test_empty_tasks_anywhere_change_nothing(seed, n):
    rng = np.random.default_rng(seed)
    A1, A2, b1, b2 = rng.normal(size=(1, n)), rng.normal(size=(1, n)), rng.normal(size=1), rng.normal(size=1)
    none = np.zeros((0, n))
    expected = solve(ranked([A1, A2], [b1, b2]), "task-priority")
    solution = solve(ranked([none, A1, none, none, A2, none], [[], b1, [], [], b2, []]), "task-priority")
    np.testing.assert_allclose(solution.u, expected.u, atol=tol.ORACLE * (1.0 + np.linalg.norm(expected.u)))
    assert solution.status is expected.status is Status.OPTIMAL and solution.residuals.shape == (6,)
