"""Calibration: known errors are found as surely as it claims, unseen ones reported, outliers survived."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2, f, t

import cartctl as cc
from cartctl import calibration as cal
from cartctl.calibration import Outcome, robust
from cartctl.calibration.identifiability import identify
from cartctl.calibration.tall import tall_r
from cartctl.dynamics.expressions import number
from cartctl.errors import NonFiniteError, ParameterError, ParameterNotFound, ShapeError
from tests.calibration_for_tests import HALF, TOOL, hayati, lwr, measure, panda, planted, puma, scara, spread

WHOLE = ["table", "base", "tool"]
TRIALS, COVERED = 200, 0.91  # of 95 %: four standard errors of a share of 200


def in_its_own_gauge(chain, measured, parameters, **options):
    """The true errors, expressed along the directions that the fit uses: what noise-free data lead to exactly."""
    exact = measured.exact if options.get("kind", "pose") == "pose" else measured.exact[:, :3, 3]
    found = cc.calibrate(chain, measured.q, exact, parameters=parameters, **options)
    assert found.errors()[0].rms < 1e-12
    return found.delta


# --- recovery ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("noise", [None, (1e-4, 2e-4)], ids=["estimated", "given"])
def test_the_pandas_errors_lie_in_the_joint_ellipsoid(noise):
    """1 mm and 0.5 deg planted in the 28 entries of the table, 40 noisy poses, 200 seeded trials: all identifiable."""
    inside = 0
    for seed in range(TRIALS):
        data = measure(panda(), "table", seed)
        found = cc.calibrate(panda(), data.q, data.poses, noise=noise)
        assert found.outcome is Outcome.CONVERGED and not found.unidentifiable
        assert found.rank == found.rank_after == 28
        inside += found.contains(data.delta)
    assert inside >= COVERED * TRIALS


@pytest.mark.slow
def test_with_base_and_tool_they_do_over_what_is_identifiable():
    """40 parameters of which 34 are: 4 for each of seven revolute joints and 6 (Everett, Driels & Mooring 1987).

    Moved along a direction that nothing sees, errors of 1 mm and 0.5 deg become others of second order; they are
    compared where the estimate is, in its gauge.
    """
    inside = 0
    for seed in range(TRIALS):
        data = measure(panda(), WHOLE, seed)
        found = cc.calibrate(panda(), data.q, data.poses, parameters=WHOLE)
        assert found.rank == 34 and len(found.unidentifiable) == 6
        inside += found.contains(in_its_own_gauge(panda(), data, WHOLE))
    assert inside >= COVERED * TRIALS


def test_intervals_cover_each_parameter():
    """Single 95 % intervals: over 28 parameters and 60 trials, 95 % within four standard errors of that share."""
    hits = []
    for seed in range(60):
        data = measure(panda(), "table", 1000 + seed)
        low, high = cc.calibrate(panda(), data.q, data.poses).interval().T
        hits.append((low <= data.delta) & (data.delta <= high))
    assert abs(np.mean(hits) - 0.95) < 4 * math.sqrt(0.05 * 0.95 / 60 / 10)  # parameters of one trial hang together


@pytest.mark.parametrize(
    ("chain", "parameters", "kind"),
    [
        (panda, "table", "pose"), (panda, WHOLE, "pose"), (panda, "a d tool", "position"), (hayati, WHOLE, "position"),
        (puma, ["theta", "base"], "pose"), (lwr, "placements tool", "pose"), (lwr, "placements base", "position"),
        (lwr, "offsets", "position"), (scara, "a2 d theta2", "pose"),
    ],
)  # fmt: skip
def test_without_noise_the_chain_is_found_exactly(chain, parameters, kind):
    """Poses and positions, tables and URDFs: the calibrated chain is the true one, also where nobody measured."""
    chain = chain()
    data = measure(chain, parameters, 5, count=60)
    values = data.exact if kind == "pose" else data.exact[:, :3, 3]
    found = cc.calibrate(chain, data.q, values, parameters=parameters, kind=kind)
    true = chain.changed(dict(zip(found.names, data.delta.tolist(), strict=True)))
    fresh = spread(chain, 10, np.random.default_rng(99))
    assert found.errors(after=False)[0].rms > 1e-5
    np.testing.assert_allclose(found.chain.positions(fresh), true.positions(fresh), atol=1e-10)
    if kind == "pose":
        np.testing.assert_allclose(found.chain.poses(fresh), true.poses(fresh), atol=1e-10)


def test_distances_from_several_anchors_find_the_lengths():
    """A wire from three points in turn sees positions; one anchor at the base's axis does not see its own turn."""
    chain, rng = hayati(), np.random.default_rng(1)
    q = spread(chain, 90, rng)
    errors = planted(chain, "table", rng)
    anchors = np.tile([[1.5, 0, 0], [0, 1.5, 0], [-1.0, -1.0, 1.0]], (30, 1))
    true = chain.changed(errors)
    lengths = np.linalg.norm(true.positions(q) - anchors, axis=1)
    found = cc.calibrate(chain, q, lengths, kind="distance", anchor=anchors)
    np.testing.assert_allclose(found.chain.positions(q), true.positions(q), atol=1e-10)
    axis = np.linalg.norm(true.positions(q) - [0, 0, 2.0], axis=1)
    blind = cc.calibrate(chain, q, axis, parameters="theta", kind="distance", anchor=[0, 0, 2.0])
    assert ("theta1",) in [one.parameters for one in blind.unidentifiable]
    assert found.residuals.shape == (90, 1) and found.errors()[0].unit == "m"


