"""Torque bounds at both levels: kept to the last digit, and what yields where limits exclude each other."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize

import cartctl as cc
from cartctl.algebra.problem import Equation, Problem
from cartctl.constraints import Box
from cartctl.errors import CartctlWarning
from cartctl.levels import Secondary
from cartctl.levels.acceleration_bounds import AccelerationBounds
from cartctl.levels.yielding import ORDER, Layer, intervals, missed, widened
from tests.robots_for_tests import panda, planar, random_state, talos

sys.path.insert(0, str(Path(__file__).parent.parent / "benchmarks"))
from rollouts import limits_of  # noqa: E402
from torque_rollouts import rollout  # noqa: E402

EXCEEDED = 1e-9  # N m
BY_GREED = 1e-7  # N m: what the published iteration leaves of a row
BOUNDED = ["sns", "hqp", "qp", "sns-greedy", "task-scaling"]


def weak(robot, share):
    """The robot's limits with a share of its torques."""
    limits = limits_of(robot)
    return limits.replace(torque_lower=share * limits.torque_lower, torque_upper=share * limits.torque_upper)


# ---------------------------------------------------------------- rollouts


@pytest.mark.parametrize("level", ["torque", "acceleration"])
@pytest.mark.parametrize("solver", BOUNDED)
def test_no_torque_is_ever_beyond_its_bound(level, solver):
    """Also where the motors are so weak that other limits have to yield."""
    yielded = 0
    for name, share, seeds in (("panda", 1.0, (0, 1)), ("panda", 0.2, (0, 1)), ("lwr", 1.0, (4,))):
        robot = cc.load(name)
        for seed in seeds:
            tally = rollout(robot, weak(robot, share), np.random.default_rng(seed), 120, solver, level)
            assert tally.worst["torque"] <= (BY_GREED if solver == "sns-greedy" else EXCEEDED), (name, seed)
            assert tally.yielded["FAILED"] == 0
            yielded += tally.yielded["YIELDED"]
    assert level == "acceleration" or solver not in ("sns", "hqp") or yielded > 0


def test_limits_hold_where_torques_suffice():
    """Position, velocity and acceleration limits, up to how far a held torque's motion is from a held acceleration's.

    Steps of up to 5 ms; benchmarks/torque_rollouts.py has 1,000 starts.
    """
    robot = panda()
    for seed in range(6):
        worst = rollout(robot, limits_of(robot), np.random.default_rng(seed), 150).worst
        assert worst["position"] < 1e-4 and worst["velocity"] < 5e-2 and worst["acceleration"] < 6.0, (seed, worst)


def test_joints_come_back_from_outside_by_torques():
    robot, dt = panda(), 2e-3
    q = robot.home.copy()
    q[3] = robot.limits.position_upper[3] + 0.05
    limits = limits_of(robot)
    controller = cc.Controller(robot, cc.FrameTask(robot.tool), "sns", "torque", limits=limits, dt=dt)
    run = cc.simulate(controller, q, duration=0.4)
    assert run.status[0] == "RECOVERING"
    assert run.q[-1, 3] < robot.limits.position_upper[3] + 1e-4
    assert (np.abs(run.torque) <= robot.limits.torque_upper).all()


# ---------------------------------------------------------------- the rows


@pytest.mark.parametrize("solver", ["sns", "hqp"])
def test_joint_limits_are_rows_on_the_acceleration(solver):
    """The rows of the torque level hold for tau exactly where the bounds on a hold for M^-1 (tau - h)."""
    robot, rng, dt = panda(), np.random.default_rng(1), 5e-3
    limits = limits_of(robot)
    for _ in range(10):
        q, v = robot.random_configuration(rng), 0.3 * rng.normal(size=7)
        controller = cc.Controller(robot, cc.FrameTask(robot.tool), solver, "torque", limits=limits, dt=dt)
        state = robot.state(q, v)
        confines = controller._confining.at(state)
        given = (state, controller.tasks, [0.0], [None], Secondary(), None, confines)
        problem, _ = controller.level.problem(*given)
        C, low, high = problem.constraints
        a_low, a_high, _ = AccelerationBounds(limits, dt)(q, v)
        a = rng.normal(size=7)
        tau = state.mass_matrix @ a + state.nonlinear_effects
        np.testing.assert_allclose(C @ tau - low, a - a_low, atol=1e-7 * (1 + np.abs(low).max()))
        np.testing.assert_allclose(high - C @ tau, a_high - a, atol=1e-7 * (1 + np.abs(high).max()))
        np.testing.assert_array_equal(problem.upper, robot.limits.torque_upper)


