"""Cartesian bounds: every row by finite differences, and what an adversary can make of a loop that obeys them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

import cartctl as cc
from cartctl.braking import allowed_speed
from cartctl.constraints import Box, PositionConstraint, Rows, stacked
from cartctl.constraints.curvature import curvatures, joint_order, largest_form, third_order
from cartctl.constraints.polyhedron import INSIDE_BALL
from cartctl.errors import CartctlError, FrameNotFound, NonFiniteError, ParameterError, ShapeError
from cartctl.motion.integrate import by_acceleration, by_velocity
from tests.oracles import random_rotation
from tests.robots_for_tests import ROBOTS, panda, planar, random_state

DT = 1e-2


def unit(rng: np.random.Generator, k: int) -> np.ndarray:
    n = rng.normal(size=(k, 3))
    return n / np.linalg.norm(n, axis=1)[:, None]


# ---------------------------------------------------------------- derivatives


@pytest.mark.parametrize("name", list(ROBOTS))
def test_the_curvature_is_the_jacobians_derivative(name: str) -> None:
    robot, rng, h = ROBOTS[name](), np.random.default_rng(4), 1e-6
    state, normals = random_state(robot, rng), unit(rng, 3)
    J = state.jacobian(robot.tool)
    H = curvatures(J, normals, joint_order(robot))
    np.testing.assert_array_equal(H, H.transpose(0, 2, 1))
    u, w = rng.normal(size=(2, robot.nv))
    ends = [robot.state(robot.integrate(state.q, s * h * u)).jacobian(robot.tool)[:3] for s in (1.0, -1.0)]
    along = normals @ ((ends[0] - ends[1]) / (2 * h)) @ u
    np.testing.assert_allclose(np.einsum("i,kij,j->k", u, H, u), along, atol=1e-7 * (1 + abs(along).max()))

    def bend(x: np.ndarray) -> np.ndarray:
        return normals @ robot.state(state.q, x).drift(robot.tool)[:3]

    cross = 0.5 * (bend(u + w) - bend(u) - bend(w))
    np.testing.assert_allclose(np.einsum("i,kij,j->k", u, H, w), cross, atol=1e-11 * (1 + abs(cross).max()))


@pytest.mark.parametrize("name", list(ROBOTS))
def test_what_a_step_adds_to_its_tangent_is_bounded(name: str) -> None:
    """``p(q (+) u dt)`` against second order, and the second order against its bound, for u anywhere in a box."""
    robot, rng = ROBOTS[name](), np.random.default_rng(5)
    shares = []
    for _ in range(30):
        state, normals = random_state(robot, rng), unit(rng, 2)
        radius, dt = rng.uniform(0.0, 3.0, robot.nv), 10.0 ** rng.uniform(-3, -1)
        J = state.jacobian(robot.tool)
        H = curvatures(J, normals, joint_order(robot))
        u = radius * rng.choice([-1.0, 1.0], robot.nv) * rng.choice([1.0, rng.uniform()])
        moved = robot.state(robot.integrate(state.q, u * dt)).position(robot.tool) - state.position(robot.tool)
        forms = np.einsum("i,kij,j->k", u, H, u)
        assert (np.abs(forms) <= np.maximum(largest_form(H, radius), largest_form(-H, radius)) + 1e-12).all()
        assert (forms <= largest_form(H, radius) + 1e-12).all()
        rest = np.abs(normals @ moved - dt * normals @ J[:3] @ u - 0.5 * dt**2 * forms)
        bound = third_order(J, radius, dt)
        assert (rest <= bound + 1e-13).all()
        shares.append(rest.max() / (bound + 1e-13))
    assert max(shares) > 1e-3  # no empty promise


class Bound(NamedTuple):
    constraint: PositionConstraint
    normals: np.ndarray


def bounds_on(frame: str, rng: np.random.Generator, at: np.ndarray) -> list[Bound]:
    n, R = unit(rng, 1), random_rotation(rng)
    return [
        Bound(cc.HalfSpace(frame, 3.0 * n[0], 3.0 * (n[0] @ at + 0.2), margin=0.0), n),
        Bound(cc.FrameBox(frame, at - 0.2, at + 0.3, margin=0.0), np.eye(3)),
        Bound(cc.FrameBox(frame, R.T @ at - 0.2, R.T @ at + 0.3, axes=R, margin=0.0), R.T),
    ]


@pytest.mark.parametrize("name", list(ROBOTS))
def test_velocity_rows_are_the_mean_rate_of_a_step(name: str) -> None:
    """By differences about the centre of the box; the room before the bound is what the profile allows."""
    robot, rng, dt = ROBOTS[name](), np.random.default_rng(6), 1e-4
    state = random_state(robot, rng)
    at, c = state.position(robot.tool), rng.normal(size=robot.nv)
    for constraint, normals in bounds_on(robot.tool, rng, at):
        rows = constraint.velocity_rows(state, dt, Box(c - 1e-3, c + 1e-3))

        def rate(u: np.ndarray, n: np.ndarray = normals) -> np.ndarray:
            return n @ (robot.state(robot.integrate(state.q, u * dt)).position(robot.tool) - at) / dt

        room = 0.3 if len(normals) > 1 else 0.2
        allowed = rows.upper - allowed_speed(np.full(len(normals), room), constraint.deceleration, dt)
        np.testing.assert_allclose(rows.C @ c - allowed, rate(c), atol=1e-6)
        assert np.abs(allowed).max() > 1e-6 or name == "pendulum"
        if len(normals) > 1:
            offset = rows.lower + allowed_speed(np.full(3, 0.2), constraint.deceleration, dt)
            np.testing.assert_allclose(offset, allowed, atol=1e-9)
        for e in 0.1 * np.eye(robot.nv)[:7]:  # O(dt^2) in the slope
            np.testing.assert_allclose(rows.C @ e, 0.5 * (rate(c + e) - rate(c - e)), atol=1e-6)


@pytest.mark.parametrize("name", list(ROBOTS))
def test_acceleration_rows_hold_the_drift(name: str) -> None:
    """``C a``, less what the bound leaves out, is twice the mean rate of a step over dt, less twice the present."""
    robot, rng, dt = ROBOTS[name](), np.random.default_rng(7), 1e-3
    state = random_state(robot, rng)
    at, c = state.position(robot.tool), rng.normal(size=robot.nv)
    for constraint, normals in bounds_on(robot.tool, rng, at):
        rows = constraint.acceleration_rows(state, dt, Box(c - 1e-3, c + 1e-3))
        speed = normals @ state.twist(robot.tool)[:3]

        def change(a: np.ndarray, n: np.ndarray = normals, s: np.ndarray = speed) -> np.ndarray:
            """2 (p+ - p - s dt)/dt^2: the mean acceleration of the step."""
            q = by_acceleration(robot, state.q, state.v, a, dt).q
            return n @ (robot.state(q).position(robot.tool) - at) * (2 / dt**2) - s * (2 / dt)

        room = (0.3 if len(normals) > 1 else 0.2) - 0.5 * dt * speed
        end = np.maximum(allowed_speed(room, constraint.deceleration, dt), speed - 2 * constraint.deceleration * dt)
        drift = (end - speed) / dt - rows.upper
        exact = normals @ state.drift(robot.tool)[:3]
        np.testing.assert_allclose(rows.C @ c + drift, change(c), atol=0.02 * (1 + abs(exact).max()))
        np.testing.assert_allclose(drift, exact, atol=0.05 * (1 + abs(exact).max()))
        for e in np.eye(robot.nv)[:7]:
            np.testing.assert_allclose(rows.C @ e, 0.5 * (change(c + e) - change(c - e)), atol=1e-4)


@pytest.mark.parametrize("name", list(ROBOTS))
def test_speed_rows_by_differences(name: str) -> None:
    robot, rng, h = ROBOTS[name](), np.random.default_rng(8), 1e-5
    state, a = random_state(robot, rng), rng.normal(size=robot.nv)
    limit = cc.FrameSpeed(robot.tool, linear=50.0, angular=40.0)
    rows = limit.velocity_rows(state, DT)
    normals, height = INSIDE_BALL[12]
    N = np.block([[normals, np.zeros((6, 3))], [np.zeros((6, 3)), normals]])
    np.testing.assert_allclose(rows.C, N @ state.jacobian(robot.tool), atol=1e-14)
    np.testing.assert_allclose(rows.upper, height * np.repeat([50.0, 40.0], 6))
    np.testing.assert_array_equal(rows.lower, -rows.upper)
    ends = [robot.state(*by_acceleration(robot, state.q, state.v, a, s * h)).twist(robot.tool) for s in (1.0, -1.0)]
    rate = N @ (ends[0] - ends[1]) / (2 * h)
    held = limit.acceleration_rows(state, DT)
    left = (rows.upper - N @ state.twist(robot.tool)) / DT - held.upper  # the drift
    np.testing.assert_allclose(held.C @ a + left, rate, atol=1e-5 * (1 + abs(rate).max()))


# ---------------------------------------------------------------- the profile and the polyhedra


@pytest.mark.parametrize("seed", range(3))
def test_the_allowed_speed_is_the_largest_that_can_stop(seed: int) -> None:
    """By adding up the steps of full braking: velocity commands y, y - a dt, ... cover no more than the distance."""
    rng = np.random.default_rng(seed)
    for _ in range(200):
        a, dt, d = 10.0 ** rng.uniform(-1, 2), 10.0 ** rng.uniform(-4, -1), 10.0 ** rng.uniform(-6, 0)
        if d / (a * dt**2) > 1e5:
            continue
        y = allowed_speed(np.array([d]), a, dt)[0]
        steps = np.maximum(y - a * dt * np.arange(int(y / (a * dt)) + 2), 0.0)
        assert steps.sum() * dt == pytest.approx(d, rel=1e-9)
    np.testing.assert_array_equal(allowed_speed(np.array([0.0, -1.0, np.inf]), 1.0, 0.1), [0.0, 0.0, np.inf])


@pytest.mark.parametrize("facets", list(INSIDE_BALL))
def test_polyhedra_lie_inside_the_ball(facets: int) -> None:
    normals, height = INSIDE_BALL[facets]
    assert 2 * len(normals) == facets
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-15)
    inradius = (-ConvexHull(np.concatenate([normals, -normals])).equations[:, -1]).min()
    assert height <= inradius * (1 + 1e-12) and height == pytest.approx(inradius, abs=1e-12)
    x = unit(np.random.default_rng(9), 20000)
    reach = height / np.abs(x @ normals.T).max(axis=1)  # how far each direction may go
    assert reach.max() <= 1.0 and reach.max() > 0.999 and reach.min() == pytest.approx(height, rel=1e-2)


# ---------------------------------------------------------------- the adversary


class Fight(NamedTuple):
    worst: float  # largest excess of all states
    nearest: float  # smallest distance inside, in the second half
    infeasible: int


def strongest(g: np.ndarray, rows: Rows, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, bool]:
    """The u inside rows and box with the largest g . u, and whether there is any; else the one that misses least."""
    A, b = np.concatenate([rows.C, -rows.C]), np.concatenate([rows.upper, -rows.lower])
    A, b = A[np.isfinite(b)], b[np.isfinite(b)]
    found = linprog(-g, A_ub=A, b_ub=b, bounds=np.column_stack([low, high]))
    if found.status == 0:
        return np.clip(found.x, low, high), True
    sides = [*zip(low, high, strict=True), (0.0, None)]
    found = linprog(np.append(0.0 * g, 1.0), A_ub=np.column_stack([A, -np.ones(len(b))]), b_ub=b, bounds=sides)
    return np.clip(found.x[:-1], low, high), False


def fight(
    constraint: cc.Constraint,
    robot: cc.Robot,
    drive: Callable[[int, cc.State, Rows], np.ndarray],
    level: str = "velocity",
    most: float | None = None,
    steps: int = 100,
    dt: float = DT,
    q: np.ndarray | None = None,
) -> Fight:
    """A loop at full speed: u of largest ``drive . u`` inside rows, speed limits and accelerations of ``most``."""
    q, v = robot.home if q is None else q, np.zeros(robot.nv)
    limits, excesses, infeasible = robot.limits, [], 0
    for k in range(steps):
        state = robot.state(q, v)
        low, high = limits.velocity_lower, limits.velocity_upper
        if level == "velocity":
            if most is not None:
                low, high = np.maximum(low, v - most * dt), np.minimum(high, v + most * dt)
            rows = constraint.velocity_rows(state, dt, Box(low, high))
        else:
            low, high = np.maximum((low - v) / dt, -most), np.minimum((high - v) / dt, most)
            rows = constraint.acceleration_rows(state, dt, Box(low, high))
        u, feasible = strongest(drive(k, state, rows), rows, low, high)
        infeasible += not feasible
        q, v = by_velocity(robot, q, u, dt) if level == "velocity" else by_acceleration(robot, q, v, u, dt)
        excesses.append(constraint.excess(robot.state(q, v)))
    return Fight(max(excesses), -max(excesses[steps // 2 :]), infeasible)


def outwards(rng: np.random.Generator, noise: float) -> Callable[[int, cc.State, Rows], np.ndarray]:
    """Towards the bound that leaves least room, with a share of anything: bang-bang in the joints."""

    def drive(k: int, state: cc.State, rows: Rows) -> np.ndarray:
        i = int(np.argmin(np.minimum(rows.upper, -rows.lower)))
        sign = 1.0 if rows.upper[i] < -rows.lower[i] else -1.0
        return sign * rows.C[i] + noise * np.abs(rows.C[i]).max() * rng.normal(size=len(state.v))

    return drive


ARMS = {"planar": np.array([0.5, 0.8, 0.9]), "panda": None}


def walls(name: str, **options: object) -> tuple[cc.Robot, list[PositionConstraint], np.ndarray]:
    robot = ROBOTS[name]()
    q = robot.home if ARMS[name] is None else ARMS[name]
    at, n = robot.state(q).position(robot.tool), np.array([1.0, 0.3, 0.0 if name == "planar" else 0.4])
    n = n / np.linalg.norm(n)
    plane = cc.HalfSpace(robot.tool, n, n @ at + 0.05, **options)
    box = cc.FrameBox(robot.tool, at - [0.05, 0.06, 0.07], at + [0.07, 0.04, 0.06], **options)
    return robot, [plane, box], q


LOOPS = [("velocity", None), ("velocity", 20.0), ("acceleration", 20.0)]


@pytest.mark.parametrize("name", list(ARMS))
@pytest.mark.parametrize(("level", "most"), LOOPS)
@pytest.mark.parametrize("noise", [0.0, 0.3, 3.0])
def test_an_adversary_at_full_speed_never_crosses(name: str, level: str, most: float | None, noise: float) -> None:
    """dt = 10 ms; wherever rows and box leave a command, no step ends outside. What is held free is what is stated."""
    robot, constraints, q = walls(name)
    for constraint in constraints:
        found = fight(constraint, robot, outwards(np.random.default_rng(10), noise), level, most, q=q)
        assert found.infeasible == 0
        assert found.worst <= 0.0
        if noise == 0.0:
            assert found.nearest < (2e-2 if most is None else 3e-4)


@pytest.mark.parametrize(("level", "most", "allowed"), [(*LOOPS[0], 1e-3), (*LOOPS[1], 2e-5), (*LOOPS[2], 2e-5)])
def test_without_a_margin_curvature_alone_crosses(level: str, most: float | None, allowed: float) -> None:
    """At full speed and 10 ms; measured 3.4e-4 m where joints may turn round within a step, 8e-6 m otherwise."""
    worst = []
    for name in ARMS:
        robot, constraints, q = walls(name, margin=0.0)
        found = [fight(c, robot, outwards(np.random.default_rng(11), 0.3), level, most, q=q) for c in constraints]
        worst += [f.worst for f in found if not f.infeasible]
    assert 0.0 < max(worst) < allowed


@pytest.mark.parametrize("facets", list(INSIDE_BALL))
@pytest.mark.parametrize("name", list(ARMS))
def test_no_command_is_faster_than_the_limit(name: str, facets: int) -> None:
    robot, rng = ROBOTS[name](), np.random.default_rng(12)
    limit = cc.FrameSpeed(robot.tool, linear=0.25, angular=0.8, facets=facets)
    fastest = []
    for _ in range(40):
        state = random_state(robot, rng)
        rows = limit.velocity_rows(state, DT)
        drive = state.jacobian(robot.tool).T @ rng.normal(size=6)
        u, feasible = strongest(drive, rows, robot.limits.velocity_lower, robot.limits.velocity_upper)
        assert feasible and limit.excess(robot.state(state.q, u)) <= 1e-12
        fastest.append(np.linalg.norm(state.jacobian(robot.tool)[:3] @ u))
    assert max(fastest) > 0.8 * 0.25


@pytest.mark.parametrize(("dt", "allowed"), [(1e-2, 0.02), (1e-3, 2e-4)])
def test_a_speed_limit_by_accelerations_holds_to_second_order(dt: float, allowed: float) -> None:
    """Measured at 20 rad/s^2, joints anywhere within their speeds: 4 mm/s over at 10 ms, 0.02 mm/s at 1 ms."""
    robot, rng = panda(), np.random.default_rng(13)
    limit = cc.FrameSpeed(robot.tool, linear=0.25)
    ways = unit(rng, 20)

    def drive(k: int, state: cc.State, rows: Rows) -> np.ndarray:
        return ways[k // 20] @ state.jacobian(robot.tool)[:3]

    found = fight(limit, robot, drive, "acceleration", 20.0, steps=300, dt=dt)
    assert found.infeasible == 0 and found.worst < allowed


# ---------------------------------------------------------------- starts outside, narrow gaps, missing limits


@pytest.mark.parametrize(("level", "most"), LOOPS)
@pytest.mark.parametrize("name", list(ARMS))
def test_a_start_outside_comes_back_at_a_bounded_rate(name: str, level: str, most: float | None) -> None:
    """Even an adversary is led back, at recovery_speed until the last step."""
    robot = ROBOTS[name]()
    q = robot.home if ARMS[name] is None else ARMS[name]
    n = np.array([1.0, 0.0, 0.0])
    wall = cc.HalfSpace(robot.tool, n, n @ robot.state(q).position(robot.tool) - 0.05, recovery_speed=0.2)
    assert wall.excess(robot.state(q)) == pytest.approx(0.05)
    v, path, dt = np.zeros(robot.nv), [0.05], 2e-3
    limits = robot.limits
    for _ in range(300):
        state = robot.state(q, v)
        if level == "velocity":
            reach = np.inf if most is None else most * dt
            low, high = np.maximum(limits.velocity_lower, v - reach), np.minimum(limits.velocity_upper, v + reach)
            rows = wall.velocity_rows(state, dt, Box(low, high))
        else:
            low, high = np.maximum(-most, (limits.velocity_lower - v) / dt), np.full(robot.nv, most)
            rows = wall.acceleration_rows(state, dt, Box(low, high))
        u, _ = strongest(rows.C[0], rows, low, high)
        q, v = by_velocity(robot, q, u, dt) if level == "velocity" else by_acceleration(robot, q, v, u, dt)
        path.append(wall.excess(robot.state(q, v)))
    speeds = -np.diff(path) / dt
    assert speeds.max() < 0.2 * (1.1 if most is None else 1.01)  # joints that turn round add their curvature
    assert path[-1] <= 0.0
    back = int(np.argmax(np.array(path) < 1e-3))
    assert 0.9 * 0.25 < back * dt < 0.25 + 0.24  # 0.05 m at 0.2 m/s, and the time to get going
    assert max(path[back:]) < 1e-3


@pytest.mark.parametrize("level", ["velocity", "acceleration"])
def test_rows_never_cross_whatever_the_state(level: str) -> None:
    """Gaps narrower than their margins, points, far outside, absurdly fast, steps that are long: Problem takes all."""
    rng = np.random.default_rng(14)
    for name, build in ROBOTS.items():
        robot = build()
        for scale in (1.0, 1e3):
            state = random_state(robot, rng)
            state = robot.state(state.q, scale * state.v)
            at = state.position(robot.tool)
            for width in (0.0, 1e-5, 1e-2):
                for away in (0.0, 0.3, 5.0):
                    box = cc.FrameBox(robot.tool, at + away, at + away + width)
                    speed = cc.FrameSpeed(robot.tool, linear=1e-3, angular=1e-3)
                    for constraint in (box, speed):
                        rows = getattr(constraint, f"{level}_rows")(state, 0.05)
                        assert np.isfinite(rows.C).all() and (rows.lower <= rows.upper).all(), name
                        cc.Problem([(np.eye(robot.nv), np.zeros(robot.nv))], constraints=rows)


def test_a_bound_that_is_open_gives_no_row() -> None:
    robot = panda()
    state = robot.state(robot.home)
    rows = cc.FrameBox(robot.tool, [-np.inf, -np.inf, 0.1], [np.inf, 0.8, np.inf]).velocity_rows(state, DT)
    assert rows.C.shape == (2, 7)
    assert np.isinf(rows.lower).tolist() == [True, False] and np.isinf(rows.upper).tolist() == [False, True]
    empty = cc.FrameBox(robot.tool, [-np.inf] * 3, [np.inf] * 3)
    assert empty.velocity_rows(state, DT).C.shape == (0, 7) and empty.excess(state) == -np.inf
    both = stacked([rows, empty.acceleration_rows(state, DT), cc.FrameSpeed(robot.tool, 0.3).velocity_rows(state, DT)])
    assert both is not None and [len(part) for part in both] == [8, 8, 8]
    assert stacked([empty.velocity_rows(state, DT)]) is None


def test_a_box_that_says_nothing_stands_for_the_robots_limits() -> None:
    """Where there are none either, the motion as it is; a better box holds less free."""
    robot = panda()
    state = robot.state(robot.home, 0.1 * np.ones(7))
    wall = cc.HalfSpace(robot.tool, [1.0, 0.0, 0.0], 1.0)
    limits, open_ = robot.limits, np.full(7, np.inf)
    default, none, own = (
        wall.velocity_rows(state, DT, box)
        for box in (None, Box(-open_, open_), Box(limits.velocity_lower, limits.velocity_upper))
    )
    for a, b in ((default, none), (default, own)):
        np.testing.assert_array_equal(a.upper, b.upper)
    assert wall.velocity_rows(state, DT, Box(state.v - 0.1, state.v + 0.1)).upper > default.upper
    free = cc.Robot(ROBOTS["talos"]().model, tool=ROBOTS["talos"]().tool)
    rows = cc.HalfSpace(free.tool, [0.0, 0.0, 1.0], 9.0).velocity_rows(free.state(free.home), DT)
    assert np.isfinite(rows.upper).all()


# ---------------------------------------------------------------- with a solver


@pytest.mark.parametrize(("dt", "gap"), [(1e-2, 3e-3), (4e-3, 5e-4)])
def test_task_scaling_stops_a_circle_at_the_wall(dt: float, gap: float) -> None:
    """Half of the circle lies behind the wall: the hand waits before it and goes on where the circle comes back."""
    robot = panda()
    start = robot.state(robot.home).placement(robot.tool)
    circle = cc.Circle.starting_at(start, radius=0.1, period=3.0)
    points = np.array([circle(t).position for t in np.linspace(0.0, 3.0, 301)])
    axis = int(np.argmax(points.max(axis=0) - start.translation))
    n = np.eye(3)[axis]
    wall = cc.HalfSpace(robot.tool, n, 0.5 * (points[:, axis].max() + start.translation[axis]))
    hand = cc.FrameTask(robot.tool, target=circle)
    controller = cc.Controller(robot, hand, "pinv", limits=None, dt=dt)
    limits = robot.limits
    q, excess, scaled = robot.home, [], 0
    for k in range(round(3.5 / dt)):
        state = robot.state(q)
        asked = controller.step(q, t=k * dt).solution.problem
        problem = cc.Problem(
            asked.equations,
            lower=limits.velocity_lower,
            upper=limits.velocity_upper,
            constraints=wall.velocity_rows(state, dt),
        )
        solution = cc.solve(problem, "task-scaling")
        assert solution.status in (cc.Status.OPTIMAL, cc.Status.SCALED)
        scaled += solution.status is cc.Status.SCALED
        q = by_velocity(robot, q, solution.u, dt).q
        excess.append(wall.excess(robot.state(q)))
    assert -gap < max(excess) <= 0.0 and scaled > 0.1 * len(excess)
    assert hand.reference(robot.state(q), 3.5, None).error[:3] == pytest.approx(0.0, abs=1e-4)


def test_the_approach_slows_by_no_more_than_its_deceleration() -> None:
    """Straight at a wall: the speed falls by deceleration dt a step to the end, and the hand comes to rest there."""
    robot = panda()
    at = robot.state(robot.home).position(robot.tool)
    wall = cc.HalfSpace(robot.tool, [1.0, 0.0, 0.0], at[0] + 0.1, deceleration=1.5)
    hand = cc.FrameTask(robot.tool, target=lambda t: _ahead(robot, t), gain=0.0)
    q, x, dt = robot.home, [at[0]], 1e-3
    for k in range(700):
        state = robot.state(q)
        asked = cc.Controller(robot, hand, limits=None, dt=dt).step(q, t=k * dt).solution.problem.equations
        low, high = robot.limits.velocity_lower, robot.limits.velocity_upper
        problem = cc.Problem(asked, lower=low, upper=high, constraints=wall.velocity_rows(state, dt))
        q = by_velocity(robot, q, cc.solve(problem, "task-scaling").u, dt).q
        x.append(robot.state(q).position(robot.tool)[0])
    speed = np.diff(x) / dt
    assert speed[0] == pytest.approx(0.3, rel=1e-3) and abs(speed[-1]) < 1e-4
    assert np.diff(speed).min() > -1.5 * dt * 1.05
    assert 0.0 <= at[0] + 0.1 - x[-1] < 2e-4


def _ahead(robot: cc.Robot, t: float) -> cc.PathSample:
    start = robot.state(robot.home).placement(robot.tool)
    twist = np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
    return cc.PathSample(start.translation + t * twist[:3], start.rotation, twist, np.zeros(6))


# ---------------------------------------------------------------- misuse


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (lambda: cc.FrameBox("tool", [0, 0, 0], [1, 1]), ShapeError, "upper"),
        (lambda: cc.FrameBox("tool", [0, 2, 0], [1, 1, 1]), ParameterError, "lower <= upper"),
        (lambda: cc.FrameBox("tool", [np.nan, 0, 0], [1, 1, 1]), NonFiniteError, "lower"),
        (lambda: cc.FrameBox("tool", [np.inf, 0, 0], [np.inf, 1, 1]), ParameterError, "room"),
        (lambda: cc.FrameBox("tool", [0, 0, 0], [1, 1, 1], axes="tool"), ParameterError, "'world'"),
        (lambda: cc.FrameBox("tool", [0, 0, 0], [1, 1, 1], axes=2 * np.eye(3)), ParameterError, "rotation"),
        (lambda: cc.FrameBox("tool", [0, 0, 0], [1, 1, 1], deceleration=0.0), ParameterError, "deceleration"),
        (lambda: cc.FrameBox("tool", [0, 0, 0], [1, 1, 1], recovery_speed=-1.0), ParameterError, "recovery_speed"),
        (lambda: cc.FrameBox("tool", [0, 0, 0], [1, 1, 1], margin=-1.0), ParameterError, "margin"),
        (lambda: cc.HalfSpace("tool", [0, 0, 0], 1.0), ParameterError, "direction"),
        (lambda: cc.HalfSpace("tool", [0, 1], 1.0), ShapeError, "normal"),
        (lambda: cc.HalfSpace("tool", [0, 0, 1], np.inf), NonFiniteError, "offset"),
        (lambda: cc.FrameSpeed("tool"), ParameterError, "both None"),
        (lambda: cc.FrameSpeed("tool", linear=0.0), ParameterError, "linear"),
        (lambda: cc.FrameSpeed("tool", 1.0, facets=7), ParameterError, "12"),
    ],
)
def test_what_makes_no_sense_is_refused(
    make: Callable[[], cc.Constraint], error: type[CartctlError], says: str
) -> None:
    with pytest.raises(error, match=says) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_frame_that_is_not_there_is_refused_by_name() -> None:
    for constraint in (
        cc.FrameBox("tol", [0, 0, 0], [1, 1, 1]),
        cc.HalfSpace("tol", [0, 0, 1], 1.0),
        cc.FrameSpeed("tol", 1.0),
    ):
        with pytest.raises(FrameNotFound, match="'tool'"):
            constraint.check(planar())
        assert isinstance(constraint, cc.Constraint) and "tol" in constraint.name