def test_prismatic_offsets_are_lengths():
    chain = scara()
    q = spread(chain, 30, np.random.default_rng(2))
    true = chain.changed({"theta1": 0.01, "theta2": -0.02, "d3": 0.003})
    found = cc.calibrate(chain, q, true.positions(q), parameters=["theta1", "theta2", "d3"], kind="position")
    np.testing.assert_allclose(found.delta, [0.01, -0.02, 0.003], atol=1e-11)
    assert found.units == ("rad", "rad", "m")
    assert chain.groups["offsets"] == ["theta1", "theta2", "d3", "theta4"]


def test_continuous_joints_take_configurations_of_nq():
    robot = cc.load("kinova")
    chain, rng = cal.RobotChain(robot), np.random.default_rng(3)
    q = np.array([robot.random_configuration(rng) for _ in range(40)])
    assert q.shape[1] > robot.nv
    true = chain.changed(planted(chain, "placements", rng))
    found = cc.calibrate(robot, q, true.poses(q))
    np.testing.assert_allclose(found.chain.poses(q), true.poses(q), atol=1e-10)
    rows = [found.chain.robot.state(row).placement(robot.tool).homogeneous for row in q[:3]]
    np.testing.assert_allclose(rows, true.poses(q[:3]), atol=1e-10)


def test_far_off_steps_are_damped_and_the_cost_never_grows():
    """Errors of 10 cm and 20 deg: Gauss-Newton alone would overshoot; the answer is exact all the same."""
    hits = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        q = spread(panda(), 60, rng)
        true = panda().changed(planted(panda(), "table", rng, m=0.1, rad=np.radians(20)))
        found = cc.calibrate(panda(), q, true.poses(q))
        assert found.errors()[0].rms <= found.errors(after=False)[0].rms
        hits += found.errors()[0].rms < 1e-9
    assert hits >= 18


# --- what cannot be told apart ----------------------------------------------------------------------------------------


def test_what_cannot_be_told_apart_is_named_and_held():
    data = measure(panda(), WHOLE, 0)
    found = cc.calibrate(panda(), data.q, data.poses, parameters=WHOLE)
    named = {frozenset(one.parameters) for one in found.unidentifiable}
    assert {"base.z", "d1"} in named and {"base.x", "a1"} in named and {"base.rz", "theta1"} in named
    assert {"d7", "tool.z"} in named and {"base.rx", "alpha1"} in named
    for one in found.unidentifiable:  # a change along it is seen by none of the measurements
        step = dict(zip(one.parameters, (1e-6 * np.array(one.direction)).tolist(), strict=True))
        np.testing.assert_allclose(panda().changed(step).poses(data.q), panda().poses(data.q), atol=1e-11)
        assert max(map(abs, one.direction)) == 1.0 and one.parameters[0] in str(one)
        along = np.array([step.get(name, 0.0) for name in found.names])
        assert (
            abs(along / found.seen.scale @ (found.delta / found.seen.scale)) < 1e-12
        )  # the estimate has no part in it
    lost = {name for one in found.unidentifiable for name in one.parameters}
    assert {n for n, sure in zip(found.names, found.determined, strict=True) if not sure} == lost
    assert np.isinf(found.deviations[~found.determined]).all() and np.isfinite(found.deviations[found.determined]).all()
    assert np.isinf(found.interval()[~found.determined]).all()
    assert np.isfinite(found.covariance).all() and np.linalg.matrix_rank(found.covariance, tol=1e-14) <= 34


def test_the_independent_parameters_fit_as_well():
    data = measure(lwr(), "placements base tool", 1, count=60)
    whole = cc.calibrate(lwr(), data.q, data.poses, parameters="placements base tool")
    fewer = cc.calibrate(lwr(), data.q, data.poses, parameters=whole.independent)
    assert len(whole.independent) == whole.rank == fewer.rank and not fewer.unidentifiable
    np.testing.assert_allclose(fewer.residuals, whole.residuals, atol=2e-6)  # the curvature of what is not seen
    assert np.isfinite(fewer.interval()).all()


@pytest.mark.parametrize(("kind", "rank"), [("pose", 34), ("position", 31)])
def test_ranks_are_the_theory(kind, rank):
    """4 R + 6 for poses, 3 fewer for positions: the tool's orientation is not seen. Tables and placements alike."""
    data = measure(panda(), WHOLE, 2, count=60)
    values = data.poses if kind == "pose" else data.poses[:, :3, 3]
    assert cc.calibrate(panda(), data.q, values, parameters=WHOLE, kind=kind).rank == rank
    robot = cc.load("panda")
    six = cc.calibrate(robot, data.q, values, parameters=["placements", "base", "tool"], kind=kind, tool=TOOL)
    assert six.rank == rank and len(six.unidentifiable) == 54 - rank


@pytest.mark.parametrize(
    ("chain", "parameters", "kind"),
    [(puma, "table", "pose"), (scara, "table", "pose"), (puma, WHOLE, "position")],
    ids=["parallel axes", "a slide", "a target on the axes of the wrist"],
)
def test_what_only_the_nominal_chain_hides_is_seen_the_second_time(chain, parameters, kind):
    """Errors of second order remain: what 8 mrad make of 1 mm. From the estimate, all of it is found."""
    chain = chain()
    data = measure(chain, parameters, 5, count=60)
    values = data.exact if kind == "pose" else data.exact[:, :3, 3]
    first = cc.calibrate(chain, data.q, values, parameters=parameters, kind=kind)
    assert first.rank_after > first.rank and "calibrate its chain again" in first.summary()
    assert 1e-9 < first.errors()[0].rms < 5e-5
    again = cc.calibrate(first.chain, data.q, values, parameters=parameters, kind=kind, rank_tolerance=1e-9)
    assert again.rank > first.rank and again.errors()[0].rms < 1e-9


