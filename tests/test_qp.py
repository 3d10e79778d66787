"""Weighted tasks as a quadratic programme: optimality conditions, other solvers, limits kept, every backend."""

from __future__ import annotations

import numpy as np
import pytest
import qpsolvers
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, lsq_linear

from cartctl import QP, Equation, Problem, Status, solve
from cartctl.errors import ParameterError
from tests import oracles
from tests import tolerances as tol

INSIDE = 1e-10
AGREE = 1e-8  # two backends, after polishing
SAME = ("daqp", "osqp", "proxqp", "clarabel", "piqp", "quadprog", "highs", "qpalm")
BACKENDS = [name for name in SAME if name in qpsolvers.available_solvers]


@st.composite
def bounded(draw, max_n=9):
    """Tasks of any rank and weight; a box, rows with room in them, a metric, a reference, or none of these."""
    rng, matrices, commands = draw(oracles.systems(levels=3, max_n=max_n))
    n = matrices[0].shape[1]
    equations = [
        Equation(A, 3.0 * b, drift=rng.normal(size=b.shape), weight=10.0 ** rng.uniform(-2.0, 2.0))
        for A, b in zip(matrices, commands, strict=True)
    ]
    lower, upper = -rng.uniform(0.0, 1.5, n), rng.uniform(0.0, 1.5, n)
    kind = draw(st.sampled_from(["around 0", "beside 0", "locked", "open", "none"]))
    if kind == "beside 0":
        lower, upper = lower + 2.0, upper + 2.0
    elif kind == "locked":
        lower[0] = upper[0] = 0.3
    elif kind == "open":
        upper[:] = np.inf
    constraints = None
    if draw(st.booleans()):
        C = rng.normal(size=(int(rng.integers(1, 5)), n))
        inside = C @ rng.uniform(np.maximum(lower, -3.0), np.minimum(upper, 3.0))
        width = rng.uniform(0.0, 0.5, (2, len(C)))
        constraints = (C, inside - width[0], np.where(rng.random(len(C)) < 0.3, np.inf, inside + width[1]))
    bounds = {} if kind == "none" else {"lower": lower, "upper": upper}
    W = oracles.metric(rng, n, draw(oracles.METRICS))
    u0 = rng.normal(size=n) if draw(st.booleans()) else None
    return Problem(equations, constraints=constraints, metric=W, reference=u0, **bounds)


def rho_of(p, damping):
    """(damping ||[w^1/2 A L^-T]||_F)^2, by traces."""
    inverse = np.linalg.inv(oracles.full_metric(p.metric, p.n))
    return damping**2 * sum(e.weight * np.trace(e.A @ inverse @ e.A.T) for e in p.equations)


def check_optimal(p, duals):
    """The conditions of Karush, Kuhn and Tucker, from the problem alone."""
    u0 = np.zeros(p.n) if p.reference is None else p.reference
    pull = duals.rho * oracles.full_metric(p.metric, p.n) @ (duals.u - u0)
    force = pull + sum(e.weight * e.A.T @ (e.A @ duals.u - e.rhs) for e in p.equations) + duals.box
    limits = [(duals.u, p.lower, p.upper, duals.box)]
    if p.constraints is not None:
        force = force + p.constraints[0].T @ duals.rows
        limits.append((p.constraints[0] @ duals.u, *p.constraints[1:], duals.rows))
    size = 1.0 + sum(
        e.weight * oracles.size(e.A) * (oracles.size(e.A @ duals.u) + oracles.size(e.rhs)) for e in p.equations
    )
    np.testing.assert_allclose(force, 0.0, atol=tol.ORACLE * size)
    for values, low, high, z in limits:
        for bound, part in ((high, np.maximum(z, 0.0)), (low, np.maximum(-z, 0.0))):
            gap = np.full(len(values), np.inf) if bound is None else np.abs(bound - values)
            assert (np.minimum(gap, part) <= tol.ORACLE * size).all()  # it pushes only where it touches


