"""Frames, exponentials and screws against Pinocchio, SciPy's expm, series in high precision and finite differences."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from cartctl import spatial
from cartctl.errors import CartctlError, ParameterError, ShapeError
from tests import oracles
from tests import tolerances as tol
from tests.test_spatial import ANGLES, AXES

ORDERS = ("linear-first", "angular-first")
SMALL = st.floats(-12.0, 0.0).map(lambda e: 10.0**e)
SWAP = np.roll(np.eye(6), 3, axis=0)


def random_pose(rng, reach=1.0):
    return spatial.pose(oracles.random_rotation(rng), rng.normal(size=3) * reach)


def moved(screw, T):
    """Direction and point of a screw given in frame B, in frame A."""
    R, p = T[:3, :3], T[:3, 3]
    return R @ screw.direction, R @ screw.point + p


def assert_same_line(direction, point, other, other_point, atol):
    np.testing.assert_allclose(direction, other, atol=atol)
    np.testing.assert_allclose(np.cross(point - other_point, other), 0.0, atol=atol * (1.0 + np.linalg.norm(point)))


# ---------------------------------------------------------------- frames


@given(oracles.SEEDS)
def test_adjoints_are_pinocchios(seed):
    rng = np.random.default_rng(seed)
    T = random_pose(rng)
    M = pin.SE3(T)
    twist, wrench = rng.normal(size=(2, 6))
    np.testing.assert_allclose(spatial.adjoint(M), M.toActionMatrix(), atol=tol.LOG)
    np.testing.assert_allclose(spatial.wrench_adjoint(T), M.toDualActionMatrix(), atol=tol.LOG)
    np.testing.assert_allclose(spatial.move_twist(T, twist), M.act(pin.Motion(twist)).vector, atol=tol.LOG)
    np.testing.assert_allclose(spatial.move_wrench(M, wrench), M.act(pin.Force(wrench)).vector, atol=tol.LOG)
    np.testing.assert_allclose(spatial.inverse_pose(T), M.inverse().homogeneous, atol=tol.LOG)


@given(oracles.SEEDS)
def test_a_body_seen_from_two_of_its_points(seed):
    """v_A = v_B - omega x (p_B - p_A), all in one set of axes; the moment grows by the arm times the force."""
    rng = np.random.default_rng(seed)
    arm, v, omega, f, m = rng.normal(size=(5, 3))
    T = spatial.pose(p=arm)
    np.testing.assert_allclose(
        spatial.move_twist(T, [*v, *omega]), np.concatenate([v - np.cross(omega, arm), omega]), atol=tol.LOG
    )
    np.testing.assert_allclose(
        spatial.move_wrench(T, [*f, *m]), np.concatenate([f, m + np.cross(arm, f)]), atol=tol.LOG
    )


@pytest.mark.parametrize("order", ORDERS)
@given(seed=oracles.SEEDS)
def test_adjoints_compose_and_are_dual(order, seed):
    rng = np.random.default_rng(seed)
    first, second = random_pose(rng), random_pose(rng)
    for map_of in (spatial.adjoint, spatial.wrench_adjoint):
        product = map_of(first, order) @ map_of(second, order)
        np.testing.assert_allclose(map_of(first @ second, order), product, atol=tol.LOG * 10)
        back = map_of(spatial.inverse_pose(first), order)
        np.testing.assert_allclose(back @ map_of(first, order), np.eye(6), atol=tol.LOG * 10)
    duality = spatial.adjoint(first, order).T @ spatial.wrench_adjoint(first, order)
    np.testing.assert_allclose(duality, np.eye(6), atol=tol.LOG * 10)


@given(oracles.SEEDS)
def test_power_is_the_same_in_every_frame(seed):
    rng = np.random.default_rng(seed)
    T, twist, wrench = random_pose(rng), rng.normal(size=6), rng.normal(size=6)
    power = spatial.move_wrench(T, wrench) @ spatial.move_twist(T, twist)
    assert power == pytest.approx(wrench @ twist, abs=tol.LOG * 100)


@given(oracles.SEEDS)
def test_the_two_orders_are_one_permutation_apart(seed):
    rng = np.random.default_rng(seed)
    T, J = random_pose(rng), rng.normal(size=(6, 5))
    for map_of in (spatial.adjoint, spatial.wrench_adjoint):
        np.testing.assert_array_equal(map_of(T, "angular-first"), SWAP @ map_of(T) @ SWAP.T)
    np.testing.assert_array_equal(spatial.other_order(J), SWAP @ J)
    np.testing.assert_array_equal(spatial.other_order(spatial.other_order(J[:, 0])), J[:, 0])
    np.testing.assert_allclose(
        spatial.other_order(spatial.move_twist(T, J)),
        spatial.adjoint(T, "angular-first") @ spatial.other_order(J),
        atol=tol.LOG,
    )


def test_a_jacobian_moves_column_by_column():
    rng = np.random.default_rng(1)
    T, J = random_pose(rng), rng.normal(size=(6, 7))
    columns = [spatial.move_twist(T, column) for column in J.T]
    np.testing.assert_allclose(spatial.move_twist(T, J), np.column_stack(columns), atol=tol.LOG)


@given(oracles.SEEDS)
def test_how_adjoints_change(seed):
    """d/dt Ad(T) = Ad(T) ad(xi), xi in the moving axes; for wrenches -ad^T."""
    rng = np.random.default_rng(seed)
    T, twist, h = random_pose(rng), rng.normal(size=6), 1e-6
    ahead, behind = T @ spatial.exp6(h * twist), T @ spatial.exp6(-h * twist)
    X = spatial.ad(twist)
    for map_of, rate in ((spatial.adjoint, X), (spatial.wrench_adjoint, -X.T)):
        difference = (map_of(ahead) - map_of(behind)) / (2.0 * h)
        np.testing.assert_allclose(difference, map_of(T) @ rate, atol=tol.DIFFERENCE)
    other = rng.normal(size=6)
    bracket = spatial.hat(twist) @ spatial.hat(other) - spatial.hat(other) @ spatial.hat(twist)
    np.testing.assert_allclose(spatial.vee(bracket), X @ other, atol=tol.LOG)


# ---------------------------------------------------------------- hat, vee, exp, log


@given(oracles.SEEDS, st.sampled_from([3, 6]), oracles.magnitudes(1e-150, 1e150))
def test_vee_undoes_hat(seed, size, scale):
    x = np.random.default_rng(seed).normal(size=size) * scale
    np.testing.assert_array_equal(spatial.vee(spatial.hat(x)), x)
    if size == 6:
        point = np.array([0.3, -0.7, 0.2, 1.0])  # of a body that moves so
        np.testing.assert_allclose((spatial.hat(x) @ point)[:3], x[:3] + np.cross(x[3:], point[:3]), rtol=1e-12)


@given(oracles.SEEDS)
def test_vee_takes_finite_differences(seed):
    """R_dot R^T of central differences is skew to their precision alone."""
    rng = np.random.default_rng(seed)
    R, omega, h = oracles.random_rotation(rng), rng.normal(size=3), 1e-6
    rate = (spatial.exp3(h * omega) - spatial.exp3(-h * omega)) @ R / (2.0 * h)
    np.testing.assert_allclose(spatial.vee(rate @ R.T), omega, atol=tol.DIFFERENCE)


@given(AXES, st.one_of(ANGLES, st.floats(0.0, 30.0)))
def test_exp3_is_rodrigues(axis, angle):
    np.testing.assert_allclose(spatial.exp3(angle * axis), oracles.rotation(axis, angle), atol=tol.ROTATION * 10)


@given(oracles.SEEDS, SMALL, st.floats(0.0, 12.0))
def test_exp6_is_the_matrix_exponential(seed, scale, angle):
    rng = np.random.default_rng(seed)
    v, axis = rng.normal(size=3), rng.normal(size=3)
    for size in (angle, scale):
        twist = np.concatenate([v, size * axis / np.linalg.norm(axis)])
        np.testing.assert_allclose(spatial.exp6(twist), expm(spatial.hat(twist)), atol=1e-12)
    np.testing.assert_allclose(spatial.exp6(0.3 * twist) @ spatial.exp6(0.7 * twist), spatial.exp6(twist), atol=tol.LOG)


@given(oracles.SEEDS, AXES, ANGLES)
def test_exp_and_log_undo_each_other(seed, axis, angle):
    """From round-off to a hair from the half turn, in full precision."""
    v = np.random.default_rng(seed).normal(size=3)
    twist = np.concatenate([v, angle * axis])
    T = spatial.exp6(twist)
    again = spatial.log6(T)
    np.testing.assert_allclose(spatial.exp6(again), T, atol=tol.LOG * 10)
    if angle < math.pi - 1e-7:
        np.testing.assert_allclose(again, twist, atol=tol.LOG * 10)
    assert np.linalg.norm(again[3:]) <= math.pi + tol.LOG


@given(AXES, oracles.SEEDS)
def test_the_half_turn_itself(axis, seed):
    p = np.random.default_rng(seed).normal(size=3)
    T = spatial.pose(2.0 * np.outer(axis, axis) - np.eye(3), p)
    twist = spatial.log6(T)
    assert np.linalg.norm(twist[3:]) == pytest.approx(math.pi, abs=tol.LOG)
    np.testing.assert_allclose(spatial.exp6(twist), T, atol=tol.LOG * 10)


@given(oracles.SEEDS)
def test_log6_is_pinocchios(seed):
    T = random_pose(np.random.default_rng(seed))
    np.testing.assert_allclose(spatial.log6(pin.SE3(T)), pin.log6(T).vector, atol=tol.HALF_TURN)
    np.testing.assert_allclose(spatial.log6(spatial.inverse_pose(T)), -spatial.log6(T), atol=tol.LOG * 10)


@given(oracles.SEEDS)
def test_the_log_of_a_moved_displacement_is_the_moved_log(seed):
    """T e^hat(xi) T^-1 = e^hat(Ad(T) xi)."""
    rng = np.random.default_rng(seed)
    T, twist = random_pose(rng), rng.normal(size=6)
    twist[3:] *= rng.uniform(0.1, 3.0) / np.linalg.norm(twist[3:])
    conjugate = T @ spatial.exp6(twist) @ spatial.inverse_pose(T)
    np.testing.assert_allclose(spatial.log6(conjugate), spatial.move_twist(T, twist), atol=1e-11)


def test_nothing_moves():
    np.testing.assert_array_equal(spatial.exp6(np.zeros(6)), np.eye(4))
    np.testing.assert_array_equal(spatial.log6(np.eye(4)), np.zeros(6))


def test_the_coefficients_of_the_exponential_have_no_seam():
    """Against series summed in integers' precision, on both sides of where the formulas change."""
    from fractions import Fraction

    from cartctl.spatial.rotations import series

    for x in (1e-200, 1e-9, 1e-3, 0.3, 0.999, 1.0, 1.001, 2.0, 3.1, 5.0):
        square, terms = Fraction(x) ** 2, range(40)
        exact = [
            float(sum((-square) ** k / Fraction(math.factorial(2 * k + first)) for k in terms)) for first in (1, 2, 3)
        ]
        np.testing.assert_allclose(series(x), exact, rtol=4e-15)


