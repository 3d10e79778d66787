"""A Solution taken apart: task part, null-space part and Lagrange multipliers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl import Equation, Problem, Status, solve
from cartctl.solvers import get_solver, solvers_that_honour
from tests import oracles
from tests import tolerances as tol

STEERED = [name for name in solvers_that_honour("reference")]
EXACT = ["projected-gradient", "task-priority", "reverse-priority", "task-scaling"]  # least ||u - u0||_W


def kkt(A, c, W, u0):
    """u and lambda of ``min 1/2 (u - u0)^T W (u - u0)`` with A u = c, from the whole system at once."""
    m, n = A.shape
    K = np.block([[W, -A.T], [A, np.zeros((m, m))]])
    both = np.linalg.solve(K, np.concatenate([W @ u0, c]))
    return both[:n], both[n:]


@pytest.mark.parametrize("name", STEERED)
@given(seed=oracles.SEEDS, kind=oracles.METRICS)
def test_the_parts_add_up_and_the_null_part_is_no_task(name, seed, kind):
    rng = np.random.default_rng(seed)
    kind = kind if get_solver(name).takes_metric else "identity"
    A, b, u0 = oracles.matrix(rng, 3, 7), rng.normal(size=3), rng.normal(size=7)
    solution = solve(Problem([(A, b)], metric=oracles.metric(rng, 7, kind), reference=u0), name)
    np.testing.assert_allclose(solution.task_part + solution.null_part, solution.u, atol=tol.EXACT * 10)
    leak = tol.NEARLY_UNDAMPED * 10 if name == "qp" else tol.ORACLE  # weighs u0 against the task, by 1e-6
    np.testing.assert_allclose(A @ solution.null_part, 0.0, atol=leak)
    assert np.linalg.norm(solution.null_part) > 1e-3
    np.testing.assert_allclose(
        solution.task_part, solve(solution.problem.without_reference(), name).u, atol=tol.EXACT * 10
    )
    again = solve(solution.problem, name)
    np.testing.assert_array_equal(again.u, solution.u)  # asking for parts changes nothing


@pytest.mark.parametrize("name", ["pinv", "dls", "transpose", "projected-gradient", "task-priority", "sdls"])
def test_without_a_reference_all_is_task(name):
    rng = np.random.default_rng(2)
    solution = solve(Problem([(oracles.matrix(rng, 3, 6), rng.normal(size=3))]), name)
    np.testing.assert_array_equal(solution.task_part, solution.u)
    assert not solution.null_part.any()


@given(oracles.SEEDS, oracles.METRICS)
def test_the_parts_are_orthogonal_in_the_metric(seed, kind):
    """The task's part is the least-norm answer: W-orthogonal to all that the null space holds."""
    rng = np.random.default_rng(seed)
    A, b, u0, W = oracles.matrix(rng, 3, 7), rng.normal(size=3), rng.normal(size=7), oracles.metric(rng, 7, kind)
    solution = solve(Problem([(A, b)], metric=W, reference=u0), "projected-gradient")
    product = solution.task_part @ oracles.full_metric(W, 7) @ solution.null_part
    assert abs(product) < tol.ORACLE


@pytest.mark.parametrize("name", ["pinv", *EXACT, "main-variables"])
@given(seed=oracles.SEEDS, kind=oracles.METRICS, n=st.integers(1, 12))
def test_multipliers_by_an_independent_kkt_solve(name, seed, kind, n):
    """W (u - u0) = sum_k A_k^T lambda_k, one lambda a row, split as the equations are."""
    rng = np.random.default_rng(seed)
    sizes = [int(rng.integers(0, n + 1))]
    sizes.append(int(rng.integers(0, n + 1 - sizes[0])))
    A, d = oracles.matrix(rng, sum(sizes), n), rng.normal(size=sum(sizes))
    c, W = rng.normal(size=sum(sizes)), oracles.metric(rng, n, kind)
    u0 = rng.normal(size=n) if "reference" in get_solver(name).honours else None
    cut = [sizes[0]]
    equations = [
        Equation(M, x + y, drift=y)
        for M, x, y in zip(np.split(A, cut), np.split(c, cut), np.split(d, cut), strict=True)
    ]
    solution = solve(Problem(equations, metric=W, reference=u0), name)
    F = oracles.full_metric(W, n)
    u, multipliers = kkt(A, c, F, np.zeros(n) if u0 is None else u0)
    np.testing.assert_allclose(solution.u, u, atol=1e-8 * (1.0 + np.linalg.norm(u)))
    assert [x.shape for x in solution.multipliers] == [(size,) for size in sizes]
    scale = 1.0 + np.linalg.norm(multipliers)
    np.testing.assert_allclose(np.concatenate(solution.multipliers), multipliers, atol=1e-7 * scale)


