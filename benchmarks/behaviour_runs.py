"""The scenarios of the behaviour benchmark, rolled out step by step on a Panda that does what it is told.

    limits      "none"          the method alone
                "clipped"       each joint's speed and position clipped afterwards, as ten lines of one's own would
                "velocity"      the controller is told position and velocity limits
                "acceleration"  and the data sheet's acceleration limits

Moving targets are the paths that the samples were taken from, so that the hand is told their exact velocities:
``phi = pi t^2`` for 1 s and ``2 pi t - pi`` from then on for the circle, quintic there and back past the singularity.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
from behaviour_figures import Figures

import cartctl as cc

DATA = json.loads((Path(__file__).parent.parent / "tests" / "data" / "behaviour_scenarios.json").read_text())
SCENARIOS, DT, STEPS, FRAME = DATA["scenarios"], DATA["dt_s"], DATA["steps"], "panda_hand_tcp"
RADIUS = 0.15  # m, of circle1
GAINS = {"circle1": 60.0}  # 1/s; 20 elsewhere


@dataclass
class Trace:
    """N steps. q (N+1, 7); v (N, 7); hand (N, 4, 4), after each step; target (N, 4, 4), where it should be by then."""

    name: str
    q: np.ndarray
    v: np.ndarray
    hand: np.ndarray
    target: np.ndarray
    statuses: list[str]
    own_time: float  # s, of the target's path at the end
    microseconds: float  # median of a step


def panda_limits(which: str) -> cc.Limits:
    """The Panda's, with or without accelerations."""
    limits = cc.load("panda").limits
    return limits if which == "acceleration" else limits.replace(acceleration_lower=-np.inf, acceleration_upper=np.inf)


def circle(t: float) -> cc.PathSample:
    """1 Hz after a ramp of 1 s, in the y-z plane, orientation held."""
    x, y, z = SCENARIOS["circle1"]["targets_position"][0]
    t = max(t, 0.0)
    phi, rate, rise = (np.pi * t * t, 2 * np.pi * t, 2 * np.pi) if t < 1.0 else (2 * np.pi * t - np.pi, 2 * np.pi, 0.0)
    s, c = RADIUS * np.sin(phi), RADIUS * np.cos(phi)
    velocity, bend = np.array([0.0, c, s]), np.array([0.0, -s, c])
    position = np.array([x, y + s, z + RADIUS - c])
    linear = np.concatenate([[velocity * rate], [velocity * rise + bend * rate * rate]])
    twist, acceleration = np.hstack([linear, np.zeros((2, 3))])
    return cc.PathSample(position, np.array(SCENARIOS["circle1"]["rotation"]), twist, acceleration)


def _lines() -> tuple[cc.Line, cc.Line]:
    given = SCENARIOS["sing_over"]
    inner, outer = np.eye(4), np.eye(4)
    inner[:3, :3] = outer[:3, :3] = given["rotation"]
    inner[:3, 3], outer[:3, 3] = given["targets_position"][0], given["targets_position"][320]
    return cc.Line(inner, outer, 3.0), cc.Line(outer, inner, 3.0)


OUT, BACK = _lines()


def there_and_back(t: float) -> cc.PathSample:
    """3 s out past the singularity, 0.5 s there, 3 s back."""
    return OUT(t) if t < 3.25 else BACK(t - 3.5)


PATHS: dict[str, Callable[[float], cc.PathSample]] = {"circle1": circle, "sing_over": there_and_back}


def target_after(name: str, k: int) -> np.ndarray:
    """The pose (4, 4) that step k aims at."""
    given = SCENARIOS[name]
    if "targets_position" in given:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = given["rotation"], given["targets_position"][k + 1]
        return pose
    if "target" in given:
        return np.array(given["target"])
    return np.array(given["target_before" if k < given["switch_step"] else "target_after"])


def controller(name: str, solver: str, limits: str, posture: bool = False, gain: float | None = None) -> cc.Controller:
    """The hand at the target, the home posture below it if asked for."""
    hand = cc.FrameTask(FRAME, "position" if name == "unreach_pos" else "pose", gain=gain or GAINS.get(name, 20.0))
    if name in PATHS:
        hand.target = PATHS[name]
    told = None if limits in ("none", "clipped") else panda_limits(limits)
    # A path that leaves the workspace would wait for ever at the edge.
    clock = False if name == "sing_over" else None
    tasks = [hand, cc.PostureTask()] if posture else [hand]
    return cc.Controller(cc.load("panda"), tasks, solver, limits=told, dt=DT, path_clock=clock)


def roll(name: str, made: cc.Controller, clipped: bool = False) -> Trace:
    """8 s of a scenario."""
    robot, limits, hand = made.robot, made.robot.limits, made.tasks[0]
    q, v = np.array(SCENARIOS[name]["q0_rad"]), np.zeros(robot.nv)
    postures, speeds, hands, targets, statuses, times = [q], [], [], [], [], []
    for k in range(STEPS):
        target = target_after(name, k)
        if name not in PATHS:
            hand.target = target
        start = perf_counter()
        command = made.step(q, v, k * DT)
        times.append(perf_counter() - start)
        v, before = command.velocity, q
        q = robot.integrate(q, v * DT)
        if clipped:
            v = np.clip(v, limits.velocity_lower, limits.velocity_upper)
            q = np.clip(robot.integrate(before, v * DT), limits.position_lower, limits.position_upper)
            v = (q - before) / DT
        postures.append(q)
        speeds.append(v)
        hands.append(robot.state(q).placement(FRAME).homogeneous)
        targets.append(target)
        statuses.append(str(command.solution.status))
    arrays = (np.array(a) for a in (postures, speeds, hands, targets))
    return Trace(name, *arrays, statuses, made.step_times[0] + DT, 1e6 * float(np.median(times)))


def run(name: str, solver: str, limits: str, posture: bool = False, gain: float | None = None) -> Trace:
    """A controller made for the scenario, and its 8 s."""
    return roll(name, controller(name, solver, limits, posture, gain), limits == "clipped")


def figures_of(trace: Trace) -> Figures:
    """Its figures, against the data sheet's limits."""
    centre = np.array(SCENARIOS["circle1"]["targets_position"][0]) + [0.0, 0.0, RADIUS]
    return Figures(trace, DT, cc.load("panda").limits, centre, RADIUS)
