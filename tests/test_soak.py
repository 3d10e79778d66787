"""The soak: a tiny one finds nothing, and what is wrong is found."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

import cartctl as cc
from tests import joint_rollouts as jr

BENCHMARKS = Path(__file__).parent.parent / "benchmarks"
pytestmark = pytest.mark.skipif(not jr.COMPILED, reason="a soak is compiled")


@pytest.fixture(scope="module")
def soaking():
    """The soak's modules, as its script finds them."""
    sys.path.insert(0, str(BENCHMARKS))
    try:
        from soaking import batch, loops, tally
    finally:
        sys.path.remove(str(BENCHMARKS))
    batch.prepare()
    return batch, loops, tally


def test_a_tiny_soak_finds_nothing(soaking):
    batch, _, _ = soaking
    found = batch.run(seed=5, first=0, count=2000)
    assert found.failed == 0, found.failures
    assert (found.counts[:6] > 0).all()  # every claim there is, and rows that the box forbids
    assert (found.worst < 1e-6).all()


def test_an_answer_that_is_off_is_found(soaking):
    """u moved by a thousandth: wherever something was at stake, its certificate no longer holds."""
    batch, _, _ = soaking
    found = [batch.run(5, index, 1, spoilt=index) for index in range(200)]
    caught = [result.failed + result.counts[batch.GREY] for result in found]
    assert np.mean(caught) > 0.95
    assert all(f.command == f"--problem 5 {k}" for k, result in enumerate(found) for f in result.failures)


def test_a_problem_is_made_by_its_seed_and_index_alone(soaking):
    batch, _, _ = soaking
    whole = batch.run(6, 0, 300)
    parts = [batch.run(6, 0, 100), batch.run(6, 100, 200)]
    np.testing.assert_array_equal(whole.counts, parts[0].counts + parts[1].counts)
    np.testing.assert_array_equal(whole.worst, np.maximum(parts[0].worst, parts[1].worst))


@pytest.mark.parametrize("index", [2287, 7257, 26462, 28799, 47150, 61196, 65297])
def test_what_levels_above_settled_is_not_taken_back(soaking, index):
    """A vertex of bounds and nearly dependent rows, which round-off made contradictory for the levels below."""
    batch, _, _ = soaking
    assert not batch.run(3, index, 1).failures


NEARLY_SINGULAR = {
    (20251, 54314): "a row that nearly depends on others pins the scale, to no more digits than it has",
    (20252, 260024): "two such rows pin it, to different ones",
    (20252, 1395778): "a row of zeros asks for something small beside a large u",
    (20251, 9040): "what a fitted level misses is round-off in its members; it must not press on a bound",
    (20251, 445057): "a bound met with a member that then leaves",
    (20252, 1444000): "a row that cannot move sends the line search far away",
    (20251, 724667): "a multiplier turned by the level that holds its bound, not by another's round-off",
    (20252, 276799): "steps that lower the misses no more are taken for ever",
    (20253, 147333): "rows of one level a million times smaller than the others",
    (30001, 1372844): "an entry of a step is no surer than its largest; from a guess it went 1e13 far",
    (30001, 1066367): "a u of nothing beside bounds of 1",
    (30002, 1244659): "a multiplier turned by millions of another level's",
    (30002, 3582090): "a miss of the last bits is none",
    (30001, 195215): "a contradiction that is none in another order of the joints",
    (30001, 1390428): "the same, two levels deep",
    (30003, 305765): "rows of dust that contradict each other where the box keeps u from 0",
    (30003, 1995324): "feasible at a single point of the rows",
    (30003, 2195699): "what nearly dependent members magnify is no licence to miss a row",
    (50001, 908067): "the same, among rows that are dependent twice over",
    (93001, 15930889): "a dependent row that is missed by 1e-8",
    (92001, 48188177): "a u of 1e-16 beside bounds of 3",
    (95005, 11291664): "a u of 1e-17 where drifts cancel that alone give it a size",
    (95002, 13321952): "a share of 1e-13 in what limits a scale, magnified round-off, held a bound for good",
    (95001, 7498907): "a fitted level that came to no end is none that is skipped",
    (90001, 3709332): "a fit that misses by hardly more than round-off presses against bounds",
    (95005, 22670411): "a row on the end of its interval, by the last bit, was in it and out of it",
    (96001, 10616408): "a faint fit whose equations' small multipliers are needed a million times over below",
    (20253, 799927): "a scale lowered by less than round-off in it makes room for levels below",
}


@pytest.mark.parametrize("problem", NEARLY_SINGULAR, ids=str)
def test_nearly_singular_levels_have_their_certificates(soaking, problem):
    batch, _, _ = soaking
    assert not batch.run(*problem, 1).failures, NEARLY_SINGULAR[problem]


UNPROVEN = [(50001, 982241), (50001, 4948025), (50001, 7354811), (50001, 1920496), (50001, 4720112), (50001, 9677257)]


