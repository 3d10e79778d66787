"""A URDF is data: what is wrong with it is said in one line, and it reaches nowhere it was not given."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import cartctl as cc
from cartctl.errors import (
    CartctlError,
    CartctlWarning,
    FrameNotFound,
    JointNotFound,
    MalformedUrdfError,
    MissingUrdfError,
    NoJointsError,
    NonFiniteError,
    ParameterError,
    RobotNotFound,
    ShapeError,
    UnsafeUrdfError,
    UrdfError,
)

LINK = (
    '<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    "{1}</link>"
)
JOINT = (
    '<joint name="{0}" type="{3}"><parent link="{1}"/><child link="{2}"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>'
    '<limit lower="-2" upper="2.5" velocity="3" effort="10"/>{4}</joint>'
)


def arm(extra: str = "", visual: str = "", kind: str = "revolute", joint_extra: str = "") -> str:
    links = LINK.format("base", visual) + LINK.format("upper", "") + LINK.format("lower", "")
    joints = JOINT.format("shoulder", "base", "upper", kind, "") + JOINT.format(
        "elbow", "upper", "lower", kind, joint_extra
    )
    return f'<robot name="arm">{links}{joints}{extra}</robot>'


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def mesh(filename: str) -> str:
    return f'<visual><geometry><mesh filename="{filename}"/></geometry></visual>'


CUBE = (
    "solid c\n"
    + "".join(
        f"facet normal 0 0 1\nouter loop\nvertex 0 0 {z}\nvertex 1 0 {z}\nvertex 0 1 {z}\nendloop\nendfacet\n"
        for z in (0, 1)
    )
    + "endsolid c\n"
)


def test_a_plain_urdf_loads_with_its_limits(tmp_path: Path) -> None:
    robot = cc.load(write(tmp_path / "arm.urdf", arm()))
    assert robot.joint_names == ("shoulder", "elbow")
    np.testing.assert_allclose(robot.limits.position_lower, [-2, -2])
    np.testing.assert_allclose(robot.limits.position_upper, [2.5, 2.5])
    np.testing.assert_allclose(robot.limits.velocity_lower, [-3, -3])
    np.testing.assert_allclose(robot.limits.torque_upper, [10, 10])
    assert np.isposinf(robot.limits.acceleration_upper).all() and np.isneginf(robot.limits.jerk_lower).all()


BOMB = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
EXTERNAL = '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]>'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "well-formed"),
        ("<robot name='x'>", "well-formed"),
        ("<html></html>", "<html>"),
        (BOMB + arm().replace('name="arm"', 'name="&b;"'), "entities"),
        (EXTERNAL + arm().replace('name="arm"', 'name="&a;"'), "entities"),
        ('<robot name="none"><link name="a"/></robot>', "none that moves"),
        (arm(kind="fixed"), "none that moves"),
        (arm(kind="floating"), "floating"),
        (arm(kind="hinge"), "hinge"),
        (arm().replace('child link="lower"', 'child link="nowhere"'), "nowhere"),
        (arm().replace('child link="lower"', 'child link="upper"'), "two parent joints"),
        (arm(LINK.format("stray", "")), "root links"),
        (arm().replace('lower="-2"', 'lower="nan"', 1), "nan"),
        (arm().replace('mass value="1"', 'mass value="inf"', 1), "inf"),
        (arm().replace('ixx="1"', 'ixx="one"', 1), "one"),
        (arm().replace('name="elbow"', 'name="shoulder"'), "twice"),
        (arm().replace('<link name="base"', "<link"), "no name"),
        (arm().replace('lower="-2" upper="2.5"', 'lower="2" upper="-2.5"', 1), "lower <= upper"),
        (arm().replace('<limit lower="-2" upper="2.5" velocity="3" effort="10"/>', "", 1), "no <limit>"),
        (arm(joint_extra='<mimic joint="ghost"/>'), "ghost"),
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="m"/></robot>', "xacro"),
    ],
)
def test_a_bad_urdf_is_refused_in_one_line(tmp_path: Path, text: str, says: str) -> None:
    path = write(tmp_path / "bad.urdf", text)
    with pytest.raises(UrdfError) as caught:
        cc.load(path)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "bad.urdf" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("<robot", MalformedUrdfError),
        ("<html/>", MalformedUrdfError),
        (arm(kind="fixed"), NoJointsError),
        (BOMB + arm().replace('name="arm"', 'name="&b;"'), UnsafeUrdfError),
    ],
)
def test_each_kind_of_badness_has_its_own_error(tmp_path: Path, text: str, error: type[UrdfError]) -> None:
    with pytest.raises(error):
        cc.load(write(tmp_path / "bad.urdf", text))


def test_binary_rubbish_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rubbish.urdf"
    path.write_bytes(bytes(range(256)) * 4)
    with pytest.raises(UrdfError):
        cc.load(path)


def test_missing_files_and_unknown_names(tmp_path: Path) -> None:
    with pytest.raises(MissingUrdfError, match="no such file"):
        cc.load(tmp_path / "nothing.urdf")
    with pytest.raises(UrdfError, match="folder"):
        cc.load(tmp_path)
    with pytest.raises(RobotNotFound, match="panda"):
        cc.load("pandda")
    with pytest.raises(RobotNotFound):
        cc.load("")


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"active_joints": ["elbov"]}, JointNotFound),
        ({"active_joints": []}, UrdfError),
        ({"root_joint": "floating"}, ParameterError),
        ({"tool": "hand"}, FrameNotFound),
        ({"home": {"knee": 0.1}}, JointNotFound),
        ({"home": {"elbow": float("nan")}}, NonFiniteError),
        ({"gravity": (0, 0)}, ShapeError),
        ({"gravity": (0, 0, float("inf"))}, NonFiniteError),
    ],
)
def test_bad_options_are_refused(tmp_path: Path, options: dict, error: type[CartctlError]) -> None:
    with pytest.raises(error) as caught:
        cc.load(write(tmp_path / "arm.urdf", arm()), **options)
    assert "\n" not in str(caught.value)


def test_meshes_beside_the_urdf_and_in_packages(tmp_path: Path) -> None:
    write(tmp_path / "robots/meshes/cube.stl", CUBE)
    write(tmp_path / "shapes/meshes/cube.stl", CUBE)
    for name, options in {
        "meshes/cube.stl": {},
        "package://shapes/meshes/cube.stl": {"package_dirs": [tmp_path]},
        "package://shapes/meshes/./cube.stl": {"package_dirs": [tmp_path / "shapes"]},
        "package://robots/meshes/cube.stl": {},
        f"file://{tmp_path}/robots/meshes/cube.stl": {},
    }.items():
        robot = cc.load(write(tmp_path / "robots/arm.urdf", arm(visual=mesh(name))), **options)
        assert len(robot.visual_model.geometryObjects) == 1, name


def test_a_ros_package_around_the_urdf_is_its_own_folder(tmp_path: Path) -> None:
    write(tmp_path / "my_robot/package.xml", "<package/>")
    write(tmp_path / "my_robot/meshes/cube.stl", CUBE)
    robot = cc.load(write(tmp_path / "my_robot/urdf/arm.urdf", arm(visual=mesh("../meshes/cube.stl"))))
    assert len(robot.visual_model.geometryObjects) == 1


@pytest.mark.parametrize(
    "name",
    [
        "../secret/cube.stl",
        "/etc/passwd",
        "package://shapes/../../secret/cube.stl",
        "http://a.b/c.stl",
        "file:///etc/hostname",
        "link.stl",
    ],
)
def test_meshes_that_climb_out_are_refused(tmp_path: Path, name: str) -> None:
    write(tmp_path / "secret/cube.stl", CUBE)
    (tmp_path / "given/shapes").mkdir(parents=True)
    path = write(tmp_path / "given/arm.urdf", arm(visual=mesh(name)))
    (tmp_path / "given/link.stl").symlink_to(tmp_path / "secret/cube.stl")
    with pytest.raises(UnsafeUrdfError, match="outside|scheme"):
        cc.load(path, package_dirs=[tmp_path / "given"])


def test_missing_meshes_are_one_warning(tmp_path: Path) -> None:
    path = write(tmp_path / "arm.urdf", arm(visual=mesh("a.stl") + mesh("package://gone/b.stl")))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = cc.load(path)
    assert len([w for w in caught if issubclass(w.category, CartctlWarning)]) == 1
    assert "2 mesh" in str(caught[0].message)
    assert robot.visual_model.ngeoms == 0


def test_an_absent_velocity_limit_is_none_not_zero(tmp_path: Path) -> None:
    text = arm().replace('velocity="3" effort="10"', "")
    robot = cc.load(write(tmp_path / "arm.urdf", text))
    assert np.isposinf(robot.limits.velocity_upper).all() and np.isneginf(robot.limits.torque_lower).all()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (arm().replace('axis xyz="0 1 0"', 'axis xyz="0 0 0"', 1), "axis 0 0 0"),
        (arm().replace('axis xyz="0 1 0"', 'axis xyz="0 1"', 1), "expected 3"),
        (arm().replace('mass value="1"', 'mass value="-1"', 1), "negative"),
        (arm().replace('xyz="0 0 0.3"', 'xyz="0 0 1e308"', 1), "at most"),
        (arm(joint_extra='<mimic joint="elbow"/>'), "mimics itself"),
        (arm(kind="continuous", joint_extra='<mimic joint="shoulder"/>'), "continuous"),
    ],
)
def test_absurd_robots_are_refused_in_one_line(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(UrdfError, match=says) as caught:
        cc.load(write(tmp_path / "bad.urdf", text))
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


def test_a_robot_without_a_name_and_shapes_without_geometry_load(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    text = arm(visual="<visual><geometry/></visual>").replace(' name="arm"', "")
    assert cc.load(write(tmp_path / "arm.urdf", text)).name == "robot"
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("content", [b"", b"solid", b"\x00" * 90, b"<dae>"])
@pytest.mark.parametrize("suffix", ["stl", "dae", "obj"])
def test_broken_meshes_are_one_warning_and_the_rest_is_shown(tmp_path: Path, content: bytes, suffix: str) -> None:
    write(tmp_path / "good.stl", CUBE)
    (tmp_path / f"bad.{suffix}").write_bytes(content)
    robot = cc.load(write(tmp_path / "arm.urdf", arm(visual=mesh("good.stl") + mesh(f"bad.{suffix}"))))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        shapes = robot.visual_model.ngeoms
    assert shapes == 1 and len([w for w in caught if issubclass(w.category, CartctlWarning)]) == 1


def test_a_mesh_behind_a_circle_of_links_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.stl").symlink_to(tmp_path / "b.stl")
    (tmp_path / "b.stl").symlink_to(tmp_path / "a.stl")
    with pytest.raises(UnsafeUrdfError, match="outside"):
        cc.load(write(tmp_path / "arm.urdf", arm(visual=mesh("a.stl"))))


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda: cc.load(None), ParameterError),
        (lambda: cc.load("a\0b.urdf"), MissingUrdfError),
        (lambda: cc.load("a" * 5000 + ".urdf"), MissingUrdfError),
        (lambda: cc.load("planar3R", home=[1, 2, 3]), ParameterError),
        (lambda: cc.load("planar3R", gravity=(0, 0, 1e308)), ParameterError),
        (lambda: cc.Robot(3), ParameterError),
        (lambda: cc.load("planar3R").random_configuration(3), ParameterError),
        (lambda: cc.load("planar3R").integrate(np.zeros(3), np.full(3, np.nan)), NonFiniteError),
        (lambda: cc.load("planar3R").difference(np.zeros(3), np.zeros(2)), ShapeError),
        (lambda: cc.load("planar3R").coordinates(np.full(3, np.inf)), NonFiniteError),
        (lambda: cc.simulate(3), ParameterError),
    ],
)
def test_nonsense_is_refused_by_our_own_errors(call: object, error: type[CartctlError]) -> None:
    with pytest.raises(error) as caught:
        call()
    assert "\n" not in str(caught.value)
