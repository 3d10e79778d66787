"""Rows that keep links from obstacles and from each other: what an adversary can make of a loop that obeys them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import linprog

import cartctl as cc
from cartctl.braking import allowed_speed
from cartctl.constraints import Box, ClearanceConstraint, Rows
from cartctl.constraints.clearance_kernel import REST
from cartctl.constraints.curvature import curvatures, joint_order, largest_form, third_order
from cartctl.errors import CartctlError, FrameNotFound, NonFiniteError, ParameterError
from cartctl.motion.integrate import by_acceleration, by_velocity
from tests.robots_for_tests import panda, planar

DT = 1e-2


class Fight(NamedTuple):
    nearest: float  # smallest distance of all states
    rows: int  # most rows at a time
    infeasible: int


def strongest(g: np.ndarray, rows: Rows, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, bool]:
    """The u inside rows and box with the largest g . u, and whether there is any; else the one that misses least."""
    if not len(rows.lower):
        return np.where(g > 0.0, high, low), True
    found = linprog(-g, A_ub=-rows.C, b_ub=-rows.lower, bounds=np.column_stack([low, high]))
    if found.status == 0:
        return np.clip(found.x, low, high), True
    A = np.column_stack([-rows.C, -np.ones(len(rows.lower))])
    sides = [*zip(low, high, strict=True), (0.0, None)]
    found = linprog(np.append(0.0 * g, 1.0), A_ub=A, b_ub=-rows.lower, bounds=sides)
    return np.clip(found.x[:-1], low, high), False


def fight(
    constraint: ClearanceConstraint,
    robot: cc.Robot,
    drive: Callable[[cc.State], np.ndarray],
    level: str,
    most: float | None,
    q: np.ndarray,
    steps: int = 150,
) -> Fight:
    """A loop at full speed: u of largest ``drive . u`` inside rows, speed limits and accelerations of ``most``."""
    v, limits, nearest, infeasible, count = np.zeros(robot.nv), robot.limits, [], 0, 0
    for k in range(steps):
        state = robot.state(q, v, k * DT)
        low, high = limits.velocity_lower, limits.velocity_upper
        if level == "velocity":
            if most is not None:
                low, high = np.maximum(low, v - most * DT), np.minimum(high, v + most * DT)
            rows = constraint.velocity_rows(state, DT, Box(low, high))
        else:
            low, high = np.maximum((low - v) / DT, -most), np.minimum((high - v) / DT, most)
            rows = constraint.acceleration_rows(state, DT, Box(low, high))
        count = max(count, len(rows.lower))
        u, feasible = strongest(drive(state), rows, low, high)
        infeasible += not feasible
        q, v = by_velocity(robot, q, u, DT) if level == "velocity" else by_acceleration(robot, q, v, u, DT)
        found = constraint.closest(robot.state(q, v, (k + 1) * DT))
        assert found is not None
        nearest.append(found.distance)
    return Fight(min(nearest), count, infeasible)


def towards(
    constraint: ClearanceConstraint, rng: np.random.Generator, noise: float
) -> Callable[[cc.State], np.ndarray]:
    """Down the distance of the closest pair, with a share of anything: bang-bang in the joints."""

    def drive(state: cc.State) -> np.ndarray:
        arrangement = constraint.arrangement(state.robot)
        g = -arrangement.gradients(state, arrangement.closest(state))[0]
        return g + noise * (np.abs(g).max() + 1e-3) * rng.normal(size=len(g))

    return drive


def cage() -> cc.Scene:
    """A sphere, a box, a capsule, a cylinder, a plane and a mesh around the Panda."""
    scene = cc.Scene()
    scene.sphere("ball", 0.08, at=[0.45, 0.35, 0.5]).box("shelf", [0.3, 0.5, 0.02], at=[0.55, 0.0, 0.28])
    scene.capsule("bar", 0.03, 0.8, at=[-0.35, 0.0, 0.75]).plane("floor", [0.0, 0.0, 1.0], -0.02)
    scene.cylinder("post", 0.05, 1.0, at=[0.2, -0.45, 0.5])
    corners = np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.2]]) + [0.5, 0.1, 0.75]
    return scene.mesh("wedge", corners, at=[0.0, 0.0, 0.0])


def flat_cage() -> cc.Scene:
    return cc.Scene().sphere("ball", 0.2, at=[1.25, 1.6, 0.0]).box("box", [0.5, 0.2, 1.0], at=[1.5, -0.3, 0.0])


LOOPS = [("velocity", None), ("velocity", 20.0), ("acceleration", 20.0)]
CASES = {
    "panda": (panda, lambda: cc.Avoid(cage(), 0.01), None),
    "panda and itself": (panda, lambda: cc.AvoidSelf(0.005), None),
    "planar": (planar, lambda: cc.Avoid(flat_cage(), 0.02), np.array([0.5, 0.8, 0.9])),
}


@pytest.mark.parametrize("noise", [0.0, 1.0])
@pytest.mark.parametrize(("level", "most"), LOOPS)
@pytest.mark.parametrize("name", list(CASES))
def test_an_adversary_at_full_speed_never_enters_the_margin(
    name: str, level: str, most: float | None, noise: float
) -> None:
    """dt = 10 ms; wherever rows and box leave a command, no step ends inside."""
    build, make, q = CASES[name]
    robot, constraint = build(), make()
    drive = towards(constraint, np.random.default_rng(1), noise)
    steps = 60 if "itself" in name and most is None else 150  # hundreds of rows each, for an LP
    found = fight(constraint, robot, drive, level, most, robot.home if q is None else q, steps)
    assert found.rows > 0
    # of 150 steps; where braking in several rows, at 2 m/s^2 and against centripetal terms, asks for over 20 rad/s^2
    assert found.infeasible <= (25 if name == "planar" and level == "velocity" and most else 1)
    assert found.nearest >= constraint.margin - 1e-6


@pytest.mark.parametrize("name", ["panda", "planar"])
def test_without_rows_the_adversary_goes_through(name: str) -> None:
    """The same fights are lost without them: the obstacles are within reach."""
    build, make, q = CASES[name]
    robot, constraint = build(), make()
    drive = towards(constraint, np.random.default_rng(1), 0.0)
    q = robot.home if q is None else q
    worst = []
    for _ in range(150):
        q = robot.integrate(q, DT * np.sign(drive(robot.state(q))))
        worst.append(constraint.excess(robot.state(q)))
    assert max(worst) > constraint.margin + 1e-3


@pytest.mark.parametrize("level", ["velocity", "acceleration"])
def test_obstacles_that_move_push_the_arm(level: str) -> None:
    """A ball comes at 0.2 m/s into the forearm of an arm that would rather stay: it gives way before it is touched."""
    robot = panda()
    elbow = robot.state(robot.home).position("panda_link4")
    start = elbow + [0.0, -0.45, 0.1]
    path = cc.Line(start, start + [0.0, 0.6, 0.0], duration=3.0)
    constraint = cc.Avoid(cc.Scene().sphere("ball", 0.06, at=path), 0.01)
    found = fight(constraint, robot, lambda s: -s.v - 3.0 * (s.q - robot.home), level, 20.0, robot.home, 300)
    assert found.infeasible == 0 and found.nearest >= 0.01 - 1e-6
    still = [constraint.excess(robot.state(robot.home, time=t)) for t in np.linspace(0.0, 3.0, 61)]
    assert max(still) > 0.03  # it would have been hit


@pytest.mark.parametrize(("level", "most"), [("velocity", None), ("velocity", 20.0), ("acceleration", 20.0)])
def test_a_start_inside_the_margin_comes_back_at_a_bounded_rate(level: str, most: float | None) -> None:
    """Against an adversary that pushes inwards; 3 cm deep in the margin, at 0.1 m/s, and no faster."""
    robot, dt = panda(), 2e-3
    at = robot.state(robot.home).position("panda_hand_tcp") + [0.16, 0.0, 0.0]
    constraint = cc.Avoid(cc.Scene().sphere("ball", 0.05, at=at), 0.12, recovery_speed=0.1)
    q, v, path, limits = robot.home, np.zeros(7), [constraint.excess(robot.state(robot.home))], robot.limits
    assert 0.01 < path[0] < 0.1
    drive = towards(constraint, np.random.default_rng(3), 0.0)
    for _ in range(400):
        state = robot.state(q, v)
        if level == "velocity":
            reach = np.inf if most is None else most * dt
            box = Box(np.maximum(limits.velocity_lower, v - reach), np.minimum(limits.velocity_upper, v + reach))
        else:
            box = Box(np.full(7, -20.0), np.full(7, 20.0))
        rows = getattr(constraint, f"{level}_rows")(state, dt, box)
        u, _ = strongest(drive(state), rows, *box)
        q, v = by_velocity(robot, q, u, dt) if level == "velocity" else by_acceleration(robot, q, v, u, dt)
        path.append(constraint.excess(robot.state(q, v)))
    speeds = -np.diff(path) / dt
    assert speeds.max() < 0.11
    assert path[-1] <= 0.0
    back = int(np.argmax(np.array(path) < 1e-3))
    assert 0.5 * path[0] / 0.1 < back * dt < path[0] / 0.1 + 0.3


def test_a_velocity_row_is_the_rate_of_its_points() -> None:
    """One ball against one point: ``C c - offset`` is the mean rate of the distance in a step, c the box's middle."""
    robot, rng, dt = panda(), np.random.default_rng(5), 1e-3
    for _ in range(20):
        state = robot.state(robot.random_configuration(rng), rng.normal(size=7))
        at = state.position(robot.tool) + 0.03 * unit(rng)
        velocity = rng.normal(size=3)

        def ball(t: float, at: np.ndarray = at, velocity: np.ndarray = velocity) -> np.ndarray:
            return at + velocity * t

        constraint = cc.Avoid(cc.Scene().sphere("ball", 0.005, at=ball), 0.0, points=[robot.tool])
        found = constraint.closest(state)
        assert found is not None and found.distance == pytest.approx(0.025)
        c = state.v
        rows = constraint.velocity_rows(state, dt, Box(c - 3.0, c + 3.0))
        assert rows.C.shape == (1, 7) and np.isinf(rows.upper).all()
        n = state.position(robot.tool) - at
        n = n / np.linalg.norm(n)
        c = np.sign(c) * np.maximum(np.abs(c) - 0.1, 0.0)
        after = robot.state(robot.integrate(state.q, c * dt)).position(robot.tool)
        mean = n @ (after - at - velocity * dt) / dt - 0.03 / dt
        narrow = constraint.velocity_rows(state, dt, Box(state.v - 30.0, state.v + 30.0))
        np.testing.assert_allclose(rows.C, narrow.C, atol=1e-12)  # about the same middle
        free = 0.025 - REST - 2.0 * error_of(state, robot, n, dt)
        allowed = allowed_speed(np.array([free]), constraint.deceleration, dt)[0]
        assert rows.C[0] @ c - rows.lower[0] == pytest.approx(mean + allowed, abs=1e-5)