# ---------------------------------------------------------------- optimality


@given(bounded())
def test_the_conditions_of_optimality(p):
    solution = QP().solve(p)
    assert solution.bound_violation() <= INSIDE
    check_optimal(p, solution.duals)
    if any(e.A.any() for e in p.equations):
        assert solution.duals.rho == pytest.approx(rho_of(p, 1e-3), rel=1e-9)
    assert solution.status in (Status.OPTIMAL, Status.DAMPED, Status.INEXACT, Status.OVERDETERMINED)


@given(oracles.SEEDS, st.integers(1, 9), oracles.METRICS)
def test_in_a_box_against_scipy(seed, n, kind):
    """Bounded-variable least squares of the taller matrix [A; rho^1/2 L^T]."""
    rng = np.random.default_rng(seed)
    A, b, u0, upper = rng.normal(size=(4, n)), 3.0 * rng.normal(size=4), rng.normal(size=n), rng.uniform(0.1, 1.0, n)
    p = Problem([(A, b)], lower=-upper, upper=upper, metric=oracles.metric(rng, n, kind), reference=u0)
    solver = QP(damping=0.1)
    root = rho_of(p, 0.1) ** 0.5 * np.linalg.cholesky(oracles.full_metric(p.metric, n)).T
    expected = lsq_linear(
        np.vstack([A, root]), np.concatenate([b, root @ u0]), (-upper, upper), method="bvls", tol=1e-14
    )
    np.testing.assert_allclose(solver.solve(p).u, expected.x, atol=tol.ORACLE)


@given(oracles.SEEDS, oracles.METRICS)
def test_without_limits_it_is_damped_least_squares(seed, kind):
    rng = np.random.default_rng(seed)
    p = Problem([(rng.normal(size=(3, 7)), rng.normal(size=3))], metric=oracles.metric(rng, 7, kind))
    solution = QP(damping=0.05).solve(p)
    (e,) = p.equations
    expected = oracles.damped(e.A, e.b, rho_of(p, 0.05) ** 0.5, p.metric)
    np.testing.assert_allclose(solution.u, expected, atol=tol.DAMPED)
    assert solution.backend == "none" and solution.status is Status.DAMPED


def test_weights_weigh_and_do_not_rank():
    heavy, light = Equation([[1.0]], [1.0], weight=3.0), Equation([[1.0]], [0.0], weight=1.0)
    for order in ([heavy, light], [light, heavy]):
        assert QP(damping=1e-6).solve(Problem(order)).u == pytest.approx([0.75])


def test_units_do_not_matter():
    rng = np.random.default_rng(3)
    A, b, upper, C = (
        rng.normal(size=(4, 6)),
        3.0 * rng.normal(size=4),
        rng.uniform(0.2, 1.0, 6),
        rng.normal(size=(2, 6)),
    )
    w = rng.uniform(0.5, 2.0, 6)
    base = Problem([(A, b)], lower=-upper, upper=upper, constraints=(C, [-0.3] * 2, [0.3] * 2), metric=w)
    expected = solve(base, "qp").u
    for t, a, c in [(1e-4, 1e3, 1e5), (1e5, 1e-6, 1e-3)]:
        p = Problem([(a * A, a * t * b)], -t * upper, t * upper, (c * C, [-0.3 * c * t] * 2, [0.3 * c * t] * 2), 7 * w)
        np.testing.assert_allclose(solve(p, "qp").u, t * expected, rtol=1e-8, atol=1e-9 * t)


@given(oracles.SEEDS, oracles.magnitudes(1e-6, 1e6))
def test_limits_hold_however_fast_the_command(seed, speed):
    rng = np.random.default_rng(seed)
    A, C, upper = rng.normal(size=(3, 6)), rng.normal(size=(2, 6)), 10.0 ** rng.uniform(-3, 1, 6)
    p = Problem([(A, speed * rng.normal(size=3))], lower=-upper, upper=upper, constraints=(C, [-0.01] * 2, [0.01] * 2))
    for backend in ("daqp", "osqp"):
        assert QP(backend=backend).solve(p).bound_violation() <= INSIDE


