"""Exact prioritised scaling: certified optima, optima known to be at least so large, linear programmes, invariances."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from cartctl import SNS, Equation, Inequality, Problem, Solution, Status, solve
from cartctl.errors import UnsupportedProblem
from tests import oracles, prioritised
from tests import tolerances as tol
from tests.sns_cases import CASES, problem_of
from tests.test_worked_examples import planar_drift
from tests.worked_examples import ITEMS, real

PROVEN = 1e-7  # of a certificate
INSIDE = 1e-10  # of what u is made of


def same(one, other, message="", atol=1e-8):
    """The same scales and the same u."""
    np.testing.assert_allclose(one.scales, other.scales, atol=atol, err_msg=message)
    np.testing.assert_allclose(one.u, other.u, atol=atol * (1.0 + np.abs(other.u).max()), err_msg=message)


# ---------------------------------------------------------------- certified optima


def test_every_certified_optimum():
    groups = Counter()
    for case in CASES:
        solution, best = solve(problem_of(case), "sns"), case["optimum"]["lex_scale"]
        expected = [np.nan if s is None else s for s in best["s"]]
        np.testing.assert_allclose(solution.scales, expected, atol=1e-9, err_msg=str(case["id"]))
        if case["bias"]:
            best = case["optimum"]["bias_projection"]
            away, least = (np.linalg.norm(np.subtract(u, case["bias"])) for u in (solution.u, best["dq"]))
        else:
            away, least = np.linalg.norm(solution.u), best["norm"]
        assert away == pytest.approx(least, rel=1e-7, abs=1e-12), case["id"]
        if "near_singular_sigma_1e-08" not in case["category"]:  # certified with a residual of 2e-9, 0.2 in u
            np.testing.assert_allclose(solution.u, best["dq"], atol=1e-7, err_msg=str(case["id"]))
        assert solution.bound_violation() <= INSIDE and solution.certificate().holds(PROVEN), case["id"]
        groups[case["group"]] += 1
    assert sum(groups.values()) == 219 and len(groups) == 8


# ---------------------------------------------------------------- random problems


def check_random(seeds, solver, floor=True, **options):
    """Inside the bounds, never below what is known to be possible, proven; how often each status came."""
    count = Counter()
    for seed in seeds:
        problem, u, possible = prioritised.made(seed, **options)
        solution = solve(problem, solver)
        assert solution.status is not Status.FAILED, seed
        if problem.lower is not None:
            assert (solution.u >= problem.lower).all() and (solution.u <= problem.upper).all(), seed
        if solution.status is not Status.INFEASIBLE:
            assert solution.bound_violation() <= INSIDE * (1.0 + np.abs(solution.u).max()), seed
            assert not floor or not prioritised.below_floor(solution.scales, possible), seed
        certificate = solution.certificate()
        assert certificate.holds(PROVEN), (seed, [level[:5] for level in certificate.levels])
        count[solution.status] += 1
    return count


def test_scaled_tasks_of_every_kind():
    count = check_random(range(4000), "sns")
    assert min(count[s] for s in (Status.OPTIMAL, Status.SCALED, Status.SKIPPED, Status.SINGULAR)) > 150
    assert count[Status.INFEASIBLE] == 0


def test_fitted_tasks_between_scaled_ones():
    count = check_random(range(2500), "sns", fits=("scale", "scale", "least_squares"))
    assert count[Status.SCALED] > 100 and count[Status.INFEASIBLE] == 0


def test_rows_that_the_box_forbids():
    count = check_random(range(500), "sns", floor=False, contradict=True, fits=("scale", "least_squares"))
    assert count[Status.INFEASIBLE] > 300


def test_nearly_singular_tasks():
    """Singular values down to 1e-4 of the largest; below about 1e-7 answers hang on round-off."""
    check_random(range(500), "sns", near=4)


@pytest.mark.parametrize("kind", ["scaled", "fitted", "contradictory"])
def test_by_linear_programming(kind):
    options = {
        "scaled": {},
        "fitted": {"fits": ("scale", "least_squares")},
        "contradictory": {"contradict": True, "fits": ("scale", "least_squares")},
    }[kind]
    for seed in range(20):
        solution = solve(prioritised.made(seed, most=15, levels=3, **options).problem, "sns")
        for level, what, excess in prioritised.shortcomings(solution):
            assert excess <= prioritised.DESCENT, (seed, level, what)


@pytest.mark.slow
def test_many_more():
    check_random(range(100_000, 140_000), "sns")
    check_random(range(100_000, 120_000), "sns", fits=("scale", "least_squares"))


# ---------------------------------------------------------------- what a posture and hard rows are


@given(oracles.SEEDS, st.integers(1, 12))
def test_a_posture_below_is_a_reference(seed, n):
    """A last level u = u0 by least squares is what the reference asks for."""
    rng = np.random.default_rng(seed)
    m = int(rng.integers(0, n + 1))
    first = Equation(oracles.matrix(rng, m, n), 3.0 * rng.normal(size=m))
    posture, limit = rng.normal(size=n), rng.uniform(0.2, 2.0, n)
    below = solve(Problem([first, Equation(np.eye(n), posture, fit="least_squares")], -limit, limit), "sns")
    beside = solve(Problem([first], -limit, limit, reference=posture), "sns")
    np.testing.assert_allclose(below.u, beside.u, atol=1e-8)
    assert below.scales[:1] == pytest.approx(beside.scales, abs=tol.ORACLE) and below.certificate().holds(PROVEN)


@given(oracles.SEEDS, st.integers(2, 8))
def test_contradictory_rows_are_missed_by_least_squares(seed, n):
    """As scipy's bounded least squares misses them; a task that need not suffer is served."""
    rng = np.random.default_rng(seed)
    C, limit = rng.normal(size=(n, n)), rng.uniform(0.3, 1.0, n)
    C[:, -1] = 0.0
    wanted = 3.0 * rng.normal(size=n)
    free = Equation(np.eye(n)[-1:], [0.5 * limit[-1]])
    solution = solve(Problem([free], -limit, limit, constraints=(C, wanted, wanted)), "sns")
    least = lsq_linear(C, wanted, (-limit, limit), method="bvls", tol=1e-14)
    missed = np.linalg.norm(C @ solution.u - wanted)
    assert missed == pytest.approx(np.sqrt(2.0 * least.cost), rel=1e-8, abs=1e-9)
    if missed > 1e-6:
        assert solution.status is Status.INFEASIBLE
    assert solution.u[-1] == pytest.approx(0.5 * limit[-1]) and solution.scales == pytest.approx([1.0])