def test_torque_bounds_are_rows_at_the_acceleration_level():
    robot, rng = panda(), np.random.default_rng(2)
    for _ in range(10):
        state = random_state(robot, rng)
        controller = cc.Controller(robot, cc.FrameTask(robot.tool), "sns", "acceleration", limits=weak(robot, 0.8))
        command = controller.step(state.q, 0.1 * state.v)
        assert (np.abs(command.torque) <= 0.8 * robot.limits.torque_upper + EXCEEDED).all()
        if not command.solution.yielded:
            C, low, high = command.solution.problem.constraints
            h = robot.state(state.q, 0.1 * state.v).nonlinear_effects
            np.testing.assert_array_equal(C, state.mass_matrix)
            np.testing.assert_allclose(high, 0.8 * robot.limits.torque_upper - h, rtol=1e-12)
            np.testing.assert_allclose(low, -0.8 * robot.limits.torque_upper - h, rtol=1e-12)


def test_torque_bounds_slow_a_task_that_needs_more():
    """The same target, asked for with strong and with weak motors: scaled, at the bound, still along its line."""
    robot = planar()
    q = np.array([0.3, 0.9, 0.7])
    target = robot.state(q).position("tool") + [0.1, 0.2, 0.0]
    task = cc.FrameTask("tool", "xy", gain=20.0, target=target)
    wide = robot.limits.replace(acceleration_upper=1e4, acceleration_lower=-1e4, velocity_upper=99, velocity_lower=-99)
    for level in ("torque", "acceleration"):
        free = cc.Controller(robot, task, "sns", level, limits=wide).step(q)
        most = 0.5 * np.abs(free.torque).max()
        held = cc.Controller(robot, task, "sns", level, limits=wide.replace(torque_lower=-most, torque_upper=most))
        command = held.step(q)
        assert free.solution.scales[0] == 1.0 and 0.05 < command.solution.scales[0] < 1.0
        assert np.abs(command.torque).max() == pytest.approx(most, rel=1e-9)
        assert command.solution.certificate().worst < 1e-8


def test_floating_bases_have_no_torque_rows_and_limits_without_torques_none():
    robot = talos()
    controller = cc.Controller(robot, cc.FrameTask(robot.tool, "position"), "sns", "acceleration")
    command = controller.step(robot.home)
    assert command.solution.problem.constraints is None and command.torque is None
    arm = panda()
    free = arm.limits.replace(torque_lower=-np.inf, torque_upper=np.inf)
    command = cc.Controller(arm, cc.FrameTask(arm.tool), "sns", "acceleration", limits=free).step(arm.home)
    assert command.solution.problem.constraints is None


class _BoxOnly(cc.SNS):
    """A user's solver that takes a box and no rows."""

    honours = frozenset({"bounds", "reference"})


def test_a_solver_without_rows_keeps_what_it_can_and_says_so():
    robot = panda()
    with pytest.warns(CartctlWarning, match="honours no rows"):
        controller = cc.Controller(robot, cc.FrameTask(robot.tool), _BoxOnly(), "torque", limits=robot.limits)
    problem = controller.step(robot.home).solution.problem
    assert problem.constraints is None
    np.testing.assert_array_equal(problem.upper, robot.limits.torque_upper)
    controller = cc.Controller(robot, cc.FrameTask(robot.tool), _BoxOnly(), "acceleration", limits=robot.limits)
    assert controller.step(robot.home).solution.problem.constraints is None


