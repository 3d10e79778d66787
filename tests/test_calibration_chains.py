"""Chains as data: kinematics, regressors by finite differences, frames from axes, models and URDF there and back."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl import calibration as cal
from cartctl import dynamics as dyn
from cartctl.calibration.frames import NEARLY
from cartctl.calibration.motions import placed
from cartctl.errors import (
    FrameNotFound,
    NonFiniteError,
    ParameterError,
    ParameterNotFound,
    ShapeError,
    UnsupportedJoint,
)
from tests.calibration_for_tests import HALF, lwr, panda, puma, scara, spread

CHAINS = {"puma": puma, "panda": panda, "lwr": lwr, "scara": scara}


def same(one, other, q, tolerance=1e-12):
    np.testing.assert_allclose(one.poses(q), other.poses(q), atol=tolerance)


# --- kinematics -------------------------------------------------------------------------------------------------------


def test_the_modified_table_of_the_panda_is_its_urdf():
    robot, q = cc.load("panda"), spread(panda(), 20, np.random.default_rng(0))
    bare = cc.DHChain(panda().a, panda().alpha, panda().d, convention="modified")
    for row, T in zip(q, bare.poses(q), strict=True):
        np.testing.assert_allclose(T, robot.state(row).placement("panda_link7").homogeneous, atol=1e-14)


def test_a_standard_table_is_the_dynamics_table_and_back():
    """One table for kinematics and dynamics: the same arm, the same model."""
    arm = puma().arm()
    from cartctl.dynamics.dh_model import pinocchio_model

    robot, q = cc.Robot(pinocchio_model(arm)), spread(puma(), 5, np.random.default_rng(1))
    for row, T in zip(q, puma().poses(q), strict=True):
        np.testing.assert_allclose(T, robot.state(row).placement("link6").homogeneous, atol=1e-14)
    again = cc.DHChain.of(arm)
    assert all(np.array_equal(getattr(again, c), getattr(puma(), c)) for c in ("a", "alpha", "d", "theta"))
    assert cc.DHChain.of(dyn.DHArm([dyn.DHLink("P", alpha="pi/2", d=0.1)])).alpha[0] == pytest.approx(HALF)


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_rows_are_the_products_of_their_conventions(convention):
    rng = np.random.default_rng(2)
    a, alpha, d, theta, beta = rng.normal(size=(5, 3))
    chain = cc.DHChain(a, alpha, d, theta, "RPR", convention, beta)
    x, y, z = np.eye(3)
    q, T = rng.normal(size=3), np.eye(4)
    for i in range(3):
        turn, lift = (q[i], 0.0) if i != 1 else (0.0, q[i])
        own = placed(True, z, theta[i] + turn) @ placed(False, z, d[i] + lift)
        link = placed(False, x, a[i]) @ placed(True, x, alpha[i]) @ placed(True, y, beta[i])
        T = T @ (own @ link if convention == "standard" else link @ own)
    np.testing.assert_allclose(chain.pose(q), T, atol=1e-14)


# --- regressors -------------------------------------------------------------------------------------------------------


def differences(chain, names, q, h=1e-6):
    """(N, 6, p) by central differences of the poses themselves, through the chain rebuilt with changed parameters."""
    T, Phi = chain.poses(q), np.empty((len(q), 6, len(names)))
    for k, name in enumerate(names):
        up, down = chain.changed({name: h}).poses(q), chain.changed({name: -h}).poses(q)
        Phi[:, :3, k] = (up[:, :3, 3] - down[:, :3, 3]) / (2 * h)
        spin = (up[:, :3, :3] - down[:, :3, :3]) / (2 * h) @ T[:, :3, :3].transpose(0, 2, 1)
        Phi[:, 3:, k] = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    return Phi


@pytest.mark.parametrize("name", CHAINS)
def test_regressors_are_the_finite_differences(name):
    """Every parameter: the table, beta, offsets, six a joint, base and tool."""
    chain = CHAINS[name]()
    q = spread(chain, 12, np.random.default_rng(3))
    found = chain.regressor(q, list(chain.names))
    assert found.shape == (12, 6, len(chain.names))
    np.testing.assert_allclose(found, differences(chain, chain.names, q), atol=2e-9)


@pytest.mark.parametrize("name", CHAINS)
def test_regressors_of_a_chain_that_was_changed(name):
    """Away from the nominal table the derivative is the changed chain's own, and steps add up."""
    chain, rng = CHAINS[name](), np.random.default_rng(4)
    delta = dict(zip(chain.names, rng.uniform(-0.1, 0.1, len(chain.names)).tolist(), strict=True))
    q = spread(chain, 3, rng)
    x, h = np.array(list(delta.values())), 1e-6
    poses, Phi = chain.product.regressor(q, np.arange(len(x)), x)
    np.testing.assert_allclose(poses.position, chain.changed(delta).positions(q), atol=1e-12)
    for k in range(len(x)):
        step = h * np.eye(len(x))[k]
        up, down = chain.product.at(q, x + step), chain.product.at(q, x - step)
        np.testing.assert_allclose(Phi[:, :3, k], (up.position - down.position) / (2 * h), atol=2e-9)


