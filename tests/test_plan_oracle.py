"""Plans of a planar 3R against dynamic programming on dense grids, which knows nothing of the planner."""

from __future__ import annotations

import numpy as np
import pytest

import cartctl as cc
from tests.planar_grid import best_path, wrapped, zoomed

LENGTHS = (1.0, 0.7, 0.4)
SAMPLES, PERIOD = 31, 2.0
WITHIN = 5e-3  # of the grid's cost


def problem(seed: int):
    robot, rng = cc.planar(list(LENGTHS)), np.random.default_rng(seed)
    q0 = rng.uniform(-np.pi, np.pi, 3)
    q0[1] = rng.uniform(0.4, 2.6) * rng.choice([-1.0, 1.0])
    p0 = robot.state(q0).position("tool")
    path = cc.Circle.starting_at(p0, radius=rng.uniform(0.1, 0.3), period=PERIOD)
    times = np.linspace(0.0, PERIOD, SAMPLES)
    return robot, q0, path, np.array([path(t).position[:2] for t in times.tolist()]), float(times[1])


def masses(robot: cc.Robot):
    return lambda q: np.array([robot.state(x).mass_matrix for x in q])


def ones(q: np.ndarray) -> np.ndarray:
    return np.broadcast_to(np.eye(3), (len(q), 3, 3))


# Paths on which the grid's best stays away from a straight elbow, where its two sheets meet, and no joint goes round.
CASES = [
    (1, "fixed", "joint-speed"),
    (1, "closed", "joint-speed"),
    (1, "fixed", "kinetic-energy"),
    (1, "closed", "kinetic-energy"),
    (2, "free", "joint-speed"),
    (2, "closed", "joint-speed"),
    (3, "fixed", "joint-speed"),
    (3, "free", "joint-speed"),
    (3, "closed", "joint-speed"),
    (3, "fixed", "kinetic-energy"),
    (3, "free", "kinetic-energy"),
    (3, "closed", "kinetic-energy"),
    (4, "fixed", "joint-speed"),
    (4, "free", "joint-speed"),
    (4, "closed", "joint-speed"),
    (4, "fixed", "kinetic-energy"),
]


@pytest.mark.parametrize(("seed", "ends", "objective"), CASES)
def test_the_cost_is_the_grids(seed: int, ends: str, objective: str) -> None:
    robot, q0, path, points, h = problem(seed)
    weight = ones if objective == "joint-speed" else masses(robot)
    fixed = {"start": q0} if ends != "free" else {}
    fixed |= {"end": q0} if ends == "closed" else {}
    best, coarse = best_path(LENGTHS, points, h, weight, 360, 30, **fixed)
    assert np.abs(np.sin(best[:, 1])).min() > 0.25
    assert ends != "closed" or np.abs(wrapped(np.diff(best, axis=0)).sum(axis=0)).max() < 1.0
    dense = zoomed(LENGTHS, points, h, weight, best, 0.05, rounds=14, count=31, **fixed)
    plan = cc.plan(
        robot, cc.FrameTask("tool", "xy", target=path), samples=SAMPLES, objective=objective, limits=None,
        closed=ends == "closed", q0=None if ends == "free" else q0, methods=("pinv",),
    )  # fmt: skip
    assert dense <= coarse
    assert plan.report.cost == pytest.approx(dense, rel=WITHIN)
    assert plan.report.cost <= dense * (1.0 + 1e-4)
    assert plan.report.status is cc.PlanStatus.OPTIMAL


def test_another_posture_wins() -> None:
    """From the elbow's other side the path is shorter: a free start must find it, whatever home is."""
    robot, path = cc.planar([1.0, 1.0, 0.3]), cc.Line([1.3, 0.4, 0.0], [1.0, -0.9, 0.0], duration=PERIOD)
    task = cc.FrameTask("tool", "xy", target=path)
    times = np.linspace(0.0, PERIOD, SAMPLES)
    points = np.array([path(t).position[:2] for t in times.tolist()])
    best, _ = best_path((1.0, 1.0, 0.3), points, times[1], ones, 360, 30)
    dense = zoomed((1.0, 1.0, 0.3), points, times[1], ones, best, 0.03, rounds=14, count=31)
    costs = []
    for home in ([0.9, -1.4, 0.4], [-0.9, 1.4, -0.4]):
        posed = cc.Robot(robot.model, tool="tool", home=dict(zip(robot.joint_names, home, strict=True)))
        plan = cc.plan(posed, task, samples=SAMPLES, objective="joint-speed", limits=None, methods=("pinv",))
        assert plan.report.local[0].cost > 1.02 * plan.report.cost
        costs.append(plan.report.cost)
    assert costs == pytest.approx([dense, dense], rel=WITHIN)
