"""Reduced gradient: the split, the formula in permuted order, singular tasks, and how it compares with projection."""

from __future__ import annotations

from itertools import combinations
from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cartctl as cc
from cartctl import Equation, Problem, Status, solve
from cartctl.errors import UnsupportedProblem
from tests import oracles
from tests import tolerances as tol

SMALL = [(1, 1), (1, 2), (2, 3), (2, 7), (3, 7), (6, 7), (4, 10), (6, 10), (9, 10), (4, 4), (1, 60), (59, 60)]
LARGE = [(5, 10), (5, 11), (3, 20), (6, 40), (30, 60)]


def chosen_joints(A):
    """The joints that do the task: those that move when there is no reference, for commands in general position."""
    m, n = A.shape
    moving = np.zeros(n, dtype=bool)
    for b in (np.cos(np.arange(m)), np.sin(1.0 + 2.0 * np.arange(m))):
        moving |= solve(Problem([(A, b)]), "reduced-gradient").u != 0.0
    return np.flatnonzero(moving)


def formula(A, c, chosen, u0):
    """[A_a^-1; 0] c + [-A_a^-1 A_b; I] [-(A_a^-1 A_b)^T I] u0, with a permutation matrix and plain inverses."""
    m, n = A.shape
    order = [*chosen, *(j for j in range(n) if j not in set(chosen))]
    T = np.eye(n)[:, order]  # u = T [u_a; u_b]
    permuted = A @ T
    inverse = np.linalg.inv(permuted[:, :m])
    F = np.vstack([-inverse @ permuted[:, m:], np.eye(n - m)])
    return T @ (np.concatenate([inverse @ c, np.zeros(n - m)]) + F @ (F.T @ (T.T @ u0)))


@given(oracles.SEEDS, st.sampled_from(SMALL + LARGE))
def test_the_formula_for_the_chosen_minor(seed, shape):
    rng = np.random.default_rng(seed)
    m, n = shape
    A, b, d, u0 = oracles.matrix(rng, m, n), rng.normal(size=m), rng.normal(size=m), rng.normal(size=n)
    chosen = chosen_joints(A)
    expected = formula(A, b - d, list(chosen), u0)
    solution = solve(Problem([Equation(A, b, drift=d)], reference=u0), "reduced-gradient")
    np.testing.assert_allclose(solution.u, expected, atol=1e-7 * (1.0 + np.linalg.norm(expected)))
    assert solution.status is Status.OPTIMAL and solution.residuals[0] < 1e-8 * (1.0 + np.linalg.norm(expected))
    still = solve(Problem([Equation(A, b, drift=d)]), "reduced-gradient")
    np.testing.assert_allclose(still.u, formula(A, b - d, list(chosen), np.zeros(n)), atol=1e-7 * n)
    assert still.status is Status.OPTIMAL
    assert np.count_nonzero(still.u) <= m  # only the m chosen joints do the task


@given(oracles.SEEDS, st.sampled_from([s for s in SMALL if s[1] <= 10]), oracles.magnitudes(1e-9, 1e9))
def test_no_minor_is_larger(seed, shape, unit):
    rng = np.random.default_rng(seed)
    m, n = shape
    A = unit * rng.normal(size=(m, n))
    chosen = chosen_joints(A)
    assert len(chosen) == m
    ours = abs(np.linalg.det(A[:, chosen] / unit))
    largest = max(abs(np.linalg.det(A[:, list(c)] / unit)) for c in combinations(range(n), m))
    assert ours >= largest * (1.0 - tol.ORACLE)


@given(oracles.SEEDS, st.sampled_from(LARGE))
def test_beyond_the_few_a_pivoted_minor_that_is_regular(seed, shape):
    """Not the largest, but nonsingular whenever rank A = m."""
    rng = np.random.default_rng(seed)
    m, n = shape
    assert comb(n, m) > 210
    A = oracles.matrix_with(rng, m, n, 10.0 ** rng.uniform(-4, 0.5, m))
    chosen = chosen_joints(A)
    assert len(chosen) == m
    low = np.linalg.svd(A, compute_uv=False)[-1]
    s = np.linalg.svd(A[:, chosen], compute_uv=False)
    assert s[-1] > low / (np.sqrt(n) * 2.0**m)
    lost = Problem([(oracles.matrix(rng, m, n, m - 1), rng.normal(size=m))])
    assert solve(lost, "reduced-gradient").status is Status.SINGULAR


@given(oracles.SEEDS, st.sampled_from([(2, 8), (3, 12), (4, 30)]))
def test_sparse_matrices(seed, shape):
    """Whole columns and blocks of zeros, as with frames half-way along a chain: most minors are singular."""
    rng = np.random.default_rng(seed)
    m, n = shape
    A = np.zeros((m, n))
    columns = rng.choice(n, m, replace=False)
    A[:, columns] = oracles.matrix(rng, m, m)
    b, u0 = rng.normal(size=m), rng.normal(size=n)
    solution = solve(Problem([(A, b)], reference=u0), "reduced-gradient")
    assert set(chosen_joints(A)) == set(columns)
    np.testing.assert_allclose(A @ solution.u, b, atol=tol.ORACLE)
    others = np.setdiff1d(np.arange(n), columns)
    np.testing.assert_allclose(solution.u[others], u0[others], atol=tol.ORACLE)


