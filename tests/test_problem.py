"""Problem, Equation and Solution: what they take, refuse, keep and work out."""

from __future__ import annotations

import copy
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cartctl import Equation, Problem, Solution, Status
from cartctl.errors import (
    CartctlError,
    MetricError,
    NonFiniteError,
    ParameterError,
    ProblemError,
    ShapeError,
)
from tests import oracles
from tests import tolerances as tol

NAN, INF = float("nan"), float("inf")
A23 = [[1.0, 2.0, 3.0], [4.0, 5.0, 7.0]]
B2 = [0.5, -0.25]


def one(**more):
    """A problem of one good equation, (2, 3), with one thing about it given."""
    return Problem([(A23, B2)], **more)


def equation(**more):
    """A good equation with one thing about it replaced."""
    return Equation(**{"A": A23, "b": B2, "name": "hand", **more})


def asymmetric():
    W = np.eye(3)
    W[0, 2] = 1e-3
    return W


# (what is built, the error, what its line must hold: name, value, expectation)
BAD = {
    "A is a vector": (lambda: equation(A=[1.0, 2.0]), ShapeError, ["hand", "A", "(2,)", "(m, n)"]),
    "A is 3-dimensional": (lambda: equation(A=np.zeros((1, 2, 3))), ShapeError, ["A", "(1, 2, 3)"]),
    "A is ragged": (lambda: equation(A=[[1.0, 2.0], [3.0]]), ShapeError, ["A", "[3.0]", "array of real"]),
    "A is None": (lambda: equation(A=None), ShapeError, ["A", "None", "array"]),
    "A is a string": (lambda: equation(A="jacobian"), ShapeError, ["A", "jacobian", "array of real"]),
    "A holds strings": (lambda: equation(A=[["1", "2", "3"]] * 2), ShapeError, ["A", "'1'", "real"]),
    "A holds None": (lambda: equation(A=[[1.0, None, 3.0]] * 2), ShapeError, ["A", "None", "real"]),
    "A is complex": (lambda: equation(A=np.eye(2) * 1j), ShapeError, ["A", "1.j", "real"]),
    "A holds a huge integer": (lambda: equation(A=[[10**400, 1, 1]] * 2), ShapeError, ["A", "real"]),
    "A holds NaN": (lambda: equation(A=[[1, 2, 3], [4, NAN, 6]]), NonFiniteError, ["A[1, 1]", "nan", "finite"]),
    "A holds inf": (lambda: equation(A=[[1, 2, -INF], [4, 5, 6]]), NonFiniteError, ["A[0, 2]", "-inf", "finite"]),
    "A has no columns": (lambda: Problem([(np.zeros((2, 0)), B2)]), ShapeError, ["A", "(2, 0)", "column"]),
    "b has the wrong size": (lambda: equation(b=[1.0, 2.0, 3.0]), ShapeError, ["hand", "b", "(3,)", "(2,)"]),
    "b is a column": (lambda: equation(b=[[1.0], [2.0]]), ShapeError, ["b", "(2, 1)", "(2,)"]),
    "b is a number": (lambda: equation(b=1.0), ShapeError, ["b", "()", "(2,)"]),
    "b is None": (lambda: equation(b=None), ShapeError, ["b", "None"]),
    "b holds NaN": (lambda: equation(b=[0.0, NAN]), NonFiniteError, ["b[1]", "nan", "finite"]),
    "b holds inf": (lambda: equation(b=[INF, 0.0]), NonFiniteError, ["b[0]", "inf", "finite"]),
    "b is complex": (lambda: equation(b=[1j, 0.0]), ShapeError, ["b", "1j", "real"]),
    "drift has the wrong size": (lambda: equation(drift=[1.0]), ShapeError, ["drift", "(1,)", "(2,)"]),
    "drift holds NaN": (lambda: equation(drift=[NAN, 1.0]), NonFiniteError, ["drift[0]", "nan", "finite"]),
    "fit is unknown": (lambda: equation(fit="exact"), ParameterError, ["fit", "'exact'", "'scale'", "'least_squares'"]),
    "fit is None": (lambda: equation(fit=None), ParameterError, ["fit", "None", "'scale'"]),
    "weight is negative": (lambda: equation(weight=-1.0), ParameterError, ["weight", "-1", "at least 0"]),
    "weight is NaN": (lambda: equation(weight=NAN), NonFiniteError, ["weight", "nan", "finite"]),
    "weight is inf": (lambda: equation(weight=INF), NonFiniteError, ["weight", "inf", "finite"]),
    "weight is a string": (lambda: equation(weight="1"), ParameterError, ["weight", "'1'", "number"]),
    "weight is None": (lambda: equation(weight=None), ParameterError, ["weight", "None", "number"]),
    "weight is complex": (lambda: equation(weight=1j), ParameterError, ["weight", "1j", "number"]),
    "weight is beyond floats": (lambda: equation(weight=10**400), CartctlError, ["weight"]),
    "no equations": (lambda: Problem([]), ProblemError, ["equations", "empty", "at least one"]),
    "equations is None": (lambda: Problem(None), ProblemError, ["equations", "NoneType", "sequence"]),
    "equations is a string": (lambda: Problem("ab"), ProblemError, ["equation 0", "str", "pair"]),
    "equations is an array": (lambda: Problem(np.ones((1, 2, 2))), ProblemError, ["equations", "ndarray", "sequence"]),
    "equations is a bare pair": (lambda: Problem((np.array(A23), B2)), ProblemError, ["equation 0", "pair"]),
    "an equation is a triple": (lambda: Problem([(A23, B2, B2)]), ProblemError, ["equation 0", "tuple", "pair"]),
    "an equation is None": (lambda: Problem([(A23, B2), None]), ProblemError, ["equation 1", "NoneType", "pair"]),
    "equations differ in n": (
        lambda: Problem([(A23, B2), (np.eye(2), B2)]),
        ShapeError,
        ["equation 1", "(2, 2)", "3 columns"],
    ),
    "lower has the wrong size": (lambda: one(lower=[0.0]), ShapeError, ["lower", "(1,)", "(3,)"]),
    "upper is a number": (lambda: one(upper=1.0), ShapeError, ["upper", "()", "(3,)"]),
    "lower holds NaN": (lambda: one(lower=[0, 0, NAN]), NonFiniteError, ["lower[2]", "nan", "+-inf"]),
    "bounds cross": (
        lambda: one(lower=[0, 2, 0], upper=[1, 1, 1]),
        ProblemError,
        ["lower[1]", "2", "upper[1]", "1", "lower <= upper"],
    ),
    "lower is +inf": (lambda: one(lower=[0, INF, 0], upper=[1, INF, 1]), ProblemError, ["lower[1]", "inf"]),
    "lower is +inf, no upper": (lambda: one(lower=[0, INF, 0]), ProblemError, ["lower[1]", "inf"]),
    "upper is -inf, no lower": (lambda: one(upper=[0, 0, -INF]), ProblemError, ["upper[2]", "-inf"]),
    "constraints is an array": (lambda: one(constraints=np.eye(3)), ProblemError, ["constraints", "ndarray", "three"]),
    "constraints is a number": (lambda: one(constraints=3), ProblemError, ["constraints", "int", "three"]),
    "constraints is a pair": (lambda: one(constraints=(A23, B2)), ProblemError, ["constraints", "2", "three"]),
    "C has the wrong columns": (lambda: one(constraints=(np.eye(2), B2, B2)), ShapeError, ["C", "(2, 2)", "(m, 3)"]),
    "C holds inf": (lambda: one(constraints=([[INF, 0, 0]], [0], [1])), NonFiniteError, ["C[0, 0]", "inf"]),
    "c_lower has the wrong size": (lambda: one(constraints=(A23, [0.0], B2)), ShapeError, ["c_lower", "(1,)", "(2,)"]),
    "c_upper holds NaN": (lambda: one(constraints=(A23, B2, [NAN, 1])), NonFiniteError, ["c_upper[0]", "nan"]),
    "constraint rows cross": (
        lambda: one(constraints=(A23, [1, 0], [0, 0])),
        ProblemError,
        ["c_lower[0]", "c_upper[0]", "lower <= upper"],
    ),
    "metric has the wrong size": (lambda: one(metric=[1.0, 2.0]), ShapeError, ["metric", "(2,)", "(3,)"]),
    "metric is not square": (lambda: one(metric=np.ones((3, 2))), ShapeError, ["metric", "(3, 2)", "(3, 3)"]),
    "metric is a number": (lambda: one(metric=2.0), ShapeError, ["metric", "()", "(3, 3)"]),
    "metric is a string": (lambda: one(metric="mass"), ShapeError, ["metric"]),
    "metric is ragged": (lambda: one(metric=[[1.0, 0.0], [0.0]]), ShapeError, ["metric"]),
    "metric is complex": (lambda: one(metric=[1j, 1, 1]), ShapeError, ["metric", "j", "real"]),
    "metric holds NaN": (lambda: one(metric=[1, NAN, 1]), NonFiniteError, ["metric[1]", "nan"]),
    "full metric holds inf": (lambda: one(metric=np.diag([1, INF, 1])), NonFiniteError, ["metric[1, 1]", "inf"]),
    "metric is zero somewhere": (lambda: one(metric=[1, 0, 1]), MetricError, ["metric[1]", "0", "positive"]),
    "metric is negative": (lambda: one(metric=[1, 1, -2]), MetricError, ["metric[2]", "-2", "positive"]),
    "metric is asymmetric": (lambda: one(metric=asymmetric()), MetricError, ["metric", "0.001", "symmetric"]),
    "metric is indefinite": (
        lambda: one(metric=np.diag([1, -2, 3])),
        MetricError,
        ["metric", "-2", "positive definite"],
    ),
    "metric is zero": (lambda: one(metric=np.zeros((3, 3))), MetricError, ["metric", "0", "positive definite"]),
    "metric is semidefinite": (lambda: one(metric=np.ones((3, 3))), MetricError, ["metric", "positive definite"]),
    "reference has the wrong size": (lambda: one(reference=[1.0]), ShapeError, ["reference", "(1,)", "(3,)"]),
    "reference holds NaN": (lambda: one(reference=[0, 0, NAN]), NonFiniteError, ["reference[2]", "nan"]),
    "reference is a string": (lambda: one(reference="home"), ShapeError, ["reference", "home", "real"]),
}


