"""Measures of a frame's Jacobian: published optima, closed forms, the textbook formulas, singular postures, scaling."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from scipy.optimize import minimize

import cartctl as cc
from cartctl import analysis
from cartctl.errors import FrameNotFound, ParameterError, ShapeError
from tests.objectives_for_tests import PLANE, SIX
from tests.worked_examples import ITEMS

PUBLISHED = ITEMS["r1-2012-01-11-bonus"]


def climb(robot: cc.Robot, objective: cc.Objective, q: np.ndarray) -> np.ndarray:
    """The posture where the objective is greatest, by its own gradient alone."""
    found = minimize(
        lambda x: -objective.value(robot.state(x)),
        q,
        jac=lambda x: -objective.gradient(robot.state(x)),
        method="BFGS",
        options={"gtol": 1e-10},
    )
    return found.x


# ---------------------------------------------------------------- published and closed forms


def test_planar_2R() -> None:
    """w = l1 l2 |sin q2|, greatest at a right angle (Yoshikawa 1985)."""
    l1, l2 = 0.8, 0.5
    robot, w = cc.planar([l1, l2]), cc.Manipulability(axes="xy")
    for q in np.random.default_rng(1).uniform(-3.0, 3.0, (50, 2)):
        state = robot.state(q)
        assert w.value(state) == pytest.approx(l1 * l2 * abs(math.sin(q[1])), abs=1e-12)
        slope = l1 * l2 * math.cos(q[1]) * np.sign(math.sin(q[1]))
        np.testing.assert_allclose(w.gradient(state), [0.0, slope], atol=1e-12)
    best = climb(robot, w, np.array([0.3, 0.4]))
    assert best[1] == pytest.approx(math.pi / 2, abs=1e-7) and w.value(robot.state(best)) == pytest.approx(l1 * l2)


def test_planar_3R_is_best_where_it_is_published_to_be() -> None:
    """On the source's grid of 0.02 rad, and then on from there."""
    lengths, expected = PUBLISHED["inputs"]["L"], PUBLISHED["expected"]
    robot, w = cc.planar(lengths), cc.Manipulability(axes="xy")
    angles = np.arange(0.0, math.pi, PUBLISHED["inputs"]["grid"])
    q2, q3 = (a.ravel() for a in np.meshgrid(angles, angles, indexing="ij"))
    l1, l2, l3 = lengths
    closed = np.sqrt(
        (l1 * (l2 * np.sin(q2) + l3 * np.sin(q2 + q3))) ** 2
        + (l3 * (l1 * np.sin(q2 + q3) + l2 * np.sin(q3))) ** 2
        + (l2 * l3 * np.sin(q3)) ** 2
    )
    for k in np.random.default_rng(2).integers(len(q2), size=200):
        assert w.value(robot.state([0.4, q2[k], q3[k]])) == pytest.approx(closed[k], abs=1e-12)
    top = int(closed.argmax())
    best = climb(robot, w, np.array([0.4, q2[top], q3[top]]))
    tolerance = PUBLISHED["tolerance"]
    np.testing.assert_allclose(best[1:], expected["q2_q3"], atol=tolerance["q2_q3"])
    assert w.value(robot.state(best)) == pytest.approx(expected["H_max"], abs=tolerance["*"])
    assert closed[top] <= w.value(robot.state(best)) < closed[top] + 1e-4
    np.testing.assert_allclose(best[1:], [1.4702, 0.2473], atol=1e-4)  # the continuous optimum


def test_the_smallest_singular_value_of_planar_2R_is_greatest_where_a_grid_says() -> None:
    robot, sigma, inverse = (
        cc.planar([math.sqrt(2.0), 1.0]),
        cc.SmallestSingularValue(axes="xy"),
        cc.InverseCondition(axes="xy"),
    )
    grid = [(inverse.value(robot.state([0.3, a])), a) for a in np.arange(0.0, math.pi, 1e-3)]
    value, angle = max(grid)
    assert value == pytest.approx(1.0, abs=2e-3)  # isotropic at 135 degrees (Salisbury & Craig 1982)
    assert angle == pytest.approx(0.75 * math.pi, abs=1e-3)
    grid = [(sigma.value(robot.state([0.3, a])), a) for a in np.arange(0.0, math.pi, 1e-3)]
    best = climb(robot, cc.Manipulability(axes="xy"), np.array([0.3, 0.5]))
    assert max(grid)[0] >= sigma.value(robot.state(best))


# ---------------------------------------------------------------- formulas