@pytest.mark.parametrize(("convention", "rows"), [("standard", (1, 2)), ("modified", (2, 3))])
def test_parallel_axes_need_hayatis_parameter(convention, rows):
    """Of parallel axes a table sees only the sum of their d; a tilt of the true axes about y it cannot follow."""
    points, directions = [[0, 0, 0], [0.5, 0, 0], [0.9, 0, 0.1]], np.tile([0.0, 0.0, 1.0], (3, 1))
    end = np.array([[0, 0, 1, 1.2], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1.0]])
    chain = cc.DHChain.from_axes(points, directions, tool=end, convention=convention)
    tilted = directions + [[0, 0, 0], [2e-3, 1e-3, 0], [-1e-3, 2e-3, 0]]
    true = cc.DHChain.from_axes(points, tilted, tool=end, hayati=True)
    q = spread(chain, 40, np.random.default_rng(4))
    plain = cc.calibrate(chain, q, true.poses(q), parameters=["table", "tool"])
    with_beta = cc.calibrate(chain.with_hayati(), q, true.poses(q), parameters=["table", "tool"])
    assert {"d1", "d2"} <= {name for one in plain.unidentifiable for name in one.parameters}
    assert plain.errors()[0].rms > 1e-4 and with_beta.errors()[0].rms < 1e-10
    assert {f"beta{i}" for i in rows} <= set(with_beta.names) and not {f"d{i}" for i in rows} & set(with_beta.names)


def test_a_parameter_without_effect_is_said_so():
    chain = cc.DHChain(a=[1, 1], alpha=[0, 0], d=[0, 0])
    q = spread(chain, 10, np.random.default_rng(5))
    found = cc.calibrate(chain, q, chain.positions(q) + 0.01, parameters=["a1", "alpha2", "tool.ry"], kind="position")
    texts = [str(one) for one in found.unidentifiable]
    assert "alpha2 has no effect on the measurements" in texts and "tool.ry has no effect on the measurements" in texts
    assert found.rank == 1 and found.delta[found.names.index("alpha2")] == 0.0
    none = cc.calibrate(chain, q, chain.positions(q) + 0.01, parameters="alpha2", kind="position")
    assert none.rank == 0 and none.outcome is Outcome.NOTHING_SEEN and not none.delta.any()
    assert none.radius() == 0.0 and json.loads(none.to_json())["rank"] == 0


def test_too_few_measurements_are_reported_not_inverted():
    """One pose, six numbers, 28 parameters: six combinations, and no claim how sure they are."""
    data = measure(panda(), "table", 6, count=1)
    found = cc.calibrate(panda(), data.q, data.poses)
    assert found.rank == 6 and np.isfinite(found.delta).all() and np.abs(found.delta).max() < 0.1
    assert found.errors()[0].rms < 1e-9
    assert np.isinf(found.covariance).all() and np.isinf(found.interval()).all() and found.contains(np.ones(28))
    assert "6 numbers were measured for 6 unknowns" in found.summary()
    known = cc.calibrate(panda(), data.q, data.poses, noise=(1e-4, 2e-4))
    assert np.isfinite(known.covariance).all()
    twice = cc.calibrate(panda(), np.tile(data.q, (30, 1)), np.tile(data.poses, (30, 1, 1)))
    assert twice.rank == 6  # the same pose again tells nothing new


# --- stopping, noise, statistics --------------------------------------------------------------------------------------


def test_data_that_agree_change_nothing():
    q = spread(puma(), 20, np.random.default_rng(7))
    found = cc.calibrate(puma(), q, puma().poses(q))
    assert found.outcome is Outcome.AGREES and found.iterations == 0 and not found.delta.any()
    loose = cc.calibrate(puma(), q, puma().positions(q) + 4e-4, kind="position", agreement=5e-4)
    assert loose.outcome is Outcome.AGREES and not loose.delta.any()
    assert cc.calibrate(puma(), q, puma().positions(q) + 4e-4, kind="position", parameters="a").delta.any()
    none = cc.calibrate(puma(), q, puma().positions(q) + 4e-4, kind="position", parameters="a", iterations=0)
    assert none.outcome is Outcome.ITERATIONS and not none.delta.any()


def test_unequal_noise_in_metres_and_radians_is_estimated():
    """Both standard deviations, a hundred times apart either way; the estimate is as good as with them known."""
    for noise in ((1e-5, 1e-3), (1e-3, 1e-5)):
        data = measure(panda(), "table", 8, count=400, noise=noise)
        found = cc.calibrate(panda(), data.q, data.poses)
        known = cc.calibrate(panda(), data.q, data.poses, noise=noise)
        assert found.noise["m"] == pytest.approx(noise[0], rel=0.1)
        assert found.noise["rad"] == pytest.approx(noise[1], rel=0.1)
        assert known.noise == {"m": noise[0], "rad": noise[1]}
        assert (np.abs(found.delta - known.delta) < 0.3 * known.deviations).all()