def unit(rng: np.random.Generator) -> np.ndarray:
    n = rng.normal(size=3)
    return n / np.linalg.norm(n)


def error_of(state: cc.State, robot: cc.Robot, n: np.ndarray, dt: float) -> float:
    """What a step may stray from its row: a frame's bound, for rates within 3 rad/s, or 0.1 more, about the centre."""
    J = state.jacobian(robot.tool)
    centre = np.sign(state.v) * np.maximum(np.abs(state.v) - 0.1, 0.0)
    radius = 3.0 + np.abs(state.v - centre)
    H = curvatures(J, n[None], joint_order(robot))
    error = 0.5 * dt**2 * largest_form(-H, radius)[0] + third_order(J, np.abs(centre) + radius, dt)
    return min(float(error), 0.025)


def test_misuse_is_refused() -> None:
    scene = cage()
    for bad, error in (
        (lambda: cc.Avoid("cage"), ParameterError),
        (lambda: cc.Avoid(scene, -0.1), ParameterError),
        (lambda: cc.Avoid(scene, 0.1, deceleration=0.0), ParameterError),
        (lambda: cc.Avoid(scene, 0.1, recovery_speed=np.nan), NonFiniteError),
        (lambda: cc.Avoid(scene, points=["panda_hnd"]).check(panda()), FrameNotFound),
        (lambda: cc.Avoid(scene, points=3).check(panda()), ParameterError),
        (lambda: cc.AvoidSelf(srdf="/no/such.srdf").check(panda()), CartctlError),
    ):
        with pytest.raises(error):
            bad()