@pytest.mark.parametrize("name", list(SIX))
def test_the_textbook_formula(name: str) -> None:
    """w tr((J D J^T)^-1 J D dJ_i^T), with the inverse that the code does without."""
    robot, rng = SIX[name](), np.random.default_rng(3)
    axes = "xy" if name in PLANE else "pose"
    rows = slice(0, 2) if name in PLANE else slice(0, 6)
    for _ in range(10):
        D = rng.uniform(0.3, 2.0, robot.nv)
        state = robot.state(robot.random_configuration(rng))
        J, H = state.jacobian(robot.tool)[rows], state.hessian(robot.tool)[rows]
        square = (J * D) @ J.T
        w = math.sqrt(np.linalg.det(square))
        expected = [w * np.trace(np.linalg.inv(square) @ (J * D) @ H[:, :, i].T) for i in range(robot.nv)]
        objective = cc.Manipulability(axes=axes, scale=np.sqrt(D))
        assert objective.value(state) == pytest.approx(w, rel=1e-9)
        np.testing.assert_allclose(objective.gradient(state), expected, atol=1e-8 * (1 + np.abs(expected).max()))


@pytest.mark.parametrize("name", list(SIX))
def test_values_are_those_of_the_analysis(name: str) -> None:
    robot, rng = SIX[name](), np.random.default_rng(4)
    axes, m = ("xy", 2) if name in PLANE else ("pose", 6)
    scale, length = rng.uniform(0.3, 2.0, robot.nv), 0.4
    rows = {"axes": axes, "length": length, "scale": scale}
    for _ in range(10):
        state, d = robot.state(robot.random_configuration(rng)), rng.normal(size=m)
        A = np.array(state.jacobian(robot.tool)[:m])
        A[3:] *= length
        A *= scale
        spectrum = analysis.spectrum(A)
        assert cc.Manipulability(**rows).value(state) == pytest.approx(spectrum.manipulability, rel=1e-10)
        assert cc.SmallestSingularValue(**rows).value(state) == pytest.approx(spectrum.values[-1], rel=1e-8)
        assert cc.InverseCondition(**rows).value(state) == pytest.approx(1.0 / spectrum.condition, rel=1e-8)
        speed = cc.VelocityRatio(along=d, **rows).value(state)
        assert speed == pytest.approx(analysis.velocity_ellipsoid(A).along(d), rel=1e-6)
        effort = cc.TorquePerForce(along=d, **rows).value(state)
        assert effort == pytest.approx(1.0 / analysis.force_ellipsoid(A).along(d), rel=1e-8)


def test_a_mask_takes_rows() -> None:
    """The same as the rows of a task, in its order."""
    robot = SIX["panda"]()
    state = robot.state(robot.random_configuration(np.random.default_rng(5)))
    for axes, rows in (("z rx ry", [2, 3, 4]), ("position", [0, 1, 2]), ([1, 0, 1, 0, 0, 1], [0, 2, 5])):
        J = state.jacobian("panda_link6")[rows]
        w = cc.Manipulability("panda_link6", axes).value(state)
        assert w == pytest.approx(math.sqrt(np.linalg.det(J @ J.T)), rel=1e-9)


def test_more_rows_than_joints() -> None:
    """A planar arm in all six rows: the product of its three singular values, and its slope."""
    robot, w = SIX["planar3R"](), cc.Manipulability()
    state = robot.state([0.2, 0.7, -1.1])
    J = state.jacobian("tool")
    assert w.value(state) == pytest.approx(math.sqrt(np.linalg.det(J.T @ J)), rel=1e-12)
    slope = cc.FunctionObjective(w.value).gradient(state)
    np.testing.assert_allclose(w.gradient(state), slope, atol=1e-9)
    upwards = cc.VelocityRatio(along=[0, 0, 1, 0, 0, 0])  # no joint moves it out of its plane
    assert upwards.value(state) == 0.0 and not upwards.gradient(state).any()


# ---------------------------------------------------------------- singular postures


@pytest.mark.parametrize("kind", [cc.Manipulability, cc.SmallestSingularValue, cc.InverseCondition])
@pytest.mark.parametrize("distance", [0.0, 1e-12, 1e-8, 1e-4])
@pytest.mark.parametrize("name", ["planar3R", "panda", "kinova"])
def test_at_and_near_singular_postures(kind: type[cc.Manipulability], distance: float, name: str) -> None:
    """Finite, and the way it points is up; at the kink itself, one of the ways up."""
    robot = SIX[name]()
    objective = kind(axes="xy" if name == "planar3R" else "pose")
    state = robot.state(robot.integrate(robot.neutral, distance * np.linspace(1.0, 2.0, robot.nv)))
    assert analysis.rank(state.jacobian(robot.tool)[: 2 if name == "planar3R" else 6], 1e-3) < robot.nv
    gradient = objective.gradient(state)
    size = np.linalg.norm(gradient)
    assert np.isfinite(gradient).all() and size < 1e3
    if size > 1e-6 * (1.0 + objective.value(state)):
        ahead = robot.state(robot.integrate(state.q, 1e-3 * gradient / size))
        assert objective.value(ahead) > objective.value(state)