@given(oracles.SEEDS, st.integers(1, 12))
def test_the_reference_never_moves_the_task(seed, n):
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, n + 1))
    A, u0 = oracles.matrix(rng, m, n), rng.normal(size=n)
    u = solve(Problem([(A, np.zeros(m))], reference=u0), "reduced-gradient").u
    assert np.linalg.norm(A @ u) <= 100 * tol.LEAK * np.linalg.norm(A) * (np.linalg.norm(u0) + np.linalg.norm(u))
    if m < n:
        assert u @ u0 > 0.0  # it goes the way the reference points


@given(oracles.systems(levels=2, max_n=9))
def test_any_shape_and_rank(system):
    """Full row rank meets the task; lost rank is SINGULAR and the projected gradient; m > n is least squares."""
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    A, c = np.vstack(matrices), np.concatenate(commands)
    u0 = rng.normal(size=n)
    solution = solve(Problem(list(zip(matrices, commands, strict=True)), reference=u0), "reduced-gradient")
    rank = np.linalg.matrix_rank(A, tol=oracles.GAP) if A.size else 0
    if rank == A.shape[0]:
        assert solution.status is Status.OPTIMAL
        np.testing.assert_allclose(A @ solution.u, c, atol=1e-6)
        return
    assert (solution.status is Status.SINGULAR) == (rank < min(A.shape))
    np.testing.assert_allclose(solution.u, oracles.constrained_minimum(A, c, None, u0), atol=1e-6)


@pytest.mark.parametrize("exponent", range(-14, 0))
def test_near_singular_sweep(exponent):
    """Down to round-off A u = b holds; below it the loss is reported, and nothing explodes there."""
    rng = np.random.default_rng(3)
    for shape in ((3, 6), (5, 12)):
        A = oracles.matrix_with(rng, *shape, [2.0, 1.0, 0.7, 0.5][: shape[0] - 1] + [10.0**exponent])
        b, u0 = rng.normal(size=shape[0]), rng.normal(size=shape[1])
        solution = solve(Problem([(A, b)], reference=u0), "reduced-gradient")
        assert np.isfinite(solution.u).all()
        if solution.status is Status.SINGULAR:
            assert np.linalg.norm(solution.u) < 1e3 and exponent <= -10
        else:
            np.testing.assert_allclose(A @ solution.u, b, atol=1e-14 * np.linalg.norm(solution.u) + tol.ORACLE)


def test_a_metric_is_refused():
    p = Problem([([[1.0, 2.0, 3.0]], [1.0])], metric=[1.0, 2.0, 3.0])
    with pytest.raises(UnsupportedProblem, match="'reduced-gradient'") as caught:
        solve(p, "reduced-gradient")
    assert "metric" in str(caught.value) and "\n" not in str(caught.value)


@given(oracles.SEEDS, oracles.magnitudes(1e-3, 0.999))
def test_prismatic_joints_and_one_turn(seed, length):
    """PPR: z = (l s, -l c, 1) spans the null space. With the slides as minor the reduced gradient is z z^T u0 and the
    projected one z z^T u0 / z^T z: the former is 1 + l^2 times the latter."""
    rng = np.random.default_rng(seed)
    robot = cc.planar([0.0, 0.0, length], joints="XYR")
    q = rng.uniform(-3.0, 3.0, 3)
    J = robot.state(q).jacobian(robot.tool)[:2]
    np.testing.assert_allclose(J, [[1, 0, -length * np.sin(q[2])], [0, 1, length * np.cos(q[2])]], atol=tol.EXACT)
    p = Problem([(J, [0.0, 0.0])], reference=rng.normal(size=3))
    reduced, projected = solve(p, "reduced-gradient").u, solve(p, "projected-gradient").u
    np.testing.assert_allclose(reduced, (1.0 + length**2) * projected, atol=tol.ORACLE)
    z = np.array([length * np.sin(q[2]), -length * np.cos(q[2]), 1.0])
    np.testing.assert_allclose(reduced, z * (z @ p.reference), atol=tol.ORACLE)


@given(oracles.SEEDS, st.floats(1.0, 1.3))
def test_a_longer_link_at_an_angle(seed, length):
    """1 + l^2 beyond l = 1 too, as long as neither l |sin| nor l |cos| is above 1."""
    q3 = np.pi / 4 + np.random.default_rng(seed).integers(4) * np.pi / 2
    J = np.array([[1.0, 0.0, -length * np.sin(q3)], [0.0, 1.0, length * np.cos(q3)]])
    p = Problem([(J, [0.3, -0.4])], reference=[0.5, -1.0, 2.0])
    still = [solve(p.without_reference(), s).u for s in ("reduced-gradient", "projected-gradient")]
    moved = [solve(p, s).u for s in ("reduced-gradient", "projected-gradient")]
    np.testing.assert_allclose(moved[0] - still[0], (1.0 + length**2) * (moved[1] - still[1]), atol=tol.ORACLE)


@given(oracles.SEEDS)
def test_both_gradients_descend_the_same_objective(seed):
    """The reduced one is the gradient in the free joints: d/du_b of u0 . u over the answers of the task."""
    rng = np.random.default_rng(seed)
    A, b, u0 = oracles.matrix(rng, 3, 7), rng.normal(size=3), rng.normal(size=7)
    chosen = chosen_joints(A)
    rest = np.setdiff1d(np.arange(7), chosen)
    u = solve(Problem([(A, b)], reference=u0), "reduced-gradient").u

    def gain(free):
        full = np.zeros(7)
        full[rest] = free
        full[chosen] = np.linalg.solve(A[:, chosen], b - A[:, rest] @ free)
        return u0 @ full

    slope = [(gain(1e-3 * e) - gain(-1e-3 * e)) / 2e-3 for e in np.eye(4)]  # linear: exact at any step
    np.testing.assert_allclose(u[rest], slope, atol=1e-8)