# ---------------------------------------------------------------- screws


@given(oracles.SEEDS, st.floats(-3.0, 3.0), oracles.magnitudes(1e-6, 1e3))
def test_a_twist_is_built_and_read_back(seed, pitch, speed):
    rng = np.random.default_rng(seed)
    s, anywhere = rng.normal(size=3), rng.normal(size=3)
    s /= np.linalg.norm(s)
    omega = speed * s
    twist = np.concatenate([np.cross(anywhere, omega) + pitch * omega, omega])
    screw = spatial.twist_screw(twist)
    np.testing.assert_allclose([screw.pitch, screw.size], [pitch, speed], rtol=1e-9, atol=1e-12)
    assert_same_line(screw.direction, screw.point, s, anywhere, 1e-12)
    assert screw.point @ screw.direction == pytest.approx(0.0, abs=1e-12)  # the nearest point to the origin
    np.testing.assert_allclose(screw.twist, twist, atol=1e-12 * speed)
    again = spatial.wrench_screw(spatial.other_order(twist))  # the same line, pitch and size for a wrench
    np.testing.assert_allclose(again.wrench, spatial.other_order(twist), atol=1e-12 * speed)
    assert (again.pitch, again.size) == (screw.pitch, screw.size)


@given(oracles.SEEDS)
def test_points_of_the_axis_only_slide(seed):
    """... and every other point is faster; about the central axis of a wrench the moment is least."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=6)
    twist, wrench = spatial.twist_screw(x), spatial.wrench_screw(x)
    on_axis = twist.point + rng.normal() * twist.direction
    velocity = x[:3] + np.cross(x[3:], on_axis)
    np.testing.assert_allclose(velocity, twist.pitch * x[3:], atol=tol.LOG * 100)
    moment = x[3:] - np.cross(wrench.point + rng.normal() * wrench.direction, x[:3])
    np.testing.assert_allclose(moment, wrench.pitch * x[:3], atol=tol.LOG * 100)
    away = rng.normal(size=3)
    assert np.linalg.norm(x[:3] + np.cross(x[3:], on_axis + away)) >= np.linalg.norm(velocity) - tol.LOG


@given(oracles.SEEDS)
def test_screws_are_the_same_from_every_frame(seed):
    """The line moves with the frame, pitch and size do not change."""
    rng = np.random.default_rng(seed)
    T, x = random_pose(rng, 3.0), rng.normal(size=6)
    x[:3] += np.sign(x[:3])
    x[3:] += np.sign(x[3:])
    for screw_of, move in ((spatial.twist_screw, spatial.move_twist), (spatial.wrench_screw, spatial.move_wrench)):
        here, there = screw_of(x), screw_of(move(T, x))
        np.testing.assert_allclose([there.pitch, there.size], [here.pitch, here.size], atol=1e-11)
        assert_same_line(there.direction, there.point, *moved(here, T), 1e-11)
    displacement = spatial.exp6(np.concatenate([x[:3], x[3:] / np.linalg.norm(x[3:])]))
    here = spatial.displacement_screw(displacement)
    there = spatial.displacement_screw(T @ displacement @ spatial.inverse_pose(T))
    np.testing.assert_allclose([there.pitch, there.size], [here.pitch, here.size], atol=1e-11)
    assert_same_line(there.direction, there.point, *moved(here, T), 1e-10)


@given(oracles.SEEDS, AXES, st.floats(0.01, math.pi), st.floats(-2.0, 2.0))
def test_chasles(seed, axis, angle, slide):
    """A displacement made of a turn about a line and a slide along it: both come back."""
    anywhere = np.random.default_rng(seed).normal(size=3)
    R = oracles.rotation(axis, angle)
    T = spatial.pose(R, anywhere - R @ anywhere + slide * axis)
    screw = spatial.displacement_screw(T)
    sign = 1.0 if screw.direction @ axis > 0.0 else -1.0  # either way round, at a half turn
    assert sign > 0.0 or angle > math.pi - 1e-7
    np.testing.assert_allclose([screw.size, screw.pitch * screw.size], [angle, sign * slide], atol=1e-12)
    assert_same_line(sign * screw.direction, screw.point, axis, anywhere, 1e-10)
    np.testing.assert_allclose(spatial.exp6(screw.twist), T, atol=1e-12)


def test_translations_couples_and_nothing():
    direction = np.array([2.0, -1.0, 2.0]) / 3.0
    slide = spatial.twist_screw([*(0.6 * direction), 0.0, 0.0, 0.0])
    couple = spatial.wrench_screw([1e-13, 0.0, -1e-13, *(0.6 * direction)])  # round-off in the force
    shift = spatial.displacement_screw(spatial.pose(p=0.6 * direction))
    for screw in (slide, couple, shift):
        assert screw.pitch == math.inf and screw.size == pytest.approx(0.6)
        np.testing.assert_allclose(screw.direction, direction)
        np.testing.assert_array_equal(screw.point, 0.0)
    np.testing.assert_allclose(slide.twist, [*(0.6 * direction), 0.0, 0.0, 0.0])
    np.testing.assert_allclose(couple.wrench, [0.0, 0.0, 0.0, *(0.6 * direction)])
    for rest in (spatial.twist_screw(np.zeros(6)), spatial.displacement_screw(np.eye(4))):
        assert rest.size == 0.0 and rest.pitch == 0.0
        np.testing.assert_array_equal(rest.twist, 0.0)


def test_how_far_an_axis_may_be_is_the_callers():
    twist = [0.0, 1.0, 0.0, 0.0, 0.0, 1e-4]  # about a line 10 km away
    assert spatial.twist_screw(twist).point[0] == pytest.approx(-1e4)
    assert spatial.twist_screw(twist, farthest=1e3).pitch == math.inf


# ---------------------------------------------------------------- bad input

MIRROR = np.diag([1.0, 1.0, -1.0])
TILTED = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.1, 0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (lambda: spatial.pose(MIRROR), ParameterError, "expected a rotation matrix"),
        (lambda: spatial.pose(1.01 * np.eye(3)), ParameterError, "off R^T R = I"),
        (lambda: spatial.adjoint(TILTED), ParameterError, "last row"),
        (lambda: spatial.adjoint(np.eye(3)), ShapeError, "expected (4, 4)"),
        (lambda: spatial.adjoint("here"), ShapeError, "T is 'here'"),
        (lambda: spatial.adjoint(np.eye(4), "force-first"), ParameterError, "'angular-first'"),
        (lambda: spatial.wrench_adjoint(np.eye(4), None), ParameterError, "order is None"),
        (lambda: spatial.move_twist(np.eye(4), np.zeros(5)), ShapeError, "expected (6,)"),
        (lambda: spatial.move_wrench(np.eye(4), np.full(6, np.nan)), CartctlError, "wrench[0] is nan"),
        (lambda: spatial.other_order(np.zeros((5, 6))), ShapeError, "columns (6, n)"),
        (lambda: spatial.hat(np.zeros(4)), ShapeError, "(3,) or (6,)"),
        (lambda: spatial.vee(np.ones((3, 3))), ParameterError, "by 2"),
        (lambda: spatial.vee(np.eye(4)), ParameterError, "misses"),
        (lambda: spatial.vee(np.zeros((2, 2))), ShapeError, "(3, 3) or (4, 4)"),
        (lambda: spatial.exp3([0.0, np.inf, 0.0]), CartctlError, "phi[1] is inf"),
        (lambda: spatial.exp3([0.0, 1e12, 0.0]), ParameterError, "at most 1e+09"),
        (lambda: spatial.exp6(np.zeros(3)), ShapeError, "expected (6,)"),
        (lambda: spatial.log6(2.0 * np.eye(4)), ParameterError, "last row"),
        (lambda: spatial.ad(np.zeros(3)), ShapeError, "expected (6,)"),
        (lambda: spatial.twist_screw(np.full(6, 1e200)), ParameterError, "at most 1e+100"),
        (lambda: spatial.wrench_screw(np.zeros(6), farthest=0.0), ParameterError, "farthest is 0"),
        (lambda: spatial.displacement_screw(MIRROR), ShapeError, "expected (4, 4)"),
    ],
)
def test_misuse_is_named(call, error, says):
    with pytest.raises(error) as caught:
        call()
    assert says in str(caught.value) and "\n" not in str(caught.value)
