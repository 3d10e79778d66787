"""The certificate of a weighted optimum holds for the optimum and for nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cartctl as cc
from cartctl.errors import UnsupportedProblem
from cartctl.solvers.qp_certificate import weighted_certificate
from tests import oracles


def bounded(rng, n, rows):
    A, b = rng.normal(size=(3, n)), 3.0 * rng.normal(size=3)
    C = rng.normal(size=(rows, n))
    return cc.Problem(
        [cc.Equation(A, b, weight=2.0), (rng.normal(size=(2, n)), rng.normal(size=2))],
        lower=-rng.uniform(0.1, 1.0, n),
        upper=rng.uniform(0.1, 1.0, n),
        constraints=(C, -np.full(rows, 0.5), np.full(rows, 0.5)),
        metric=oracles.metric(rng, n, "full"),
        reference=rng.normal(size=n),
    )


@given(oracles.SEEDS, st.integers(2, 9), st.integers(0, 3))
def test_the_optimum_is_certified_and_nothing_else(seed, n, rows):
    rng = np.random.default_rng(seed)
    problem = bounded(rng, n, rows)
    solution = cc.solve(problem, "qp")
    certificate = solution.certificate()
    assert certificate.holds(1e-7), certificate
    assert certificate.levels[0].claim == "weighted"
    d = solution.duals
    moved = weighted_certificate(problem, d.u + 1e-3 * rng.normal(size=n), d.rho, d.box, d.rows)
    assert not moved.holds(1e-6)
    if np.abs(d.box).max() > 1e-3:
        turned = weighted_certificate(problem, d.u, d.rho, -d.box, d.rows)
        assert not turned.holds(1e-6)


def test_without_an_optimum_there_is_nothing_to_certify():
    problem = cc.Problem([(np.eye(2), np.ones(2))], upper=[0.0, 0.0], constraints=([[1.0, 1.0]], [1.0], [2.0]))
    with pytest.raises(UnsupportedProblem, match="INFEASIBLE"):
        cc.solve(problem, "qp").certificate()
    with pytest.raises(UnsupportedProblem, match="no optimum"):
        cc.solve(cc.Problem([(np.eye(2), np.ones(2))]), "transpose").certificate()