def test_inequalities_among_the_equations_are_refused():
    with pytest.raises(UnsupportedProblem, match="inequalities"):
        solve(Problem([Inequality([[1.0, 0.0]], [0.0], [1.0])]), "sns")


# ---------------------------------------------------------------- invariances


@pytest.mark.parametrize("fits", [("scale",), ("scale", "least_squares")])
def test_joints_may_be_numbered_as_one_likes(fits):
    for seed in range(150):
        p = prioritised.made(seed, most=12, fits=fits).problem
        order = np.random.default_rng(seed).permutation(p.n)
        turned = replace(
            p,
            equations=[replace(e, A=e.A[:, order]) for e in p.equations],
            lower=None if p.lower is None else p.lower[order],
            upper=None if p.upper is None else p.upper[order],
            constraints=p.constraints and (p.constraints[0][:, order], *p.constraints[1:]),
            metric=None if p.metric is None else p.metric[order] if p.metric.ndim == 1 else p.metric[order][:, order],
            reference=None if p.reference is None else p.reference[order],
        )
        one, other = solve(p, "sns"), solve(turned, "sns")
        np.testing.assert_allclose(one.scales, other.scales, atol=1e-7, err_msg=str(seed))
        np.testing.assert_allclose(one.u[order], other.u, atol=1e-6, err_msg=str(seed))


@pytest.mark.parametrize("fits", [("scale",), ("scale", "least_squares")])
def test_units_do_not_matter(fits):
    """Of the unknowns, of each task and of the rows: 1e-6 to 1e6."""
    for seed in range(150):
        p, rng = prioritised.made(seed, most=12, fits=fits).problem, np.random.default_rng(seed)
        unit, c = 10.0 ** rng.uniform(-6, 6, 2)
        equations = []
        for e in p.equations:
            k = 10.0 ** rng.uniform(-6, 6)
            d = None if e.drift is None else k * unit * e.drift
            equations.append(replace(e, A=k * e.A, b=k * unit * e.b, drift=d))
        other = replace(
            p,
            equations=equations,
            lower=None if p.lower is None else unit * p.lower,
            upper=None if p.upper is None else unit * p.upper,
            constraints=p.constraints and (c * p.constraints[0], *(c * unit * side for side in p.constraints[1:])),
            reference=None if p.reference is None else unit * p.reference,
        )
        one, two = solve(p, "sns"), solve(other, "sns")
        np.testing.assert_allclose(two.scales, one.scales, atol=1e-7, err_msg=str(seed))
        np.testing.assert_allclose(two.u / unit, one.u, atol=1e-6, err_msg=str(seed))