@given(oracles.SEEDS, oracles.METRICS)
def test_multipliers_are_the_price_of_the_command(seed, kind):
    """d(cost)/d(b) = lambda: what one more unit of each row would cost."""
    rng = np.random.default_rng(seed)
    A, b, u0, W = oracles.matrix(rng, 3, 7), rng.normal(size=3), rng.normal(size=7), oracles.metric(rng, 7, kind)
    F = oracles.full_metric(W, 7)

    def cost(b):
        step = solve(Problem([(A, b)], metric=W, reference=u0), "projected-gradient").u - u0
        return 0.5 * step @ F @ step

    h = 1e-5  # quadratic: the central difference is exact
    slope = [(cost(b + h * e) - cost(b - h * e)) / (2 * h) for e in np.eye(3)]
    (multipliers,) = solve(Problem([(A, b)], metric=W, reference=u0), "projected-gradient").multipliers
    np.testing.assert_allclose(multipliers, slope, atol=1e-6 * (1.0 + np.linalg.norm(slope)))


@given(oracles.systems(levels=3, max_n=8), oracles.METRICS)
def test_stationary_for_every_shape_and_rank(system, kind):
    """W (u - u0) lies in the row space, dependent rows or not; of all multipliers the least."""
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    W, u0 = oracles.metric(rng, n, kind), rng.normal(size=n)
    for name, reference in (("pinv", None), ("projected-gradient", u0)):
        p = Problem(list(zip(matrices, commands, strict=True)), metric=W, reference=reference)
        solution = solve(p, name)
        force = oracles.full_metric(W, n) @ (solution.u - (0.0 if reference is None else u0))
        multipliers = solution.multipliers
        assert all(x.shape == c.shape for x, c in zip(multipliers, commands, strict=True))
        total = sum((A.T @ x for A, x in zip(matrices, multipliers, strict=True)), np.zeros(n))
        np.testing.assert_allclose(total, force, atol=1e-7 * (1.0 + np.linalg.norm(force)))
        S, x = np.vstack(matrices), np.concatenate(multipliers)
        if S.size:
            np.testing.assert_allclose(
                x, np.linalg.pinv(S.T, rcond=1e-9) @ force, atol=1e-6 * (1.0 + np.linalg.norm(force))
            )


@given(oracles.SEEDS, st.integers(2, 4))
def test_repeated_rows_share_the_multiplier(seed, copies):
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, 2, 6), rng.normal(size=2)
    (once,) = solve(Problem([(A, b)]), "pinv").multipliers
    shared = solve(Problem([(A, b)] * copies), "pinv").multipliers
    assert len(shared) == copies
    for part in shared:
        np.testing.assert_allclose(part, once / copies, atol=tol.ORACLE)
    (stacked,) = solve(Problem([(np.vstack([A] * copies), np.tile(b, copies))]), "pinv").multipliers
    np.testing.assert_allclose(stacked, np.tile(once / copies, copies), atol=tol.ORACLE)


@given(oracles.SEEDS, oracles.magnitudes(1e-6, 1e6))
def test_sums_of_rows_up_to_round_off(seed, unit):
    """A dependent row that is not an exact copy, in another unit: multipliers of the order of the problem, no 1e16."""
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, 3, 6), rng.normal(size=3)
    mix = rng.normal(size=(2, 3)) * unit
    solution = solve(Problem([(A, b), (mix @ A / 3.0, mix @ b / 3.0)]), "pinv")
    assert np.linalg.norm(np.concatenate(solution.multipliers)) < 1e3 * (1.0 + 1.0 / unit)


def test_zero_and_empty_equations():
    for A, b in ((np.zeros((0, 3)), []), (np.zeros((2, 3)), [1.0, 2.0])):
        solution = solve(Problem([(A, b)], reference=[1.0, 2.0, 3.0]), "projected-gradient")
        (multipliers,) = solution.multipliers
        assert multipliers.shape == (A.shape[0],) and not multipliers.any()
        assert not solution.task_part.any() and solution.null_part == pytest.approx([1.0, 2.0, 3.0])


def test_what_round_off_leaves_of_a_large_reference_is_no_miss():
    """u0 of 700 that the bounds cut to 1e-3: what is left of the task is round-off of u0, not of u."""
    rng = np.random.default_rng(4)
    for solver in ("sns", "projected-gradient"):
        for _ in range(50):
            A, u0 = rng.normal(size=(6, 7)), 700.0 * rng.normal(size=7)
            bounds = {"lower": np.full(7, -1e-3), "upper": np.full(7, 1e-3)} if solver == "sns" else {}
            assert solve(Problem([(A, np.zeros(6))], reference=u0, **bounds), solver).status is Status.OPTIMAL
            assert solve(Problem([(A, np.zeros(6))]), "pinv").status is Status.OPTIMAL
