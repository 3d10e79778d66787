"""Analysis: ranks, ellipsoids, inverses and projectors against other formulas; singularities where they are known."""

from __future__ import annotations

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.linalg import subspace_angles

import cartctl as cc
from cartctl import analysis
from cartctl.algebra.nullspace import projector
from cartctl.errors import (
    CartctlError,
    FrameNotFound,
    MetricError,
    NonFiniteError,
    ParameterError,
    ShapeError,
)
from tests import oracles, robots_for_tests
from tests import tolerances as tol
from tests.worked_examples import ITEMS, real

SCALES = st.sampled_from([1e-150, 1e-6, 1.0, 1e6, 1e150])


def pinv(A):
    """By numpy, with a cutoff that knows the scale of the oracles' matrices."""
    return np.linalg.pinv(A, rcond=oracles.GAP) if A.size else A.T


def true_rank(A):
    return int(np.linalg.matrix_rank(A, tol=oracles.GAP)) if A.size else 0


# ---------------------------------------------------------------- singular values


@given(oracles.systems(), SCALES)
def test_spectrum_of_any_shape_rank_and_scale(system, size):
    _, (A,), _ = system
    m, n = A.shape
    found = analysis.spectrum(A * size)
    rank = true_rank(A)
    assert found.rank == rank == analysis.rank(A * size)
    assert found.nullity == n - rank == analysis.nullity(A * size)
    assert found.redundancy == n - rank == analysis.redundancy(A * size)
    expected = np.linalg.svd(A, compute_uv=False) if A.size else np.zeros(0)
    np.testing.assert_allclose(analysis.singular_values(A * size) / size, expected, atol=tol.EXACT * 10)
    if rank < min(m, n):
        assert found.condition == np.inf and found.manipulability == 0.0
    elif A.size:
        assert found.condition == pytest.approx(np.linalg.cond(A), rel=1e-9)
    assert (found.determinant is None) == (m != n)


@given(oracles.SEEDS, st.integers(1, 8), st.integers(1, 8))
def test_manipulability_is_the_root_of_the_gram_determinant(seed, m, n):
    J = oracles.matrix(np.random.default_rng(seed), m, n)
    gram = J @ J.T if m <= n else J.T @ J
    assert analysis.manipulability(J) == pytest.approx(math.sqrt(np.linalg.det(gram)), rel=tol.ORACLE)
    assert analysis.manipulability(J) == pytest.approx(np.prod(np.linalg.svd(J, compute_uv=False)), rel=tol.EXACT)
    if m == n:
        assert analysis.determinant(J) == pytest.approx(np.linalg.det(J), rel=tol.ORACLE)
        assert analysis.manipulability(J) == pytest.approx(abs(analysis.determinant(J)), rel=tol.ORACLE)


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_determinant_of_the_planar_2r(q1, q2):
    """det J = l1 l2 sin q2."""
    robot = cc.planar([0.9, 0.6])
    J = robot.state([q1, q2]).jacobian("tool")[:2]
    assert analysis.determinant(J) == pytest.approx(0.9 * 0.6 * math.sin(q2), abs=tol.EXACT)


def test_matrices_without_rows_and_with_one_column():
    empty = analysis.spectrum(np.zeros((0, 3)))
    assert (empty.rank, empty.nullity, empty.condition, empty.manipulability) == (0, 3, 1.0, 1.0)
    column = analysis.spectrum([[3.0], [4.0]])
    assert (column.rank, column.nullity, column.condition) == (1, 0, 1.0)
    assert column.manipulability == pytest.approx(5.0)
    assert analysis.determinant(np.zeros((0, 0))) == 1.0
    assert analysis.determinant([[2.0]]) == 2.0 and analysis.determinant([[0.0]]) == 0.0
    assert analysis.spectrum(np.zeros((2, 3))).condition == np.inf
    assert analysis.manipulability([[1.0, 2.0, 3.0], [0.1, 0.2, 0.3]]) == 0.0  # not the round-off that LAPACK leaves


def test_a_tolerance_for_matrices_known_to_fewer_digits():
    A = np.diag([1.0, 1e-9])
    assert analysis.rank(A) == 2 and analysis.rank(A, tolerance=1e-8) == 1
    assert analysis.determinant(A) == pytest.approx(1e-9) and analysis.determinant(A, tolerance=1e-8) == 0.0
    assert analysis.rank(1e20 * A, tolerance=1e-8) == 1


def test_determinants_beyond_the_largest_float_keep_their_sign():
    A = np.eye(40) * 1e20
    A[0] *= -1.0
    assert analysis.determinant(A) == -np.inf


# ---------------------------------------------------------------- ellipsoids


