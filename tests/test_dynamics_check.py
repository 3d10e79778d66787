"""The inertia-matrix check: matrices of robots pass, each kind of fault is named, in both kinds of angles."""

from __future__ import annotations

import numpy as np
import pytest

import cartctl as cc
from cartctl.errors import NonFiniteError, ParameterError, ShapeError
from tests.arms_for_tests import generated
from tests.robots_for_tests import panda, planar

check = cc.dynamics.check_inertia_matrix


def planar_2r(q):
    return np.array([[3.0 + 2 * np.cos(q[1]), 1.0 + np.cos(q[1])], [1.0 + np.cos(q[1]), 1.0]])


def absolute(M, n):
    """The same arm with all angles from the base: q = T p, so M_p = T^T M T."""
    T = np.eye(n) - np.eye(n, k=-1)
    return lambda p: T.T @ M(T @ p) @ T


@pytest.mark.parametrize("name", ["planar", "panda", "generated"])
def test_a_robots_own_matrix_passes(name):
    robot = {"planar": planar, "panda": panda, "generated": lambda: generated(11, 6)}[name]()

    def M(q):
        return robot.state(robot.integrate(robot.neutral, q)).mass_matrix

    verdict = check(M, robot.nv, coordinates="relative", samples=40)
    assert verdict and verdict.failed is None and verdict.moved == (0,)
    assert check(M, robot.nv, samples=40)


def test_absolute_angles_are_accepted():
    robot = planar()
    M = absolute(lambda q: robot.state(q).mass_matrix, 3)
    assert check(M, 3).moved == (0, 1, 2)
    assert check(M, 3, coordinates="absolute")
    relative = check(M, 3, coordinates="relative")
    assert not relative and relative.failed == "independent of the base" and "q_1" in relative.reason


def test_some_angles_absolute_some_coordinates_not():
    """A slide at the end of a 2R arm in absolute angles: the slide's coordinate turns nothing."""

    def M(q):
        c = np.cos(q[1] - q[0])
        return np.array([[4.0, c, 0.5 * c], [c, 3.0 + q[2] ** 2, 0.0], [0.5 * c, 0.0, 1.0]])

    assert check(M, 3).moved == (0, 1)


FAULTS = {
    "q_1 on the diagonal": (
        lambda q: np.diag([3.0 + np.cos(q[0]), 1.0]),
        "independent of the base",
        "M_11 depends on q_1",
    ),
    "q_1 beside a difference": (
        lambda q: np.array([[3.0, np.cos(q[1] - q[0])], [np.cos(q[1] - q[0]), 2.0 + 0.5 * np.sin(q[1])]]),
        "independent of the base",
        "M_12 depends on q_1, and not on differences to it alone",
    ),
    "not symmetric": (
        lambda q: np.array([[3.0, np.cos(q[1])], [np.sin(q[1]), 2.0]]),
        "symmetric",
        "M_12 and M_21 differ",
    ),
    "negative determinant": (
        lambda q: np.array([[1.0 + 2 * np.cos(q[1]) ** 2, 1.5], [1.5, 1.0]]),
        "positive definite",
        "the determinant is -",
    ),
    "negative inertia": (lambda q: np.diag([1.0, -0.2 + np.cos(q[1]) ** 2]), "positive definite", "M_22 is -0.2"),
    "semidefinite": (lambda q: np.ones((2, 2)), "positive definite", "eigenvalue"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_the_failing_step_is_named(fault):
    M, step, text = FAULTS[fault]
    verdict = check(M, 2)
    assert not verdict and verdict.failed == step
    assert text in verdict.reason, verdict.reason
    assert verdict.q.shape == (2,)
    again = M(verdict.q)
    if step == "positive definite":
        assert np.linalg.eigvalsh(again)[0] <= 1e-9
    elif step == "symmetric":
        assert abs(again[0, 1] - again[1, 0]) > 0.1 and verdict.entry == (0, 1)


def test_a_narrow_dip_below_zero_is_found():
    """Indefinite on 0.4 % of the circle only: the descent gets there, 20 samples alone do not."""

    def M(q):
        return np.diag([1.0, 1.0 + np.sin(q[1] + 0.2) - 1e-5])

    assert check(M, 2, samples=20).failed == "positive definite"


def test_structure_of_a_serial_chain():
    """Positive definite and independent of q_1, but its last joint feels itself."""

    def M(q):
        return np.diag([3.0 + np.cos(q[1]), 2.0 + np.cos(q[1])])

    assert check(M, 2)
    verdict = check(M, 2, coordinates="relative")
    assert verdict.failed == "serial structure" and verdict.entry == (1, 1) and "M_22 depends on q_2" in verdict.reason
    assert check(planar_2r, 2, coordinates="relative")


def test_constant_matrices_units_and_ranges():
    assert check([[2.0, 0.5], [0.5, 1.0]])
    assert check([[2.0, 3.0], [3.0, 1.0]]).failed == "positive definite"
    assert check(np.diag([1e-9, 1e3]))  # kg m^2 beside kg
    rp = check(lambda q: np.diag([1.0 + q[1], 2.0]), 2, lower=[-3, 0.0], upper=[3, 2.0])
    assert rp  # as long as the slide stays out
    assert check(lambda q: np.diag([1.0 + q[1], 2.0]), 2).failed == "positive definite"


def test_many_coordinates():
    robot = generated(5, 10)
    assert check(lambda q: robot.state(robot.integrate(robot.neutral, q)).mass_matrix, 10, samples=10).moved == (0,)


def test_misuse_is_named():
    for bad, error, text in (
        (lambda: check(planar_2r), ParameterError, "n is None"),
        (lambda: check(planar_2r, 3), ShapeError, "M("),
        (lambda: check(lambda q: np.full((2, 2), np.nan), 2), NonFiniteError, "M("),
        (lambda: check(np.ones((2, 3))), ParameterError, "shape"),
        (lambda: check(planar_2r, 2, coordinates="polar"), ParameterError, "coordinates"),
        (lambda: check(planar_2r, 2, lower=[4, 4]), ParameterError, "lower"),
        (lambda: check(planar_2r, 2, samples=0), ParameterError, "samples"),
        (lambda: check(planar_2r, 2, seed=-1), ParameterError, "seed is -1"),
        (lambda: check(planar_2r, 2, seed="a"), ParameterError, "seed is 'a'"),
        (lambda: check(np.eye(2), 3), ParameterError, "n is 3, but M has shape (2, 2)"),
    ):
        with pytest.raises(error) as caught:
            bad()
        assert text in str(caught.value)
    assert check(planar_2r, np.int64(2), samples=np.int64(20))  # a whole number is one, numpy's too
