"""A random robot with random tasks, limits, step and solver, from (seed, index)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from functools import cache
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

import cartctl as cc

SOLVERS = ("sns", "hqp", "qp", "task-scaling")
_ROBOTS = ("panda", "lwr", "iiwa14", "kinova", "planar")


class Scene(NamedTuple):
    """A controller and where it starts, at rest inside its limits; a line that says what it is."""

    controller: cc.Controller
    q: np.ndarray
    limits: cc.Limits
    jerk: bool
    words: str


def scene(seed: int, index: int) -> Scene:
    """Scene ``index`` of a seed."""
    rng = np.random.default_rng([seed, index])
    robot = _robot(rng)
    level = str(rng.choice(["velocity", "acceleration"]))
    solver = str(rng.choice(SOLVERS, p=[0.35, 0.3, 0.1, 0.25]))
    dt = float(10.0 ** rng.uniform(-4.0, math.log10(2e-2)))
    limits, jerk = _limits(rng, robot)
    q = start(rng, robot, limits)
    tasks, what = _tasks(rng, robot, q, dt)
    if solver == "task-scaling":
        tasks = tasks[:1]
    objective = cc.JointRange() if level == "velocity" and rng.random() < 0.3 else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cc.CartctlWarning)
        made = cc.Controller(robot, tasks, solver, level, limits, objective=objective, dt=dt, jerk=jerk)
    told = f"{robot.name}, {level}, {solver}, dt {dt:.2g}, {what}{', jerk' if jerk else ''}"
    return Scene(made, q, limits, jerk, told + (", objective" if objective else ""))


def rolled_scene(seed: int, index: int) -> Scene:
    """Scene ``index`` of a seed as a compiled loop can hold it: exact scaling by velocities, no jerk limits."""
    rng = np.random.default_rng([seed, index, 2])
    robot = _robot(rng)
    dt = float(10.0 ** rng.uniform(-4.0, math.log10(2e-2)))
    limits, _ = _limits(rng, robot)
    q = start(rng, robot, limits)
    tasks, what = _tasks(rng, robot, q, dt)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cc.CartctlWarning)
        made = cc.Controller(robot, tasks, "sns", limits=limits, dt=dt)
    return Scene(made, q, limits, False, f"{robot.name}, dt {dt:.2g}, {what}, compiled")


def _robot(rng: np.random.Generator) -> cc.Robot:
    name = str(rng.choice(_ROBOTS, p=[0.25, 0.25, 0.15, 0.15, 0.2]))
    return _loaded(name, int(rng.integers(2, 11)) if name == "planar" else 0)


@cache
def _loaded(name: str, n: int) -> cc.Robot:
    return cc.planar([0.3] * n) if n else cc.load(name)


def _limits(rng: np.random.Generator, robot: cc.Robot) -> tuple[cc.Limits, bool]:
    """The robot's own, tighter, narrower, without accelerations or with jerks."""
    given = robot.limits
    a = np.where(np.isfinite(given.acceleration_upper), given.acceleration_upper, 10.0) * rng.uniform(0.2, 2.0)
    kind = rng.random()
    a = np.full(robot.nv, np.inf) if kind < 0.2 else a
    jerk = kind > 0.75
    j = a * 10.0 ** rng.uniform(0.5, 3.0)
    v = given.velocity_upper * rng.uniform(0.3, 1.0)
    low, high = given.position_lower, given.position_upper
    if rng.random() < 0.4:
        room = 0.5 * (high - low) * rng.uniform(0.0, 0.45, robot.nv)
        low, high = low + np.where(np.isfinite(room), room, 0.0), high - np.where(np.isfinite(room), room, 0.0)
    return given.replace(
        position_lower=low, position_upper=high, velocity_lower=-v, velocity_upper=v, acceleration_lower=-a,
        acceleration_upper=a, jerk_lower=-j, jerk_upper=j,
    ), jerk  # fmt: skip


def start(rng: np.random.Generator, robot: cc.Robot, limits: cc.Limits) -> np.ndarray:
    """A configuration inside the limits, some of its joints on them."""
    low = np.where(np.isfinite(limits.position_lower), limits.position_lower, -math.pi)
    high = np.where(np.isfinite(limits.position_upper), limits.position_upper, math.pi)
    share = rng.random(robot.nv)
    at = rng.random(robot.nv) < rng.choice([0.0, 0.2])
    wanted = low + np.where(at, np.round(share), share) * (high - low)
    q = robot.home
    return robot.integrate(q, np.clip(wanted, low, high) - robot.coordinates(q))


def _tasks(rng: np.random.Generator, robot: cc.Robot, q: np.ndarray, dt: float) -> tuple[list[cc.Task], str]:
    planar = robot.name.startswith("planar")
    axes = str(rng.choice(["xy", "xy rz", "x"] if planar else ["pose", "position", "orientation", "x z"]))
    gain = float(min(10.0 ** rng.uniform(-0.3, 2.3), 1.9 / dt))
    target, name = _target(rng, robot, q)
    fit = "scale" if rng.random() < 0.85 else "least_squares"
    tasks: list[cc.Task] = [cc.FrameTask(robot.tool, axes, gain, target=target, fit=fit)]
    words = f"{axes} {name}, gain {gain:.2g}, {fit}"
    if rng.random() < 0.25 and not planar:
        elbow = robot.frame_names[len(robot.frame_names) // 2]
        tasks.append(cc.FrameTask(elbow, "position", gain, target=q_target(rng, robot)))
        words += ", elbow"
    if rng.random() < 0.5:
        tasks.append(cc.PostureTask(gain=gain))
        words += ", posture"
    return tasks, words


def q_target(rng: np.random.Generator, robot: cc.Robot) -> np.ndarray:
    """A point near what the tool can reach."""
    return robot.state(robot.random_configuration(rng)).position(robot.tool)


def _target(rng: np.random.Generator, robot: cc.Robot, q: np.ndarray) -> tuple[object, str]:
    """Within reach, far away, jumping, or on a fast circle."""
    kind = str(rng.choice(["reachable", "unreachable", "jumping", "circle", "held"], p=[0.2, 0.25, 0.25, 0.25, 0.05]))
    if kind == "held":
        return None, kind
    if kind == "circle":
        here = robot.state(q).placement(robot.tool)
        radius, period = float(rng.uniform(0.02, 0.5)), float(10.0 ** rng.uniform(-0.7, 0.7))
        return cc.Circle.starting_at(here, radius, towards=np.append(rng.normal(size=2), 0.0), period=period), kind
    poses = [robot.state(robot.random_configuration(rng)).placement(robot.tool) for _ in range(8)]
    if kind == "unreachable":
        poses[0].translation = poses[0].translation * rng.uniform(1.5, 20.0)
    if kind != "jumping":
        return poses[0], kind
    return _jumping(poses, float(10.0 ** rng.uniform(-1.7, 0.0))), kind


def _jumping(poses: list, period: float) -> Callable[[float], SimpleNamespace]:
    zeros = np.zeros(6)

    def path(t: float) -> SimpleNamespace:
        pose = poses[int(t / period) % len(poses)]
        parts = {"position": np.array(pose.translation), "rotation": np.array(pose.rotation)}
        return SimpleNamespace(**parts, twist=zeros, acceleration=zeros)

    return path