def test_with_two_directions_lost_there_is_no_slope_of_the_product() -> None:
    """One lost direction leaves a slope, two do not: each cofactor has one of the two zeros as a factor."""
    robot = cc.planar([1.0, 0.7, 0.4, 0.3])
    state = robot.state(np.zeros(4))
    w = cc.Manipulability(axes="x y rz")
    assert analysis.rank(state.jacobian("tool")[[0, 1, 5]]) == 2
    assert np.linalg.norm(w.gradient(state)) > 1e-3
    flat = cc.Manipulability(axes="x z")  # z is never reached, x is lost where it is stretched
    assert analysis.rank(state.jacobian("tool")[[0, 2]]) == 0
    assert flat.value(state) == 0.0 and not flat.gradient(state).any()


def test_a_folded_arm_leaves_the_singularity() -> None:
    """From rank lost exactly, inside the workspace, by the objective alone, with the hand where it was."""
    robot = cc.planar([1.0, 0.7, 0.4])
    w = cc.Manipulability(axes="xy", gain=5.0)
    tip = cc.FrameTask("tool", "xy", gain=0.0)
    controller = cc.Controller(robot, tip, "projected-gradient", objective=w, limits=None, dt=1e-3)
    run = cc.simulate(controller, q0=np.array([0.0, np.pi, np.pi]), duration=2.0)
    assert w.value(robot.state(run.q[0])) < 1e-12 < 0.4 < w.value(robot.state(run.q[-1]))
    gone = robot.state(run.q[-1]).position("tool") - robot.state(run.q[0]).position("tool")
    assert np.linalg.norm(gone) < 0.01


def test_coinciding_singular_values() -> None:
    """Their mean, whatever basis the decomposition chose: an isotropic 2R."""
    robot = cc.planar([math.sqrt(2.0), 1.0])
    state = robot.state([0.3, 0.75 * math.pi])
    J, H = state.jacobian("tool")[:2], state.hessian("tool")[:2]
    s = np.linalg.svd(J)[1]
    assert s[0] == pytest.approx(s[1])
    frobenius = np.tensordot(J, H, axes=2) / (2.0 * s[0])  # d/dq of the mean of two equal singular values
    np.testing.assert_allclose(cc.SmallestSingularValue(axes="xy").gradient(state), frobenius, atol=1e-7)
    np.testing.assert_allclose(cc.InverseCondition(axes="xy").gradient(state), 0.0, atol=1e-7)


@pytest.mark.parametrize("angle", [1e-13, 1e-9, 1e-5, 1e-3])
def test_a_velocity_ratio_vanishes_with_a_finite_slope(angle: float) -> None:
    """Radially, a stretched 2R: H = l1 l2 |sin q2| / |J_x|, with slope l1 l2 / |J_x| as q2 goes to 0."""
    l1, l2 = 0.8, 0.5
    robot, radial = cc.planar([l1, l2]), cc.VelocityRatio(axes="xy", along=[1.0, 0.0])
    state = robot.state([0.0, angle])
    J = state.jacobian("tool")[:2]
    expected = abs(np.linalg.det(J)) / np.linalg.norm(J[1])
    assert radial.value(state) == pytest.approx(expected, rel=1e-3, abs=1e-15)
    slope = l1 * l2 / math.hypot(l1 + l2, l2)
    assert radial.gradient(state)[1] == pytest.approx(slope, rel=1e-2)
    across = cc.VelocityRatio(axes="xy", along=[0.0, 1.0])
    assert across.value(robot.state([0.0, 0.0])) == pytest.approx(math.hypot(l1 + l2, l2))  # the other way is open
    assert cc.TorquePerForce(axes="xy", along=[1.0, 0.0]).value(robot.state([0.0, 0.0])) == 0.0
    assert not cc.TorquePerForce(axes="xy", along=[1.0, 0.0]).gradient(robot.state([0.0, 0.0])).any()


# ---------------------------------------------------------------- scaling


def test_a_length_is_a_change_of_units() -> None:
    """In millimetres, a length of 400 mm: manipulability grows by 1000^6, ratios and directions stay."""
    robot, rng = SIX["panda"](), np.random.default_rng(6)
    state = robot.state(robot.random_configuration(rng))
    J = state.jacobian(robot.tool)
    for length in (0.1, 0.4, 2.5):
        w = cc.Manipulability(length=length)
        A = np.concatenate([J[:3], length * J[3:]])
        assert w.value(state) == pytest.approx(math.sqrt(np.linalg.det(A @ A.T)), rel=1e-9)
        unit = cc.Manipulability()
        np.testing.assert_allclose(w.gradient(state), length**3 * unit.gradient(state), rtol=1e-9, atol=1e-14)
    a, b = (cc.InverseCondition(length=x).value(state) for x in (0.1, 0.4))
    assert abs(a - b) > 1e-3