@given(oracles.systems(), oracles.METRICS)
def test_ellipsoids_are_the_images_of_unit_balls(system, kind):
    """For v^T W v = 1 the ellipsoid holds J v; a force at its tip needs tau^T W^-1 tau = 1; both are reciprocal."""
    rng, (J,), _ = system
    m, n = J.shape
    W = oracles.metric(rng, n, kind)
    full = oracles.full_metric(W, n)
    velocity, force = analysis.velocity_ellipsoid(J, W), analysis.force_ellipsoid(J, W)
    rank = true_rank(J)
    for ellipsoid in (velocity, force):
        np.testing.assert_allclose(ellipsoid.axes.T @ ellipsoid.axes, np.eye(m), atol=tol.EXACT)
        assert list(ellipsoid.lengths) == sorted(ellipsoid.lengths, reverse=True)
    assert (velocity.lengths > 0.0).sum() == rank == np.isfinite(force.lengths).sum()
    with np.errstate(divide="ignore"):
        np.testing.assert_array_equal(force.lengths, 1.0 / velocity.lengths[::-1])
    np.testing.assert_array_equal(force.axes, velocity.axes[:, ::-1])

    v = rng.normal(size=n)
    v /= math.sqrt(v @ full @ v)
    inside = velocity.axes.T @ J @ v
    np.testing.assert_allclose(inside[rank:], 0.0, atol=tol.EXACT * 10)
    assert np.linalg.norm(inside[:rank] / velocity.lengths[:rank]) <= 1.0 + tol.EXACT
    for axis, length in zip(velocity.axes.T[:rank], velocity.lengths[:rank], strict=True):
        fastest = np.linalg.solve(full, J.T @ axis) / length  # the joint velocity that reaches the tip
        assert fastest @ full @ fastest == pytest.approx(1.0, rel=tol.ORACLE)
        np.testing.assert_allclose(J @ fastest, length * axis, atol=tol.ORACLE)
    for axis, length in zip(force.axes.T[m - rank :], force.lengths[m - rank :], strict=True):
        tau = J.T @ (length * axis)
        assert tau @ np.linalg.solve(full, tau) == pytest.approx(1.0, rel=tol.ORACLE)


@given(oracles.SEEDS, st.integers(1, 6))
def test_transmission_ratios(seed, m):
    """Chiu: (d^T (J J^T)^-1 d)^-1/2 of velocities and (d^T J J^T d)^-1/2 of forces."""
    rng = np.random.default_rng(seed)
    J = oracles.matrix(rng, m, m + 2)
    d = rng.normal(size=m)
    unit = d / np.linalg.norm(d)
    velocity, force = analysis.velocity_ellipsoid(J), analysis.force_ellipsoid(J)
    assert velocity.along(d) == pytest.approx((unit @ np.linalg.solve(J @ J.T, unit)) ** -0.5, rel=tol.ORACLE)
    assert force.along(d) == pytest.approx((unit @ J @ J.T @ unit) ** -0.5, rel=tol.ORACLE)
    assert velocity.isotropy == pytest.approx(1.0 / np.linalg.cond(J), rel=tol.ORACLE)
    ball = math.pi ** (m / 2) / math.gamma(m / 2 + 1)
    assert velocity.volume == pytest.approx(ball * analysis.manipulability(J), rel=tol.ORACLE)


def test_ellipsoids_of_a_stretched_arm():
    """Along the arm no velocity, and any force."""
    J = cc.planar([1.0, 0.5]).state([0.4, 0.0]).jacobian("tool")[:2]
    along, across = np.array([math.cos(0.4), math.sin(0.4)]), np.array([-math.sin(0.4), math.cos(0.4)])
    velocity, force = analysis.velocity_ellipsoid(J), analysis.force_ellipsoid(J)
    assert velocity.along(along) == 0.0 and velocity.along(across) == pytest.approx(math.hypot(1.5, 0.5))
    assert force.along(along) == np.inf and force.along(across) == pytest.approx(1.0 / math.hypot(1.5, 0.5))
    assert velocity.isotropy == force.isotropy == 0.0 and velocity.volume == 0.0
    assert abs(velocity.axes[:, 1] @ along) == pytest.approx(1.0) == abs(force.axes[:, 0] @ along)
    nothing = analysis.velocity_ellipsoid(np.zeros((2, 3)))
    assert nothing.along([1.0, 2.0]) == 0.0 and nothing.isotropy == 0.0
    assert analysis.force_ellipsoid(np.zeros((2, 3))).along([1.0, 2.0]) == np.inf
    assert analysis.velocity_ellipsoid(np.zeros((0, 2))).isotropy == 1.0


# ---------------------------------------------------------------- singularities at a configuration


