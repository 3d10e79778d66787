"""Exact scaling on arrays that stay: the same answers as by a Problem, and words for what cannot be one."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import cartctl as cc
from cartctl.errors import NonFiniteError, ParameterError, ProblemError, ShapeError
from tests import joint_rollouts as jr

SHAPES = [
    {"n": 7, "rows": [6]},
    {"n": 7, "rows": [3, 2, 1]},
    {"n": 7, "rows": [6, 7], "fits": ["scale", "least_squares"], "reference": True},
    {"n": 10, "rows": [4, 3], "constraints": 3, "drift": True},
    {"n": 4, "rows": [2, 4], "fits": ["least_squares", "least_squares"], "bounds": False},
    {"n": 3, "rows": [0, 2], "drift": True, "reference": True},
]


def filled(prepared: cc.Prepared, rng: np.random.Generator, reach: float) -> None:
    """Random numbers in all there is; u = 0 keeps the bounds and the rows."""
    for k, A in enumerate(prepared.A):
        A[:] = rng.normal(size=A.shape)
        prepared.b[k][:] = reach * rng.normal(size=len(A))
    for d in getattr(prepared, "drift", ()):
        d[:] = 0.1 * rng.normal(size=len(d))
    if hasattr(prepared, "C"):
        prepared.C[:] = rng.normal(size=prepared.C.shape)
    for side, sign in (("lower", -1.0), ("upper", 1.0), ("c_lower", -1.0), ("c_upper", 1.0)):
        if hasattr(prepared, side):
            bound = getattr(prepared, side)
            bound[:] = sign * rng.uniform(0.1, 2.0, len(bound))
    if hasattr(prepared, "reference"):
        prepared.reference[:] = 0.3 * rng.normal(size=len(prepared.reference))


@pytest.mark.skipif(not jr.COMPILED, reason="takes long interpreted")
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape['n']}-{shape['rows']}")
@pytest.mark.parametrize("warm", [False, True])
def test_the_same_answer_as_by_a_problem(shape, warm):
    rng = np.random.default_rng(3)
    prepared = cc.Prepared(**shape)
    met = set()
    for turn in range(150):
        filled(prepared, rng, float(rng.choice([0.1, 1.0, 10.0])))
        status, solution = prepared.solve(warm), cc.solve(prepared.problem(), "sns")
        met.add(status)
        np.testing.assert_allclose(prepared.scales, solution.scales, atol=0.0 if not warm else 1e-9, rtol=0.0)
        np.testing.assert_allclose(prepared.u, solution.u, atol=0.0 if not warm else 1e-9, rtol=0.0)
        if solution.status is not cc.Status.INEXACT:
            assert status is solution.status, turn
        else:
            assert status is cc.Status.OPTIMAL
    assert len(met) > 1 or shape.get("bounds") is False


def test_one_task_step_after_step():
    """Reused with other numbers, also after a refusal, it forgets the last problem but for its active bounds."""
    prepared = cc.Prepared(3, [1])
    prepared.A[0][:], prepared.lower[:], prepared.upper[:] = 1.0, -1.0, [1.0, 1.0, 0.2]
    for b, s in [(2.4, 2.2 / 2.4), (1.0, 1.0), (-6.0, 0.5)]:
        prepared.b[0][:] = b
        assert prepared.solve() is (cc.Status.OPTIMAL if s == 1.0 else cc.Status.SCALED)
        np.testing.assert_allclose(prepared.scales, [s], rtol=1e-12)
        np.testing.assert_allclose(prepared.u.sum(), s * b, rtol=1e-12)
        prepared.A[0][0, 0] = np.nan
        with pytest.raises(NonFiniteError, match="'level 0': A"):
            prepared.solve()
        prepared.A[0][0, 0] = 1.0
    assert prepared.problem().equations[0].b == [-6.0]


def test_what_is_left_to_the_general_way():
    prepared = cc.Prepared(2, [1], constraints=1)
    prepared.A[0][:], prepared.b[0][:], prepared.C[:] = [[1.0, 0.0]], 0.5, [[0.0, 1.0]]
    prepared.lower[:], prepared.upper[:], prepared.c_lower[:], prepared.c_upper[:] = -1.0, 1.0, 3.0, 4.0
    assert prepared.solve() is cc.Status.INFEASIBLE  # the row cannot be kept: missed by as little as may be
    np.testing.assert_allclose(prepared.u, [0.5, 1.0], atol=1e-12)
    prepared.c_lower[:], prepared.A[0][:] = 0.0, [[1e130, 0.0]]
    prepared.b[0][:] = 1e129
    assert prepared.solve() is cc.Status.OPTIMAL
    np.testing.assert_allclose(prepared.u, [0.1, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    "name, value, error, words",
    [
        ("reference", np.inf, NonFiniteError, "reference"),
        ("C", np.nan, NonFiniteError, "C"),
        ("sizes", np.nan, NonFiniteError, "size"),
        ("sizes", -1.0, ParameterError, "size"),
        ("lower", 3.0, ProblemError, "lower"),
        ("lower", np.inf, ProblemError, "lower"),
        ("upper", -np.inf, ProblemError, "upper"),
        ("upper", np.nan, NonFiniteError, "upper"),
        ("c_lower", 2.0, ProblemError, "lower"),
        ("c_lower", np.inf, ProblemError, "lower"),
    ],
)
def test_what_is_no_problem_is_named_and_the_last_answer_stays(name, value, error, words):
    prepared = cc.Prepared(2, [1], constraints=1, reference=True)
    prepared.lower[:], prepared.upper[:], prepared.c_lower[:], prepared.c_upper[:] = -1.0, 1.0, -1.0, 1.0
    prepared.A[0][:], prepared.b[0][:] = 1.0, 1.0
    assert prepared.solve() is cc.Status.OPTIMAL
    getattr(prepared, name)[:] = value
    with pytest.raises(error, match=words):
        prepared.solve()
    np.testing.assert_allclose(prepared.u, 0.5)


def test_a_number_of_a_level_names_the_level():
    prepared = cc.Prepared(2, [1, 1])
    prepared.b[1][:] = np.nan
    with pytest.raises(NonFiniteError, match="level 1"):
        prepared.solve()


@pytest.mark.parametrize("bounds", [True, False])
def test_no_number_is_ever_none_in_an_answer(bounds):
    """Finite numbers 1e200 apart: what overflows is FAILED, as by a Problem."""
    rng = np.random.default_rng(8)
    prepared = cc.Prepared(3, [2, 2], ["scale", "least_squares"], bounds=bounds)
    failed = 0
    for _ in range(300):
        for A, b in zip(prepared.A, prepared.b, strict=True):
            A[:] = rng.normal(size=A.shape) * 10.0 ** rng.uniform(-200, 200, (len(A), 1))
            b[:] = rng.normal(size=len(b)) * 10.0 ** rng.uniform(-200, 200)
        if bounds:
            prepared.lower[:], prepared.upper[:] = -1.0, 10.0 ** rng.uniform(-200, 200)
        status = prepared.solve()
        failed += status is cc.Status.FAILED
        assert np.isfinite(prepared.u).all() and (status is not cc.Status.FAILED or (prepared.scales == 1.0).all())
    assert bounds or failed > 0
    prepared = cc.Prepared(2, [1], bounds=False)
    prepared.A[0][:], prepared.b[0][:] = 1e-100, 1e250
    assert prepared.solve() is cc.Status.FAILED and (prepared.u == 0.0).all()


def test_arrays_cannot_be_replaced_and_those_that_are_not_there_say_so():
    prepared = cc.Prepared(2, [1], bounds=False)
    for name in ("A", "b", "u", "lower", "foo"):
        with pytest.raises(ParameterError, match=f"{name} cannot be set; expected an array to be filled in place"):
            setattr(prepared, name, np.zeros(2))
    with pytest.raises(AttributeError, match=r"there is no lower .* expected cc.Prepared\(..., bounds=True\)"):
        prepared.lower[:] = -1.0
    with pytest.raises(AttributeError, match="constraints=how many rows"):
        prepared.C[:] = 1.0
    with pytest.raises(AttributeError, match="has no 'foo'"):
        _ = prepared.foo
    assert repr(prepared).startswith("Prepared(n=2, rows=[1], fits=['scale'], bounds=False")


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_a_copy_is_one_of_its_own(copied):
    prepared = cc.Prepared(2, [1], constraints=1, drift=True)
    prepared.A[0][:], prepared.b[0][:], prepared.lower[:], prepared.upper[:] = 1.0, 1.0, -1.0, 1.0
    prepared.solve()
    other = copied(prepared)
    np.testing.assert_array_equal(other.u, prepared.u)
    other.b[0][:] = -1.0
    assert other.solve() is cc.Status.OPTIMAL
    np.testing.assert_allclose(other.u, [-0.5, -0.5])
    np.testing.assert_allclose(prepared.u, [0.5, 0.5])


@pytest.mark.parametrize("b", [1e11, 1e14, 1e15, 1e40, 1e300])
def test_a_command_out_of_all_proportion_is_slowed_like_any_other(b):
    """Its scale, 2 / b, would be lost in the round-off of 1; u is what it would be for b = 4."""
    prepared = cc.Prepared(2, [1, 1])
    prepared.A[0][:], prepared.A[1][:], prepared.b[0][:], prepared.b[1][:] = 1.0, [[1.0, -1.0]], b, 0.5
    prepared.lower[:], prepared.upper[:] = -1.0, 1.0
    by_problem = cc.solve(prepared.problem(), "sns")
    for status, u, scales in (
        (prepared.solve(), prepared.u, prepared.scales),
        (by_problem.status, by_problem.u, by_problem.scales),
    ):
        assert status is cc.Status.SINGULAR  # at the corner nothing is left for the second
        np.testing.assert_allclose(u, [1.0, 1.0], rtol=1e-9)
        np.testing.assert_allclose(scales[0], 2.0 / b, rtol=1e-4 if b < 1e12 else 1e-9)  # as many digits as 1 has left
        np.testing.assert_allclose(scales[1], 0.0, atol=1e-12)
    assert by_problem.certificate().holds()


@pytest.mark.parametrize(
    "given, error",
    [
        ({"n": 0, "rows": [1]}, ParameterError),
        ({"n": 2, "rows": []}, ParameterError),
        ({"n": 2, "rows": 2}, ShapeError),
        ({"n": 2, "rows": [-1]}, ParameterError),
        ({"n": 2, "rows": [1], "fits": ["scale", "scale"]}, ParameterError),
        ({"n": 2, "rows": [1], "fits": ["exact"]}, ParameterError),
        ({"n": 2, "rows": [1], "constraints": -1}, ParameterError),
        ({"n": 2, "rows": [1], "bounds": (-1, 1)}, ParameterError),
    ],
)
def test_shapes_that_are_none(given, error):
    with pytest.raises(error):
        cc.Prepared(**given)
