"""The planar generator: textbook kinematics and dynamics at random configurations, and refusals."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from cartctl.errors import NonFiniteError, ParameterError, ShapeError
from cartctl.model.planar import PlanarLimits, planar_urdf

EXACT = 1e-12


def build(text: str) -> tuple[Any, Any, int]:
    model = pin.buildModelFromXML(text)
    return model, model.createData(), model.getFrameId("tool")


def tip(lengths: np.ndarray, q: np.ndarray) -> np.ndarray:
    a = np.cumsum(q)
    return np.array([lengths @ np.cos(a), lengths @ np.sin(a), a[-1]])


def tip_jacobian(lengths: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Rows x, y, angle: column j sums the links from j on."""
    a, n = np.cumsum(q), len(q)
    beyond = [range(j, n) for j in range(n)]
    dx = [-sum(lengths[i] * math.sin(a[i]) for i in k) for k in beyond]
    dy = [sum(lengths[i] * math.cos(a[i]) for i in k) for k in beyond]
    return np.array([dx, dy, [1.0] * n])


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 12])
def test_kinematics_of_nR_are_the_textbooks(n: int) -> None:
    rng = np.random.default_rng(n)
    lengths = rng.uniform(0.2, 1.5, n)
    model, data, frame = build(planar_urdf(lengths))
    assert (model.nq, model.nv) == (n, n)
    for _ in range(20):
        q = rng.uniform(-math.pi, math.pi, n)
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        jacobian = jacobian.reshape(6, n)  # Pinocchio hands out (6,) for one joint
        pin.framesForwardKinematics(model, data, q)
        pose = data.oMf[frame]
        x, y, angle = tip(lengths, q)
        np.testing.assert_allclose(pose.translation, [x, y, 0.0], atol=EXACT * n)
        np.testing.assert_allclose(pose.rotation, pin.utils.rotate("z", angle), atol=EXACT * n)
        np.testing.assert_allclose(jacobian[[0, 1, 5]], tip_jacobian(lengths, q), atol=EXACT * n)
        np.testing.assert_allclose(jacobian[[2, 3, 4]], 0.0, atol=EXACT)


def test_jacobian_of_4R_is_the_one_of_the_lectures() -> None:
    # Unit links at (pi/2, -pi/2, pi/2, -pi/2): the example of the papers on saturation in the null space.
    model, data, frame = build(planar_urdf([1.0] * 4))
    q = np.array([1, -1, 1, -1]) * math.pi / 2
    jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
    np.testing.assert_allclose(jacobian[:2], [[-2, -1, -1, 0], [2, 2, 1, 1]], atol=EXACT)


def test_ppr_slides_along_x_then_y() -> None:
    rng = np.random.default_rng(3)
    model, data, frame = build(planar_urdf([0.0, 0.0, 0.5], joints="XYR"))
    for _ in range(20):
        q = rng.uniform(-1.5, 1.5, 3)
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        pin.framesForwardKinematics(model, data, q)
        x, y = q[0] + 0.5 * math.cos(q[2]), q[1] + 0.5 * math.sin(q[2])
        np.testing.assert_allclose(data.oMf[frame].translation, [x, y, 0], atol=EXACT)
        s, c = math.sin(q[2]), math.cos(q[2])
        expected = np.array([[1, 0, -0.5 * s], [0, 1, 0.5 * c], [0, 0, 1]])
        np.testing.assert_allclose(jacobian[[0, 1, 5]], expected, atol=EXACT)


def test_ppr_pseudoinverse_is_the_one_of_an_exam() -> None:
    # De Luca, Robotics 2, 2018-04-26, exercise 4: l = 0.5 m, q3 = 30 deg.
    model, data, frame = build(planar_urdf([0.0, 0.0, 0.5], joints="XYR"))
    q = np.array([0.3, -0.2, math.pi / 6])
    jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:2]
    printed = [[0.95, 0.0866], [0.0866, 0.85], [-0.2, 0.3464]]
    np.testing.assert_allclose(np.linalg.pinv(jacobian), printed, atol=6e-5)