@given(oracles.systems(), SCALES)
def test_lost_directions_are_what_no_joint_moves(system, size):
    _, (J,), _ = system
    m, rank = J.shape[0], true_rank(J)
    found = analysis.kinematic_singularity(J * size)
    assert found.occurs == (rank < m) and found.rank == rank and found.lost.shape == (m, m - rank)
    np.testing.assert_allclose(found.lost.T @ found.lost, np.eye(m - rank), atol=tol.EXACT)
    np.testing.assert_allclose(found.lost.T @ J, 0.0, atol=tol.EXACT * 10)
    assert len(found.names) == m - rank and all(name in found.reason for name in found.names)


@given(oracles.SEEDS, st.sets(st.sampled_from(range(6)), max_size=5))
def test_lost_axes_have_their_names(seed, lost):
    """However the decomposition mixes them."""
    rng = np.random.default_rng(seed)
    J = oracles.matrix(rng, 6, 8)
    J[sorted(lost)] = 0.0
    names = ("x", "y", "z", "rx", "ry", "rz")
    assert analysis.kinematic_singularity(J, names).names == tuple(names[i] for i in sorted(lost))


def test_slanted_lost_directions_are_spelt_out():
    J = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    found = analysis.kinematic_singularity(J, ["x", "y", "rz"])
    assert found.names == ("0.71 x - 0.71 y",) and found.reason.endswith("rank 2 of 3, lost 0.71 x - 0.71 y")
    assert analysis.kinematic_singularity(J.T).reason == "regular: rank 2 of 2"
    assert analysis.kinematic_singularity([[0.0]]).names == ("row 0",)


@given(oracles.SEEDS, st.integers(1, 3), st.integers(1, 3), st.integers(0, 2))
def test_algorithmic_singularity_whatever_the_units(seed, m1, m2, spare):
    rng = np.random.default_rng(seed)
    n = m1 + m2 + spare
    rows = oracles.matrix(rng, m1 + m2, n)
    J1, J2 = oracles.matrix(rng, m1, m1) @ rows[:m1], oracles.matrix(rng, m2, m2) @ rows[m1:]
    found = analysis.algorithmic_singularity(1e10 * J1, 1e-10 * J2)
    assert not found.occurs and found.stacked_rank == m1 + m2 and found.reason.startswith("regular")
    cosine = math.cos(subspace_angles(J1.T, J2.T).min())
    assert found.closeness == pytest.approx(math.sqrt(max(1.0 - cosine, 0.0)), abs=tol.HALF_TURN)

    J2[0] = rng.normal(size=m1) @ J1  # a row that the first task already has
    assume(true_rank(J2) == m2)
    found = analysis.algorithmic_singularity(1e10 * J1, 1e-10 * J2)
    assert found.occurs and found.stacked_rank == m1 + m2 - 1 and found.reason.startswith("algorithmic")
    assert found.closeness < tol.ORACLE
    assert analysis.algorithmic_singularity(J2, J1).occurs


def test_other_conflicts_are_no_algorithmic_singularities():
    J = np.random.default_rng(5).normal(size=(2, 4))
    weak = np.vstack([J[0], 2.0 * J[0]])
    found = analysis.algorithmic_singularity(J, weak)
    assert not found.occurs and not found.regular and "kinematic singularity of task 2: rank 1 of 2" in found.reason
    crowded = analysis.algorithmic_singularity(J, np.vstack([J, J[:1] + 1.0])[1:], np.eye(4)[:1])
    assert not crowded.occurs and not crowded.fits and "5 rows, 4 joints" in crowded.reason
    assert crowded.closeness == 0.0
    nothing = analysis.algorithmic_singularity(np.zeros((0, 4)), J)
    assert not nothing.occurs and nothing.closeness == pytest.approx(1.0)
    three = analysis.algorithmic_singularity([[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]], [[1.0, 1.0, 0.0]])
    assert three.occurs and three.stacked_rank == 2


# ---------------------------------------------------------------- published singularities


def prrr(q):
    """A rail-mounted planar 3R in absolute angles, tip position."""
    c, s = np.cos(q[1:]), np.sin(q[1:])
    return np.array([[1.0, *-s], [0.0, *c]])


def first_angle(q):
    return np.array([0.0, 1.0, 0.0, 0.0])


def test_the_rail_mounted_arm_of_2020_07_15():
    item = ITEMS["r2-2020-07-15-ex2"]
    start, singular = real(item["inputs"]["q0"]), real(item["inputs"]["qs"])
    found = analysis.algorithmic_singularity(prrr(singular), first_angle(singular)[None])
    assert found.occurs and found.stacked_rank == item["expected"]["rank_s"]
    assert not analysis.algorithmic_singularity(prrr(start), first_angle(start)[None]).occurs

    box = analysis.Box([-5.0, *[-math.pi] * 3], [5.0, *[math.pi] * 3])
    search = analysis.find_algorithmic_singularities(box, [prrr, first_angle], starts=8)
    assert search.starts == 8 and len(search.found) >= 6
    for end in search.found:  # "cos q3 = cos q4 = 0"
        np.testing.assert_allclose(np.cos(end.q[2:]), 0.0, atol=tol.MET)
        assert (box.lower <= end.q).all() and (end.q <= box.upper).all() and end.singularity.occurs


