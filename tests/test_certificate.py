"""Certificates hold for the optimum and for nothing else: every claim, falsified in every way it can be false."""

from __future__ import annotations

import numpy as np
import pytest

from cartctl import HQP, SNS, Equation, Inequality, Problem, Solution, Status, solve
from cartctl.errors import UnsupportedProblem
from tests import oracles, prioritised

TOLERANCE = 1e-7


def claim(solution, u=None, scales=None):
    """The same method's claim about another answer to the same problem."""
    u = solution.u if u is None else np.asarray(u, dtype=float)
    scales = solution.scales if scales is None else np.asarray(scales, dtype=float)
    method = HQP() if solution.solver == "hqp" else SNS()
    return Solution(solution.problem, u, solution.solver, method, None, solution.lost_rank, scales).certificate()


def failing(certificate):
    """The claims that do not hold."""
    return {level.claim for level in certificate.levels if not level.worst <= TOLERANCE}


# ---------------------------------------------------------------- one claim at a time

LIMIT = np.ones(2)


def test_a_scale_that_could_be_larger():
    solution = solve(Problem([([[1.0, 1.0]], [4.0])], -LIMIT, LIMIT), "sns")
    assert solution.scales == pytest.approx([0.5]) and claim(solution).holds(1e-12)
    for s in (0.0, 0.25, 0.4999):  # feasible, and less than it could be
        assert "scale" in failing(claim(solution, [2.0 * s, 2.0 * s], [s]))
    assert "scale" in failing(claim(solution, scales=[0.6]))  # not what u delivers
    assert failing(claim(solution, [1.2, 1.2], [0.6])) == {"scale", "nearest"}  # outside the box


def test_a_scale_of_one_that_is_not_delivered():
    solution = solve(Problem([([[1.0, 1.0]], [4.0])], -LIMIT, LIMIT), "sns")
    assert "scale" in failing(claim(solution, scales=[1.0]))
    unscaled = solve(Problem([([[1.0, 1.0]], [1.0])], -LIMIT, LIMIT), "sns")
    assert claim(unscaled).holds(1e-12)
    assert "scale" in failing(claim(unscaled, [0.25, 0.25], [0.5]))  # slowed without need


def test_a_task_skipped_that_could_be_served():
    p = Problem([Equation([[1.0, 1.0]], [1.0], drift=[0.1]), ([[1.0, -1.0]], [0.5])], -LIMIT, LIMIT)
    solution = solve(p, "sns")
    assert claim(solution).holds(1e-12)
    lazy = solve(Problem([p.equations[1]], -LIMIT, LIMIT), "sns")
    assert "skipped" in failing(claim(solution, lazy.u, [np.nan, 1.0]))
    stopped = Problem([Equation([[1.0, 1.0]], [1.0], drift=[2.0])], -LIMIT, LIMIT)  # s = 0 is just possible
    at_rest = solve(stopped, "sns")
    assert at_rest.u == pytest.approx([-0.5, -0.5]) and at_rest.scales == pytest.approx([1.0])
    assert "skipped" in failing(claim(at_rest, [0.0, 0.0], [np.nan]))
    back = Problem([Equation([[1.0, 1.0]], [-1.0], drift=[2.0])], -LIMIT, LIMIT)
    edge = solve(back, "sns")
    assert edge.scales == pytest.approx([0.0]) and claim(edge).holds(1e-9)
    assert "skipped" in failing(claim(edge, [0.0, 0.0], [np.nan]))


def test_a_task_served_that_had_to_be_skipped():
    solution = solve(Problem([Equation([[1.0, 1.0]], [-1.0], drift=[3.0])], -LIMIT, LIMIT), "sns")
    assert np.isnan(solution.scales[0]) and claim(solution).holds(1e-12)
    assert "scale" in failing(claim(solution, [-1.0, -1.0], [0.0]))


def test_a_miss_that_could_be_less():
    p = Problem([Equation([[2.0, 1.0], [0.0, 1.0]], [5.0, 3.0], fit="least_squares")], -LIMIT, LIMIT)
    solution = solve(p, "sns")
    assert claim(solution).holds(1e-12) and solution.residuals[0] > 1.0
    for u in ([1.0, 0.9], [0.9, 1.0], [0.0, 0.0], [0.99999, 1.0]):
        assert "least squares" in failing(claim(solution, u))
    assert "nearest" in failing(claim(solution, [1.1, 1.0]))  # less, but outside


def test_an_inequality_missed_without_need():
    p = Problem([Inequality([[1.0, 0.0]], upper=[-0.5]), Equation([[1.0, 0.0]], [1.0])], -LIMIT, LIMIT)
    solution = solve(p, "hqp")
    assert solution.u == pytest.approx([-0.5, 0.0]) and claim(solution).holds(1e-12)
    assert "least squares" in failing(claim(solution, [1.0, 0.0]))  # the order turned round
    assert "least squares" in failing(claim(solution, [-0.7, 0.0]))  # kept, at a cost to the equation below


def test_a_longer_answer_than_need_be():
    solution = solve(Problem([([[1.0, 1.0]], [1.0])], -LIMIT, LIMIT, reference=[0.2, 0.0]), "sns")
    assert claim(solution).holds(1e-12)
    for t in (0.3, 1e-3, 1e-6):
        assert failing(claim(solution, solution.u + [t, -t])) == {"nearest"}


