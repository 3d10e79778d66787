"""One contract for every registered solver, and the registry.

A new method is held to every check here by its line in the registry alone. A check takes an instance and is true of
any method; what is true of one method only stands in that method's own tests.
"""

from __future__ import annotations

import copy
import functools
import pickle
import subprocess
import sys
import warnings
from dataclasses import FrozenInstanceError, fields, is_dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cartctl as cc
from cartctl import Damped, Equation, Pinv, Problem, ProjectedGradient, Status, TaskPriority, Truncated, solve
from cartctl.algebra.inverses import ManipulabilityDamped, NumericalFiltering, SelectivelyDamped, SigmaDamped
from cartctl.errors import CartctlError, ParameterError, SolverNotFound, UnsupportedProblem
from cartctl.solvers import get_solver, solver_class, solvers, solvers_that_honour
from tests import oracles
from tests import tolerances as tol

INSTANCES = {name: get_solver(name) for name in solvers()}
INSTANCES |= {
    "pinv, damped": Pinv(Damped(0.1)),
    "pinv, coarse": Pinv(Truncated(0.05)),
    "projected-gradient, damped": ProjectedGradient(Damped(0.1)),
    "task-priority, damped": TaskPriority(Damped(0.1)),
    "task-priority, coarse": TaskPriority(Truncated(0.05)),
    "pinv, manipulability": Pinv(ManipulabilityDamped()),
    "task-priority, sigma": TaskPriority(SigmaDamped()),
    "projected-gradient, filtering": ProjectedGradient(NumericalFiltering()),
    "pinv, selective": Pinv(SelectivelyDamped()),
}
every_solver = pytest.mark.parametrize("solver", INSTANCES.values(), ids=INSTANCES.keys())


CORE = {"pinv", "dls", "projected-gradient", "task-priority"}  # honour every problem without bounds


def may_refuse(test):
    """A method for some problems only may refuse the others, in one line that names it; the core ones never do."""

    @functools.wraps(test)
    def run(solver, *args, **more):
        try:
            test(solver, *args, **more)
        except UnsupportedProblem as refusal:
            assert solver.name not in CORE
            assert "\n" not in str(refusal) and repr(solver.name) in str(refusal)

    return run


def is_singular(solution, solver):
    """Whether lost rank is owned up to; a gradient step, which inverts nothing, may call itself damped."""
    return solution.status is Status.SINGULAR or (solver.name not in CORE and solution.status is Status.DAMPED)


def problem(solver, matrices, commands, u0=None, **more):
    """The problem with what the solver honours of it."""
    return Problem(list(zip(matrices, commands, strict=True)), reference=reference(solver, u0), **more)


def reference(solver, u0):
    return u0 if "reference" in solver.honours else None


def check_answer(solution, p):
    """What holds for every answer to every problem: shapes, no NaN, a status, residuals that can be checked."""
    count = len(p.equations)
    assert solution.problem is p
    assert solution.u.shape == (p.n,) and solution.u.dtype == np.float64 and np.isfinite(solution.u).all()
    assert solution.scales.shape == solution.residuals.shape == (count,)
    assert not np.isnan(solution.residuals).any() and (solution.residuals >= 0.0).all()
    assert ((solution.scales >= 0.0) & (solution.scales <= 1.0) | np.isnan(solution.scales)).all()
    assert solution.saturated.shape == (p.n,) and np.isin(solution.saturated, (-1, 0, 1)).all()
    assert solution.bound_violation() == 0.0
    assert isinstance(solution.status, Status) and solution.status.name in repr(solution)
    if solution.status is Status.FAILED:
        assert not solution.u.any()
    if solution.status is Status.OPTIMAL:
        for e, left in zip(p.equations, solution.residuals, strict=True):
            round_off = tol.EXACT * oracles.size(e.A) * oracles.size(solution.u)
            assert left <= tol.MET * oracles.size(e.rhs) + round_off < np.inf


# ---------------------------------------------------------------- any problem


