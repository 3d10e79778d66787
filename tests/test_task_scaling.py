"""Task scaling: the largest s, by linear programming and by trying; bounds that are never left."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from cartctl import Damped, Equation, Problem, SelectivelyDamped, Status, TaskScaling, solve
from cartctl.errors import ParameterError
from tests import oracles
from tests import tolerances as tol

LEFT = 1e-10  # how far outside a bound round-off may put an answer of size one


def answer_at(s, equations, W, u0):
    """u(s) by a KKT system of the weighted stack."""
    roots = [e.weight**0.5 for e in equations]
    A = np.vstack([r * e.A for r, e in zip(roots, equations, strict=True)])
    rows = []
    for r, e in zip(roots, equations, strict=True):
        d = np.zeros_like(e.b) if e.drift is None else e.drift
        rows.append(r * ((s if e.fit == "scale" else 1.0) * e.b - d))
    return oracles.constrained_minimum(A, np.concatenate(rows), W, u0)


def largest_scale(p):
    """max s, 0 <= s <= 1, lower <= u(0) + s (u(1) - u(0)) <= upper and the rows of C; None where there is none."""
    still, full = (answer_at(s, p.equations, p.metric, p.reference) for s in (0.0, 1.0))
    rows, limits = [], []
    for M, low, high in [(np.eye(p.n), p.lower, p.upper), *([p.constraints] if p.constraints else [])]:
        for sign, bound in ((-1.0, low), (1.0, high)):
            if bound is not None:
                finite = np.isfinite(bound)
                rows.append(sign * (M @ (full - still))[finite])
                limits.append(sign * (bound - M @ still)[finite])
    result = linprog([-1.0], A_ub=np.concatenate(rows)[:, None], b_ub=np.concatenate(limits), bounds=[(0.0, 1.0)])
    return (float(result.x[0]), still, full) if result.status == 0 else (None, still, full)


@st.composite
def bounded(draw):
    """A problem with bounds of any kind: finite, infinite, one-sided, far, near, locked; with or without rows."""
    rng, matrices, commands = draw(oracles.systems(levels=2, max_n=7))
    n = matrices[0].shape[1]
    equations = [
        Equation(
            A,
            3.0 * b,
            drift=0.3 * rng.normal(size=b.shape) if draw(st.booleans()) else None,
            fit=draw(st.sampled_from(["scale", "scale", "least_squares"])),
            weight=rng.uniform(0.5, 2.0),
        )
        for A, b in zip(matrices, commands, strict=True)
    ]
    kind = draw(oracles.METRICS)
    lower, upper = -rng.uniform(0.05, 4.0, n), rng.uniform(0.05, 4.0, n)
    lower[rng.random(n) < 0.2] = -np.inf
    upper[rng.random(n) < 0.2] = np.inf
    if draw(st.integers(0, 4)) == 0:
        i = int(rng.integers(n))
        lower[i] = upper[i] = rng.choice([0.0, 0.3])
    bounds = draw(st.sampled_from(["both", "lower", "upper", "none"]))
    C = rng.normal(size=(2, n)) if bounds == "none" or draw(st.booleans()) else None
    return Problem(
        equations,
        lower=lower if bounds in ("both", "lower") else None,
        upper=upper if bounds in ("both", "upper") else None,
        constraints=None if C is None else (C, [-2.0, -np.inf], [np.inf, 1.0]),
        metric=oracles.metric(rng, n, kind),
        reference=0.5 * rng.normal(size=n) if draw(st.booleans()) else None,
    )


@given(bounded())
def test_the_largest_scale(p):
    solution = solve(p, "task-scaling")
    expected, still, full = largest_scale(p)
    slowed = np.array([e.fit == "scale" for e in p.equations])
    rate = np.linalg.norm(full - still)
    if expected is None:
        # round-off may decide either way where a bound is just touched
        edge = max(abs(solution.bound_violation()), 0.0) < 1e-9 and solution.status is not Status.INFEASIBLE
        assert solution.status is Status.INFEASIBLE or edge
        return
    if solution.status is Status.INFEASIBLE:
        s = np.linspace(0.0, 1.0, 1001)[:, None]
        inside = Problem(p.equations, p.lower, p.upper, p.constraints).bounded or p.constraints
        worst = min(violation(p, u) for u in still + s * (full - still))
        assert inside and worst > -1e-8
        return
    np.testing.assert_allclose(solution.scales[~slowed], 1.0)
    if slowed.any() and rate > 1e-6:
        np.testing.assert_allclose(solution.scales[slowed], expected, atol=1e-6 / min(rate, 1.0))
        s = solution.scales[slowed][0]
        np.testing.assert_allclose(solution.u, still + s * (full - still), atol=1e-6 * (1.0 + np.linalg.norm(full)))
        for more in (1e-5, 1e-3, 0.1):  # any faster is too fast
            if s + more <= 1.0 and rate > 1e-3:
                assert violation(p, still + (s + more) * (full - still)) > -1e-8
    assert solution.bound_violation() <= LEFT * (1.0 + np.abs(still).max())
    if (solution.scales < 1.0).any():
        assert solution.status is Status.SCALED


def violation(p, u):
    """The largest amount by which u is outside; negative inside."""
    gaps = [-np.inf]
    for M, low, high in [(np.eye(p.n), p.lower, p.upper), *([p.constraints] if p.constraints else [])]:
        gaps += [] if low is None else [(low - M @ u).max()]
        gaps += [] if high is None else [(M @ u - high).max()]
    return max(gaps)


@settings(max_examples=10)
@given(oracles.SEEDS, st.integers(1, 9))
def test_by_a_dense_scan(seed, n):
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, n + 1))
    A, b, u0 = oracles.matrix(rng, m, n), 10.0 * rng.normal(size=m), 0.1 * rng.normal(size=n)
    upper = rng.uniform(0.2, 2.0, n)
    p = Problem([(A, b)], lower=-upper, upper=upper, reference=u0)
    solution = solve(p, "task-scaling")
    inside = [s for s in np.linspace(0.0, 1.0, 501) if np.all(np.abs(answer_at(s, p.equations, None, u0)) <= upper)]
    assert inside and 0.0 <= solution.scales[0] - inside[-1] <= 1.0 / 500 + 1e-9
    np.testing.assert_allclose(A @ solution.u, solution.scales[0] * b, atol=tol.ORACLE)
    assert solution.residuals[0] < tol.ORACLE
    if solution.scales[0] < 1.0:
        joint = np.flatnonzero(solution.saturated)
        assert joint.size and solution.status is Status.SCALED
        np.testing.assert_allclose(solution.u[joint], solution.saturated[joint] * upper[joint], rtol=1e-9)
    else:
        assert solution.status is Status.OPTIMAL and not solution.saturated.any()


@given(oracles.SEEDS, oracles.magnitudes(1e-9, 1e9), oracles.METRICS)
def test_bounds_hold_to_the_last_digit(seed, speed, kind):
    """At any scale of command, bounds and drift."""
    rng = np.random.default_rng(seed)
    A, W = oracles.matrix(rng, 3, 6), oracles.metric(rng, 6, kind)
    upper = 10.0 ** rng.uniform(-3, 3, 6)
    drift = 1e-6 * rng.normal(size=3)
    p = Problem([Equation(A, speed * rng.normal(size=3), drift=drift)], lower=-upper, upper=upper, metric=W)
    solution = solve(p, "task-scaling")
    assert (np.abs(solution.u) - upper <= LEFT * upper).all()
    assert solution.bound_violation() <= LEFT


@given(oracles.SEEDS)
def test_wide_bounds_change_nothing(seed):
    rng = np.random.default_rng(seed)
    A, b, u0, W = oracles.matrix(rng, 3, 6), rng.normal(size=3), rng.normal(size=6), oracles.metric(rng, 6, "full")
    free = Problem([(A, b)], metric=W, reference=u0)
    expected = solve(free, "projected-gradient").u
    big = 1e3 * np.ones(6)
    for p in (
        free,
        Problem([(A, b)], lower=-big, upper=big, metric=W, reference=u0),
        Problem([(A, b)], lower=np.full(6, -np.inf), upper=np.full(6, np.inf), metric=W, reference=u0),
        Problem([(A, b)], constraints=(np.eye(6), -big, big), metric=W, reference=u0),
        Problem([(A, b)], constraints=(np.zeros((0, 6)), [], []), metric=W, reference=u0),
    ):
        solution = solve(p, "task-scaling")
        np.testing.assert_allclose(solution.u, expected, atol=tol.ORACLE)
        assert solution.status is Status.OPTIMAL and solution.scales == pytest.approx([1.0])


def test_infeasible_by_hand():
    """u = 2 is needed to rest, the box ends at 1: no scale helps, the answer is clipped and says so."""
    p = Problem([Equation([[1.0]], [1.0], drift=[-2.0])], lower=[-1.0], upper=[1.0])
    solution = solve(p, "task-scaling")
    assert solution.status is Status.INFEASIBLE and solution.scales == pytest.approx([0.0])
    assert solution.u == pytest.approx([1.0])
    # a command that brings it back: s = 1 needs u = 0, s = 0 needs u = 2, the smallest that fits is s = 1/2
    back = solve(Problem([Equation([[1.0]], [-2.0], drift=[-2.0])], lower=[-1.0], upper=[1.0]), "task-scaling")
    assert back.status is Status.OPTIMAL and back.u == pytest.approx([0.0]) and back.scales == pytest.approx([1.0])
    # too much of it: between s = 1/8 and 3/8
    much = solve(Problem([Equation([[1.0]], [-8.0], drift=[-2.0])], lower=[-1.0], upper=[1.0]), "task-scaling")
    assert much.status is Status.SCALED and much.u == pytest.approx([-1.0]) and much.scales == pytest.approx([3 / 8])


def test_a_row_that_cannot_be_met_is_infeasible():
    rows = ([[1.0, 1.0]], [5.0], [6.0])
    solution = solve(Problem([([[1.0, 0.0]], [1.0])], constraints=rows), "task-scaling")
    assert solution.status is Status.INFEASIBLE


@pytest.mark.parametrize("at", [0.0, 0.4])
def test_locked_joints(at):
    """lower = upper: a joint that the answer needs stops the task, one that it does not leaves it alone."""
    A, b = np.array([[1.0, 1.0, 0.0]]), [2.0]
    lower, upper = np.array([-5.0, -5.0, at]), np.array([5.0, 5.0, at])
    free = solve(Problem([(A, b)], lower=lower, upper=upper, reference=[0.0, 0.0, at]), "task-scaling")
    assert free.status is Status.OPTIMAL and free.u == pytest.approx([1.0, 1.0, at])
    lower, upper = np.array([-5.0, at, -5.0]), np.array([5.0, at, 5.0])
    needed = solve(Problem([(A, b)], lower=lower, upper=upper), "task-scaling")
    assert needed.u == pytest.approx([at, at, 0.0]) and needed.status is Status.SCALED
    assert needed.scales == pytest.approx([at]) and needed.bound_violation() == 0.0


def test_least_squares_equations_are_not_slowed():
    first = Equation([[1.0, 0.0]], [4.0])
    second = Equation([[0.0, 1.0]], [1.5], fit="least_squares")
    solution = solve(Problem([first, second], lower=[-1.0, -2.0], upper=[1.0, 2.0]), "task-scaling")
    assert solution.scales == pytest.approx([0.25, 1.0]) and solution.u == pytest.approx([1.0, 1.5])
    np.testing.assert_allclose(solution.residuals, 0.0, atol=tol.EXACT)
    too_fast = Equation([[0.0, 1.0]], [3.0], fit="least_squares")
    stuck = solve(Problem([first, too_fast], lower=[-1.0, -2.0], upper=[1.0, 2.0]), "task-scaling")
    assert stuck.status is Status.INFEASIBLE and stuck.u == pytest.approx([0.0, 2.0])


@given(oracles.SEEDS, oracles.METRICS)
def test_the_metric_decides_who_moves(seed, kind):
    rng = np.random.default_rng(seed)
    A, b, W = oracles.matrix(rng, 2, 5), 5.0 * rng.normal(size=2), oracles.metric(rng, 5, kind)
    p = Problem([(A, b)], lower=-np.ones(5), upper=np.ones(5), metric=W)
    full = oracles.constrained_minimum(A, b, W)
    s = min(1.0, 1.0 / np.abs(full).max())
    solution = solve(p, "task-scaling")
    np.testing.assert_allclose(solution.u, s * full, atol=tol.ORACLE)
    np.testing.assert_allclose(solution.scales, [s], atol=tol.ORACLE)


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
def test_rates_near_zero_divided_into_endless_bounds():
    p = Problem([([[1.0, 1e-200]], [1e-120])], lower=[-1e300, -1e300], upper=[1e300, 1e300])
    solution = solve(p, "task-scaling")
    assert solution.status is Status.OPTIMAL and np.isfinite(solution.u).all()


@given(oracles.SEEDS)
def test_both_parts_of_a_scaled_answer(seed):
    """What u0 adds does not move the task, and the task's part delivers the scaled command."""
    rng = np.random.default_rng(seed)
    A, b, u0 = oracles.matrix(rng, 2, 5), 10.0 * rng.normal(size=2), 0.3 * rng.normal(size=5)
    solution = solve(Problem([(A, b)], lower=-np.ones(5), upper=np.ones(5), reference=u0), "task-scaling")
    if solution.status is Status.INFEASIBLE:
        return
    np.testing.assert_allclose(A @ solution.null_part, 0.0, atol=tol.ORACLE)
    np.testing.assert_allclose(A @ solution.task_part, solution.scales[0] * b, atol=tol.ORACLE)


@given(oracles.SEEDS)
def test_any_policy_that_is_linear_in_the_command(seed):
    """A damped scaled answer is A^#(s b - d) with the damped inverse; a policy that looks at the command is refused."""
    rng = np.random.default_rng(seed)
    A, b, d, lam = oracles.matrix(rng, 3, 6), 5.0 * rng.normal(size=3), 0.05 * rng.normal(size=3), 0.3
    damped = A.T @ np.linalg.inv(A @ A.T + lam**2 * np.eye(3))
    p = Problem([Equation(A, b, drift=d)], lower=-np.ones(6), upper=np.ones(6))
    solution = solve(p, TaskScaling(Damped(lam)))
    np.testing.assert_allclose(solution.u, damped @ (solution.scales[0] * b - d), atol=tol.ORACLE)
    assert solution.bound_violation() == 0.0
    assert solution.status in (Status.SCALED, Status.DAMPED)
    with pytest.raises(ParameterError, match="not linear"):
        TaskScaling(SelectivelyDamped())
    with pytest.raises(ParameterError, match="policy is"):
        TaskScaling("damped")