def test_a_bound_may_be_a_row():
    for seed in range(150):
        p = prioritised.made(seed, most=12).problem
        if p.lower is None:
            continue
        some = np.random.default_rng(seed).random(p.n) < 0.5
        C, low, high = p.constraints or (np.zeros((0, p.n)), np.zeros(0), np.zeros(0))
        split = replace(
            p,
            lower=np.where(some, -np.inf, p.lower),
            upper=np.where(some, np.inf, p.upper),
            constraints=(
                np.vstack([C, 2.0 * np.eye(p.n)[some]]),
                np.append(low, 2.0 * p.lower[some]),
                np.append(high, 2.0 * p.upper[some]),
            ),
        )
        same(solve(split, "sns"), solve(p, "sns"), str(seed), 1e-6)


def test_any_start_leads_to_the_same_answer():
    """From its own answer, from a neighbour's, from garbage, from a problem of another size."""
    stranger = solve(prioritised.made(3, most=5).problem, "sns")
    for seed in range(200):
        rng = np.random.default_rng(seed)
        p = prioritised.made(seed, most=20, fits=("scale", "scale", "least_squares")).problem
        cold = solve(p, "sns")
        near = replace(p, equations=[replace(e, b=e.b + 0.05 * rng.normal(size=e.b.shape)) for e in p.equations])
        garbage = Solution(p, cold.u, "sns")
        garbage.warm = np.append(p.n, rng.integers(-3, 3 * p.n + 3, p.n + 1)).astype(np.int64)
        for start in (cold, solve(near, "sns"), garbage, stranger, Solution(p, cold.u, "pinv")):
            warm = solve(p, "sns", start=start)
            same(warm, cold, str(seed), 1e-6)
            assert warm.certificate().holds(PROVEN)


# ---------------------------------------------------------------- corners


def test_one_unknown_by_hand():
    def one(b, d, low, high):
        return solve(Problem([Equation([[2.0]], [b], drift=[d])], lower=[low], upper=[high]), "sns")

    free = one(1.0, 0.0, -1.0, 1.0)
    assert free.u == pytest.approx([0.5]) and free.status is Status.OPTIMAL
    slowed = one(8.0, 0.0, -1.0, 1.0)
    assert slowed.u == pytest.approx([1.0]) and slowed.scales == pytest.approx([0.25])
    assert slowed.status is Status.SCALED
    drift = one(8.0, 1.0, -1.0, 1.0)  # 2 u + 1 = 8 s
    assert drift.u == pytest.approx([1.0]) and drift.scales == pytest.approx([3.0 / 8.0])
    skipped = one(-1.0, 8.0, -1.0, 1.0)
    assert skipped.status is Status.SKIPPED and np.isnan(skipped.scales).all() and skipped.u == pytest.approx([0.0])
    back = one(6.0, 8.0, -1.0, 1.0)  # only s in [1, 5/3] is possible
    assert back.u == pytest.approx([-1.0]) and back.scales == pytest.approx([1.0])


def test_a_task_without_rows():
    limit = np.array([1.0, 2.0])
    alone = solve(Problem([(np.zeros((0, 2)), [])], -limit, limit, reference=[3.0, 1.0]), "sns")
    assert alone.u == pytest.approx([1.0, 1.0]) and alone.scales == pytest.approx([1.0])
    assert alone.status is Status.OPTIMAL and alone.certificate().holds(PROVEN)


def test_more_rows_than_unknowns():
    rng = np.random.default_rng(0)
    A, u = rng.normal(size=(6, 3)), np.array([0.5, -0.5, 0.2])
    limit = np.full(3, 0.25)
    met = solve(Problem([(A, A @ u)], -limit, limit), "sns")
    assert met.scales == pytest.approx([0.5]) and met.u == pytest.approx(0.5 * u)
    torn = solve(Problem([(A, rng.normal(size=6))], -limit, limit), "sns")  # no u, but for s = 0
    assert torn.scales == pytest.approx([0.0]) and torn.u == pytest.approx(np.zeros(3), abs=1e-12)


def test_the_second_task_gets_what_the_first_leaves():
    limit = np.ones(2)
    solution = solve(Problem([([[1.0, 1.0]], [1.5]), ([[1.0, -1.0]], [2.0])], -limit, limit), "sns")
    assert solution.scales == pytest.approx([1.0, 0.25]) and solution.u == pytest.approx([1.0, 0.5])


def test_a_first_inequality_that_no_task_may_leave():
    """Code 0, joint 0 at its lower bound, decides whether a fitted level can begin at all."""
    fit = Equation([[1.0, 0.0]], [3.0], fit="least_squares")
    solution = solve(Problem([fit], [0.5, -1.0], [1.0, 1.0], constraints=([[1.0, 0.0]], [-np.inf], [0.0])), "sns")
    assert solution.status is Status.INFEASIBLE and solution.u == pytest.approx([0.5, 0.0])