@every_solver
@given(system=oracles.systems(levels=4), kind=oracles.METRICS, steered=st.booleans())
@may_refuse
def test_any_shape_any_rank(solver, system, kind, steered):
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    drift = rng.normal(size=commands[0].shape)
    p = Problem(
        [
            Equation(A, b, drift=drift if k == 0 else None, weight=1.0 + k, name=f"task {k}")
            for k, (A, b) in enumerate(zip(matrices, commands, strict=True))
        ],
        metric=oracles.metric(rng, n, kind),
        reference=reference(solver, rng.normal(size=n) if steered else None),
    )
    solution = solve(p, solver)
    check_answer(solution, p)
    assert solution.status is not Status.FAILED
    scales = np.nan_to_num(solution.scales, nan=1.0)  # a skipped task misses all of its command
    expected = [oracles.residual(e, solution.u, s) for e, s in zip(p.equations, scales, strict=True)]
    np.testing.assert_allclose(solution.residuals, expected, rtol=tol.ORACLE, atol=tol.ORACLE)


@every_solver
@pytest.mark.parametrize("n", [1, 2, 7, 40])
@pytest.mark.parametrize("rows", [-1, 0, 1, "n - 1", "n", "n + 3"])
@may_refuse
def test_named_shapes(solver, n, rows):
    m = max(0, eval(str(rows), {"n": n}))
    rng = np.random.default_rng(n)
    p = problem(solver, [oracles.matrix(rng, m, n)], [rng.normal(size=m)], rng.normal(size=n))
    check_answer(solve(p, solver), p)


@every_solver
@given(seed=oracles.SEEDS, exponent=st.integers(-14, -1))
@may_refuse
def test_near_singular_sweep(solver, seed, exponent):
    rng = np.random.default_rng(seed)
    A = oracles.matrix_with(rng, 3, 6, [2.0, 1.0, 10.0**exponent])
    p = problem(solver, [A, rng.normal(size=(2, 6))], [rng.normal(size=3), rng.normal(size=2)], rng.normal(size=6))
    solution = solve(p, solver)
    check_answer(solution, p)
    assert np.linalg.norm(solution.u) < 1e12 and solution.status is not Status.FAILED
    if exponent == -14:
        assert is_singular(solution, solver)


@every_solver
@pytest.mark.parametrize("size", [1e-150, 1e-75, 1e75, 1e150])
@may_refuse
def test_huge_and_tiny_scales_are_solved(solver, size):
    """A and b in absurd units: the same u, since u has the unit of neither; only damping may tell them apart."""
    rng = np.random.default_rng(5)
    for rank in (1, 3):
        A, b, u0 = oracles.matrix(rng, 3, 5, rank), rng.normal(size=3), rng.normal(size=5)
        p = problem(solver, [size * A], [size * b], u0)
        solution = solve(p, solver)
        check_answer(solution, p)
        assert solution.status is not Status.FAILED
        if isinstance(getattr(solver, "policy", None), Truncated):
            expected = solve(problem(solver, [A], [b], u0), solver)
            np.testing.assert_allclose(solution.u, expected.u, atol=tol.ORACLE)
            assert solution.status is expected.status