@pytest.mark.parametrize("build, error, words", BAD.values(), ids=BAD.keys())
def test_bad_input_is_named_in_one_line(build, error, words):
    with pytest.raises(CartctlError) as caught:
        build()
    assert isinstance(caught.value, error)
    line = str(caught.value)
    assert "\n" not in line and len(line) < 250
    missing = [w for w in words if w not in line]
    assert not missing, f"{missing} not in {line!r}"


@settings(max_examples=300)
@given(oracles.SEEDS, st.integers(2, 8))
def test_semidefinite_metrics_are_refused(seed, n):
    """Round-off lifts the zero eigenvalue of half of them above zero; they are no metrics all the same."""
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(n, n - 1))
    W = B @ B.T
    with pytest.raises(MetricError):
        Problem([(np.eye(n), np.ones(n))], metric=(W + W.T) / 2.0)


@given(oracles.SEEDS, st.integers(1, 8))
def test_badly_scaled_metrics_are_taken(seed, n):
    """Metres beside millimetres: positive definite, if far from the identity."""
    rng = np.random.default_rng(seed)
    D = np.diag(10.0 ** rng.uniform(-7, 7, n))
    W = D @ oracles.metric(rng, n, "full") @ D
    W = (W + W.T) / 2.0
    np.testing.assert_array_equal(Problem([(np.eye(n), np.ones(n))], metric=W).metric, W)


