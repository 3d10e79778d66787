"""What the figures have in common: a few arms, and motions that bring out what a method does."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

import cartctl as cc


class Passage(NamedTuple):
    """A tip on its way past a singularity: time (N,), joint speed (N,) rad/s, distance from the path (N,) m."""

    time: np.ndarray
    speed: np.ndarray
    error: np.ndarray


@lru_cache
def past_the_fold(solver) -> Passage:
    """A 2R arm's tip along a line that passes the base at 5 mm, where the arm is all but folded."""
    robot = cc.planar([1.0, 1.0])
    line = cc.Line([-0.8, 0.005, 0.0], [0.8, 0.005, 0.0], duration=4.0)
    reach, angle = np.hypot(0.8, 0.005), np.arctan2(0.005, -0.8)
    bend = np.pi - 2.0 * np.arcsin(reach / 2.0)
    q0 = [angle - bend / 2.0, bend]
    tip = cc.FrameTask("tool", "xy", gain=10.0, target=line)
    run = cc.simulate(cc.Controller(robot, tip, solver=solver, limits=None, dt=1e-3), q0, duration=4.5)
    return Passage(run.time[:-1], np.linalg.norm(run.command, axis=1), np.linalg.norm(run.tasks[0].error, axis=1)[:-1])


def four_joints() -> cc.Robot:
    """A planar 4R arm."""
    return cc.planar([0.5, 0.4, 0.35, 0.25], limits=None)


def laps(solver, count: int, objective=None) -> list[cc.Run]:
    """A 3R arm's tip round a circle, closed loop: a run for each lap, from rest to rest."""
    robot, q = cc.planar([1.0, 0.8, 0.6]), np.array([0.4, 0.9, 0.7])
    circle = cc.Circle.starting_at(robot.state(q).placement("tool"), radius=0.35, period=2.0)
    tip = cc.FrameTask("tool", "xy", gain=20.0, target=circle)
    controller = cc.Controller(robot, tip, solver=solver, limits=None, objective=objective, dt=2e-3)
    runs: list[cc.Run] = []
    for _ in range(count):
        runs.append(cc.simulate(controller, runs[-1].q[-1] if runs else q, duration=2.0))
    return runs


def self_motion(solver, objective, duration: float = 4.0) -> cc.Run:
    """A 4R arm that holds its tip while its redundancy descends an objective."""
    robot = four_joints()
    tip = cc.FrameTask("tool", "xy", gain=20.0)
    controller = cc.Controller(robot, tip, solver=solver, limits=None, objective=objective, dt=2e-3)
    return cc.simulate(controller, [1.4, -1.9, 1.5, 0.9], duration=duration)


def too_fast(solver) -> cc.Run:
    """A 4R arm's tip round a circle that its joint speeds of 1 rad/s do not allow in the time given."""
    robot = four_joints()
    start = robot.state([0.5, 0.6, 0.5, 0.5]).placement("tool")
    circle = cc.Circle.starting_at(start, radius=0.3, period=1.6)
    tip = cc.FrameTask("tool", "xy", gain=20.0, target=circle)
    limits = robot.limits.replace(velocity_lower=-1.0, velocity_upper=1.0)
    controller = cc.Controller(robot, tip, solver=solver, limits=limits, dt=5e-3)
    return cc.simulate(controller, [0.5, 0.6, 0.5, 0.5], duration=4.0)