def test_slides_follow_the_link_before_them() -> None:
    # RP: a slide along the turned x axis, the tip a link further.
    rng = np.random.default_rng(4)
    model, data, frame = build(planar_urdf([0.7, 0.4], joints="RX"))
    for _ in range(10):
        q = rng.uniform(-1.5, 1.5, 2)
        pin.framesForwardKinematics(model, data, q)
        reach = 0.7 + q[1] + 0.4
        expected = [reach * math.cos(q[0]), reach * math.sin(q[0]), 0]
        np.testing.assert_allclose(data.oMf[frame].translation, expected, atol=EXACT)


def test_inertia_of_3R_of_thin_rods_is_the_one_of_an_exam() -> None:
    # De Luca, Robotics 2, 2021-09-10, exercise 2: three rods of 0.5 m and 5 kg at (pi/2, pi/2, 0).
    model, data, _ = build(planar_urdf([0.5] * 3, [5.0] * 3))
    inertia = mass_matrix(model, data, np.array([math.pi / 2, math.pi / 2, 0.0]))
    printed = [[6.25, 3.3333, 1.0417], [3.3333, 3.3333, 1.0417], [1.0417, 1.0417, 0.4167]]
    np.testing.assert_allclose(inertia, printed, atol=6e-5)


def mass_matrix(model: Any, data: Any, q: np.ndarray) -> np.ndarray:
    upper: np.ndarray = np.triu(pin.crba(model, data, q))
    return np.asarray(upper + np.triu(upper, 1).T)


def test_inertia_of_3R_in_closed_form() -> None:
    rng = np.random.default_rng(5)
    model, data, _ = build(planar_urdf([0.8] * 3, [1.7] * 3))
    for _ in range(20):
        q = rng.uniform(-math.pi, math.pi, 3)
        c2, c3, c23 = math.cos(q[1]), math.cos(q[2]), math.cos(q[1] + q[2])
        m11, m12 = 4 + 3 * c2 + c23 + c3, 5 / 3 + 1.5 * c2 + 0.5 * c23 + c3
        m13, m22, m23 = 1 / 3 + 0.5 * c23 + 0.5 * c3, 5 / 3 + c3, 1 / 3 + 0.5 * c3
        expected = np.array([[m11, m12, m13], [m12, m22, m23], [m13, m23, 1 / 3]]) * 1.7 * 0.8**2
        np.testing.assert_allclose(mass_matrix(model, data, q), expected, atol=EXACT)


def test_inertia_of_ppr_in_closed_form() -> None:
    rng = np.random.default_rng(6)
    m, length = np.array([2.0, 1.3, 0.8]), 0.9
    model, data, _ = build(planar_urdf([0.0, 0.0, length], m, joints="XYR"))
    for _ in range(20):
        q = rng.uniform(-1.5, 1.5, 3)
        moment = m[2] * length / 2
        s, c = moment * math.sin(q[2]), moment * math.cos(q[2])
        expected = [[m.sum(), 0, -s], [0, m[1] + m[2], c], [-s, c, m[2] * length**2 / 3]]
        np.testing.assert_allclose(mass_matrix(model, data, q), expected, atol=EXACT)


@pytest.mark.parametrize("joints", ["R", "RRRRR", "XYR", "RX", "Y"])
def test_inertias_are_those_of_rigid_bodies(joints: str) -> None:
    rng = np.random.default_rng(len(joints))
    lengths = [0.6 if kind == "R" else 0.0 for kind in joints]
    model, data, _ = build(planar_urdf(lengths, rng.uniform(0.1, 5, len(joints)), joints=joints))
    for inertia in list(model.inertias)[1:]:
        small, middle, large = np.linalg.eigvalsh(inertia.inertia)
        assert small > 0
        assert small + middle >= large * (1 - EXACT)
    for _ in range(10):
        assert np.linalg.eigvalsh(mass_matrix(model, data, rng.uniform(-1.5, 1.5, model.nq))).min() > 1e-4


def test_gravity_along_z_does_no_work() -> None:
    model, data, _ = build(planar_urdf([1.0, 0.5, 0.7]))
    assert model.gravity.linear[2] == -9.81
    gravity = pin.computeGeneralizedGravity(model, data, np.array([0.3, -1.1, 0.8]))
    np.testing.assert_allclose(gravity, 0.0, atol=EXACT)