def test_good_input_in_many_forms():
    drifting = Equation(np.array(A23, order="F"), (1, 2), drift=range(2))
    p = Problem(
        (drifting, [A23, np.float32([1.5, 2])], (np.zeros((0, 3), int), [])),
        lower=[-INF, 0, -1],
        upper=[INF, 0, 1],
        constraints=[[[1, 0, True]], [-INF], [INF]],
        metric=[1, 2, 3],
        reference=np.arange(3, dtype=np.int8),
    )
    assert (p.n, p.sizes, p.bounded) == (3, (2, 2, 0), True)
    arrays = [p.lower, p.upper, *p.constraints, p.metric, p.reference]
    arrays += [a for e in p.equations for a in (e.A, e.b)] + [p.equations[0].drift]
    assert all(type(a) is np.ndarray and a.dtype == np.float64 for a in arrays)
    np.testing.assert_array_equal(p.equations[1].A, A23)
    np.testing.assert_array_equal(p.equations[0].rhs, [1.0, 1.0])
    np.testing.assert_array_equal(p.equations[1].rhs, [1.5, 2.0])


def test_one_bare_equation_is_a_list_of_one():
    assert Problem(equation()).sizes == (2,)


def test_frozen():
    e, p = equation(), one(metric=np.eye(3), reference=[1, 2, 3], lower=[0, 0, 0])
    for thing, field in [(e, "A"), (e, "weight"), (p, "equations"), (p, "metric"), (p, "upper")]:
        with pytest.raises(FrozenInstanceError):
            setattr(thing, field, None)
    for array in (e.A, e.b, p.metric, p.reference, p.lower, p.equations[0].A):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


