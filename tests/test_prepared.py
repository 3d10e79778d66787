"""Exact scaling on arrays that stay: the same answers as by a Problem, and words for what cannot be one."""

from __future__ import annotations

import numpy as np
import pytest

import cartctl as cc
from cartctl.errors import NonFiniteError, ParameterError, ProblemError
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
    for d in prepared.drift:
        d[:] = 0.1 * rng.normal(size=len(d))
    prepared.C[:] = rng.normal(size=prepared.C.shape)
    for low, high in ((prepared.lower, prepared.upper), (prepared.c_lower, prepared.c_upper)):
        low[:], high[:] = -rng.uniform(0.1, 2.0, len(low)), rng.uniform(0.1, 2.0, len(high))
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
        with pytest.raises(NonFiniteError, match="A holds nan"):
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
        ("reference", np.inf, NonFiniteError, "reference holds inf"),
        ("C", np.nan, NonFiniteError, "C holds nan"),
        ("sizes", np.nan, NonFiniteError, "sizes holds nan"),
        ("lower", 3.0, ProblemError, r"lower\[0\] is 3 and upper\[0\] 1; expected no lower above its upper"),
        ("upper", np.nan, ProblemError, r"lower\[0\] is -1 and upper\[0\] nan"),
        ("c_lower", 2.0, ProblemError, r"c_lower\[0\] is 2 and c_upper\[0\] 1"),
    ],
)
def test_what_is_no_problem_is_named(name, value, error, words):
    prepared = cc.Prepared(2, [1], constraints=1, reference=True)
    prepared.lower[:], prepared.upper[:], prepared.c_lower[:], prepared.c_upper[:] = -1.0, 1.0, -1.0, 1.0
    assert prepared.solve() is cc.Status.SINGULAR  # a row of zeros
    getattr(prepared, name)[:] = value
    with pytest.raises(error, match=words):
        prepared.solve()


@pytest.mark.parametrize(
    "given",
    [
        {"n": 0, "rows": [1]},
        {"n": 2, "rows": []},
        {"n": 2, "rows": [-1]},
        {"n": 2, "rows": [1], "fits": ["scale", "scale"]},
        {"n": 2, "rows": [1], "fits": ["exact"]},
        {"n": 2, "rows": [1], "constraints": -1},
    ],
)
def test_shapes_that_are_none(given):
    with pytest.raises(ParameterError):
        cc.Prepared(**given)