@pytest.mark.parametrize("problem", UNPROVEN, ids=str)
def test_what_double_precision_cannot_prove_says_so(soaking, problem):
    """Levels with singular values of 1e-6 of their size, one above the other: said, and u is inside."""
    batch, _, _ = soaking
    from soaking.judge import TOLD

    found = batch.run(*problem, 1)
    assert not found.failures and found.counts[TOLD] == 1
    stated = as_problem(problem)
    inequalities = any(equation.fit == "inequality" for equation in stated.equations)
    solution = cc.solve(stated, "hqp" if inequalities else "sns")
    certificate = solution.certificate()
    assert np.isfinite(solution.u).all() and solution.bound_violation() <= 1e-9 * abs(solution.u).max(initial=1e-9)
    assert solution.status in (cc.Status.UNPROVEN, cc.Status.FAILED) or certificate.holds()  # by other last digits


def as_problem(which):
    """A problem of the soak's by its seed and index, as a user would write it."""
    from soaking.problems import make

    with np.errstate(over="ignore"):
        made, _, _ = make(*which)
    m, row, low = made.arrays, 0, 0
    low = m.C.shape[0] - sum(size for size, fit in zip(m.sizes, m.fits, strict=True) if fit == 2)
    hard = None if low == 0 else (m.C[:low], m.c_lower[:low], m.c_upper[:low])
    levels = []
    for size, fit in zip(m.sizes.tolist(), m.fits.tolist(), strict=True):
        if fit == 2:
            own = slice(low, low + size)
            levels.append(cc.Inequality(m.C[own], m.c_lower[own], m.c_upper[own]))
            low += size
        else:
            own = slice(row, row + size)
            drift = m.d[own] if m.d.size else None
            levels.append(cc.Equation(m.A[own], m.b[own], drift=drift, fit=("scale", "least_squares")[fit]))
            row += size
    box = (None, None) if m.lower.size == 0 else (m.lower, m.upper)
    reference = m.reference if m.reference.size else None
    return cc.Problem(levels, lower=box[0], upper=box[1], constraints=hard, reference=reference)


@pytest.mark.parametrize("s", [0.3, 0.5, 1.0])
def test_a_small_command_for_a_row_of_zeros_pins_the_scale(s):
    """Of the size at which its side counted as nothing, but not its slope: s was 0."""
    b = np.array([1.58746e5, 2.6e-3])
    equation = cc.Equation(np.array([[-475.0], [0.0]]), b, drift=np.array([0.0, s * 2.6e-3]))
    solution = cc.solve(cc.Problem([equation]), "sns")
    np.testing.assert_allclose(solution.scales, [s], rtol=1e-9)
    assert solution.certificate().holds()


def test_a_few_loops_find_nothing_and_a_push_is_found(soaking):
    _, loops, _ = soaking
    found, following = loops.run(seed=3, first=0, seconds=0.0, scenes=1)
    assert following == 1 and found.steps == loops.STEPS
    assert not found.failures
    pushed, _ = loops.run(seed=3, first=0, seconds=0.0, scenes=1, spoil=1e3)
    assert [f.command for f in pushed.failures] == ["--scene 3 0"]


def test_rollouts_find_nothing_and_a_push_is_found(soaking):
    _, _, tally = soaking
    from soaking import rollouts

    found, following = rollouts.run(seed=7, first=2, seconds=0.0, scenes=1)
    assert following == 3 and found.steps == rollouts.STARTS * rollouts.STEPS
    assert not found.failures and found.certificates > 0
    pushed, _ = rollouts.run(seed=7, first=2, seconds=0.0, scenes=1, spoil=1e2)
    assert [f.command for f in pushed.failures] == ["--rollouts 7 2"] and "outside at step" in pushed.failures[0].what
    total = tally.Tally()
    total.add_loops(found, 0.5, "rollouts")
    assert total.row(1.0, 7, 2)["compiled_steps"] == str(found.steps) and total.steps == 0


@pytest.mark.parametrize("scene", [(7, 12), (7, 161)], ids=str)
def test_next_to_rest_a_certificate_asks_for_no_more_than_round_off_leaves(soaking, scene):
    """u of 1e-9 or 1e-12 where commands of 70 rad/s cancel, or bounds are 1 rad/s."""
    from soaking import rollouts

    found, _ = rollouts.run(*scene, 0.0)
    assert not found.failures and found.worst < 1e-6


def test_a_line_is_appended(soaking, tmp_path):
    batch, loops, tally = soaking
    total = tally.Tally()
    total.add_batch(batch.run(5, 0, 10, spoilt=3), 0.5)
    total.add_loops(loops.run(3, 0, 0.0, scenes=1)[0], 0.5)
    row = total.row(minutes=1.0, seed=5, jobs=2)
    for _ in range(2):
        tally.append(tmp_path / "soak.csv", row)
    with (tmp_path / "soak.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows == [row, row]
    assert row["problems"] == "10" and row["problems_per_s"] == "40" and row["steps"] == str(loops.STEPS)
    tally.append(tmp_path / "soak.csv", {"other": "columns"})
    assert (tmp_path / "soak.old.csv").exists() and (tmp_path / "soak.csv").read_text() == "other\ncolumns\n"


@pytest.mark.xfail(
    reason="open: an axis parallel but for 5e-12, and a warm start that stays where only round-off holds it"
)
def test_a_warm_start_beside_parallel_axes(soaking):
    """Found by soaking: from a cold start the same problem is answered to 5e-14, and nothing says UNPROVEN."""
    from soaking import rollouts

    found, _ = rollouts.run(98001, 510000, 0.0)
    assert not found.failures
