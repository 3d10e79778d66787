"""Uniform bodies: against points spread through them, Pinocchio's shapes, and the parallel-axes theorem."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest

from cartctl import dynamics as dyn
from cartctl.errors import NonFiniteError, ParameterError, ShapeError
from tests.arms_for_tests import placement

GRID = 150  # cells along an axis, the planes of the shapes between them; a midpoint rule
COARSE = 5e-3


def spread(inside, reach):
    """Midpoints of a grid over [-reach, reach] that lie inside, (3, N)."""
    lines = [(np.arange(GRID) + 0.5) / GRID * 2 * r - r for r in reach]
    points = np.array(np.meshgrid(*lines, indexing="ij")).reshape(3, -1)
    return points[:, inside(*points)]


def moments(points, mass, about=None):
    x = points - (points.mean(axis=1, keepdims=True) if about is None else np.asarray(about)[:, None])
    return mass * (np.mean((x**2).sum(axis=0)) * np.eye(3) - x @ x.T / x.shape[1])


SOLIDS = {
    "box": (dyn.box(2.0, (0.4, 0.6, 1.0)), lambda x, y, z: x == x, (0.2, 0.3, 0.5)),
    "cylinder": (dyn.cylinder(2.0, 0.5, 1.2), lambda x, y, z: np.hypot(x, y) < 0.5, (0.5, 0.5, 0.6)),
    "hollow": (
        dyn.cylinder(2.0, 0.5, 1.2, 0.3, axis="x"),
        lambda x, y, z: (np.hypot(y, z) < 0.5) & (np.hypot(y, z) > 0.3),
        (0.6, 0.5, 0.5),
    ),
    "ball": (dyn.sphere(3.0, 0.5), lambda x, y, z: x * x + y * y + z * z < 0.25, (0.5, 0.5, 0.5)),
    "hollow ball": (
        dyn.sphere(3.0, 0.5, 0.4),
        lambda x, y, z: abs(np.sqrt(x * x + y * y + z * z) - 0.45) < 0.05,
        (0.5, 0.5, 0.5),
    ),
    "ellipsoid": (
        dyn.ellipsoid(3.0, (0.2, 0.3, 0.5)),
        lambda x, y, z: (x / 0.2) ** 2 + (y / 0.3) ** 2 + (z / 0.5) ** 2 < 1.0,
        (0.2, 0.3, 0.5),
    ),
    "cone": (
        dyn.cone(3.0, 0.4, 1.0),  # base at -1/4, apex at 3/4
        lambda x, y, z: (np.hypot(x, y) < 0.4 * (0.75 - z)) & (z > -0.25),
        (0.4, 0.4, 0.75),
    ),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_a_body_is_what_its_points_are(name):
    body, inside, reach = SOLIDS[name]
    points = spread(inside, reach)
    expected = moments(points, body.mass)
    assert np.abs(body.inertia - expected).max() < COARSE * np.abs(expected).max()
    assert np.abs(points.mean(axis=1)).max() < 2e-3  # the centroid is the origin
    corner = np.array([0.3, -0.2, 0.5])
    far = moments(points, body.mass, corner)
    assert np.abs(body.about(corner) - far).max() < COARSE * np.abs(far).max()


def test_the_shapes_pinocchio_knows():
    for body, expected in (
        (dyn.box(2.0, (0.4, 0.6, 1.0)), pin.Inertia.FromBox(2.0, 0.4, 0.6, 1.0)),
        (dyn.cylinder(2.0, 0.5, 1.2), pin.Inertia.FromCylinder(2.0, 0.5, 1.2)),
        (dyn.sphere(2.0, 0.5), pin.Inertia.FromSphere(2.0, 0.5)),
        (dyn.ellipsoid(2.0, (0.2, 0.3, 0.5)), pin.Inertia.FromEllipsoid(2.0, 0.2, 0.3, 0.5)),
    ):
        np.testing.assert_allclose(body.inertia, expected.inertia, atol=1e-14)


def test_limits_of_the_shapes():
    """Thin ones and shells: rod, disk, tube, hollow sphere; the lecture's hollow cylinder along x."""
    np.testing.assert_allclose(np.diag(dyn.rod(3.0, 2.0).inertia), [0.0, 1.0, 1.0])
    np.testing.assert_allclose(np.diag(dyn.disk(2.0, 0.5).inertia), [0.125, 0.125, 0.25])
    np.testing.assert_allclose(np.diag(dyn.sphere(3.0, 2.0, 2.0).inertia), np.full(3, 2 / 3 * 3.0 * 4.0))
    thin = dyn.sphere(3.0, 2.0, 2.0 - 1e-12).inertia[0, 0]
    assert thin == pytest.approx(8.0, rel=1e-11)
    a, b, c, m = 0.3, 0.5, 1.2, 2.0
    lecture = m / 12 * np.array([6 * (a**2 + b**2), 3 * (a**2 + b**2) + c**2, 3 * (a**2 + b**2) + c**2])
    np.testing.assert_allclose(np.diag(dyn.cylinder(m, b, c, a, axis="x").inertia), lecture)
    for axis, k in zip("xyz", range(3), strict=True):
        assert dyn.cone(1.0, 0.2, 0.9, axis=axis).inertia[k, k] == pytest.approx(0.3 * 0.04)