@given(oracles.SEEDS)
def test_later_changes_of_the_callers_arrays_change_nothing(seed):
    rng = np.random.default_rng(seed)
    given_ = {
        "A": np.asfortranarray(rng.normal(size=(2, 3))),
        "b": rng.normal(size=2),
        "d": rng.normal(size=2),
        "lower": -rng.random(3),
        "upper": rng.random(3),
        "C": rng.normal(size=(1, 3)),
        "c": rng.normal(size=1),
        "W": oracles.metric(rng, 3, "full"),
        "u0": rng.normal(size=3),
    }
    g = copy.deepcopy(given_)
    p = Problem(
        [Equation(g["A"], g["b"], g["d"])], g["lower"], g["upper"], (g["C"], g["c"], g["c"] + 1), g["W"], g["u0"]
    )
    for array in g.values():
        assert array.flags.writeable
        array[...] = 77.0
    e = p.equations[0]
    kept = {"A": e.A, "b": e.b, "d": e.drift, "lower": p.lower, "upper": p.upper, "W": p.metric, "u0": p.reference}
    kept |= {"C": p.constraints[0], "c": p.constraints[1]}
    for name, array in kept.items():
        np.testing.assert_array_equal(array, given_[name], err_msg=name)


def test_without_bounds_and_without_reference():
    p = one(lower=[0, 0, 0], constraints=(A23, B2, B2), metric=[1, 2, 3], reference=[1, 2, 3])
    free = p.without_bounds()
    assert free.lower is free.upper is free.constraints is None and not free.bounded
    np.testing.assert_array_equal(free.metric, p.metric)
    np.testing.assert_array_equal(free.reference, p.reference)
    assert p.without_reference().reference is None and p.without_reference().bounded
    assert p.lower is not None and p.reference is not None


@given(oracles.systems(levels=3), st.booleans())
def test_residuals_by_hand(system, drifting):
    rng, matrices, commands = system
    n = matrices[0].shape[1]
    equations = [
        Equation(A, b, drift=rng.normal(size=b.shape) if drifting else None)
        for A, b in zip(matrices, commands, strict=True)
    ]
    u, s = rng.normal(size=n), rng.random(len(equations))
    solution = Solution(Problem(equations), u, "by hand", scales=s)
    expected = [oracles.residual(e, u, s_k) for e, s_k in zip(equations, s, strict=True)]
    np.testing.assert_allclose(solution.residuals, expected, rtol=tol.EXACT, atol=tol.EXACT)
    unscaled = Solution(Problem(equations), u, "by hand")
    expected = [oracles.residual(e, u) for e in equations]
    np.testing.assert_allclose(unscaled.residuals, expected, rtol=tol.EXACT, atol=tol.EXACT)
    np.testing.assert_array_equal(unscaled.scales, 1.0)


@given(oracles.SEEDS, st.integers(1, 6), st.integers(0, 4))
def test_bound_violation_by_hand(seed, n, rows):
    rng = np.random.default_rng(seed)
    lower = np.where(rng.random(n) < 0.3, -INF, -rng.random(n))
    upper = np.where(rng.random(n) < 0.3, INF, rng.random(n))
    C = rng.normal(size=(rows, n))
    c_lower = np.where(rng.random(rows) < 0.3, -INF, -rng.random(rows))
    c_upper = c_lower + rng.random(rows)
    c_upper[np.isinf(c_lower)] = rng.random(int(np.isinf(c_lower).sum()))
    u = 2.0 * rng.normal(size=n)
    worst = 0.0
    for i in range(n):
        worst = max(worst, lower[i] - u[i], u[i] - upper[i])
    for i in range(rows):
        y = float(np.dot(C[i], u))
        worst = max(worst, c_lower[i] - y, y - c_upper[i])
    p = Problem([(np.eye(n), u)], lower, upper, (C, c_lower, c_upper))
    assert Solution(p, u, "by hand").bound_violation() == pytest.approx(worst, rel=tol.EXACT, abs=tol.EXACT)
    inside = np.clip(u, lower, upper)
    boxed = Problem([(np.eye(n), u)], lower, upper)
    assert Solution(boxed, inside, "by hand").bound_violation() == 0.0
    assert Solution(Problem([(np.eye(n), u)]), u, "by hand").bound_violation() == 0.0


def test_solution_shapes_and_words():
    p = Problem([(A23, B2), (np.eye(3), [1, 2, 3])], constraints=(np.eye(3)[:1], [0], [1]))
    s = Solution(p, np.zeros(3), "by hand", status=Status.INEXACT)
    assert s.saturated.shape == (3,) and s.saturated_rows.shape == (1,) and s.scales.shape == (2,)
    assert s.saturated.dtype.kind == "i" and not s.saturated.any()
    assert "INEXACT" in repr(s) and "by hand" in repr(s)
    assert str(Status.SINGULAR) == "SINGULAR"
    assert len({m.value for m in Status}) == len(Status)
    assert all(m.value.endswith(".") and " " in m.value for m in Status)