def test_the_tip_and_the_elbows_height_of_2013_01_09():
    """det of the stack is -cos q3 sin(q2 - q1), absolute angles: identity and zeros."""
    item = ITEMS["r2-2013-01-09-ex1"]

    def tip(q):
        return np.array([-np.sin(q), np.cos(q)]) * item["inputs"]["L"]

    def height(q):
        return np.array([[math.cos(q[0]), math.cos(q[1]), 0.0]])

    for q in np.random.default_rng(1).uniform(-math.pi, math.pi, (50, 3)):
        closed = -math.cos(q[2]) * math.sin(q[1] - q[0])
        residual = analysis.determinant(np.vstack([tip(q), height(q)])) - closed
        assert abs(residual - item["expected"]["identity_residual"]) <= item["tolerance"]
    box = analysis.Box([-math.pi] * 3, [math.pi] * 3)
    search = analysis.find_algorithmic_singularities(box, [tip, height])
    factors = np.array([[math.cos(end.q[2]), math.sin(end.q[1] - end.q[0])] for end in search.found])
    np.testing.assert_allclose(np.abs(factors).min(axis=1), 0.0, atol=tol.MET)
    assert (np.abs(factors).argmin(axis=1) == 0).any() and (np.abs(factors).argmin(axis=1) == 1).any()


# ---------------------------------------------------------------- searches over a robot


def within_limits(robot, q):
    at = robot.coordinates(robot.check_configuration(q))
    low, high = robot.limits.position_lower, robot.limits.position_upper
    return bool((at >= low - tol.EXACT).all() and (at <= high + tol.EXACT).all())


def test_the_search_finds_the_planar_3rs_conflict_of_position_and_orientation():
    """Tip and angle together: a 2R with its elbow straight, whatever the last joint does."""
    robot = cc.planar([1.0, 0.7, 0.4])
    tip, angle = cc.FrameTask("tool", "xy"), cc.FrameTask("tool", "rz")
    search = analysis.find_algorithmic_singularities(robot, [tip, angle])
    assert len(search.found) >= 15
    for end in search.found:
        assert abs(math.sin(end.q[1])) < tol.MET and within_limits(robot, end.q)
        J = robot.state(end.q).jacobian("tool")
        assert np.linalg.svd(J[[0, 1, 5]], compute_uv=False)[-1] < tol.MET  # together singular
        assert np.linalg.svd(J[:2], compute_uv=False)[-1] > 1e-3  # the tip alone is not
    assert [end.sigma for end in search.found] == sorted(end.sigma for end in search.found)
    assert search.closest.sigma == search.found[0].sigma


def test_a_tasks_own_singularities_do_not_attract():
    """Tip and mid-arm of a 4R: all starts end with sin q4 = 0, none with sin q2 = 0 (mid-arm singular)."""
    robot = cc.planar([1.0, 0.7, 0.6, 0.4])
    search = analysis.find_algorithmic_singularities(robot, [cc.FrameTask("tool", "xy"), cc.FrameTask("link3", "xy")])
    assert len(search.found) == search.starts
    for end in search.found:
        assert abs(math.sin(end.q[3])) < tol.MET and abs(math.sin(end.q[1])) > 1e-3


def test_limits_keep_the_search_away():
    """With the elbow between 0.5 and 2 there is no singularity, and the closest is at one of the two."""
    text = cc.planar([1.0, 1.0])
    model = text.model.copy()
    model.lowerPositionLimit[:], model.upperPositionLimit[:] = [-1.0, 0.5], [1.0, 2.0]
    robot = cc.Robot(model, tool="tool")
    search = analysis.find_kinematic_singularities(robot, cc.FrameTask("tool", "xy"), starts=4)
    assert search.found == () and not search.closest.singularity.occurs and search.closest.sigma > 0.05
    assert search.closest.q[1] == pytest.approx(0.5, abs=1e-4) or search.closest.q[1] == pytest.approx(2.0, abs=1e-4)
    extent = analysis.where_singular(robot, cc.FrameTask("tool", "xy"), starts=4)
    assert extent.where == "nowhere found"