def test_the_covariance_is_that_of_the_linear_problem():
    """delta ~ N(truth, (H^T Sigma^-2 H)^-1): against the normal equations at the solution, and F, t, chi-squared."""
    data = measure(panda(), "table", 9)
    found = cc.calibrate(panda(), data.q, data.poses, noise=(1e-4, 2e-4))
    H = found.chain.regressor(data.q, "table")
    white = np.concatenate([H[:, :3] / 1e-4, H[:, 3:] / 2e-4], axis=1).reshape(-1, 28)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(white.T @ white), rtol=1e-3, atol=1e-13)
    gap = np.random.default_rng(0).normal(size=28) * 1e-4
    expected = gap @ white.T @ white @ gap
    assert found.distance(found.delta + gap) == pytest.approx(expected, rel=1e-3)
    assert found.radius(0.9) == pytest.approx(chi2.ppf(0.9, 28))
    guessed = cc.calibrate(panda(), data.q, data.poses)
    assert guessed.radius(0.9) == pytest.approx(28 * f.ppf(0.9, 28, guessed.freedom))
    half = 0.5 * np.diff(guessed.interval(0.99), axis=1).ravel()
    np.testing.assert_allclose(half, t.ppf(0.995, guessed.freedom) * guessed.deviations)
    assert 80 < guessed.freedom < 120  # 120 numbers a unit, less what the fit takes


# --- outliers ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("loss", ["huber", "cauchy", "tukey"])
def test_outliers_of_a_tenth_are_survived(loss):
    """4 of 40 poses 50 mm off: found, and the errors still in the ellipsoid; plain least squares is far worse."""
    inside, worse = 0, 0
    for seed in range(50):
        data = measure(panda(), "table", seed, wild=4)
        found = cc.calibrate(panda(), data.q, data.poses, loss=loss)
        plain = cc.calibrate(panda(), data.q, data.poses)
        off = np.linalg.norm(data.poses[:, :3, 3] - data.exact[:, :3, 3], axis=1) > 5e-3
        assert off.sum() >= 3 and set(np.flatnonzero(off)) <= set(found.outliers)
        assert len(found.outliers) <= 5 and (found.weights[off] < 0.2).all()
        inside += found.contains(data.delta)
        mine, theirs = (np.linalg.norm(e.delta - data.delta) for e in (found, plain))
        worse += theirs > 3 * mine
        assert np.linalg.norm(found.chain.positions(data.q) - data.exact[:, :3, 3], axis=1).max() < 1e-3
    assert inside >= 0.85 * 50 and worse >= 45


def test_a_robust_loss_costs_little_without_outliers():
    for loss in ("huber", "cauchy", "tukey"):
        ratios = []
        for seed in range(20):
            data = measure(panda(), "table", 500 + seed)
            robustly = cc.calibrate(panda(), data.q, data.poses, loss=loss)
            ratios.append(np.median(robustly.deviations / cc.calibrate(panda(), data.q, data.poses).deviations))
        assert 0.97 < np.mean(ratios) < 1.15, loss


@pytest.mark.parametrize("loss", robust.LOSSES)
def test_weights_are_psi_over_r(loss):
    """They fall with the residual, are 1 at 0, and inflation is 1 or a little more for normal residuals."""
    norms = np.linspace(0.0, 50.0, 400)
    w = robust.weights(loss, norms, 6)
    assert w[0] == 1.0 and (np.diff(w) <= 0.0).all() and (w >= 0.0).all()
    drawn = np.linalg.norm(np.random.default_rng(0).normal(size=(20000, 3)), axis=1)
    assert 1.0 - 1e-3 <= robust.inflation(loss, drawn, 3, 0) < 1.1


# --- lengths ----------------------------------------------------------------------------------------------------------


def published():
    (item,) = json.loads((Path(__file__).parent / "data" / "calibration_examples.json").read_text())
    q = [[number("q", x, {}) if isinstance(x, str) else float(x) for x in row] for row in item["inputs"]["q"]]
    return item, np.array(q), np.column_stack([item["inputs"]["p"], np.zeros(len(q))])


def test_the_published_link_lengths():
    """De Luca, Robotics 2, midterm of 13 April 2022, exercise 1: with and without nominal values."""
    item, q, p = published()
    chain = cc.DHChain(a=item["inputs"]["L_nominal"], alpha=[0, 0], d=[0, 0])
    found = cal.link_lengths(chain, q, p)
    np.testing.assert_allclose(found.before[:, :2].ravel(), item["expected"]["dp"], atol=1e-4)
    np.testing.assert_allclose(found.delta, item["expected"]["dL"], atol=1e-4)
    np.testing.assert_allclose(found.lengths, item["expected"]["L"], atol=1e-4)
    assert np.linalg.norm(found.residuals) == pytest.approx(6.8e-5, abs=1e-6) and not found.agreed
    unknown = cc.DHChain(a=[7.0, -3.0], alpha=[0, 0], d=[0, 0])  # nonsense, that nominal=False does not look at
    blind = cal.link_lengths(unknown, q, p, nominal=False)
    np.testing.assert_allclose(blind.lengths, found.lengths, atol=1e-12)
    np.testing.assert_allclose(blind.chain.positions(q), found.chain.positions(q), atol=1e-12)
    iterated = cc.calibrate(chain, q, p, parameters="a", kind="position")
    np.testing.assert_allclose(iterated.delta, found.delta, atol=1e-9)