def test_moving_and_adding_is_pinocchios():
    rng = np.random.default_rng(0)
    total, expected = dyn.Body(0.0, np.zeros(3)), pin.Inertia.Zero()
    for _ in range(6):
        body, pose = dyn.box(rng.uniform(0.5, 2.0), rng.uniform(0.1, 1.0, 3)), placement(rng)
        moved = body.moved(pose.translation, pose.rotation)
        other = pose.act(pin.Inertia(body.mass, np.zeros(3), np.asarray(body.inertia)))
        np.testing.assert_allclose(moved.inertia, other.inertia, atol=1e-14)
        np.testing.assert_allclose(moved.com, other.lever, atol=1e-14)
        total, expected = total + moved, expected + other
    assert total.mass == pytest.approx(expected.mass)
    np.testing.assert_allclose(total.com, expected.lever, atol=1e-14)
    np.testing.assert_allclose(total.inertia, expected.inertia, atol=1e-13)


def test_a_dumbbell_and_two_halves():
    ends = dyn.point_mass(1.0, (0.5, 0, 0)) + dyn.point_mass(3.0, (-0.5, 0, 0))
    np.testing.assert_allclose(ends.com, [-0.25, 0, 0])
    np.testing.assert_allclose(np.diag(ends.inertia), [0.0, 0.75, 0.75])
    halves = dyn.rod(1.0, 1.0).moved((0.5, 0, 0)) + dyn.rod(1.0, 1.0).moved((-0.5, 0, 0))
    np.testing.assert_allclose(halves.inertia, dyn.rod(2.0, 2.0).inertia)


def test_misuse_is_named():
    for bad, error, text in (
        (lambda: dyn.box(-1.0, (1, 1, 1)), ParameterError, "mass is -1"),
        (lambda: dyn.box(1.0, (1, -1, 1)), ParameterError, r"size\[1\] is -1"),
        (lambda: dyn.cylinder(1.0, 0.2, 1.0, 0.3), ParameterError, "inner_radius is 0.3"),
        (lambda: dyn.cylinder(1.0, 0.2, 1.0, axis="w"), ParameterError, "axis is 'w'"),
        (lambda: dyn.sphere(1.0, math.nan), NonFiniteError, "radius"),
        (lambda: dyn.Body(1.0, [1.0, 2.0]), ShapeError, "inertia"),
        (lambda: dyn.Body(1.0, [1.0, 1.0, 2.1]), ParameterError, "principal moments 1, 1, 2.1"),
        (lambda: dyn.Body(1.0, [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]), ParameterError, "transpose"),
        (lambda: dyn.rod(1.0, 1.0).moved(rotation=2 * np.eye(3)), ParameterError, "rotation misses R R.T = I by 3"),
        (lambda: dyn.rod(1.0, 1.0).moved(rotation=-np.eye(3)), ParameterError, "its determinant is -1"),
        (lambda: dyn.box("2", (1, 1, 1)), ParameterError, "mass is '2'"),
        (lambda: dyn.cylinder(None, 1.0, 1.0), ParameterError, "mass is None"),
        (lambda: dyn.sphere("1", 1.0), ParameterError, "mass is '1'"),
        (lambda: dyn.cone([1.0], 1.0, 1.0), ParameterError, "mass is"),
        (lambda: dyn.ellipsoid("1", (1, 1, 1)), ParameterError, "mass is '1'"),
        (lambda: dyn.rod(1.0, 1.0) + 3, TypeError, "Body"),
    ):
        with pytest.raises(error, match=text):
            bad()
