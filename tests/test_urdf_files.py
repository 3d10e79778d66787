"""The URDF files of our own against the literature: geometry, limits and inertias."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from cartctl.model.catalog.files import own_urdfs
from cartctl.model.planar import planar_urdf

FOLDER = own_urdfs()
FILES = sorted(path.name for path in FOLDER.glob("*.urdf"))
WRITTEN = {
    "planar_2r.urdf": planar_urdf([1.0] * 2),
    "planar_3r.urdf": planar_urdf([1.0] * 3),
    "planar_4r.urdf": planar_urdf([1.0] * 4),
    "ppr.urdf": planar_urdf([0.0, 0.0, 1.0], joints="XYR"),
}
EXACT = 1e-9  # the files round angles of 90 deg to nine digits
G = 9.81


def build(file: str) -> tuple[Any, Any, int]:
    model = pin.buildModelFromUrdf(str(FOLDER / file))
    return model, model.createData(), model.getFrameId("tool")


def mass_matrix(model: Any, data: Any, q: np.ndarray) -> np.ndarray:
    upper: np.ndarray = np.triu(pin.crba(model, data, q))
    return np.asarray(upper + np.triu(upper, 1).T)


def random_configurations(model: Any, count: int, seed: int) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.uniform(model.lowerPositionLimit, model.upperPositionLimit) for _ in range(count)]


def dh_product(rows: list[tuple[float, float]], q: np.ndarray) -> np.ndarray:
    """Denavit-Hartenberg product of rows (alpha, d), all a = 0."""
    pose = np.eye(4)
    for (alpha, d), angle in zip(rows, q, strict=True):
        c, s, ca, sa = math.cos(angle), math.sin(angle), math.cos(alpha), math.sin(alpha)
        pose = pose @ [[c, -s * ca, s * sa, 0], [s, c * ca, -c * sa, 0], [0, sa, ca, d], [0, 0, 0, 1]]
    return pose


# ---------------------------------------------------------------------------------------------- every file


def test_the_files_are_these() -> None:
    assert FILES == sorted([*WRITTEN, "elbow_3r.urdf", "kuka_lwr4.urdf", "kuka_iiwa14.urdf"])


@pytest.mark.parametrize("file", WRITTEN)
def test_planar_files_are_what_the_generator_writes(file: str) -> None:
    written = (FOLDER / file).read_text(encoding="utf-8")
    assert written == WRITTEN[file], f"write {file} again with planar_urdf"


@pytest.mark.parametrize("file", FILES)
def test_shapes_are_coloured_primitives(file: str) -> None:
    root = ET.parse(FOLDER / file).getroot()
    assert root.find(".//mesh") is None
    coloured = {m.get("name") for m in root.iter("material") if m.find("color") is not None}
    visuals = root.findall(".//visual")
    assert visuals
    for visual in visuals:
        material = visual.find("material")
        assert material is not None
        assert material.get("name") in coloured
    for link in root.findall("link"):
        if link.find("inertial") is not None and link.get("name") != "base":
            assert link.find("visual") is not None, link.get("name")
            assert link.find("collision") is not None, link.get("name")


@pytest.mark.parametrize("file", FILES)
def test_licence_and_readme_name_the_file(file: str) -> None:
    text = (FOLDER / file).read_text(encoding="utf-8")
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert "BSD-3-Clause" in text.split("<robot")[0]
    assert f"`{file}`" in readme
    cited = set(re.findall(r"\[(\d)\]", text.split("<robot")[0]))
    assert cited <= set(re.findall(r"^(\d)\. ", readme, re.MULTILINE))


@pytest.mark.parametrize("file", FILES)
def test_tool_ends_the_arm_on_a_fixed_joint(file: str) -> None:
    model, _, frame = build(file)
    assert model.frames[frame].type == pin.FrameType.BODY
    assert model.frames[frame].parentJoint == model.njoints - 1
    assert [f.name for f in model.frames].count("tool") == 1


@pytest.mark.parametrize("file", FILES)
def test_limits_are_finite_and_positive(file: str) -> None:
    model, _, _ = build(file)
    assert np.all(model.lowerPositionLimit < 0) and np.all(model.upperPositionLimit > 0)
    for limit in (model.lowerPositionLimit, model.velocityLimit, model.effortLimit):
        assert np.all(np.abs(limit) < 1e3) and np.all(limit != 0)


@pytest.mark.parametrize("file", FILES)
def test_inertias_are_those_of_rigid_bodies(file: str) -> None:
    model, data, _ = build(file)
    for inertia in list(model.inertias)[1:]:
        small, middle, large = np.linalg.eigvalsh(inertia.inertia)
        assert small > 0
        assert small + middle >= large * (1 - EXACT)
    for q in random_configurations(model, 50, seed=1):
        assert np.linalg.eigvalsh(mass_matrix(model, data, q)).min() > 1e-5


@pytest.mark.parametrize("file", ["elbow_3r.urdf", "kuka_lwr4.urdf", "kuka_iiwa14.urdf"])
def test_collision_shapes_of_distant_links_are_apart_at_home(file: str) -> None:
    model, data, _ = build(file)
    shapes = pin.buildGeomFromUrdf(model, str(FOLDER / file), pin.GeometryType.COLLISION)
    objects = shapes.geometryObjects
    for i, first in enumerate(objects):
        for k, second in enumerate(objects[:i]):
            if abs(first.parentJoint - second.parentJoint) > 1:
                shapes.addCollisionPair(pin.CollisionPair(k, i))
    assert len(shapes.collisionPairs) > 1
    placed = shapes.createData()
    bent = {3: [0.0, 0.8, -1.5], 7: [0.3, 0.5, 0.2, 1.4, 0.1, -0.9, 0.4]}[model.nq]
    assert not pin.computeCollisions(model, data, shapes, placed, np.array(bent), True)
    folded = {3: [0.0, 0.5, 3.1], 7: [0.0, 2.0, 0.0, -2.09, 0.0, 2.0, 0.0]}[model.nq]
    if file == "elbow_3r.urdf":  # the forearm folded back passes through the column's head
        assert pin.computeCollisions(model, data, shapes, placed, np.array(folded), True)


# ---------------------------------------------------------------------------------------------- elbow arm


def test_elbow_arm_follows_the_textbook() -> None:
    model, data, frame = build("elbow_3r.urdf")
    for q in random_configurations(model, 20, seed=2):
        (c1, c2, c23), (s1, s2, s23) = (f([q[0], q[1], q[1] + q[2]]) for f in (np.cos, np.sin))
        pin.framesForwardKinematics(model, data, q)
        reach, height = c2 + c23, 1 + s2 + s23
        np.testing.assert_allclose(data.oMf[frame].translation, [c1 * reach, s1 * reach, height], atol=EXACT)
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        expected = [
            [-s1 * reach, -c1 * (s2 + s23), -c1 * s23],
            [c1 * reach, -s1 * (s2 + s23), -s1 * s23],
            [0, c2 + c23, c23],
        ]
        np.testing.assert_allclose(jacobian[:3], expected, atol=EXACT)
        np.testing.assert_allclose(jacobian[3:], [[0, s1, s1], [0, -c1, -c1], [1, 0, 0]], atol=EXACT)


def test_elbow_arm_holds_itself_stretched_out() -> None:
    model, data, _ = build("elbow_3r.urdf")
    torque = pin.computeGeneralizedGravity(model, data, np.zeros(3))
    np.testing.assert_allclose(torque, [0, (3 * 0.5 + 2 * 1.5) * G, 2 * 0.5 * G], atol=EXACT)
    assert np.all(np.abs(torque) < model.effortLimit)


# ---------------------------------------------------------------------------------------------- KUKA arms

RIGHT = math.pi / 2
LWR_DH = [
    (RIGHT, 0.3105),
    (-RIGHT, 0.0),
    (-RIGHT, 0.4),
    (RIGHT, 0.0),
    (RIGHT, 0.39),
    (-RIGHT, 0.0),
    (0.0, 0.078),
]
IIWA_DH = [
    (-RIGHT, 0.36),
    (RIGHT, 0.0),
    (RIGHT, 0.42),
    (-RIGHT, 0.0),
    (-RIGHT, 0.4),
    (RIGHT, 0.0),
    (0.0, 0.126),
]


@pytest.mark.parametrize(("file", "dh"), [("kuka_lwr4.urdf", LWR_DH), ("kuka_iiwa14.urdf", IIWA_DH)])
def test_kuka_geometry_is_its_dh_table(file: str, dh: list[tuple[float, float]]) -> None:
    model, data, frame = build(file)
    for q in random_configurations(model, 30, seed=3):
        pin.framesForwardKinematics(model, data, q)
        np.testing.assert_allclose(data.oMf[frame].homogeneous, dh_product(dh, q), atol=EXACT)


@pytest.mark.parametrize(
    ("file", "position", "velocity", "torque"),
    [
        (
            "kuka_lwr4.urdf",
            [170, 120, 170, 120, 170, 120, 170],
            [100, 110, 100, 130, 130, 180, 180],
            [176, 176, 100, 100, 100, 38, 38],
        ),
        (
            "kuka_iiwa14.urdf",
            [170, 120, 170, 120, 170, 120, 175],
            [85, 85, 100, 75, 130, 135, 135],
            [320, 320, 176, 176, 110, 40, 40],
        ),
    ],
)
def test_kuka_limits_are_the_published_ones(
    file: str, position: list[float], velocity: list[float], torque: list[float]
) -> None:
    model, _, _ = build(file)
    np.testing.assert_allclose(np.rad2deg(model.upperPositionLimit), position, atol=1e-6)
    np.testing.assert_allclose(np.rad2deg(model.lowerPositionLimit), -np.array(position), atol=1e-6)
    np.testing.assert_allclose(np.rad2deg(model.velocityLimit), velocity, atol=1e-6)
    np.testing.assert_allclose(model.effortLimit, torque)


@pytest.mark.parametrize(("file", "total"), [("kuka_lwr4.urdf", 16.0), ("kuka_iiwa14.urdf", 29.9)])
def test_kuka_masses_sum_to_the_data_sheet(file: str, total: float) -> None:
    masses = [float(m.get("value", "nan")) for m in ET.parse(FOLDER / file).getroot().iter("mass")]
    assert sum(masses) == pytest.approx(total, abs=0.01)


def test_lwr_meets_the_identified_base_parameters() -> None:
    """Jubien, Gautier, Janot 2014: 3.46, 1.33, 0.0286 kg m; 1.25, 0.418, 0.00377, 0.00012 kg m^2."""
    model, data, _ = build("kuka_lwr4.urdf")
    level = np.array([0.0, -RIGHT, 0.0, 0.0, 0.0, 0.0, 0.0])  # stretched out along x
    torque = pin.computeGeneralizedGravity(model, data, level)
    expected = [3.46 + 1.33 + 0.0286, -(1.33 + 0.0286), 0.0286]  # axes -y, +y, -y
    np.testing.assert_allclose(torque[[1, 3, 5]] / G, expected, rtol=2e-3)
    np.testing.assert_allclose(torque[[0, 2, 4, 6]], 0.0, atol=1e-6)
    inertia = mass_matrix(model, data, level)
    wrist = 0.00377
    forearm = 0.418 + wrist + 2 * 0.39 * 0.0286
    arm = 1.25 + 2 * 0.4 * (1.33 + 0.0286) + forearm
    np.testing.assert_allclose(np.diag(inertia)[[1, 3, 5, 6]], [arm, forearm, wrist, 1.2e-4], rtol=1e-2)


def test_lwr_turns_about_its_own_length_as_identified() -> None:
    """The same paper: 0.0115, 0.0108, 0.00633 kg m^2 for joints 1, 3, 5; 0.00636 and 0.00395 beyond."""
    model, data, _ = build("kuka_lwr4.urdf")
    upright = np.diag(mass_matrix(model, data, np.zeros(7)))
    roll_7, roll_6, roll_4 = 1.2e-4, 3.95e-3, 6.36e-3
    about_5 = (0.00633 - roll_6) + roll_6 + roll_7
    about_3 = (0.0108 - roll_4) + roll_4 + about_5
    np.testing.assert_allclose(upright[[0, 2, 4]], [0.0115 + about_3, about_3, about_5], rtol=1e-3)
