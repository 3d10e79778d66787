"""Projected gradient: the pseudo-inverse plus the reference where the task does not notice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl import Damped, Equation, Problem, ProjectedGradient, Status, Truncated, solve
from tests import oracles
from tests import tolerances as tol


@given(oracles.systems(max_n=40), oracles.METRICS)
def test_the_nearest_answer_to_the_reference(system, kind):
    """min ||u - u0||_W among the least-squares answers."""
    rng, (A,), (c,) = system
    n = A.shape[1]
    W, u0, d = oracles.metric(rng, n, kind), rng.normal(size=n), rng.normal(size=c.shape)
    u = solve(Problem([Equation(A, c + d, drift=d)], metric=W, reference=u0), "projected-gradient").u
    expected = oracles.constrained_minimum(A, c, W, u0)
    np.testing.assert_allclose(u, expected, atol=tol.ORACLE * (1.0 + np.linalg.norm(expected)))


@given(oracles.SEEDS, oracles.METRICS)
def test_the_formula(seed, kind):
    """A#_W (b - d) + (I - A#_W A) u0 with A#_W = W^-1 A^T (A W^-1 A^T)^-1."""
    rng = np.random.default_rng(seed)
    A, b, d, u0 = oracles.matrix(rng, 3, 7), rng.normal(size=3), rng.normal(size=3), rng.normal(size=7)
    W = oracles.metric(rng, 7, kind)
    F = np.linalg.inv(oracles.full_metric(W, 7))
    inverse = F @ A.T @ np.linalg.inv(A @ F @ A.T)
    expected = inverse @ (b - d) + (np.eye(7) - inverse @ A) @ u0
    solution = solve(Problem([Equation(A, b, drift=d)], metric=W, reference=u0), "projected-gradient")
    np.testing.assert_allclose(solution.u, expected, atol=tol.ORACLE)
    assert solution.status is Status.OPTIMAL


@given(oracles.systems(levels=3, max_n=8))
def test_without_a_reference_it_is_the_pseudo_inverse(system):
    _, matrices, commands = system
    p = Problem(list(zip(matrices, commands, strict=True)))
    np.testing.assert_array_equal(solve(p, "projected-gradient").u, solve(p, "pinv").u)


@pytest.mark.parametrize("policy", [Truncated(), Truncated(0.3), Damped(0.5)], ids=repr)
@given(seed=oracles.SEEDS, smallest=oracles.magnitudes(1e-14, 1.0))
def test_the_projector_is_exact_whatever_the_policy(policy, seed, smallest):
    """The reference never moves the task, even where damping or a coarse cutoff gives some of the task up."""
    rng = np.random.default_rng(seed)
    A = oracles.matrix_with(rng, 3, 6, np.append(rng.uniform(0.3, 3.0, 2), smallest))
    b, u0 = rng.normal(size=3), 10.0 * rng.normal(size=6)
    solver = ProjectedGradient(policy)
    task, both = solve(Problem([(A, b)]), solver).u, solve(Problem([(A, b)], reference=u0), solver).u
    moved = np.linalg.norm(A @ (both - task))
    assert moved <= tol.LEAK * np.linalg.norm(A) * (np.linalg.norm(u0) + np.linalg.norm(task))


@given(oracles.SEEDS, st.integers(1, 9), oracles.METRICS)
def test_no_room_no_null_space_motion(seed, n, kind):
    rng = np.random.default_rng(seed)
    A, b, u0 = oracles.matrix(rng, n, n), rng.normal(size=n), 100.0 * rng.normal(size=n)
    u = solve(Problem([(A, b)], metric=oracles.metric(rng, n, kind), reference=u0), "projected-gradient").u
    np.testing.assert_allclose(u, np.linalg.solve(A, b), atol=tol.ORACLE)


@given(oracles.SEEDS, st.integers(1, 9))
def test_a_task_of_no_rows_leaves_the_reference_alone(seed, n):
    u0 = np.random.default_rng(seed).normal(size=n)
    u = solve(Problem([(np.zeros((0, n)), [])], reference=u0), "projected-gradient").u
    np.testing.assert_array_equal(u, u0)