def test_lengths_that_agree_are_left_and_unseen_ones_named():
    chain = cc.DHChain(a=[1.0, 0.8], alpha=[0, 0], d=[0.1, 0.2])
    q = spread(chain, 5, np.random.default_rng(10))
    same = cal.link_lengths(chain, q, chain.positions(q), "a d")
    assert same.agreed and not same.delta.any()
    moved = cal.link_lengths(chain, q, chain.positions(q) + [0, 0, 0.02], "a d")
    assert [set(one.parameters) for one in moved.unidentifiable] == [{"d1", "d2"}] and moved.rank == 3
    assert moved.names == ("d1", "a1", "d2", "a2") and moved.lengths == pytest.approx([0.11, 1.0, 0.21, 0.8])
    straight = np.column_stack([q[:, 0], np.zeros(5)])  # sin q2 = 0: only the sum of the links shows
    stretched = cal.link_lengths(chain, straight, chain.positions(straight) * [1.1, 1.1, 1.0], "a")
    assert stretched.rank == 1 and stretched.lengths.sum() == pytest.approx(1.98)
    none = cal.link_lengths(chain, straight, chain.positions(straight), "a", nominal=False)
    np.testing.assert_allclose(none.lengths, [0.9, 0.9], atol=1e-12)  # the shortest that fit


def test_lengths_of_random_tables_without_nominal_values():
    for seed in range(10):
        rng = np.random.default_rng(seed)
        a, d, alpha = rng.uniform(0.1, 1.0, (3, 4))
        true, q = cc.DHChain(a, alpha, d), rng.normal(size=(30, 4))
        found = cal.link_lengths(
            cc.DHChain(np.zeros(4), alpha, np.zeros(4)), q, true.positions(q), "a d", nominal=False
        )
        np.testing.assert_allclose(found.chain.positions(q), true.positions(q), atol=1e-12)
        np.testing.assert_allclose(found.chain.a, a, atol=1e-10)


# --- design, validation, alignment ------------------------------------------------------------------------------------


def test_the_choice_is_the_best_of_all_where_all_can_be_tried():
    """3 of 12 candidates on a planar arm: the exchange finds the largest determinant of the 220 choices."""
    from itertools import combinations

    chain = cc.DHChain(a=[1, 0.8], alpha=[0, 0], d=[0, 0])
    for seed in range(8):
        q = spread(chain, 12, np.random.default_rng(seed))
        options = {"parameters": ["a1", "a2", "theta1", "theta2"], "kind": "position"}
        found = cal.choose_configurations(chain, q, 3, **options)
        H = chain.regressor(q, options["parameters"])[:, :3]

        def value(chosen, H=H):
            J = H[list(chosen)].reshape(-1, 4)
            return np.linalg.slogdet(J.T @ J)[1]

        best = max(combinations(range(12), 3), key=value)
        assert value(found.chosen) == pytest.approx(value(best), abs=1e-6)
        assert found.rank == 4 and np.isfinite(found.condition)


def test_chosen_configurations_beat_random_ones():
    """25 of 200: a smaller ellipsoid than any of 200 random choices, a smaller worst deviation than their median."""
    rng = np.random.default_rng(11)
    q = spread(panda(), 200, rng)
    found = cal.choose_configurations(panda(), q, 25, parameters=WHOLE)
    assert found.rank == 34 and len(set(found.chosen.tolist())) == 25 and found.exchanges > 0

    def deviations(chosen):
        exact = panda().poses(q[chosen])
        return cc.calibrate(panda(), q[chosen], exact, parameters=WHOLE, noise=(1e-3, 1e-3))

    chosen = deviations(found.chosen)
    drawn = [deviations(rng.choice(200, 25, replace=False)) for _ in range(200)]
    gauge = chosen.seen.basis / chosen.seen.scale[:, None] ** 2  # any full set of 34 directions that are seen

    def volume(result):
        """Of the confidence ellipsoid, its logarithm, on the same directions for all."""
        return float(np.linalg.slogdet(gauge.T @ result.covariance @ gauge)[1])

    assert volume(chosen) < min(map(volume, drawn))
    worst = np.median([c.deviations[c.determined].max() for c in drawn])
    assert chosen.deviations[chosen.determined].max() < worst


def test_a_choice_too_small_to_see_all_says_so():
    q = spread(panda(), 30, np.random.default_rng(12))
    found = cal.choose_configurations(panda(), q, 2, parameters="table")
    assert len(found.chosen) == 2 and math.isinf(found.condition)
    again = cal.choose_configurations(panda(), q, 2, parameters="table")
    np.testing.assert_array_equal(found.chosen, again.chosen)


def test_cross_validation_tells_what_was_learnt_from_what_was_fitted():
    """Predicted errors are near the noise for enough data, and far above the fitted ones for too few."""
    data = measure(panda(), "table", 13, count=100)
    found = cal.cross_validate(panda(), data.q, data.poses, parameters="table", folds=5)
    assert sorted(np.bincount(found.folds)) == [20] * 5 and len(found.results) == 5
    assert found.after[0].rms == pytest.approx(math.sqrt(3) * 1e-4, rel=0.35) and found.before[0].rms > 2e-3
    for k, result in enumerate(found.results):  # each fold was predicted by a chain that had not seen it
        left = found.folds == k
        expected = data.poses[left][:, :3, 3] - result.chain.positions(data.q[left])
        np.testing.assert_allclose(found.residuals[left][:, :3], expected, atol=1e-15)
        assert len(result.data) == 80
    few = measure(panda(), "table", 14, count=6)
    fitted = cc.calibrate(panda(), few.q, few.poses, parameters="table")
    predicted = cal.cross_validate(panda(), few.q, few.poses, parameters="table", folds=6)
    assert predicted.after[0].rms > 3 * fitted.errors()[0].rms