def test_a_row_of_zeros():
    """It pins s: 0 = s b - d."""
    A, limit = np.array([[1.0, 0.0], [0.0, 0.0]]), np.ones(2)
    half = solve(Problem([Equation(A, [1.0, 2.0], drift=[0.0, 1.0])], -limit, limit), "sns")
    assert half.scales == pytest.approx([0.5]) and half.u == pytest.approx([0.5, 0.0])
    stop = solve(Problem([Equation(A, [1.0, 2.0], drift=[3.0, 0.0])], -limit, limit), "sns")  # s = 0, then u_0 = -3
    assert np.isnan(stop.scales).all() and half.certificate().holds(PROVEN) and stop.certificate().holds(PROVEN)


# ---------------------------------------------------------------- published examples


def test_slides_sns_4R():
    item = ITEMS["slides-sns-4R"]
    limit = np.array(item["inputs"]["Vmax"], dtype=float)
    J = oracles.planar_jacobian(item["inputs"]["L"], real(item["inputs"]["q"]))
    solution = solve(Problem([(J, item["inputs"]["xdot"])], lower=-limit, upper=limit), "sns")
    np.testing.assert_allclose(solution.u, item["expected"]["dq_sns"], atol=6e-5)
    assert solution.scales == pytest.approx([item["expected"]["sns_scale"]])
    assert solution.saturated.tolist() == [1, 0, 0, 0] and solution.certificate().holds(PROVEN)


def test_r2_2018_07_11_ex2():
    item = ITEMS["r2-2018-07-11-ex2"]
    limit = np.array(item["inputs"]["Amax"], dtype=float)
    J = oracles.planar_jacobian(item["inputs"]["L"], real(item["inputs"]["q"]))
    solution = solve(Problem([(J, item["inputs"]["a"])], lower=-limit, upper=limit), "sns")
    np.testing.assert_allclose(solution.u, item["expected"]["ddq_sns"], atol=item["tolerance"])
    assert np.linalg.norm(solution.u) == pytest.approx(item["expected"]["norm"], abs=item["tolerance"])
    assert solution.scales == pytest.approx([1.0]) and solution.certificate().holds(PROVEN)


def test_r2_2021_07_12_ex1():
    item = ITEMS["r2-2021-07-12-ex1"]
    given_, limit, answers = item["inputs"], real(item["inputs"]["Umax"]), {}
    for k in range(1, 5):
        q, v = real(given_[f"case{k}"]["q"]), real(given_[f"case{k}"]["qd"])
        J, drift = oracles.planar_jacobian(given_["L"], q), planar_drift(given_["L"], q, v)
        answers[k] = solve(Problem([Equation(J, np.zeros(2), drift=drift)], lower=-limit, upper=limit), "sns")
        assert answers[k].bound_violation() == 0.0 and answers[k].certificate().holds(PROVEN)
    np.testing.assert_allclose(answers[2].u, item["expected"]["u2_sns"], atol=2e-4)
    np.testing.assert_allclose(answers[1].u, [37.6713, -8.0625, -31.4159], atol=2e-4)  # see the note
    assert np.isnan(answers[3].scales).all()  # the drift cannot be stopped there
    np.testing.assert_allclose([answers[3].u, answers[4].u], 0.0, atol=tol.EXACT)


# ---------------------------------------------------------------- without the compiler

SEEDS_WITHOUT = (1, 2, 5, 8)

_PYTHON = """
import json
from tests.test_sns import answers
print(json.dumps([[s.u.tolist(), s.scales.tolist()] for s in answers()]))
"""


def answers():
    """Of a handful of problems."""
    for seed in SEEDS_WITHOUT:
        yield solve(prioritised.made(seed, most=8, levels=3, fits=("scale", "least_squares")).problem, "sns")
        yield solve(prioritised.made(seed, most=8, levels=3, inequalities=True).problem, "hqp")


def test_the_same_without_the_compiler():
    run = subprocess.run(
        [sys.executable, "-c", _PYTHON],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
        check=True,
    )
    for solution, (u, scales) in zip(answers(), json.loads(run.stdout), strict=True):
        np.testing.assert_allclose(u, solution.u, atol=1e-12)
        np.testing.assert_allclose(scales, solution.scales, atol=1e-12)


def test_parameters():
    assert SNS() == SNS() and SNS().name == "sns"


def test_round_off_of_equations_is_no_share_of_a_bound():
    """A hand at a plane that is in its way: the plane's proof is of equations alone, and the method went round."""
    given = json.loads((Path(__file__).parent / "data" / "hand_at_a_plane.json").read_text())
    A, b, lower, upper, C, c_lower, c_upper = (np.array(given[k]) for k in given)
    problem = Problem([(A, b)], lower=lower, upper=upper, constraints=(C, np.full_like(c_lower, -np.inf), c_upper))
    solution = solve(problem, "sns")
    assert solution.status is Status.SCALED
    assert solution.certificate().holds()