def test_everywhere_somewhere_nowhere():
    robot = cc.planar([1.0, 0.6])
    pose, tip = cc.FrameTask("tool"), cc.FrameTask("tool", "xy")
    everywhere = analysis.where_singular(robot, pose)
    assert everywhere.where == "everywhere" and everywhere.search is None
    assert (everywhere.generic.rank, everywhere.generic.rows, everywhere.generic.redundancy) == (2, 6, 0)
    somewhere = analysis.where_singular(robot, tip)
    assert somewhere.where == "somewhere" and not somewhere.generic.singular_everywhere
    for end in somewhere.search.found:
        assert abs(math.sin(end.q[1])) < tol.MET
    across = somewhere.search.found[0].singularity
    assert across.names[0].count("x") + across.names[0].count("y") >= 1  # the rows of a pose have names
    constant = analysis.where_singular(analysis.Box([0.0] * 3, [1.0] * 3), lambda q: np.eye(3)[:2], starts=3)
    assert constant.where == "nowhere found" and constant.search.closest.sigma == pytest.approx(1.0)
    assert analysis.where_singular(analysis.Box([0.0], [1.0]), lambda q: np.zeros((0, 1))).where == "nowhere found"
    stuck = analysis.find_kinematic_singularities(analysis.Box([0.3, 0.0], [0.3, 0.0]), lambda q: q + 1.0, starts=2)
    assert stuck.found == () and list(stuck.closest.q) == [0.3, 0.0]


@pytest.mark.parametrize("name", ["panda", "kinova", "talos"])
def test_real_arms_are_singular_somewhere(name):
    """Revolute, continuous and floating joints; judged by Pinocchio's Jacobian and numpy."""
    robot = robots_for_tests.ROBOTS[name]()
    task = cc.FrameTask(robot.tool, "position") if name == "talos" else cc.FrameTask(robot.tool)
    generic = analysis.generic_rank(robot, task, samples=3)
    assert generic.rank == generic.rows and generic.redundancy == robot.nv - generic.rows
    if name == "talos":  # the base alone moves any point anywhere
        assert analysis.where_singular(robot, task, starts=2).where == "nowhere found"
        return
    search = analysis.find_kinematic_singularities(robot, task, starts=5)
    assert len(search.found) >= 4
    for end in search.found:
        assert within_limits(robot, end.q)
        J = robot.state(end.q).jacobian(robot.tool)
        s = np.linalg.svd(J, compute_uv=False)
        assert s[-1] < tol.MET * np.linalg.norm(J)
        np.testing.assert_allclose(end.singularity.lost.T @ J, 0.0, atol=tol.MET * np.linalg.norm(J))


def test_generic_rank_of_stacks_and_functions():
    robot = robots_for_tests.panda()
    hand = cc.FrameTask(robot.tool)
    assert analysis.generic_rank(robot, hand, hand).rank == 6  # a task given twice adds nothing
    elbow = cc.FunctionTask(lambda state: state.position("panda_link4")[2])
    both = analysis.generic_rank(robot, hand, elbow, tolerance=1e-7)
    assert (both.rank, both.lowest, both.rows, both.redundancy) == (7, 7, 7, 0)
    assert analysis.generic_rank(robot, lambda state: state.com_jacobian[2]).rows == 1
    box = analysis.Box([0.0, 0.0], [1.0, 1.0])
    assert analysis.generic_rank(box, lambda q: [[1e10, 0.0]], lambda q: [[0.0, 1e-10]]).rank == 2  # whatever the units
    somewhere = analysis.generic_rank(box, lambda q: [[1.0, 0.0], [0.0, float(q[0] > 0.5)]], samples=20)
    assert (somewhere.rank, somewhere.lowest) == (2, 1) and not somewhere.singular_everywhere
    repeated = analysis.generic_rank(robot, hand, samples=3, seed=4)
    assert repeated == analysis.generic_rank(robot, hand, samples=3, seed=4)


# ---------------------------------------------------------------- Penrose


@given(oracles.systems(), SCALES)
def test_the_pseudo_inverse_and_its_identities(system, size):
    """(A#)# = A, (A#)^T = (A^T)#, and A A# = 1 exactly if the rows are independent."""
    _, (A,), _ = system
    A, X = A * size, pinv(A) / size
    m = A.shape[0]
    assert analysis.penrose(A, X).kind == "pseudo-inverse"
    assert analysis.penrose(X, A).kind == "pseudo-inverse"
    assert analysis.penrose(A.T, X.T).kind == "pseudo-inverse"
    unit = np.allclose(A @ X, np.eye(m), atol=tol.PENROSE)
    assert unit == (analysis.rank(A) == m)