@pytest.mark.parametrize("kind", ["pose", "position"])
@pytest.mark.parametrize("wild", [0, 6])
def test_a_device_anywhere_in_the_room(kind, wild):
    """Its frame turned by 2 rad and metres away: alignment first, then base and tool with the table."""
    robot = cc.load("panda")
    base = np.array([[0, -1, 0, 1.0], [0.6, 0, -0.8, -2.0], [0.8, 0, 0.6, 0.5], [0, 0, 0, 1]])
    chain = cal.RobotChain(robot, base=base)
    data = measure(chain, ["placements", "tool"], 15, count=60, wild=wild)
    values = data.poses if kind == "pose" else data.poses[:, :3, 3]
    start = cal.aligned(robot, data.q, values, kind=kind)
    assert np.abs(start.base - base).max() < 0.05
    found = cc.calibrate(start, data.q, values, kind=kind, parameters="placements base tool", loss="huber")
    np.testing.assert_allclose(found.chain.positions(data.q), data.exact[:, :3, 3], atol=5e-4)
    table = cal.aligned(panda(), data.q, values, kind=kind)
    assert isinstance(table, cc.DHChain) and np.abs(table.base - base).max() < 0.1


# --- results ----------------------------------------------------------------------------------------------------------


def test_the_result_as_urdf_and_json(tmp_path):
    robot = cc.load("lwr")
    data = measure(lwr(), "placements", 16)
    found = cc.calibrate(robot, data.q, data.poses)
    loaded = cc.load(found.write_urdf(tmp_path / "sub" / "lwr.urdf"), tool=robot.tool)
    for q, T in zip(data.q, found.chain.poses(data.q), strict=True):
        np.testing.assert_allclose(loaded.state(q).placement(robot.tool).homogeneous, T, atol=1e-12)
    facts = json.loads(found.write_json(tmp_path / "lwr.json").read_text())
    assert [p["name"] for p in facts["parameters"]] == list(found.names)
    assert [p["delta"] for p in facts["parameters"]] == found.delta.tolist()
    assert facts["rank"] == found.rank and len(facts["unidentifiable"]) == len(found.unidentifiable)
    assert any(p["deviation"] is None for p in facts["parameters"])  # not determined, and JSON knows no infinity
    summary = found.summary()
    assert "rank" in summary and "RMS" in summary and str(found.unidentifiable[0]) in summary
    name, unit, old, new, deviation = cc.calibrate(puma(), *exact_puma()).table()[0]
    assert (name, unit, old) == ("theta1", "rad", 0.0) and new == pytest.approx(0.01) and deviation < 1e-6


def exact_puma():
    q = spread(puma(), 30, np.random.default_rng(17))
    return q, puma().changed({"theta1": 0.01}).poses(q)


def test_poses_come_in_three_forms():
    import pinocchio as pin
    from scipy.spatial.transform import Rotation

    data = measure(puma(), "theta", 18)
    seven = np.column_stack([data.poses[:, :3, 3], Rotation.from_matrix(data.poses[:, :3, :3]).as_quat()])
    se3 = [pin.SE3(T[:3, :3], T[:3, 3]) for T in data.poses]
    results = [cc.calibrate(puma(), data.q, values, parameters="theta").delta for values in (data.poses, seven, se3)]
    np.testing.assert_allclose(results[1], results[0], atol=1e-11)
    np.testing.assert_allclose(results[2], results[0], atol=1e-11)


def test_half_turns_of_a_measured_rotation_are_no_trouble():
    """Residuals near pi, where the logarithm's derivative is singular: outliers, and still finite."""
    data = measure(puma(), "theta", 19)
    flipped = data.poses.copy()
    flipped[0, :3, :3] = flipped[0, :3, :3] @ np.diag([-1.0, -1.0, 1.0])
    found = cc.calibrate(puma(), data.q, flipped, parameters="theta", loss="tukey")
    assert found.outliers.tolist() == [0] and np.isfinite(found.covariance).all()
    assert np.abs(found.delta - data.delta).max() < 1e-3