def test_the_placement_regressor_is_pinocchios():
    """Six placement parameters a joint: pin.computeFrameKinematicRegressor, for every joint of the LWR."""
    chain = lwr()
    robot = chain.source
    q = spread(chain, 1, np.random.default_rng(5))
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q[0])
    pin.updateFramePlacements(robot.model, data)
    frame = robot.frame_id(robot.tool)
    expected = pin.computeFrameKinematicRegressor(robot.model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    columns = [6 * (joint.number - 1) + k for joint in chain.joints for k in range(6)]
    np.testing.assert_allclose(chain.regressor(q, "placements")[0], expected[:, columns], atol=1e-12)


def test_masks_names_groups_and_patterns_choose_the_same_columns():
    chain, q = puma(), spread(puma(), 2, np.random.default_rng(6))
    whole = chain.regressor(q, list(chain.names))
    at = {name: k for k, name in enumerate(chain.names)}
    for parameters, names in (
        (
            {"a": [False, True, True, False, False, False], "theta": True},
            ["a2", "a3", *(f"theta{i}" for i in range(1, 7))],
        ),
        ("a2 a3 theta", ["a2", "a3", *(f"theta{i}" for i in range(1, 7))]),
        (["alpha?", "tool.r?"], [*(f"alpha{i}" for i in range(1, 7)), "tool.rx", "tool.ry", "tool.rz"]),
        ("offsets", [f"theta{i}" for i in range(1, 7)]),
        ("lengths", [f"{c}{i}" for c in "ad" for i in range(1, 7)]),
    ):
        ordered = tuple(name for name in chain.names if name in names)
        assert chain.select(parameters) == ordered
        np.testing.assert_array_equal(chain.regressor(q, parameters), whole[:, :, [at[n] for n in ordered]])
    assert len(chain.select()) == 24  # a, alpha, d, theta of six rows; beta only where Hayati's rows ask for it
    assert "beta2" in chain.with_hayati().select() and "d2" not in chain.with_hayati().select()


# --- symbols ----------------------------------------------------------------------------------------------------------


def test_the_planar_arm_prints_as_the_textbook_has_it():
    text = str(cal.symbolic_regressor(cc.DHChain(a=[1, 1], alpha=[0, 0], d=[0, 0]), "a theta"))
    assert text.splitlines() == [
        "px = a1 cos(q1) + a2 cos(q1 + q2)",
        "py = a1 sin(q1) + a2 sin(q1 + q2)",
        "pz = 0",
        "dp/dtheta1 = [-a1 sin(q1) - a2 sin(q1 + q2), a1 cos(q1) + a2 cos(q1 + q2), 0]",
        "dp/da1 = [cos(q1), sin(q1), 0]",
        "dp/dtheta2 = [-a2 sin(q1 + q2), a2 cos(q1 + q2), 0]",
        "dp/da2 = [cos(q1 + q2), sin(q1 + q2), 0]",
    ]


@pytest.mark.parametrize("seed", range(6))
def test_symbols_are_the_numbers(seed):
    """Random small tables of both conventions, R and P, right and odd angles."""
    rng = np.random.default_rng(seed)
    n = 2 + seed % 3
    angles = [0.0, HALF, -HALF, 0.3]
    chain = cc.DHChain(
        a=rng.choice([0.0, 0.5, 0.25], n),
        alpha=rng.choice(angles, n),
        d=rng.choice([0.0, 0.375], n),
        theta=rng.choice(angles, n),
        joints="".join(rng.choice(["R", "R", "P"], n)),
        convention=["standard", "modified"][seed % 2],
    )
    found = cal.symbolic_regressor(chain, "table beta")
    q = rng.normal(size=n)
    values = {f"q{i + 1}": x for i, x in enumerate(q)} | {
        f"{c}{i + 1}": getattr(chain, c)[i] for c in "ad" for i in range(n)
    }
    np.testing.assert_allclose(
        np.array(found.regressor.subs(values).evalf(), dtype=float),
        chain.regressor([q], "table beta")[0, :3],
        atol=1e-12,
    )
    np.testing.assert_allclose(
        np.array(found.position.subs(values).evalf(), dtype=float).ravel(), chain.positions([q])[0], atol=1e-12
    )
    assert found.latex().startswith("\\left[\\begin{") and found.latex().count("&") == 3 * (len(found.names) - 1)


def test_symbols_refuse_what_nobody_reads():
    with pytest.raises(ParameterError, match="at most 4"):
        cal.symbolic_regressor(puma())
    with pytest.raises(ParameterError, match="base and tool"):
        cal.symbolic_regressor(scara(), "tool")


# --- frames from joint axes -------------------------------------------------------------------------------------------


def axes_chain(points, directions, joints, q, tool):
    """The end by products of exponentials: rotations about, or slides along, the given lines."""
    T = np.eye(4)
    for point, direction, letter, value in zip(points, directions, joints, q, strict=True):
        axis = np.array(direction) / np.linalg.norm(direction)
        if letter == "P":
            T = T @ placed(False, axis, value)
        else:
            about = placed(True, axis, value)
            about[:3, 3] = point - about[:3, :3] @ point
            T = T @ about
    return T @ tool


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize("hayati", [False, True])
@pytest.mark.parametrize("seed", range(20))
def test_tables_of_random_axes_are_the_screws(seed, convention, hayati):
    """Skew, parallel, antiparallel, intersecting, coincident and nearly parallel axes in any order, R and P."""
    rng = np.random.default_rng(seed)
    points, directions = [rng.normal(size=3)], [rng.normal(size=3)]
    for _ in range(4):
        last, way = points[-1], directions[-1] / np.linalg.norm(directions[-1])
        kind = rng.integers(6)
        point = last + rng.normal(size=3)
        points.append(last + 0.3 * way if kind in (3, 4) else point)
        directions.append(
            [rng.normal(size=3), way, -2.0 * way, rng.normal(size=3), way, way + 1e-5 * rng.normal(size=3)][kind]
        )
    joints = "".join(rng.choice(["R", "R", "R", "P"], 5))
    tool = (
        placed(True, np.eye(3)[0], rng.normal())
        @ placed(False, rng.normal(size=3), 1.0)
        @ placed(True, np.eye(3)[2], 1.1)
    )
    chain = cc.DHChain.from_axes(points, directions, joints, tool=tool, convention=convention, hayati=hayati)
    for q in rng.normal(size=(4, 5)):
        np.testing.assert_allclose(chain.pose(q), axes_chain(points, directions, joints, q, tool), atol=1e-11)
    assert np.abs(np.r_[chain.a, chain.d]).max() < 100.0  # nearly parallel axes have no far feet
    if not hayati:
        assert chain.hayati == ()


def test_the_rule_of_the_common_normal():
    """x_i lies along the normal from z_{i-1} to z_i: the elbow manipulator by hand, with its choices."""
    chain = cc.DHChain.from_axes(
        [[0, 0, 0], [0, 0, 0.3], [0.5, 0, 0.3]],  # the base's z, then y through its point, then parallel to it
        [[0, 0, 1], [0, -1, 0], [0, -1, 0]],
        tool=np.array([[0, 0, 1.0, 0.9], [0, -1, 0, 0], [1, 0, 0, 0.3], [0, 0, 0, 1]]),
    )
    np.testing.assert_array_equal(chain.base, np.eye(4))  # the base's z is the first axis
    np.testing.assert_allclose(chain.a, [0, 0.5, 0], atol=1e-15)  # intersect; parallel, 0.5 m apart; intersect
    np.testing.assert_allclose(chain.d, [0.3, 0, 0], atol=1e-15)  # parallel axes: the normal with d = 0
    np.testing.assert_allclose(np.abs(chain.alpha), [HALF, 0, HALF], atol=1e-15)
    np.testing.assert_array_equal(chain.beta, 0.0)


def test_intersecting_and_coincident_axes():
    crossed = cc.DHChain.from_axes([[0, 0, 0], [0.2, 0, 0.4]], [[0, 0, 1], [1, 0, 0]])
    assert crossed.a[0] == 0.0 and crossed.d[0] == pytest.approx(0.4)
    one = cc.DHChain.from_axes([[0, 0, 0], [0, 0, 7.0]], [[0, 0, 1], [0, 0, 1]])  # one axis twice: nothing between
    assert [*one.a, *one.d, *one.alpha, *one.theta] == [0.0] * 8


def test_hayatis_parameter_takes_the_place_of_d_between_parallel_axes():
    tilt = 1e-3
    points, directions = [[0, 0, 0], [0.5, 0, 0], [1, 0, 0]], [[0, 0, 1], [0, np.sin(tilt), np.cos(tilt)], [0, 0, 1]]
    plain = cc.DHChain.from_axes(points, directions)
    with_beta = cc.DHChain.from_axes(points, directions, hayati=True)
    assert tilt > NEARLY and plain.hayati == () and with_beta.hayati == (1, 2)
    assert {"beta1", "beta2"} <= set(with_beta.select()) and not {"d1", "d2"} & set(with_beta.select())
    same(plain, with_beta, spread(plain, 5, np.random.default_rng(0)))
    sideways = [[0, 0, 1], [np.sin(tilt), 0, np.cos(tilt)], [0, 0, 1]]
    assert cc.DHChain.from_axes(points, sideways, hayati=True).beta[0] == pytest.approx(tilt)
    # the standard rule has the feet of the normals 0.5 m / tilt away, where the two axes cross
    assert abs(cc.DHChain.from_axes(points, sideways).d[0]) == pytest.approx(0.5 / np.tan(tilt))


# --- there and back ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize("name", ["panda", "lwr", "iiwa14", "kinova", "ur5", "planar3R", "ppr"])
def test_model_to_table_to_model(name, convention):
    """Serial chains of URDFs, continuous joints among them: a table, and the table as a Pinocchio model again."""
    robot, rng = cc.load(name), np.random.default_rng(7)
    chain = cc.DHChain.of_robot(robot, convention=convention)
    again = cc.Robot(chain.model(), tool="tool")
    twice = cc.DHChain.of_robot(again, "tool", convention)
    for _ in range(5):
        q = robot.random_configuration(rng)
        coordinates = cal.RobotChain(robot).coordinates(q)[0]
        expected = robot.state(q).placement(robot.tool).homogeneous
        np.testing.assert_allclose(chain.pose(coordinates), expected, atol=1e-12)
        np.testing.assert_allclose(again.state(coordinates).placement("tool").homogeneous, expected, atol=1e-12)
        np.testing.assert_allclose(twice.pose(coordinates), expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_table_to_model_to_table(seed):
    """Any table, of either convention, with base, tool and beta: the model moves as it does."""
    rng = np.random.default_rng(seed)
    a, alpha, d, theta, beta = rng.normal(size=(5, 4))
    ends = [placed(True, np.eye(3)[k], rng.normal()) @ placed(False, rng.normal(size=3), 1.0) for k in (0, 1)]
    chain = cc.DHChain(a, alpha, d, theta, "RPRR", ["standard", "modified"][seed % 2], beta, base=ends[0], tool=ends[1])
    robot = cc.Robot(chain.model(), tool="tool")
    q = rng.normal(size=(5, 4))
    for row, T in zip(q, chain.poses(q), strict=True):
        np.testing.assert_allclose(robot.state(row).placement("tool").homogeneous, T, atol=1e-12)
    same(chain, cc.DHChain.of_robot(robot, "tool", "standard"), q, 1e-11)
    same(chain, cc.DHChain.of_robot(robot, "tool", "modified"), q, 1e-11)


@pytest.mark.parametrize("chain", [puma, panda, scara], ids=["puma", "panda", "scara"])
def test_a_table_as_urdf(chain, tmp_path):
    made = chain()
    (tmp_path / "arm.urdf").write_text(made.urdf())
    robot = cc.load(tmp_path / "arm.urdf", tool="tool")
    q = spread(made, 5, np.random.default_rng(8))
    for row, T in zip(q, made.poses(q), strict=True):
        np.testing.assert_allclose(robot.state(row).placement("tool").homogeneous, T, atol=1e-14)


@pytest.mark.parametrize("name", ["lwr", "panda", "planar3R", "kinova"])
def test_a_changed_robot_as_urdf_is_its_own_file_with_new_origins(name, tmp_path):
    robot, rng = cc.load(name), np.random.default_rng(9)
    chain = cal.RobotChain(robot)
    delta = dict(zip(chain.names, rng.uniform(-0.05, 0.05, len(chain.names)).tolist(), strict=True))
    changed = chain.changed(delta).changed(delta)
    path = tmp_path / "robot.urdf"
    path.write_text(changed.urdf())
    from cartctl.calibration.urdf import mesh_folders, tool_link

    loaded = cc.load(path, tool=tool_link(changed), package_dirs=mesh_folders(changed))
    for _ in range(5):
        q = robot.random_configuration(rng)
        wide = loaded.configuration({n: float(robot.coordinates(q)[robot.dof(n)]) for n in robot.joint_names})
        expected = changed.pose(q)
        np.testing.assert_allclose(loaded.state(wide).placement(loaded.tool).homogeneous, expected, atol=1e-12)
        inside = changed.base @ changed.robot.state(q).placement(robot.tool).homogeneous @ changed.tool
        np.testing.assert_allclose(inside, expected, atol=1e-12)
    assert len(loaded.visual_model.geometryObjects) >= len(robot.visual_model.geometryObjects)
    mass = sum(inertia.mass for inertia in robot.model.inertias)
    assert sum(inertia.mass for inertia in loaded.model.inertias) == pytest.approx(mass)


def test_a_model_of_ones_own_becomes_a_bare_chain(tmp_path):
    robot = cc.load("panda")
    chain = cal.RobotChain(robot.model, "panda_hand_tcp").changed({"panda_joint4.x": 0.01})
    (tmp_path / "own.urdf").write_text(chain.urdf())
    loaded = cc.load(tmp_path / "own.urdf", tool="tool")
    q = robot.home
    np.testing.assert_allclose(loaded.state(q).placement("tool").homogeneous, chain.pose(q), atol=1e-13)
    np.testing.assert_allclose(loaded.limits.position_upper, robot.limits.position_upper)


# --- misuse -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: cc.DHChain([1, 2], [0], [0, 0]), ShapeError, "alpha"),
        (lambda: cc.DHChain([], [], []), ShapeError, "a is empty"),
        (lambda: cc.DHChain([np.nan], [0], [0]), NonFiniteError, "a"),
        (lambda: cc.DHChain([1], [0], [0], joints="X"), ParameterError, "letters R or P"),
        (lambda: cc.DHChain([1], [0], [0], convention="craig"), ParameterError, "modified"),
        (lambda: cc.DHChain([1], [0], [0], hayati=[2]), ParameterError, "1 to 1"),
        (lambda: cc.DHChain([1], [0], [0], base=np.zeros((4, 4))), ParameterError, "base"),
        (lambda: cc.DHChain([2e6], [0], [0]), ParameterError, "a"),
        (lambda: puma().poses(np.zeros((3, 5))), ShapeError, r"\(N, 6\)"),
        (lambda: puma().poses(np.zeros((0, 6))), ShapeError, "N >= 1"),
        (lambda: puma().pose(np.zeros((1, 6))), ShapeError, "one configuration"),
        (lambda: puma().poses(np.full((1, 6), np.nan)), NonFiniteError, "q"),
        (lambda: puma().select("a7"), ParameterNotFound, "did you mean"),
        (lambda: puma().select({"a": [True]}), ShapeError, r"\(6,\)"),
        (lambda: puma().select({"a": ["yes"] * 6}), ParameterError, "mask"),
        (lambda: puma().select([]), ParameterError, "at least one"),
        (lambda: puma().select(3), ShapeError, "parameters"),
        (lambda: puma().changed({"q1": 1.0}), ParameterNotFound, "q1"),
        (lambda: cc.DHChain.from_axes([[0, 0, 0]], [[0, 0, 0]]), ParameterError, "length above 0"),
        (lambda: cc.DHChain.from_axes([[0, 0, 0]], [[0, 0]]), ShapeError, "directions"),
        (lambda: panda().arm(), ParameterError, "standard table"),
        (lambda: cal.RobotChain("panda"), ParameterError, "cc.Robot"),
        (lambda: cal.RobotChain(cc.load("panda"), "hand"), FrameNotFound, "panda_hand"),
        (lambda: cal.RobotChain(cc.load("panda"), "panda_link0"), UnsupportedJoint, "no joint moves"),
        (lambda: cal.RobotChain(cc.load("panda", root_joint="free_flyer")), UnsupportedJoint, "root_joint='fixed'"),
    ],
)
def test_misuse_is_named(make, error, words):
    with pytest.raises(error, match=words):
        make()