def test_a_bound_that_should_let_go():
    """At a bound without being pushed there: feasible, all scales right."""
    solution = solve(Problem([([[1.0, 1.0]], [1.2])], -LIMIT, LIMIT), "sns")
    assert failing(claim(solution, [1.0, 0.2])) == {"nearest"}


def test_a_level_paid_for_by_a_lower_one():
    """Proofs may not lean on levels that come later, or that were skipped."""
    first, second = ([[1.0, 0.0]], [2.0]), ([[1.0, 1.0]], [0.5])
    solution = solve(Problem([first, second], -LIMIT, LIMIT), "sns")
    assert solution.scales == pytest.approx([0.5, 1.0]) and claim(solution).holds(1e-12)
    turned = solve(Problem([second, first], -LIMIT * 0.5, LIMIT * 0.5), "sns")
    assert claim(turned).holds(1e-12)
    assert "scale" in failing(claim(solution, [0.5, 0.0], [0.25, 1.0]))


def test_hard_rows_count():
    rows = ([[1.0, 1.0]], [-1.0], [0.5])
    solution = solve(Problem([([[1.0, 1.0]], [1.0])], -LIMIT, LIMIT, constraints=rows), "sns")
    assert solution.scales == pytest.approx([0.5]) and claim(solution).holds(1e-12)
    assert "nearest" in failing(claim(solution, [0.5, 0.5], [1.0]))


def test_infeasible_rows_are_a_level_of_the_certificate():
    rows = ([[1.0, 1.0]], [3.0], [np.inf])
    solution = solve(Problem([([[1.0, -1.0]], [0.0])], -LIMIT, LIMIT, constraints=rows), "sns")
    assert solution.status is Status.INFEASIBLE
    certificate = solution.certificate()
    assert certificate.levels[0].name == "constraints" and certificate.holds(1e-9)
    assert "nearest" in failing(claim(solution))  # as an answer that claims to keep its rows
    worse = Solution(solution.problem, np.zeros(2), "sns", SNS(), Status.INFEASIBLE, False, solution.scales)
    assert "least squares" in failing(worse.certificate())


# ---------------------------------------------------------------- at random


def others(rng, solution):
    """Answers that are not optimal, or not feasible: stretched, moved, at other scales."""
    u, scales = solution.u, solution.scales
    away = rng.normal(size=u.shape[0])
    yield u + 1e-3 * (1.0 + np.abs(u).max()) * away, scales
    p = solution.problem
    if p.lower is not None:
        moved = np.clip(u + 0.1 * away, p.lower, p.upper)
        if np.abs(moved - u).max() > 1e-3:
            yield moved, scales
    for k in np.flatnonzero(~np.isnan(scales) & (np.abs(scales - 0.5) > 0.1)):
        e = p.equations[k]
        if e.fit == "scale" and np.abs(e.b).max(initial=0.0) > 1e-3:
            yield u, np.where(np.arange(scales.shape[0]) == k, 0.5, scales)


@pytest.mark.parametrize("solver", ["sns", "hqp"])
def test_any_other_answer_is_found_out(solver):
    """The optimum is unique: no other u and no other scales may be certified."""
    tried = 0
    for seed in range(300):
        options = {} if solver == "sns" else {"inequalities": True, "fits": ("least_squares",)}
        solution = solve(prioritised.made(seed, most=12, **options).problem, solver)
        assert claim(solution).holds(TOLERANCE), seed
        for u, scales in others(np.random.default_rng(seed), solution):
            assert not claim(solution, u, scales).holds(TOLERANCE), seed
            tried += 1
    assert tried > 400


def test_greedy_answers_hold_only_where_they_are_optimal():
    found = {True: 0, False: 0}
    for seed in range(400):
        rng = np.random.default_rng(seed)
        A, b, limit = oracles.matrix(rng, 4, 7), 4.0 * rng.normal(size=4), np.ones(7)
        p = Problem([(A, b)], -limit, limit)
        greedy, exact = solve(p, "sns-greedy"), solve(p, "sns")
        optimal = abs(greedy.scales[0] - exact.scales[0]) < 1e-9 and np.abs(greedy.u - exact.u).max() < 1e-8
        if not optimal and np.abs(greedy.u - exact.u).max() < 1e-5:
            continue  # too close to call
        assert claim(exact, greedy.u, greedy.scales).holds(TOLERANCE) == optimal, seed
        found[optimal] += 1
    assert min(found.values()) > 10


def test_by_hand():
    """2 u = 8 s, u <= 1: 8 s - 2 u = 0 minus the bound's share proves s <= 1/4."""
    level = solve(Problem([([[2.0]], [8.0])], [-1.0], [1.0]), "sns").certificate().levels[0]
    row, joint = level.multipliers
    assert row > 0.0 > joint and row * 2.0 + joint == pytest.approx(0.0)
    assert row * 8.0 * 0.25 + joint * 1.0 == pytest.approx(0.0)  # h(s) = z_row 8 s + z_joint upper vanishes at 1/4


def test_methods_that_claim_no_optimum():
    with pytest.raises(UnsupportedProblem, match="claims no optimum"):
        solve(Problem([([[1.0, 1.0]], [1.0])]), "transpose").certificate()