@given(oracles.systems(), SCALES)
def test_narrower_and_wider_inverses_are_told_apart(system, size):
    rng, (A,), _ = system
    m, n = A.shape
    rank = true_rank(A)
    assume(rank > 0)
    P = pinv(A)
    left, right = P @ A, A @ P
    noise = rng.normal(size=(n, m))
    cases = {}
    if rank < n:  # G A = G' A: the part outside the row space is free
        cases["reflexive"] = P + (np.eye(n) - left) @ noise @ right
        if rank < m:
            cases["generalised"] = P + (np.eye(n) - left) @ noise @ (np.eye(m) - right)
    if m > 0:
        cases["none"] = 2.0 * P
    for kind, X in cases.items():
        found = analysis.penrose(A * size, X / size)
        assert found.kind == kind, found
        assert (found.generalised, found.reflexive) == (kind != "none", kind == "reflexive")
        assert not found.pseudo_inverse
    if "reflexive" in cases:
        assert analysis.penrose(A, cases["reflexive"]).conditions == (True, True, True, False)


@given(oracles.SEEDS, st.floats(1e-12, 1e-1))
def test_ill_conditioned_inverses_pass_and_damped_ones_do_not(seed, smallest):
    rng = np.random.default_rng(seed)
    A = oracles.matrix_with(rng, 3, 5, [2.0, 1.0, smallest])
    assert analysis.penrose(A, np.linalg.pinv(A, rcond=1e-15)).kind == "pseudo-inverse"
    damped = A.T @ np.linalg.inv(A @ A.T + 1e-8 * np.eye(3))
    assert analysis.penrose(A, damped).kind == "none"


def test_weighted_inverses_are_reflexive_and_printed_ones_need_a_tolerance():
    A = np.array([[1.0, 0.0, -0.25], [0.0, 1.0, 0.4]])
    W = np.diag([1.0, 2.0, 5.0])
    weighted = np.linalg.solve(W, A.T) @ np.linalg.inv(A @ np.linalg.solve(W, A.T))
    assert analysis.penrose(A, weighted).kind == "reflexive"
    printed = np.round(np.linalg.pinv(A), 4)
    assert analysis.penrose(A, printed).kind == "none"
    assert analysis.penrose(A, printed, tolerance=1e-4).kind == "pseudo-inverse"
    zero = analysis.penrose(np.zeros((2, 3)), np.zeros((3, 2)))
    assert zero.kind == "pseudo-inverse" and zero.residuals == (0.0, 0.0, 0.0, 0.0)
    assert analysis.penrose(np.zeros((2, 3)), np.ones((3, 2))).kind == "generalised"
    assert analysis.penrose(A, np.zeros((3, 2))).kind == "none"
    assert analysis.penrose(np.zeros((0, 3)), np.zeros((3, 0))).kind == "pseudo-inverse"
    assert analysis.penrose(np.eye(2) * 1e300, np.eye(2) * 1e300).kind == "none"  # their product is beyond floats


# ---------------------------------------------------------------- projectors


@given(oracles.systems(), oracles.METRICS, SCALES)
def test_projectors_pass_in_their_own_metric_alone(system, kind, size):
    rng, (A,), _ = system
    n = A.shape[1]
    W = oracles.metric(rng, n, kind)
    P = projector(A)
    found = analysis.check_projector(P, A * size)
    assert found.passed and found.rank == found.nullity == n - true_rank(A)
    if W is None or not 0 < true_rank(A) < n:
        return
    inverse = np.linalg.inv(oracles.full_metric(W, n))
    oblique = np.eye(n) - inverse @ A.T @ pinv(A @ inverse @ A.T) @ A
    weighed = analysis.check_projector(oblique, A * size, metric=W, tolerance=1e-10)
    assert weighed.passed
    plain = analysis.check_projector(oblique, A, tolerance=1e-10)
    assert plain.idempotent and plain.annihilates and plain.complete
    assert plain.symmetric == np.allclose(oblique, P, atol=1e-9)


def test_verdicts_are_true_or_false():
    """``if analysis.penrose(A, X):`` asks what it seems to ask, and is not always true as of any object."""
    A, W = np.array([[1.0, 0.0, -0.25], [0.0, 1.0, 0.4]]), np.diag([1.0, 2.0, 5.0])
    reflexive = np.linalg.solve(W, A.T) @ np.linalg.inv(A @ np.linalg.solve(W, A.T))
    assert analysis.penrose(A, np.linalg.pinv(A)) and not analysis.penrose(A, reflexive)
    assert analysis.check_projector(projector(A), A) and not analysis.check_projector(0.5 * projector(A), A)
    assert analysis.kinematic_singularity(np.vstack([A[0], A[0]])) and not analysis.kinematic_singularity(A)
    assert analysis.algorithmic_singularity(A, 2 * A[:1]) and not analysis.algorithmic_singularity(A[:1], A[1:])


