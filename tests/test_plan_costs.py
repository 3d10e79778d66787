"""Costs of whole paths: values by independent sums, gradients and curvature by differences, what is refused."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.errors import CartctlError, ParameterError, ShapeError, UnderactuatedRobot
from cartctl.wholepath.costs import NAMED, CostSum, TaskMiss, as_cost
from cartctl.wholepath.curvature import bending
from cartctl.wholepath.sqp import layout_of
from cartctl.wholepath.trace import Trace
from tests.plans_for_tests import circle, setting, unprojected, wandering
from tests.robots_for_tests import kinova, panda, planar

ROBOTS = {"planar": (planar, "xy"), "panda": (panda, "pose"), "kinova": (kinova, "position")}


def drone_arm() -> cc.Robot:
    return cc.load("panda", root_joint="planar")


def tireless() -> cc.Robot:
    robot = cc.planar([1.0, 0.7])
    robot.limits = robot.limits.replace(torque_lower=-np.inf, torque_upper=np.inf)
    return robot


def weightless() -> cc.Robot:
    model = cc.planar([1.0, 0.7]).model.copy()
    for i in range(1, model.njoints):
        model.inertias[i] = pin.Inertia.Zero()
    return cc.Robot(model)


def near(robot: cc.Robot) -> cc.Posture:
    return cc.Posture(target=robot.integrate(robot.home, np.full(robot.nv, 0.3)))


COSTS = {
    "kinetic-energy": lambda robot: as_cost("kinetic-energy"),
    "joint-speed": lambda robot: cc.JointSpeed(np.linspace(0.5, 2.0, robot.nv)),
    "torque": lambda robot: cc.SquaredTorque(np.linspace(1.0, 0.2, robot.nv)),
    "posture": lambda robot: as_cost(near(robot)),
    "manipulability": lambda robot: as_cost(cc.Manipulability(axes="xy")),
    "inverse-manipulability": lambda robot: as_cost(cc.InverseManipulability(axes="xy")),
    "sum": lambda robot: cc.JointSpeed() + 0.3 * near(robot),
}


@pytest.mark.parametrize("name", COSTS)
@pytest.mark.parametrize("robot_name", ROBOTS)
@pytest.mark.parametrize(("closed", "rest"), [(False, True), (True, False), (False, False)])
def test_gradients_are_the_differences(name: str, robot_name: str, closed: bool, rest: bool) -> None:
    make, axes = ROBOTS[robot_name]
    robot, rng = make(), np.random.default_rng(7)
    given = setting(robot, circle(robot, 0.1, axes=axes), closed=closed, rest=rest)
    Q, cost = wandering(given, rng), COSTS[name](robot)
    g = cost.quadratic(unprojected(given, Q)).g
    for _ in range(4):
        delta = rng.normal(size=(given.size, robot.nv))
        if closed:
            delta[-1] = delta[0]
        h = 1e-6
        ends = [cost.value(unprojected(given, given.moved(Q, s * h * delta))) for s in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / (2.0 * h)
        assert abs(slope - np.sum(g * delta)) <= 2e-6 * max(np.linalg.norm(g) * np.linalg.norm(delta), abs(ends[0]))


@pytest.mark.parametrize("name", ["kinetic-energy", "joint-speed"])
def test_gradients_with_a_moving_base(name: str) -> None:
    """There the tangent space of q turns with q: differences q1 (-) q0 are no longer linear."""
    robot, rng = drone_arm(), np.random.default_rng(3)
    given = setting(robot, circle(robot, 0.1))
    Q, cost = wandering(given, rng), as_cost(name)
    g = cost.quadratic(unprojected(given, Q)).g
    delta = rng.normal(size=(given.size, robot.nv))
    ends = [cost.value(unprojected(given, given.moved(Q, s * 1e-6 * delta))) for s in (1.0, -1.0)]
    slope = (ends[0] - ends[1]) / 2e-6
    assert abs(slope - np.sum(g * delta)) <= 2e-6 * np.linalg.norm(g) * np.linalg.norm(delta)


@pytest.mark.parametrize("name", ["kinetic-energy", "joint-speed", "posture", "manipulability"])
@pytest.mark.parametrize("robot_name", ["planar", "panda", "kinova"])
@pytest.mark.parametrize("closed", [False, True])
def test_the_second_derivative_along_the_task_is_exact(name: str, robot_name: str, closed: bool) -> None:
    """H + X and the bending of the task: second differences of the cost along a curve on the task."""
    make, axes = ROBOTS[robot_name]
    robot, rng = make(), np.random.default_rng(11)
    q = robot.home if robot.nv > 3 else np.array([0.3, 0.8, -1.1])  # stretched out, J has no rank to speak of
    given = setting(robot, circle(robot, 0.1, axes=axes, q0=q), closed=closed)
    smooth = np.cumsum(0.03 * rng.normal(size=(given.size, robot.nv)), axis=0)
    if closed:
        smooth[-1] = smooth[0]
    trace = Trace.through(given, given.moved(np.repeat(q[None], given.size, axis=0), smooth))
    assert trace.met.all()
    cost, layout = COSTS[name](robot), layout_of(trace)
    model = cost.quadratic(trace)
    H = layout.hessian(model, trace.Z) + layout.correction(model, trace.Z)
    H = (H + layout.diagonal(bending(trace, model.g))).toarray()
    g = layout.gradient(model, trace.Z)
    h = 3e-3
    for _ in range(3):
        y = rng.normal(size=layout.size)
        ends = [cost.value(trace.moved(layout.expand(trace.Z, s * h * y))) for s in (1.0, -1.0)]
        middle = cost.value(trace)
        assert (ends[0] - ends[1]) / (2.0 * h) == pytest.approx(g @ y, rel=1e-3, abs=1e-5 * np.linalg.norm(g))
        second = (ends[0] - 2.0 * middle + ends[1]) / h**2
        assert second == pytest.approx(y @ H @ y, rel=5e-3, abs=1e-6 * np.linalg.norm(H) * (y @ y))


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("name", COSTS)
def test_h_is_positive_semidefinite(name: str, closed: bool) -> None:
    robot = panda()
    given = setting(robot, circle(robot, 0.1), closed=closed, rest=not closed)
    trace = unprojected(given, wandering(given, np.random.default_rng(2)))
    H = layout_of(trace).hessian(COSTS[name](robot).quadratic(trace), trace.Z).toarray()
    assert np.abs(H - H.T).max() <= 1e-9 * np.abs(H).max()
    assert np.linalg.eigvalsh(H).min() >= -1e-9 * np.abs(H).max()


def test_values_are_the_sums_they_say() -> None:
    robot, rng = panda(), np.random.default_rng(5)
    given = setting(robot, circle(robot, 0.1), samples=6)
    Q = wandering(given, rng)
    trace, h = unprojected(given, Q), given.h
    V = np.diff(Q, axis=0) / h
    M = [robot.state(q).mass_matrix for q in Q]
    energy = sum(h * 0.25 * v @ (A + B) @ v for v, A, B in zip(V, M[:-1], M[1:], strict=True))
    assert as_cost("kinetic-energy").value(trace) == pytest.approx(energy, rel=1e-12)
    assert cc.JointSpeed().value(trace) == pytest.approx(0.5 * h * np.sum(V**2), rel=1e-12)
    w = np.array([0.5, 1, 1, 1, 1, 0.5]) * h
    lengths = robot.limits.position_upper - robot.limits.position_lower
    middle = 0.5 * (robot.limits.position_upper + robot.limits.position_lower)
    assert as_cost("joint-range").value(trace) == pytest.approx(
        sum(a * np.sum(((q - middle) / lengths) ** 2) / 14.0 for a, q in zip(w, Q, strict=True)), rel=1e-12
    )
    measure = [np.sqrt(np.linalg.det(J @ J.T)) for J in (robot.state(q).jacobian(robot.tool) for q in Q)]
    assert as_cost("inverse-manipulability").value(trace) == pytest.approx(np.sum(w / measure), rel=1e-9)
    assert as_cost(cc.Manipulability()).value(trace) == pytest.approx(-np.sum(w * measure), rel=1e-9)
    data, chain = robot.model.createData(), np.concatenate([np.zeros((1, 7)), V, np.zeros((1, 7))])
    torques = [
        pin.rnea(robot.model, data, q, 0.5 * (a + b), (b - a) / h)
        for q, a, b in zip(Q, chain[:-1], chain[1:], strict=True)
    ]
    assert cc.SquaredTorque().value(trace) == pytest.approx(0.5 * np.sum(w * np.sum(np.square(torques), axis=1)))
    limit = robot.limits.torque_upper
    assert cc.SquaredTorque("limits").value(trace) == pytest.approx(
        0.5 * np.sum(w * np.sum(np.square(torques / limit), axis=1))
    )
    posture = cc.PostureTask(weight=2.0)
    miss = sum(a * np.sum((q - robot.home) ** 2) for a, q in zip(w, Q, strict=True))
    assert TaskMiss(posture, None).value(trace) == pytest.approx(miss, rel=1e-12)


def test_sums_count_objectives_by_gain_and_sense() -> None:
    robot = panda()
    given = setting(robot, circle(robot, 0.1), samples=5)
    trace = unprojected(given, wandering(given, np.random.default_rng(9)))
    speed, reach = cc.JointSpeed().value(trace), as_cost(cc.Manipulability()).value(trace)
    joint = as_cost(cc.JointRange()).value(trace)
    total = 3.0 * cc.JointSpeed() + 2.0 * cc.JointRange(gain=5.0) - 4.0 * cc.Manipulability(gain=0.5)
    assert total.value(trace) == pytest.approx(3.0 * speed + 10.0 * joint - 2.0 * reach, rel=1e-12)
    turned = as_cost(cc.JointRange(gain=1.0) - cc.Manipulability(gain=1.0))
    assert turned.value(trace) == pytest.approx(joint - reach, rel=1e-12)
    both = cc.JointRange() + cc.JointSpeed()
    assert isinstance(both, CostSum) and both.value(trace) == pytest.approx(100.0 * joint + speed, rel=1e-12)


def test_names_stand_for_costs() -> None:
    robot = panda()
    given = setting(robot, circle(robot, 0.05), samples=4)
    trace = unprojected(given, wandering(given, np.random.default_rng(1), 0.05))
    for name in NAMED:
        cost = as_cost(name)
        cost.check(robot)
        assert np.isfinite(cost.value(trace)) and cost.name
    assert as_cost(cc.KineticEnergy()).value(trace) == as_cost("kinetic-energy").value(trace) > 0.0


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: as_cost("energy"), ParameterError),
        (lambda: as_cost(3), ParameterError),
        (lambda: as_cost(cc.JointRange() - cc.KineticEnergy()), ParameterError),
        (lambda: cc.JointSpeed([1.0, -1.0]), ParameterError),
        (lambda: cc.JointSpeed(np.zeros(7)), ParameterError),
        (lambda: -1.0 * cc.JointSpeed(), ParameterError),
        (lambda: cc.JointSpeed(np.ones(3)).check(panda()), ShapeError),
        (lambda: as_cost("kinetic-energy").check(weightless()), ParameterError),
        (lambda: cc.SquaredTorque("all"), ParameterError),
        (lambda: cc.SquaredTorque(np.ones(3)).check(panda()), ShapeError),
        (lambda: cc.SquaredTorque("limits").check(tireless()), ParameterError),
        (lambda: cc.SquaredTorque().check(drone_arm()), UnderactuatedRobot),
    ],
)
def test_misuse_is_refused(make, error: type[CartctlError]) -> None:
    with pytest.raises(error):
        make()


def test_one_over_the_manipulability_stays_finite_at_a_singularity() -> None:
    robot = planar()
    stretched = robot.state(np.zeros(3))
    objective = cc.InverseManipulability(axes="xy")
    assert np.isfinite(objective.value(stretched)) and objective.value(stretched) > 1e6
    assert np.isfinite(objective.gradient(stretched)).all()