# ---------------------------------------------------------------- statuses


@given(oracles.SEEDS, st.integers(1, 6), st.integers(1, 5))
def test_infeasible_is_a_status(seed, n, rows):
    """By linear programming; the answer then is the one without commands, inside the box."""
    rng = np.random.default_rng(seed)
    lower, upper, C = -rng.uniform(0.1, 1, n), rng.uniform(0.1, 1, n), rng.normal(size=(rows, n))
    middle, width = rng.normal(size=rows), rng.uniform(0.0, 0.6, rows)
    p = Problem(
        [Equation(rng.normal(size=(2, n)), rng.normal(size=2), drift=[0.1, 0.2])],
        lower=lower,
        upper=upper,
        constraints=(C, middle - width, middle + width),
    )
    room = linprog(np.zeros(n), np.vstack([C, -C]), np.r_[middle + width, width - middle], bounds=np.c_[lower, upper])
    solution = QP().solve(p)
    assert (solution.u >= lower).all() and (solution.u <= upper).all()
    if room.status == 0:
        assert solution.status is not Status.INFEASIBLE and solution.bound_violation() <= INSIDE
    else:
        assert solution.status is Status.INFEASIBLE and solution.bound_violation() > 0.0
        still = QP().solve(Problem([Equation(p.equations[0].A, [0.0, 0.0], drift=[0.1, 0.2])])).u
        np.testing.assert_allclose(solution.u, np.minimum(np.maximum(still, lower), upper), atol=tol.ORACLE)
        assert solution.duals is None and QP().duals(p) is None and solution.scales.tolist() == [0.0]


def test_each_status_by_hand():
    box = {"lower": [-1.0, -1.0], "upper": [1.0, 1.0]}
    blocked = QP().solve(Problem([([[1.0, 0.0]], [4.0])], **box))
    assert blocked.status is Status.INEXACT and blocked.saturated.tolist() == [1, 0]
    assert blocked.u == pytest.approx([1.0, 0.0]) and blocked.residuals == pytest.approx([3.0])
    held_back = QP().solve(Problem([([[1.0, 0.0]], [0.5])], **box))
    assert held_back.status is Status.DAMPED and held_back.residuals == pytest.approx([0.5e-6], rel=1e-3)
    redundant = QP().solve(Problem([([[2.0, 1.0]], [2.5])], **box))  # joint 1 at its bound, joint 2 helps out
    assert redundant.status is Status.DAMPED and redundant.u == pytest.approx([1.0, 0.5], abs=1e-5)
    met = QP().solve(Problem([([[1.0, 0.0]], [0.5])], reference=[0.5, 0.3], **box))
    assert met.status is Status.OPTIMAL and met.u == pytest.approx([0.5, 0.3])
    assert QP().damps and QP.stacks


def test_multipliers_by_hand():
    """1/2 (u - 4)^2 with u <= 1 and 2 u <= 2: the bound alone, then the row alone, carries 3."""
    task = Equation([[1.0]], [4.0])
    box = QP().duals(Problem([task], upper=[1.0]))
    assert box.u == pytest.approx([1.0]) and box.box == pytest.approx([3.0], abs=1e-5)
    row = QP().duals(Problem([task], constraints=([[2.0]], [-np.inf], [2.0])))
    assert row.rows == pytest.approx([1.5], abs=1e-5) and row.box == pytest.approx([0.0])
    lower = QP().duals(Problem([task], lower=[5.0]))
    assert lower.box == pytest.approx([-1.0], abs=1e-4)


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
def test_no_number_is_too_large_for_a_status():
    p = Problem([Equation([[1e300, 1.0]], [1.0], weight=1e300)], lower=[0.5, -1.0], upper=[1.0, 1.0])
    solution = QP().solve(p)
    assert solution.status is Status.FAILED and solution.u.tolist() == [0.5, 0.0] and solution.duals is None


