"""Jacobian transpose: fixed and steepest steps, and how it reaches beside the pseudo-inverse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

import cartctl as cc
from cartctl import Equation, Problem, Status, Transpose, solve
from cartctl.errors import CartctlError, NonFiniteError, ParameterError, UnsupportedProblem
from tests import oracles
from tests import tolerances as tol


@given(oracles.systems(levels=3, max_n=9), oracles.magnitudes(1e-3, 1e2), oracles.METRICS)
def test_fixed_step(system, alpha, kind):
    """alpha W^-1 sum_k w_k A_k^T (b_k - d_k)."""
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    W = oracles.metric(rng, n, kind)
    equations, slope = [], np.zeros(n)
    for A, b in zip(matrices, commands, strict=True):
        d, weight = rng.normal(size=b.shape), rng.uniform(0.2, 5.0)
        equations.append(Equation(A, b, drift=d, weight=weight))
        slope += weight * A.T @ (b - d)
    expected = alpha * np.linalg.solve(oracles.full_metric(W, n), slope)
    u = solve(Problem(equations, metric=W), Transpose(alpha)).u
    np.testing.assert_allclose(u, expected, atol=tol.ORACLE * (1.0 + np.linalg.norm(expected)))


@given(oracles.systems(max_n=9), oracles.METRICS)
def test_steepest_step_by_line_search(system, kind):
    """No other multiple of W^-1 A^T c leaves less of c."""
    rng, (A,), (c,) = system
    n = A.shape[1]
    W = oracles.metric(rng, n, kind)
    direction = np.linalg.solve(oracles.full_metric(W, n), A.T @ c)
    solution = solve(Problem([(A, c)], metric=W), "transpose")
    if np.linalg.norm(direction) < oracles.GAP:
        np.testing.assert_allclose(solution.u, 0.0, atol=oracles.GAP * 100)
        return

    def left(alpha):
        return float(np.sum((c - alpha * A @ direction) ** 2))

    best = minimize_scalar(left, bracket=(0.0, 1.0), tol=1e-12)
    assert left(0.0) >= solution.residuals[0] ** 2 - tol.EXACT
    assert solution.residuals[0] ** 2 <= best.fun * (1.0 + tol.ORACLE) + tol.EXACT
    np.testing.assert_allclose(solution.u, best.x * direction, atol=1e-6 * (1.0 + np.linalg.norm(solution.u)))
    for other in rng.uniform(-2.0, 2.0, 20):
        assert left(best.x * other) >= solution.residuals[0] ** 2 - tol.ORACLE


@given(oracles.SEEDS)
def test_along_a_singular_direction_it_is_the_pseudo_inverse(seed):
    """Then one steepest step is all it takes; in general it is not."""
    rng = np.random.default_rng(seed)
    A = oracles.matrix_with(rng, 3, 6, [2.0, 1.0, 0.3])
    U = np.linalg.svd(A)[0]
    for k in range(3):
        p = Problem([(A, U[:, k])])
        np.testing.assert_allclose(solve(p, "transpose").u, solve(p, "pinv").u, atol=tol.ORACLE)
        assert solve(p, "transpose").status is Status.OPTIMAL
    mixed = solve(Problem([(A, U @ [1.0, 1.0, 1.0])]), "transpose")
    assert mixed.residuals[0] > 0.1 and mixed.status is Status.DAMPED


@given(oracles.SEEDS, oracles.magnitudes(1e-9, 1e9))
def test_a_command_that_cannot_be_met_moves_nothing(seed, unit):
    """c outside the range of A: A^T c is round-off, and dividing round-off by round-off must not make motion of it."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    row = rng.integers(-9, 10, n) / 10.0
    if not row.any():
        return
    A = unit * np.outer([0.1, 0.3], row)
    solution = solve(Problem([(A, unit * np.array([3.0, -1.0]))]), "transpose")
    assert np.linalg.norm(solution.u) <= 1e-6
    assert solution.residuals[0] == pytest.approx(unit * np.sqrt(10.0))


