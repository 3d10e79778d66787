"""The Cartesian inertia: identities, singular and redundant arms, published numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

import cartctl as cc
from cartctl.errors import MetricError, ParameterError, ShapeError
from tests.oracles import matrix, matrix_with, metric
from tests.robots_for_tests import panda, random_state


def cases(count=30):
    rng = np.random.default_rng(0)
    for _ in range(count):
        n = int(rng.integers(1, 10))
        yield rng, matrix(rng, int(rng.integers(1, n + 1)), n), metric(rng, n, "full")


def test_lambda_inverts_the_mobility():
    for _, J, M in cases():
        found = cc.dynamics.cartesian_inertia(J, M)
        mobility = J @ np.linalg.solve(M, J.T)
        np.testing.assert_allclose(found.mobility, mobility, atol=1e-12 * np.abs(mobility).max())
        np.testing.assert_allclose(found.matrix @ mobility, np.eye(J.shape[0]), atol=1e-10)
        np.testing.assert_allclose(found.consistent_inverse, np.linalg.solve(M, J.T) @ found.matrix, rtol=1e-8)
        np.testing.assert_allclose(np.sort(np.linalg.eigvalsh(found.matrix)), np.sort(found.inertias), rtol=1e-9)
        assert found.rank == J.shape[0] and found.lost.shape == (J.shape[0], 0)


def test_the_consistent_inverse_leaves_null_torques_without_effect():
    """J M^-1 (I - J^T J_bar^T) = 0, and J J_bar = I."""
    for _, J, M in cases():
        bar = cc.dynamics.cartesian_inertia(J, M).consistent_inverse
        N = np.eye(J.shape[1]) - J.T @ bar.T
        assert np.abs(J @ np.linalg.solve(M, N)).max() < 1e-10
        np.testing.assert_allclose(J @ bar, np.eye(J.shape[0]), atol=1e-10)


def test_a_square_jacobian_transforms_the_mass_matrix():
    rng = np.random.default_rng(1)
    for n in range(1, 8):
        J, M = matrix(rng, n, n), metric(rng, n, "full")
        expected = np.linalg.solve(J.T, np.linalg.solve(J.T, M).T)
        np.testing.assert_allclose(cc.dynamics.cartesian_inertia(J, M).matrix, expected, rtol=1e-9, atol=1e-10)


def test_lost_directions_stay_out_and_are_named():
    rng = np.random.default_rng(2)
    for n in range(3, 9):
        M = metric(rng, n, "full")
        J = matrix_with(rng, 3, n, [1.0, 0.4])
        found = cc.dynamics.cartesian_inertia(J, M)
        assert found.rank == 2 and np.isinf(found.inertias[2]) and np.isfinite(found.matrix).all()
        d = found.lost[:, 0]
        assert np.abs(d @ J).max() < 1e-12 and found.along(d) == math.inf
        np.testing.assert_allclose(found.matrix, np.linalg.pinv(J @ np.linalg.solve(M, J.T), rcond=1e-10), rtol=1e-8)
        other = rng.normal(size=3)
        other /= np.linalg.norm(other)
        assert found.along(3.0 * other) == pytest.approx(1.0 / (other @ J @ np.linalg.solve(M, J.T) @ other))


def test_more_rows_than_joints_and_no_motion_at_all():
    found = cc.dynamics.cartesian_inertia([[1.0], [1.0]], [[2.0]])
    np.testing.assert_allclose(found.matrix, [[0.5, 0.5], [0.5, 0.5]])
    np.testing.assert_allclose(found.inertias, [1.0, math.inf])
    still = cc.dynamics.cartesian_inertia(np.zeros((2, 3)), np.eye(3))
    assert still.rank == 0 and not still.matrix.any() and still.along([1.0, 0.0]) == math.inf


def test_a_cutoff_keeps_forces_small_near_a_singularity():
    """Stretched to within 1e-4 rad, a 2R arm is asked for 1 m/s^2 along itself."""
    robot = cc.planar([1.0, 1.0])
    state = robot.state([0.3, 1e-4])
    J, M = state.jacobian("tool")[:2], state.mass_matrix
    radial = np.array([math.cos(0.3), math.sin(0.3)])
    assert np.abs(J.T @ cc.dynamics.cartesian_inertia(J, M).matrix @ radial).max() > 1e3
    tamed = cc.dynamics.cartesian_inertia(J, M, cutoff=1e-2)
    assert tamed.rank == 1 and np.abs(J.T @ tamed.matrix @ radial).max() < 1e-2
    exact = robot.state([0.3, 0.0])
    assert cc.dynamics.cartesian_inertia(exact.jacobian("tool")[:2], M).along(radial) == math.inf


def test_on_the_panda_it_is_the_inertia_a_force_meets():
    robot = panda()
    state = random_state(robot, np.random.default_rng(3))
    J = state.jacobian(robot.tool)
    found = cc.dynamics.cartesian_inertia(J, state.mass_matrix)
    wrench = np.arange(1.0, 7.0)
    a = J @ np.linalg.solve(state.mass_matrix, J.T @ wrench)
    np.testing.assert_allclose(found.matrix @ a, wrench, rtol=1e-8)


def test_misuse_is_named():
    for bad, error in (
        (lambda: cc.dynamics.cartesian_inertia(np.eye(2), np.diag([1.0, -1.0])), MetricError),
        (lambda: cc.dynamics.cartesian_inertia(np.eye(2), np.eye(3)), ShapeError),
        (lambda: cc.dynamics.cartesian_inertia(np.eye(2), np.eye(2), cutoff=-1.0), ParameterError),
        (lambda: cc.dynamics.cartesian_inertia(np.eye(2), np.eye(2)).along([0.0, 0.0]), ParameterError),
        (lambda: cc.dynamics.cartesian_inertia(1e-200 * np.eye(2), np.eye(2)), ParameterError),
        (lambda: cc.dynamics.cartesian_inertia(1e200 * np.eye(2), np.eye(2)), ParameterError),
    ):
        with pytest.raises(error, match="M|cutoff|direction"):
            bad()