def test_each_fault_of_a_projector_is_found():
    rng = np.random.default_rng(11)
    A = oracles.matrix(rng, 2, 5)
    P = projector(A)
    shrunk = analysis.check_projector(0.5 * P, A)
    assert (shrunk.idempotent, shrunk.symmetric, shrunk.annihilates, shrunk.complete) == (False, True, True, True)
    other = analysis.check_projector(projector(oracles.matrix(rng, 2, 5)), A)
    assert (other.idempotent, other.symmetric, other.annihilates, other.complete) == (True, True, False, True)
    poor = analysis.check_projector(projector(np.vstack([A, rng.normal(size=(1, 5))])), A)
    assert (poor.idempotent, poor.annihilates, poor.complete) == (True, True, False) and not poor.passed
    assert (poor.rank, poor.nullity) == (2, 3)
    alone = analysis.check_projector(P)
    assert alone.passed and alone.leak is None and alone.nullity is None and alone.rank == 3
    assert analysis.check_projector(np.zeros((5, 5)), np.eye(5)).passed
    steep = oracles.matrix_with(rng, 2, 5, [1.0, 1e-4])
    formula = analysis.check_projector(np.eye(5) - np.linalg.pinv(steep) @ steep, steep, tolerance=1e-10)
    assert formula.passed and formula.rank == 3  # its zeros are round-off times the condition number
    damped = np.eye(5) - A.T @ np.linalg.solve(A @ A.T + 1e-4 * np.eye(2), A)
    assert not analysis.check_projector(damped, A).annihilates  # why null spaces are never damped


# ---------------------------------------------------------------- summary


@pytest.mark.parametrize("name", ["pendulum", "panda", "talos"])
def test_summary_puts_the_parts_together(name):
    robot = robots_for_tests.ROBOTS[name]()
    state = robots_for_tests.random_state(robot, np.random.default_rng(2))
    J = state.jacobian(robot.tool) * np.array([1, 1, 1, 0.3, 0.3, 0.3])[:, None]
    found = analysis.summary(state, length=0.3)
    assert found.frame == robot.tool and found.names == ("x", "y", "z", "rx", "ry", "rz")
    np.testing.assert_allclose(found.jacobian, J, atol=tol.EXACT)
    np.testing.assert_array_equal(found.q, state.q)
    s = np.linalg.svd(J, compute_uv=False)
    np.testing.assert_allclose(found.spectrum.values, s, atol=tol.EXACT)
    rank = np.linalg.matrix_rank(J, tol=oracles.GAP)
    assert found.spectrum.rank == found.singularity.rank == rank
    assert found.spectrum.redundancy == robot.nv - rank
    for block, rows in ((found.position, slice(0, 3)), (found.orientation, slice(3, 6))):
        lengths = np.zeros(3)
        lengths[: min(3, robot.nv)] = np.linalg.svd(state.jacobian(robot.tool)[rows], compute_uv=False)
        np.testing.assert_allclose(block.velocity.lengths, lengths, atol=tol.EXACT)
        finite = block.force.lengths[np.isfinite(block.force.lengths)]
        np.testing.assert_allclose(finite, 1.0 / lengths[::-1][3 - len(finite) :], rtol=tol.ORACLE)


def test_summary_of_some_axes_with_a_metric():
    robot = cc.planar([1.0, 0.7])
    state = robot.state([0.3, 0.0])
    found = analysis.summary(state, "tool", "xy", metric=[4.0, 4.0])
    assert found.names == ("x", "y") and found.orientation is None and found.spectrum.determinant == 0.0
    assert found.singularity.occurs and found.singularity.names == ("0.96 x + 0.30 y",)  # along the arm
    assert found.position.velocity.lengths[0] == pytest.approx(math.hypot(1.7, 0.7) / 2.0)
    turning = analysis.summary(state, "tool", "rz")
    assert turning.position is None and turning.orientation.spectrum.manipulability == pytest.approx(math.sqrt(2.0))


# ---------------------------------------------------------------- bad input


def planar():
    return robots_for_tests.planar()