Q = np.zeros((4, 6))
P = np.zeros((4, 3))


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"q": np.zeros((4, 5))}, ShapeError, r"\(N, 6\)"),
        ({"q": np.zeros((3, 6))}, ShapeError, r"expected \(3, 3\)"),
        ({"q": "none"}, ShapeError, "q is"),
        ({"measurements": np.full((4, 3), np.nan)}, NonFiniteError, r"measurements\[0, 0\]"),
        ({"measurements": np.full((4, 3), 1e9)}, ParameterError, "metres"),
        ({"measurements": np.zeros((4, 2))}, ShapeError, "a z of 0"),
        ({"measurements": np.zeros((4, 2)), "kind": None}, ShapeError, "a z of 0"),
        ({"measurements": None}, ShapeError, "measurements"),
        ({"kind": "poses"}, ParameterError, "'pose', 'position', 'distance'"),
        ({"kind": "pose"}, ShapeError, "quaternion"),
        ({"kind": "pose", "measurements": np.zeros((4, 4, 4))}, ParameterError, r"measurements\[0\] is no pose"),
        ({"kind": "pose", "measurements": np.ones((4, 7))}, ParameterError, r"norm 2"),
        ({"kind": "pose", "measurements": np.tile(np.diag([1.0, 1, -1, 1]), (4, 1, 1))}, ParameterError, "no pose"),
        ({"kind": "distance", "measurements": [-1.0, 1, 1, 1]}, ParameterError, "distances >= 0"),
        ({"kind": "distance", "measurements": np.ones(4), "anchor": [0.0, 0.0]}, ShapeError, "anchor"),
        ({"anchor": [0, 0, 0]}, ParameterError, "anchor"),
        ({"parameters": "b"}, ParameterNotFound, "'b'"),
        ({"parameters": ()}, ParameterError, "at least one"),
        ({"noise": 0.0}, ParameterError, "above 0"),
        ({"noise": (1, 1)}, ShapeError, "noise"),
        ({"noise": np.inf}, NonFiniteError, "noise"),
        ({"loss": "l1"}, ParameterError, "'huber'"),
        ({"iterations": -1}, ParameterError, "iterations"),
        ({"rank_tolerance": 0.0}, ParameterError, "rank_tolerance"),
        ({"agreement": -1.0}, ParameterError, "agreement"),
        ({"frame": "tool"}, ParameterError, "with a robot only"),
        ({"base": np.eye(4)}, ParameterError, "with a robot only"),
    ],
)
def test_misuse_of_calibrate_is_named(options, error, words):
    given = {"q": Q, "measurements": P, "kind": "position"} | options
    with pytest.raises(error, match=words):
        cc.calibrate(puma(), given.pop("q"), given.pop("measurements"), **given)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: cc.calibrate("panda", Q, P), ParameterError, "cc.DHChain"),
        (lambda: cal.link_lengths(puma(), Q, P, "theta"), ParameterError, "angle"),
        (lambda: cal.link_lengths(cc.load("panda"), Q, P), ParameterError, "cc.DHChain"),
        (lambda: cal.choose_configurations(puma(), Q, 5), ParameterError, "count"),
        (lambda: cal.choose_configurations(puma(), Q, 2, parameters="alpha6", kind="position"), ParameterError, "none"),
        (lambda: cal.cross_validate(puma(), Q, P, kind="position", folds=5), ParameterError, "at most 4"),
        (lambda: cal.cross_validate(puma(), Q, P, kind="position", folds=1), ParameterError, "folds"),
        (lambda: cal.cross_validate(puma(), Q, P, kind="position", folds=2.5), ParameterError, "folds is 2.5"),
        (lambda: cal.choose_configurations(puma(), Q, 2.5), ParameterError, "count is 2.5"),
        (lambda: cal.cross_validate(puma(), Q, P, kind="position", folds=2, seed=2.5), ParameterError, "seed is 2.5"),
        (lambda: cal.choose_configurations(puma(), Q, 2, seed=-1), ParameterError, "seed is -1"),
        (lambda: cc.calibrate(puma(), Q, P, iterations=2.5), ParameterError, "iterations is 2.5"),
        (lambda: cal.aligned(puma(), Q, P, kind="position"), cc.CartctlError, "lie on a line"),
        (lambda: cal.aligned(puma(), Q, np.ones(4), kind="distance"), cc.CartctlError, "distance"),
    ],
)
def test_misuse_of_the_rest_is_named(call, error, words):
    with pytest.raises(error, match=words):
        call()


def test_degrees_and_millimetres_are_suspected():
    """A newcomer's first try: the summary says what it looks like, of q, of the table and of the measurements."""
    data = measure(puma(), "theta", 23)
    fine = cc.calibrate(puma(), data.q, data.poses, parameters="theta").summary()
    assert "degrees" not in fine and "millimetres" not in fine
    wrong = np.array(data.poses)
    wrong[:, :3, 3] *= 1e3
    found = cc.calibrate(puma(), np.degrees(data.q), wrong, parameters="theta").summary()
    assert "q reaches" in found and "if these are millimetres" in found
    table = cc.DHChain([0, 0.4], [90, 0], [0, 0])
    assert "the table has an angle of 90 rad" in cc.calibrate(table, np.zeros((4, 2)), np.ones((4, 3))).summary()


def test_singular_data_give_numbers_all_the_same():
    """All measurements at one stretched posture: most is not seen, nothing is nan, nothing flies off."""
    chain = cc.DHChain(a=[1, 1, 1], alpha=[0, 0, 0], d=[0, 0, 0])
    q = np.zeros((20, 3))
    p = chain.positions(q) + 1e-3 * np.random.default_rng(20).normal(size=(20, 3))
    found = cc.calibrate(chain, q, p, kind="position")
    assert found.rank == 3 and np.isfinite(found.delta).all() and np.abs(found.delta).max() < 0.01
    assert np.isfinite(found.covariance).all() and not np.isnan(found.interval()).any()
    assert HALF > np.abs(found.chain.theta).max()


@pytest.mark.parametrize(("m", "n"), [(5000, 7), (1000, 30), (40, 3), (3, 5), (768, 4), (769, 4), (0, 3), (7, 0)])
def test_the_r_of_tall_matrices(m, n):
    A = np.random.default_rng(m + n).normal(size=(m, n))
    R = tall_r(A)
    assert len(R) <= n and np.allclose(np.tril(R, -1), 0.0)
    np.testing.assert_allclose(R.T @ R, A.T @ A, atol=1e-12 * max(m, 1))