@given(oracles.SEEDS, oracles.magnitudes(1e-6, 1e6))
def test_steepest_has_no_unit(seed, unit):
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, 3, 6), rng.normal(size=3)
    expected = solve(Problem([(A, b)]), "transpose").u
    np.testing.assert_allclose(solve(Problem([(unit * A, unit * b)]), "transpose").u, expected, atol=tol.ORACLE)


@given(oracles.SEEDS, st.floats(0.01, 1.9))
def test_any_step_below_two_over_the_largest_square_lessens_the_error(seed, share):
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, 3, 6), rng.normal(size=3)
    alpha = share / np.linalg.norm(A, 2) ** 2
    assert solve(Problem([(A, b)]), Transpose(alpha)).residuals[0] < np.linalg.norm(b)


def test_status():
    p = Problem([(np.eye(2), [1.0, 1.0])])
    assert solve(p, Transpose(1.0)).status is Status.OPTIMAL
    assert solve(p, Transpose(0.5)).status is Status.DAMPED
    assert solve(Problem([([[1.0, 0.0]], [0.0])]), "transpose").status is Status.OPTIMAL


def test_a_reference_is_refused():
    with pytest.raises(UnsupportedProblem, match="'transpose'"):
        solve(Problem([([[1.0, 2.0]], [1.0])], reference=[1.0, 0.0]), "transpose")


@pytest.mark.parametrize(
    "alpha, error",
    [
        (0.0, ParameterError),
        (-1.0, ParameterError),
        ("steep", ParameterError),
        (None, ParameterError),
        (True, ParameterError),
        (float("nan"), NonFiniteError),
        (float("inf"), NonFiniteError),
    ],
)
def test_bad_steps_are_named(alpha, error):
    with pytest.raises(CartctlError, match="alpha") as caught:
        Transpose(alpha)
    assert isinstance(caught.value, error) and "\n" not in str(caught.value)


# ---------------------------------------------------------------- closed loop


def reach(solver, gain, seconds, dt):
    """The tip of a planar 3R on its way to a point: positions (k, 2)."""
    robot = cc.planar([1.0, 0.8, 0.6])
    q, goal = np.array([0.3, 0.9, 0.7]), np.array([1.3, -0.4, 0.0])
    task = cc.FrameTask(robot.tool, "xy", gain=gain, target=goal)
    controller = cc.Controller(robot, task, solver=solver, limits=None, dt=dt)
    points = []
    for k in range(int(seconds / dt)):
        points.append(robot.state(q).position(robot.tool)[:2])
        q = robot.integrate(q, controller.step(q, None, k * dt).velocity * dt)
    return np.array(points), goal[:2]


def off_the_chord(points, goal):
    along = (goal - points[0]) / np.linalg.norm(goal - points[0])
    offset = points - points[0]
    return np.abs(offset[:, 0] * along[1] - offset[:, 1] * along[0]).max()


def test_the_pseudo_inverse_keeps_to_the_chord_and_the_transpose_does_not():
    pinv, goal = reach("pinv", 1.0, 8.0, 1e-3)
    assert off_the_chord(pinv, goal) < 1e-3
    assert np.linalg.norm(pinv[-1] - goal) < 1e-3 < 1.0 < np.linalg.norm(pinv[0] - goal)
    fixed, goal = reach(Transpose(0.3), 2.0, 8.0, 1e-2)
    assert off_the_chord(fixed, goal) > 0.05
    assert np.linalg.norm(fixed[-1] - goal) < 0.05
    steepest, goal = reach("transpose", 2.0, 8.0, 1e-2)
    assert off_the_chord(steepest, goal) > 0.01


@pytest.mark.parametrize("solver", [Transpose(0.2), Transpose(1.0), Transpose()], ids=repr)
def test_at_small_gain_the_error_never_grows(solver):
    points, goal = reach(solver, 0.5, 8.0, 1e-2)
    error = np.linalg.norm(points - goal, axis=1)
    assert (np.diff(error) <= 0.0).all() and error[-1] < 0.5 * error[0]