@every_solver
@given(
    seed=oracles.SEEDS,
    exponents=st.tuples(*[st.sampled_from([-308, -200, -160, 0, 160, 200, 307])] * 5),
    kind=oracles.METRICS,
)
@may_refuse
def test_over_and_underflow_are_a_status(solver, seed, exponents, kind):
    """No exception, no NaN, and never 'optimal' where the equations are not met."""
    rng = np.random.default_rng(seed)
    a1, b1, a2, w, weight = (10.0**e for e in exponents)
    W = oracles.metric(rng, 4, kind)
    p = Problem(
        [
            Equation(a1 * rng.uniform(0.1, 1, (3, 4)), b1 * rng.uniform(0.1, 1, 3), weight=weight),
            Equation(a2 * rng.uniform(0.1, 1, (2, 4)), rng.uniform(0.1, 1, 2)),
        ],
        metric=None if W is None else w * W,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # NumPy may warn, the caller gets a status
        check_answer(solve(p, solver), p)


@every_solver
@pytest.mark.parametrize("size", [1e-300, 1e-200, 1e-170, 1e155, 1e200, 1e300])
@may_refuse
def test_beyond_the_square_root_of_the_range(solver, size):
    """Squares over- or underflow: the right answer or FAILED, not a made-up singularity, not inverted round-off."""
    rng = np.random.default_rng(6)
    for rank in (1, 3):
        A, u = oracles.matrix(rng, 3, 5, rank), rng.normal(size=5)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            p = problem(solver, [size * A], [size * (A @ u)])
            solution = solve(p, solver)
            check_answer(solution, p)
        assert np.linalg.norm(solution.u) <= 10.0 * np.linalg.norm(u)
        if rank == 3 and isinstance(getattr(solver, "policy", None), Truncated):
            assert solution.status in (Status.OPTIMAL, Status.FAILED)
        clamped = isinstance(getattr(solver, "policy", None), SelectivelyDamped)
        clamped = clamped or solver.name == "qp"  # whose damping is relative to the tasks
        if rank == 3 and size > 1.0 and solution.status is not Status.FAILED and not clamped:
            np.testing.assert_allclose(A @ solution.u, A @ u, atol=tol.ORACLE)  # no damping is felt up here


def test_a_fast_answer_hides_no_conflict():
    """|u| = 1e9 from one equation is no excuse for another one missed by 0.7."""
    fast, conflict = ([[1e-9, 0.0]], [1.0]), ([[0.0, 1.0], [0.0, 1.0]], [0.0, 1.0])
    solution = solve(Problem([fast, conflict]), "task-priority")
    assert solution.residuals[1] == pytest.approx(0.5**0.5)
    assert solution.status is Status.INEXACT
    solution = solve(Problem([(np.vstack([fast[0], conflict[0]]), [1.0, 0.0, 1.0])]), "pinv")
    assert solution.status is Status.INEXACT


@every_solver
@given(seed=oracles.SEEDS, n=st.integers(1, 12), kind=oracles.METRICS)
@may_refuse
def test_no_rows_is_met_by_the_reference(solver, seed, n, kind):
    rng = np.random.default_rng(seed)
    u0 = rng.normal(size=n)
    p = problem(solver, [np.zeros((0, n))] * 2, [[]] * 2, u0, metric=oracles.metric(rng, n, kind))
    solution = solve(p, solver)
    expected = u0 if "reference" in solver.honours else np.zeros(n)
    np.testing.assert_allclose(solution.u, expected, atol=tol.EXACT * 10)
    assert solution.status is Status.OPTIMAL and not solution.residuals.any()


@every_solver
@given(seed=oracles.SEEDS, n=st.integers(1, 12), m=st.integers(1, 5))
@may_refuse
def test_a_zero_matrix_moves_nothing(solver, seed, n, m):
    rng = np.random.default_rng(seed)
    b, u0 = rng.normal(size=m), rng.normal(size=n)
    solution = solve(problem(solver, [np.zeros((m, n))], [b], u0), solver)
    np.testing.assert_allclose(solution.u, u0 if "reference" in solver.honours else 0.0, atol=tol.EXACT)
    assert is_singular(solution, solver)
    assert solution.residuals == pytest.approx(solution.scales * np.linalg.norm(b))


@every_solver
@given(seed=oracles.SEEDS, copies=st.integers(2, 5))
@may_refuse
def test_repeated_tasks_stay_bounded(solver, seed, copies):
    rng = np.random.default_rng(seed)
    A, b = oracles.matrix(rng, 3, 7), rng.normal(size=3)
    once = solve(problem(solver, [A], [b]), solver).u
    p = problem(solver, [A] * copies, [b] * copies)
    solution = solve(p, solver)
    check_answer(solution, p)
    if solver.name == "reduced-gradient":  # without a regular minor it falls back on the pseudo-inverse, and says so
        once = solve(Problem([(A, b)]), "pinv").u
        assert solution.status is Status.SINGULAR
    np.testing.assert_allclose(solution.u, once, atol=0.2 * np.linalg.norm(once))  # damping counts copies
    assert np.linalg.norm(solution.u) <= 1.2 * np.linalg.norm(once)


# ---------------------------------------------------------------- symmetries


@every_solver
@given(system=oracles.systems(levels=3, max_n=8), kind=oracles.METRICS)
@may_refuse
def test_joints_have_no_order(solver, system, kind):
    """Permuted unknowns, permuted answer."""
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    order = rng.permutation(n)
    u0, W = rng.normal(size=n), oracles.metric(rng, n, kind)
    permuted = None if W is None else W[order] if W.ndim == 1 else W[np.ix_(order, order)]
    u = solve(problem(solver, matrices, commands, u0, metric=W), solver).u
    v = solve(problem(solver, [A[:, order] for A in matrices], commands, u0[order], metric=permuted), solver).u
    np.testing.assert_allclose(v, u[order], atol=tol.ORACLE * (1.0 + np.linalg.norm(u)) * 1e3)


@every_solver
@given(seed=oracles.SEEDS)
@may_refuse
def test_one_metric_in_two_forms(solver, seed):
    rng = np.random.default_rng(seed)
    A, b, w, u0 = oracles.matrix(rng, 3, 6), rng.normal(size=3), rng.uniform(0.3, 3.0, 6), rng.normal(size=6)
    answers = [solve(problem(solver, [A], [b], u0, metric=W), solver).u for W in (w, np.diag(w))]
    np.testing.assert_allclose(answers[0], answers[1], atol=tol.ORACLE)
    plain = [solve(problem(solver, [A], [b], u0, metric=W), solver).u for W in (None, np.ones(6), np.eye(6))]
    np.testing.assert_allclose(plain[0], plain[1], atol=tol.ORACLE)
    np.testing.assert_allclose(plain[0], plain[2], atol=tol.ORACLE)
    assert np.linalg.norm(answers[0] - plain[0]) > tol.MET  # the metric is not ignored


@every_solver
@given(seed=oracles.SEEDS)
@may_refuse
def test_drift_is_the_other_side_of_the_command(solver, seed):
    """Without scaling only b - d counts."""
    rng = np.random.default_rng(seed)
    A, b, d = oracles.matrix(rng, 3, 6), rng.normal(size=3), rng.normal(size=3)
    u = solve(Problem([Equation(A, b, drift=d)]), solver).u
    np.testing.assert_allclose(u, solve(Problem([(A, b - d)]), solver).u, atol=tol.EXACT)
    assert np.linalg.norm(u - solve(Problem([(A, b)]), solver).u) > tol.MET


# ---------------------------------------------------------------- manners


@every_solver
@given(system=oracles.systems(levels=3, max_n=7), kind=oracles.METRICS)
@may_refuse
def test_inputs_are_left_alone_and_answers_repeat(solver, system, kind):
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    p = problem(solver, matrices, commands, rng.normal(size=n), metric=oracles.metric(rng, n, kind))
    before = copy.deepcopy(p)
    first = solve(p, solver).u
    kept = first.copy()
    first += 1.0  # the caller's to spoil
    np.testing.assert_array_equal(solve(p, solver).u, kept)
    for e, f in zip(p.equations, before.equations, strict=True):
        np.testing.assert_array_equal(e.A, f.A)
        np.testing.assert_array_equal(e.b, f.b)
    for name in ("metric", "reference"):
        if getattr(p, name) is not None:
            np.testing.assert_array_equal(getattr(p, name), getattr(before, name))


@every_solver
def test_frozen_dataclass_that_pickles(solver):
    assert is_dataclass(solver)
    for field in fields(solver):
        with pytest.raises(FrozenInstanceError):
            setattr(solver, field.name, None)
    with pytest.raises((FrozenInstanceError, AttributeError, TypeError)):
        solver.something = 1
    again = pickle.loads(pickle.dumps(solver))
    assert again == solver and hash(again) == hash(solver)


REFUSED = {
    "bounds": ({"lower": [-1.0, -1.0, -1.0]}, "problem.without_bounds()", "without_bounds"),
    "constraints": ({"constraints": (np.eye(3), [-1] * 3, [1] * 3)}, "problem.without_bounds()", "without_bounds"),
    "reference": ({"reference": [1.0, 2.0, 3.0]}, "problem.without_reference()", "without_reference"),
}


@every_solver
@pytest.mark.parametrize("feature", REFUSED)
def test_what_is_not_honoured_is_refused_with_the_remedy(solver, feature):
    more, remedy, method = REFUSED[feature]
    p = Problem([([[1.0, 2.0, 3.0], [0.0, 1.0, -1.0], [2.0, 0.0, 1.0]], [1.0, 2.0, 0.5])], **more)
    if feature in solver.honours:
        check_answer(solve(p, solver), p)
        return
    with pytest.raises(UnsupportedProblem) as caught:
        solve(p, solver)
    line = str(caught.value)
    assert "\n" not in line and remedy in line and repr(solver.name) in line
    assert all(repr(name) in line for name in solvers_that_honour(feature))
    assert isinstance(caught.value, CartctlError)
    free = getattr(p, method)()
    check_answer(solve(free, solver), free)


@pytest.mark.parametrize("more", [{"upper": [1.0, np.inf, 2.0]}, {"lower": [-np.inf] * 3, "upper": [np.inf] * 3}])
def test_one_sided_and_infinite_bounds_are_bounds(more):
    with pytest.raises(UnsupportedProblem):
        solve(Problem([([[1.0, 2.0, 3.0]], [1.0])], **more), "pinv")


# ---------------------------------------------------------------- registry


def test_every_solver_is_listed_with_a_line():
    listed = solvers()
    assert {"pinv", "dls", "projected-gradient", "task-priority"} <= set(listed)
    for name, line in listed.items():
        assert line.endswith(".") and "\n" not in line and len(line) > 20
        assert solver_class(name).name == name
        assert solver_class(name)() == get_solver(name)
    assert len(set(listed.values())) == len(listed)


def test_by_name_by_class_by_instance():
    p = Problem([([[1.0, 2.0], [3.0, -1.0]], [1.0, 2.0])])
    for name in solvers():
        cls = solver_class(name)
        by_name, by_class, by_instance = (solve(p, s) for s in (name, cls, cls()))
        np.testing.assert_array_equal(by_name.u, by_class.u)
        np.testing.assert_array_equal(by_name.u, by_instance.u)
        assert by_name.solver == by_class.solver == by_instance.solver == name
    assert solve(p).solver == "pinv"


def test_a_users_own_solver():
    class Transpose(cc.EquationSolver):
        name = "mine"

        def _impl(self, systems, problem, u0):
            A, c, _ = systems[0]
            return type("A", (), {"u": A.T @ c, "lost_rank": False})

    p = Problem([([[1.0, 2.0]], [1.0])], metric=[1.0, 4.0])
    solution = solve(p, Transpose())
    np.testing.assert_allclose(solution.u, [1.0, 0.5])  # W^-1 A^T c
    assert solution.solver == "mine"
    with pytest.raises(UnsupportedProblem, match="'mine'"):
        solve(Problem([([[1.0, 2.0]], [1.0])], reference=[1.0, 1.0]), Transpose)


@pytest.mark.parametrize(
    "solver, error, words",
    [
        ("pnv", SolverNotFound, ["solver", "'pnv'", "'pinv'"]),
        ("PINV", SolverNotFound, ["'PINV'", "'pinv'"]),
        ("newton", SolverNotFound, ["'newton'", *cc.solvers()]),
        ("", SolverNotFound, ["''", "pinv"]),
        (None, ParameterError, ["solver", "None", "cc.solvers()"]),
        (3, ParameterError, ["solver", "3", "cc.solvers()"]),
        (np.eye(1), ParameterError, ["solver", "cc.solvers()"]),
        (Problem, ParameterError, ["solver", "Problem", "cc.solvers()"]),
        (cc.Solver, CartctlError, ["Solver"]),
        (cc.EquationSolver, CartctlError, ["EquationSolver"]),
    ],
)
def test_unknown_solvers_are_named_in_one_line(solver, error, words):
    with pytest.raises(CartctlError) as caught:
        solve(Problem([([[1.0]], [1.0])]), solver)
    assert isinstance(caught.value, error)
    line = str(caught.value)
    assert "\n" not in line and all(w in line for w in words), line


@pytest.mark.parametrize("p", [None, [([[1.0]], [1.0])], "problem"])
def test_only_a_problem_is_solved(p):
    with pytest.raises(ParameterError, match=r"problem is a \w+; expected a cc.Problem"):
        solve(p)


@pytest.mark.parametrize("first", ["cc.Pinv", "cc.solve", "import cartctl.solvers", "cc.solvers()", "0"])
def test_the_registry_survives_its_namesake_package(first):
    """``cc.solvers()`` works whatever was imported before it, as does ``import cartctl.solvers`` after it."""
    code = f"import cartctl as cc\n{first}\nassert 'pinv' in cc.solvers()\nimport cartctl.solvers as module\n"
    code += "assert module.solve is cc.solve\nfrom cartctl.solvers import solvers\nassert solvers() == cc.solvers()"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