TIP = cc.FrameTask("tool", "xy")


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: analysis.rank([1.0, 2.0]), ShapeError, r"A has shape \(2,\)"),
        (lambda: analysis.rank("A"), ShapeError, "A is 'A'"),
        (lambda: analysis.spectrum([[1.0, np.nan]]), NonFiniteError, r"A\[0, 1\] is nan"),
        (lambda: analysis.spectrum(np.eye(2), tolerance=-1.0), ParameterError, "tolerance is -1"),
        (lambda: analysis.determinant(np.ones((2, 3))), ShapeError, "expected a square matrix"),
        (lambda: analysis.velocity_ellipsoid(np.ones((2, 3)), [1, 1]), ShapeError, "metric has shape"),
        (lambda: analysis.force_ellipsoid(np.ones((2, 2)), [1, -1]), MetricError, r"metric\[1\] is -1"),
        (lambda: analysis.velocity_ellipsoid(np.eye(2)).along([0, 0]), ParameterError, "direction is"),
        (lambda: analysis.velocity_ellipsoid(np.eye(2)).along([1]), ShapeError, "direction has shape"),
        (lambda: analysis.kinematic_singularity(np.eye(3), "xyz"), ShapeError, "names is 'xyz'; expected 3"),
        (lambda: analysis.algorithmic_singularity(np.eye(2)), ParameterError, "1 Jacobian"),
        (lambda: analysis.algorithmic_singularity(np.eye(2), np.eye(3)), ShapeError, "J2 has shape"),
        (lambda: analysis.penrose(np.ones((2, 3)), np.ones((2, 3))), ShapeError, r"X has shape \(2, 3\)"),
        (lambda: analysis.penrose([[1.0]], [[np.inf]]), NonFiniteError, "X"),
        (lambda: analysis.check_projector(np.ones((2, 3))), ShapeError, "P has shape"),
        (lambda: analysis.check_projector(np.eye(3), np.ones((1, 2))), ShapeError, "A has shape"),
        (lambda: analysis.Box([0.0], [1.0, 2.0]), ShapeError, "upper has shape"),
        (lambda: analysis.Box([2.0], [1.0]), ParameterError, r"lower\[0\] = 2 is above"),
        (lambda: analysis.Box([-np.inf], [1.0]), NonFiniteError, "lower"),
        (lambda: analysis.generic_rank(planar()), ParameterError, "tasks is empty"),
        (lambda: analysis.generic_rank(planar(), "tool"), ParameterError, "task 1 is 'tool'"),
        (lambda: analysis.generic_rank(3, TIP), ParameterError, "3 is no place to search"),
        (lambda: analysis.generic_rank(analysis.Box([0.0], [1.0]), TIP), ParameterError, "a function q -> "),
        (lambda: analysis.generic_rank(planar(), cc.FrameTask("tol")), FrameNotFound, "did you mean 'tool'"),
        (lambda: analysis.generic_rank(planar(), lambda s: np.ones(2)), ShapeError, "the Jacobian of task 1"),
        (lambda: analysis.generic_rank(planar(), TIP, samples=0), ParameterError, "samples is 0"),
        (lambda: analysis.find_algorithmic_singularities(planar(), [TIP]), ParameterError, "at least two tasks"),
        (lambda: analysis.find_algorithmic_singularities(planar(), TIP), ParameterError, "at least two tasks"),
        (lambda: analysis.find_algorithmic_singularities(planar(), [TIP, TIP]), ParameterError, "4 rows for 3 joints"),
        (
            lambda: analysis.find_algorithmic_singularities(planar(), [TIP, cc.FrameTask("tool")]),
            ParameterError,
            "task 2 has rank 3 of 6 at every configuration",
        ),
        (
            lambda: analysis.find_kinematic_singularities(planar(), cc.FrameTask("tool", "position")),
            ParameterError,
            "the task has rank 2 of 3",
        ),
        (lambda: analysis.find_kinematic_singularities(planar(), TIP, starts=0), ParameterError, "starts is 0"),
        (lambda: analysis.find_kinematic_singularities(planar(), TIP, tolerance=0.0), ParameterError, "tolerance is 0"),
        (lambda: analysis.summary(planar().state([0, 0, 0]), "tol"), FrameNotFound, "unknown frame 'tol'"),
        (lambda: analysis.summary(planar().state([0, 0, 0]), axes="q"), ParameterError, "axes is 'q'"),
        (lambda: analysis.summary(planar().state([0, 0, 0]), length=0), ParameterError, "length is 0"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(call, error, words):
    with pytest.raises(error, match=words) as caught:
        call()
    assert isinstance(caught.value, CartctlError) and "\n" not in str(caught.value)


def test_a_jacobian_that_changes_its_shape_is_refused():
    shapes = iter(range(1, 100))
    with pytest.raises(ShapeError, match="the Jacobian of task 1 has shape"):
        analysis.generic_rank(planar(), lambda state: np.ones((next(shapes), 3)))


def test_arrays_need_no_pinocchio():
    code = (
        "import sys\n"
        "for name in ('pinocchio', 'example_robot_data', 'coal', 'matplotlib'): sys.modules[name] = None\n"
        "from cartctl import analysis\n"
        "box = analysis.Box([-3.0, -3.0], [3.0, 3.0])\n"
        "f = lambda q: [[-q[1], 1.0], [q[1], 2.0]]\n"
        "print(analysis.penrose([[2.0]], [[0.5]]).kind, analysis.where_singular(box, f).where)\n"
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=False)
    assert done.stdout == "pseudo-inverse somewhere\n", done.stderr


def test_every_name_is_there_and_documented():
    for name in analysis.__all__:
        assert (getattr(analysis, name).__doc__ or "").strip(), name