@pytest.mark.parametrize("seed", range(150))
def test_whatever_the_data_no_nan_leaves(seed):
    """Random small tables, degenerate ones too, few and contradictory measurements, every kind and loss."""
    rng = np.random.default_rng(seed)
    n, count = int(rng.integers(1, 5)), int(rng.integers(1, 9))
    columns = [rng.choice([0.0, 0.0, 0.5, 1.0, -HALF, HALF, rng.normal()], n) for _ in range(4)]
    chain = cc.DHChain(*columns, "".join(rng.choice(list("RRRP"), n)), str(rng.choice(["standard", "modified"])))
    q = rng.normal(size=(count, n)) * rng.choice([0.0, 1.0, 5.0])
    poses = chain.changed({name: 1e-2 * rng.normal() for name in chain.names}).poses(q)
    kind = str(rng.choice(["pose", "position", "distance"]))
    values = {"pose": poses, "position": poses[:, :3, 3], "distance": np.linalg.norm(poses[:, :3, 3], axis=1)}[kind]
    if kind != "pose":
        values = np.abs(values + rng.choice([0.0, 1e-3, 10.0]) * rng.normal(size=values.shape))
    parameters = str(rng.choice(["table", "table base tool", "a", "theta", "tool", "base d"]))
    noise = None if rng.random() < 0.6 else (1e-3, 1e-3) if kind == "pose" else 1e-3
    with np.errstate(all="raise", under="ignore"):
        found = cc.calibrate(chain, q, values, parameters=parameters, loss=str(rng.choice(robust.LOSSES)), noise=noise)
    assert found.kind == kind  # from the shape alone
    for array in (
        found.covariance,
        found.deviations,
        found.interval(),
        found.weights,
        found.radius(),
        found.distance(found.delta),
    ):
        assert not np.isnan(array).any()
    assert np.isfinite(found.delta).all() and np.isfinite(found.residuals).all()
    assert "NaN" not in found.to_json() and "nan" not in found.urdf() and found.summary()


def test_a_device_anywhere_is_found_without_alignment_too():
    """From errors of 2.6 m and 100 deg damped steps find the base by themselves."""
    robot = cc.load("lwr")
    base = np.array([[0, -1, 0, 1.0], [0.6, 0, -0.8, -2.0], [0.8, 0, 0.6, 0.5], [0, 0, 0, 1]])
    data = measure(cal.RobotChain(robot, base=base), "placements", 0)
    found = cc.calibrate(robot, data.q, data.poses, parameters="placements base")
    assert found.outcome is Outcome.CONVERGED and found.errors(after=False)[0].rms > 2.0
    np.testing.assert_allclose(found.chain.positions(data.q), data.exact[:, :3, 3], atol=5e-4)


def test_locked_joints_are_part_of_the_placements(tmp_path):
    """A Panda with two joints locked: five are calibrated; the file, loaded with the same two locked, is the result."""
    active = [f"panda_joint{i}" for i in (1, 2, 4, 6, 7)]
    robot = cc.load("panda", active_joints=active, home={"panda_joint3": 0.4, "panda_joint5": -0.7})
    chain, rng = cal.RobotChain(robot), np.random.default_rng(21)
    q = rng.uniform(-1.0, 1.0, (40, 5))
    true = chain.changed(planted(chain, "placements offsets tool", rng))
    found = cc.calibrate(robot, q, true.poses(q), parameters="placements tool")
    assert [joint.name for joint in chain.joints] == active and found.errors()[0].rms < 1e-9
    from cartctl.calibration.urdf import mesh_folders

    path = found.write_urdf(tmp_path / "five.urdf")
    loaded = cc.load(
        path,
        active_joints=active,
        home={"panda_joint3": 0.4, "panda_joint5": -0.7},
        package_dirs=mesh_folders(found.chain),
    )
    for row, T in zip(q, true.poses(q), strict=True):
        np.testing.assert_allclose(loaded.state(row).placement("calibrated_tool").homogeneous, T, atol=1e-9)


def test_a_joint_called_base_or_tool_is_not_the_base_or_the_tool(tmp_path):
    from cartctl.model.planar import planar_urdf

    path = tmp_path / "arm.urdf"
    path.write_text(planar_urdf([0.5, 0.4]).replace('"joint1"', '"base"'))
    path.write_text(
        path.read_text().replace('<link name="base"', '<link name="root"').replace('link="base"', 'link="root"')
    )
    chain = cal.RobotChain(cc.load(path))
    assert len(set(chain.names)) == len(chain.names) and "base_joint.x" in chain.names and "base.x" in chain.names
    q = np.random.default_rng(0).uniform(-2, 2, (10, 2))
    moved = chain.changed({"base_joint.x": 0.01})
    np.testing.assert_allclose(moved.positions(q), chain.positions(q) + [0.01, 0, 0], atol=1e-15)
    (tmp_path / "moved.urdf").write_text(moved.urdf())
    loaded = cc.load(tmp_path / "moved.urdf", tool="tool")
    np.testing.assert_allclose(loaded.state(q[0]).position("tool"), moved.positions(q)[0], atol=1e-14)


def test_columns_are_scaled_before_they_are_compared():
    """Rank, directions and independent ones do not depend on units: metres, millimetres or micrometres."""
    rng = np.random.default_rng(22)
    H = rng.normal(size=(60, 6))
    H[:, 4] = 2.0 * H[:, 1] - H[:, 2]
    H[:, 5] = 0.0
    names = list("abcdef")
    plain = identify(H, names, 1e-9)
    units = np.array([1e-6, 1e3, 1.0, 1e4, 1e-3, 1.0])
    scaled = identify(H * units, names, 1e-9)
    assert plain.rank == scaled.rank == 4 and plain.independent == scaled.independent
    assert plain.condition == pytest.approx(scaled.condition) and plain.condition < 100
    assert [one.parameters for one in scaled.unidentifiable] == [("f",), ("b", "c", "e")]
    for one in scaled.unidentifiable:
        change = np.array([dict(zip(one.parameters, one.direction, strict=True)).get(name, 0.0) for name in names])
        assert np.abs(H * units @ change).max() < 1e-9 * np.abs(H * units * change).max(initial=1e-9)
    np.testing.assert_array_equal(scaled.seen, [True, False, False, True, False, False])
    assert np.linalg.matrix_rank(scaled.basis / scaled.scale[:, None]) == 4