# ---------------------------------------------------------------- what yields, and in which order


def random_layers(rng, n, torques, classes):
    """Torque rows that leave room around a point, and boxes of the classes at random."""
    S = rng.normal(size=(n, n)) + 2.0 * np.eye(n)
    s = S @ rng.normal(size=n)
    hard = Layer("torque", S, s - torques, s + torques)
    layers = []
    for name in classes:
        C = np.eye(n) if name != "constraints" else rng.normal(size=(2, n))
        middle, half = rng.normal(size=len(C)), rng.uniform(0.1, 1.0, len(C))
        layers.append(Layer(name, C, middle - half, middle + half))
    return hard, layers


def miss(layer, u):
    at = layer.C @ u
    return float(np.linalg.norm(np.maximum(layer.lower - at, 0.0) + np.maximum(at - layer.upper, 0.0)))


@pytest.mark.parametrize("seed", range(12))
def test_the_first_class_is_missed_by_no_more_than_it_must(seed):
    """Against scipy: the smallest miss of the last class to yield; the others cannot be bought at its expense."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    hard, layers = random_layers(rng, n, 0.3, ["position", "velocity", "acceleration", "constraints"])
    problem = Problem((Equation(np.eye(n), rng.normal(size=n), fit="least_squares"),))
    found = widened(problem, layers, hard)
    S = hard.C
    start = np.linalg.solve(S, 0.5 * (hard.lower + hard.upper))
    best = minimize(
        lambda u: miss(layers[0], u) ** 2,
        start,
        constraints=[
            {"type": "ineq", "fun": lambda u: S @ u - hard.lower},
            {"type": "ineq", "fun": lambda u: hard.upper - S @ u},
        ],
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert miss(layers[0], found.u) <= np.sqrt(max(best.fun, 0.0)) + 1e-5
    assert (S @ found.u <= hard.upper + 1e-9).all() and (S @ found.u >= hard.lower - 1e-9).all()
    answer = cc.solve(found.problem, "sns")
    assert not missed(answer) and answer.outcome is not cc.Status.INFEASIBLE
    assert (S @ answer.u <= hard.upper + 1e-8).all() and (S @ answer.u >= hard.lower - 1e-8).all()
    for layer in layers:  # what is reported as kept is kept, what is reported as missed is missed
        assert (layer.name in found.yielded) == (miss(layer, found.u) > 1e-6), layer.name
    assert list(found.yielded) == sorted(found.yielded, key=ORDER.index)


def test_the_order_on_one_joint():
    """One joint whose torque leaves a <= 1: constraints want 4, acceleration limits allow 3 and more, and so on."""
    hard = Layer("torque", np.eye(1), np.array([-1.0]), np.array([1.0]))
    problem = Problem((Equation(np.eye(1), np.zeros(1)),))
    inf = np.array([np.inf])

    def at_least(name, value):
        return Layer(name, np.eye(1), np.array([value]), inf)

    cases = [
        (["constraints"], [-5.0, -5.0, -5.0, 4.0], ("constraints",)),
        (["acceleration"], [-5.0, -5.0, 3.0, -5.0], ("acceleration",)),
        (["velocity", "position"], [2.0, 2.5, -5.0, -5.0], ("velocity", "position")),
        ([], [0.5, 0.2, 0.9, 1.0], ()),
    ]
    for _, wanted, yielded in cases:
        names = ("position", "velocity", "acceleration", "constraints")
        layers = [at_least(n, w) for n, w in zip(names, wanted, strict=True)]
        assert widened(problem, layers, hard).yielded == yielded
    # two classes that exclude each other, torques aside: the one that yields first gives way
    for first, last in zip(ORDER, ORDER[1:], strict=False):
        keep, drop = at_least(last, 0.5), Layer(first, np.eye(1), -inf, np.array([0.0]))
        found = widened(problem, [keep, drop], hard)
        assert found.yielded == (first,) and found.u[0] == pytest.approx(0.5, abs=1e-6)


def test_a_box_as_torque_bounds_stays_a_box():
    hard = Box(-np.ones(2), np.ones(2))
    layers = [Layer("position", np.array([[1.0, 2.0], [0.0, 1.0]]), np.array([5.0, -9.0]), np.array([6.0, 9.0]))]
    found = widened(Problem((Equation(np.eye(2), np.zeros(2)),)), layers, hard)
    np.testing.assert_array_equal(found.problem.upper, hard.upper)
    expected = lsq_linear(layers[0].C[:1], [5.0], bounds=(-1.0, 1.0)).x
    np.testing.assert_allclose(found.u, expected, atol=1e-6)
    assert found.yielded == ("position",)


@pytest.mark.parametrize("seed", range(5))
def test_the_classes_apart_make_the_box_together(seed):
    """Where no class excludes another, the box of the bounds is their intersection."""
    robot, rng = panda(), np.random.default_rng(seed)
    limits, compared = limits_of(robot), 0
    for _ in range(40):
        q, v = robot.random_configuration(rng), rng.uniform(-1, 1, 7) * limits.velocity_upper
        bounds = AccelerationBounds(limits, float(10 ** rng.uniform(-3, -2)), disabled=[int(rng.integers(7))])
        lower, upper, _ = bounds(q, v)
        apart = intervals(bounds, q, v, Box(lower, upper))
        low = np.max([box.lower for box in apart.values()], axis=0)
        high = np.min([box.upper for box in apart.values()], axis=0)
        fits = low <= high
        np.testing.assert_allclose(lower[fits], low[fits], atol=1e-8)
        np.testing.assert_allclose(upper[fits], high[fits], atol=1e-8)
        compared += int(fits.sum())
        assert list(apart) == ["position", "velocity", "acceleration"]
    assert compared > 150


@pytest.mark.parametrize("level", ["torque", "acceleration"])
def test_a_fall_that_weak_motors_cannot_stop(level):
    """Too weak to hold its weight before a limit: torques at their bound, the limit missed and reported, no NaN."""
    robot = planar()
    limits = robot.limits.replace(torque_lower=-3.0, torque_upper=3.0, position_lower=-0.6, velocity_lower=-3.0)
    limits = limits.replace(velocity_upper=3.0, acceleration_lower=-20.0, acceleration_upper=20.0)
    controller = cc.Controller(robot, cc.FrameTask("tool", "xy"), "sns", level, limits=limits, dt=5e-3)
    run = cc.simulate(controller, np.array([0.0, 0.1, 0.1]), duration=1.0, plant=cc.Plant())
    assert "YIELDED" in run.status and run.metrics().status["YIELDED"] > 10
    assert np.abs(run.torque).max() <= 3.0 + EXCEEDED and np.abs(run.torque).max() > 3.0 - 1e-6
    assert np.isfinite(run.q).all()
    assert (run.q[:, 0] < -0.6).any()
    command = controller.step(run.q[-1], run.v[-1])
    assert command.solution.yielded and command.solution.status is cc.Status.YIELDED


def test_constraints_yield_before_joint_limits():
    """A plane behind which the hand cannot get at the deceleration the joints have: the plane gives way, not they."""
    robot = panda()
    limits = limits_of(robot)
    at = robot.state(robot.home).position(robot.tool)
    wall = cc.HalfSpace(robot.tool, [1.0, 0.0, 0.0], at[0] - 0.2, recovery_speed=50.0, deceleration=1e4)
    for level in ("torque", "acceleration"):
        controller = cc.Controller(
            robot, cc.FrameTask(robot.tool), "sns", level, limits=limits, constraints=[wall], dt=2e-3
        )
        command = controller.step(robot.home)
        assert command.solution.yielded == ("constraints",)
        state = robot.state(robot.home)
        a = np.linalg.solve(state.mass_matrix, command.torque - state.nonlinear_effects)
        low, high, _ = AccelerationBounds(limits, 2e-3)(robot.home, np.zeros(7))
        assert (a >= low - 1e-5).all() and (a <= high + 1e-5).all()