def test_default_mass_is_1_kg_per_metre_and_1_kg_for_a_carriage() -> None:
    model, _, _ = build(planar_urdf([0.0, 0.4, 1.5], joints="XRR"))
    assert [i.mass for i in model.inertias][1:] == pytest.approx([1.0, 0.4, 1.5])


def test_limits_are_the_ones_asked_for() -> None:
    limits = PlanarLimits(angle=1.1, rate=2.2, torque=3.3, stroke=0.4, speed=0.5, force=6.0)
    model, _, _ = build(planar_urdf([0.0, 1.0], joints="YR", limits=limits))
    assert model.lowerPositionLimit.tolist() == [-0.4, -1.1]
    assert model.upperPositionLimit.tolist() == [0.4, 1.1]
    assert model.velocityLimit.tolist() == [0.5, 2.2]
    assert model.effortLimit.tolist() == [6.0, 3.3]


def test_names() -> None:
    model, _, _ = build(planar_urdf([1.0, 1.0]))
    assert model.name == "planar2R"
    assert list(model.names)[1:] == ["joint1", "joint2"]
    assert pin.buildModelFromXML(planar_urdf([0, 0, 1], joints="XYR")).name == "ppr"
    assert pin.buildModelFromXML(planar_urdf([1], name='two "arms" & <more>')).name == 'two "arms" & <more>'


@pytest.mark.parametrize("kind", [pin.GeometryType.VISUAL, pin.GeometryType.COLLISION])
def test_shapes_span_the_links(kind: Any) -> None:
    text = planar_urdf([1.0, 0.5])
    model, data, _ = build(text)
    shapes = pin.buildGeomFromUrdfString(model, text, kind)
    assert {g.parentJoint for g in shapes.geometryObjects} >= {1, 2}
    placed = shapes.createData()
    pin.updateGeometryPlacements(model, data, shapes, placed, np.array([0.0, math.pi / 2]))
    corners = []
    for g, place in zip(shapes.geometryObjects, placed.oMg, strict=True):
        g.geometry.computeLocalAABB()
        box = g.geometry.aabb_local
        sides = zip(box.min_, box.max_, strict=True)
        corners += [place.act(np.array(corner)) for corner in itertools.product(*sides)]
    reach = np.max(corners, axis=0)
    assert 1.0 < reach[0] <= 1.1  # the side of the second link
    assert 0.5 - EXACT <= reach[1] <= 0.6  # the tip


@pytest.mark.parametrize(
    ("arguments", "error", "names"),
    [
        ({"lengths": []}, ShapeError, "lengths"),
        ({"lengths": 1.0}, ShapeError, "lengths"),
        ({"lengths": ["a"]}, ShapeError, "lengths"),
        ({"lengths": [1.0, -0.5]}, ParameterError, r"lengths\[1\] is -0.5"),
        ({"lengths": [1.0, 0.0]}, ParameterError, r"lengths\[1\] is 0"),
        ({"lengths": [0.0, -1.0], "joints": "XY"}, ParameterError, r"lengths\[1\] is -1"),
        ({"lengths": [1.0, math.nan]}, NonFiniteError, r"lengths\[1\] is nan"),
        ({"lengths": [1.0], "masses": [math.inf]}, NonFiniteError, r"masses\[0\] is inf"),
        ({"lengths": [1.0], "masses": [0.0]}, ParameterError, r"masses\[0\] is 0"),
        ({"lengths": [1.0, 1.0], "masses": [1.0]}, ShapeError, "masses has 1 entries; expected 2"),
        ({"lengths": [1.0], "joints": "RR"}, ShapeError, "joints has 2 entries; expected 1"),
        ({"lengths": [1.0], "joints": "Z"}, ParameterError, "joints is 'Z'"),
        ({"lengths": [1.0], "joints": 3}, ParameterError, "joints is 3"),
    ],
)
def test_what_is_no_arm_is_refused(arguments: dict[str, Any], error: type[Exception], names: str) -> None:
    with pytest.raises(error, match=names):
        planar_urdf(**arguments)


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_limits_must_be_positive(value: float) -> None:
    with pytest.raises(ParameterError, match=f"PlanarLimits.rate is {value:g}"):
        PlanarLimits(rate=value)
    with pytest.raises(NonFiniteError, match="PlanarLimits.stroke is nan"):
        PlanarLimits(stroke=math.nan)