def test_a_common_scale_of_the_joints_comes_out() -> None:
    robot, rng = SIX["panda"](), np.random.default_rng(7)
    state, d = robot.state(robot.random_configuration(rng)), rng.normal(size=6)
    twice = {"scale": np.full(7, 2.0)}
    for kind, power in (
        (cc.Manipulability, 6),
        (cc.SmallestSingularValue, 1),
        (cc.InverseCondition, 0),
    ):
        np.testing.assert_allclose(kind(**twice).gradient(state), 2.0**power * kind().gradient(state), rtol=1e-8)
    for kind in (cc.VelocityRatio, cc.TorquePerForce):
        np.testing.assert_allclose(
            kind(along=d, **twice).gradient(state), 2.0 * kind(along=3.0 * d).gradient(state), rtol=1e-8
        )


def test_scales_from_the_limits() -> None:
    robot = SIX["panda"]()
    state = robot.state(robot.random_configuration(np.random.default_rng(8)))
    by_name, given = cc.Manipulability(scale="limits"), cc.Manipulability(scale=robot.limits.velocity_upper)
    np.testing.assert_allclose(by_name.gradient(state), given.gradient(state), rtol=1e-12)
    down = {"axes": "position", "along": [0.0, 0.0, -1.0]}
    by_name = cc.TorquePerForce(scale="limits", **down)
    given = cc.TorquePerForce(scale=1.0 / robot.limits.torque_upper, **down)
    np.testing.assert_allclose(by_name.gradient(state), given.gradient(state), rtol=1e-12)
    J = state.jacobian(robot.tool)[2]
    assert by_name.value(state) == pytest.approx(np.linalg.norm(J / robot.limits.torque_upper))


def test_joints_without_a_rate_are_out() -> None:
    """D = 0 locks a joint: the manipulability of the arm on its mobile base is the arm's own."""
    base, arm = SIX["mobile"](), SIX["panda"]()
    q = arm.random_configuration(np.random.default_rng(9))
    on_base = np.concatenate([base.neutral[: base.nq - arm.nq], q])
    locked = cc.Manipulability(scale=np.concatenate([np.zeros(3), np.ones(7)]))
    w = cc.Manipulability()
    assert locked.value(base.state(on_base)) == pytest.approx(w.value(arm.state(q)), rel=1e-10)
    np.testing.assert_allclose(locked.gradient(base.state(on_base))[3:], w.gradient(arm.state(q)), atol=1e-10)


# ---------------------------------------------------------------- misuse


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: cc.Manipulability(axes="w"), ParameterError, "axes is 'w'"),
        (lambda: cc.Manipulability(length=0.0), ParameterError, "length is 0"),
        (lambda: cc.Manipulability(gain=-1.0), ParameterError, "gain is -1"),
        (lambda: cc.Manipulability(scale="limit"), ParameterError, "scale is 'limit'; expected None, 'limits'"),
        (lambda: cc.Manipulability(scale=[-1.0] * 7), ParameterError, "at least 0"),
        (lambda: cc.VelocityRatio(axes="xy"), ParameterError, r"along is None; expected \(2,\)"),
        (lambda: cc.VelocityRatio(axes="xy", along=[0.0, 0.0]), ParameterError, "not zero"),
        (lambda: cc.TorquePerForce(axes="xy", along=[1.0, 0.0, 0.0]), ShapeError, r"\(2,\)"),
    ],
)
def test_misuse(make, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        make()


@pytest.mark.parametrize(
    ("objective", "error", "words"),
    [
        (cc.Manipulability("panda_hand_tpc"), FrameNotFound, "panda_hand_tcp"),
        (cc.Manipulability(scale=np.ones(6)), ShapeError, r"scale has shape \(6,\); expected \(7,\)"),
    ],
)
def test_what_does_not_fit_the_robot_is_refused_at_once(objective, error, words: str) -> None:
    robot = SIX["panda"]()
    with pytest.raises(error, match=words):
        cc.Controller(robot, cc.FrameTask(robot.tool), "projected-gradient", objective=objective, limits=None)


def test_limits_that_are_not_there_are_named() -> None:
    robot = SIX["rpr"]()
    assert not np.isfinite(robot.limits.velocity_upper).all()
    with pytest.raises(ParameterError, match="joint 'joint0' has no velocity limit; give one number a joint"):
        cc.Manipulability(axes="xy", scale="limits").check(robot)
    with pytest.raises(ParameterError, match="joint 'joint0' has no torque limit"):
        cc.GravityTorque(scale="limits").check(robot)


def test_repr_is_readable() -> None:
    assert json.dumps(repr(cc.Manipulability("hand", "xy")))
    assert repr(cc.Manipulability("hand", "xy")).startswith("Manipulability(frame='hand', axes='xy'")