# ---------------------------------------------------------------- backends


@pytest.mark.parametrize("backend", BACKENDS)
@settings(max_examples=15)
@given(p=bounded(max_n=7))
def test_every_backend_installed_gives_the_same_answer(backend, p):
    ours, theirs = QP(backend="daqp").solve(p), QP(backend=backend).solve(p)
    np.testing.assert_allclose(theirs.u, ours.u, atol=AGREE)
    assert theirs.status is ours.status and theirs.bound_violation() <= INSIDE
    assert theirs.backend in (backend, "daqp", "none")


def chain(n, rng):
    """Every fourth unknown has a goal, neighbours may differ by 0.3: large, sparse, degenerate."""
    C = np.diff(np.eye(n), axis=0)
    A = np.eye(n)[::4]
    limit = np.full(n - 1, 0.3)
    p = Problem([(A, 2.0 * rng.normal(size=len(A)))], -np.ones(n), np.ones(n), (C, -limit, limit))
    return p


def test_the_choice_between_them():
    rng = np.random.default_rng(0)
    small = QP().solve(chain(40, rng))
    assert small.backend == "daqp" and repr(small).startswith("Solution(qp (daqp), ")
    assert small.solver == "qp"
    from cartctl.solvers.qp_backends import choose
    from cartctl.solvers.qp_program import program_of

    assert choose(program_of(chain(1200, rng), 1e-3)) == "osqp"
    dense = Problem([(rng.normal(size=(6, 1200)), np.ones(6))], lower=-np.ones(1200), upper=np.ones(1200))
    assert choose(program_of(dense, 1e-3)) == "daqp"


@pytest.mark.parametrize("backend", ["daqp", "osqp"])
def test_a_large_sparse_problem(backend):
    p = chain(240, np.random.default_rng(1))
    solution = QP(backend=backend).solve(p)
    assert solution.bound_violation() <= INSIDE
    check_optimal(p, solution.duals)
    np.testing.assert_array_equal(solution.u, QP(backend=backend).solve(p).u)


def test_osqp_prints_nothing(capfd):
    QP(backend="osqp").solve(Problem([([[1.0, 2.0]], [1.0])], lower=[-5.0, -5.0], upper=[5.0, 5.0]))
    out, err = capfd.readouterr()
    assert out == err == ""


def without(monkeypatch, *packages):
    for module in ("qp", "qp_backends"):
        monkeypatch.setattr(f"cartctl.solvers.{module}.installed", lambda name: name not in packages)


def test_a_missing_backend_names_its_command(monkeypatch):
    without(monkeypatch, "daqp", "osqp")
    for name in ("daqp", "osqp"):
        with pytest.raises(ParameterError, match=f"'{name}' needs {name}.*pip install {name}"):
            QP(backend=name)
    monkeypatch.setattr(qpsolvers, "available_solvers", ["osqp"])
    with pytest.raises(ParameterError, match="'proxqp'.*pip install proxsuite"):
        QP(backend="proxqp")


def test_auto_takes_the_one_there_is(monkeypatch):
    without(monkeypatch, "daqp")
    p = Problem([([[1.0, 2.0]], [9.0])], lower=[-1.0, -1.0], upper=[1.0, 1.0])
    assert QP().solve(p).backend == "osqp"


@pytest.mark.parametrize(
    "more",
    [
        {"backend": "nonsense"},
        {"backend": None},
        {"damping": 0.0},
        {"damping": -1.0},
        {"tolerance": 0.0},
        {"max_iterations": 0},
    ],
)
def test_parameters_are_checked(more):
    with pytest.raises(ParameterError, match=next(iter(more))):
        QP(**more)
