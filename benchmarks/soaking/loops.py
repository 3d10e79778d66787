"""Closed loops: every step inside the limits and a number, now and then a certificate."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple, Protocol

import numpy as np

import cartctl as cc
from cartctl.errors import UnsupportedProblem
from cartctl.motion.integrate import advance
from soaking.batch import Failure
from soaking.scenes import Scene, scene

STEPS = 1000  # of one scene
_KEPT = 1e-9  # of a limit's range
_CERTIFIED = 50  # one step in so many
_TOLERANCE = 1e-6


class Loops(NamedTuple):
    """Steps made, statuses, certificates asked for, the worst of those that passed, the largest excess, failures."""

    steps: int
    statuses: Counter[str]
    certificates: int
    worst: float
    excess: float
    failures: list[Failure]


class Scened(Protocol):
    """A scene that was run, and what came of it."""

    scene: Scene
    made: int
    certificates: int
    worst: float
    excess: float
    size: float
    statuses: Counter[str]

    def run(self) -> str:
        """What went wrong, or nothing."""


def run(seed: int, first: int, seconds: float, scenes: int = 1 << 30, spoil: float = 0.0) -> tuple[Loops, int]:
    """Scenes first.. until the time is over or so many were made; and the next one's index."""

    def make(index: int) -> Loop:
        return Loop(scene(seed, index), np.random.default_rng([seed, index, 1]), spoil)

    return gathered(make, f"--scene {seed}", first, seconds, scenes)


def gathered(make: Callable[[int], Scened], command: str, first: int, seconds: float, scenes: int) -> tuple[Loops, int]:
    """What came of make(first), ... until the time is over or so many were run; and the next one's index."""
    until, index = perf_counter() + seconds, first
    steps, certificates, worst, excess = 0, 0, 0.0, 0.0
    statuses: Counter[str] = Counter()
    failures: list[Failure] = []
    while index < first + scenes and (index == first or perf_counter() < until):
        made = make(index)
        what = made.run()
        if what:
            failures.append(Failure(f"{what} ({made.scene.words})", made.size, f"{command} {index}"))
        steps += made.made
        certificates += made.certificates
        worst, excess = max(worst, made.worst), max(excess, made.excess)
        statuses += made.statuses
        index += 1
    return Loops(steps, statuses, certificates, worst, excess, failures), index


class Loop:
    """One scene being run."""

    def __init__(self, scene: Scene, rng: np.random.Generator, spoil: float = 0.0) -> None:
        self.scene, self.spoil = scene, spoil
        self.asked = rng.random(STEPS) < 1.0 / _CERTIFIED
        self.made, self.certificates, self.worst, self.excess, self.size = 0, 0, 0.0, 0.0, 0.0
        self.statuses: Counter[str] = Counter()
        self.exact = scene.controller.solver.name != "task-scaling"  # which may find no scale, and says so
        self.low, self.high, self.room = rooms(scene)
        self.nothing = np.zeros(scene.controller.robot.nv)

    def run(self) -> str:
        """What went wrong and when, or nothing."""
        what = self._run()
        return what and f"{what} at step {self.made}"

    def _run(self) -> str:
        controller = self.scene.controller
        robot, dt = controller.robot, controller.dt
        q, v, a = self.scene.q, self.nothing, self.nothing
        moved = np.empty((4, robot.nv))
        for k in range(STEPS):
            try:
                command = controller.step(q, v, k * dt)
            except Exception as error:  # a step must not raise: whatever it is, it is a finding
                return f"{type(error).__name__}: {error}"
            solution = command.solution
            if self.spoil:
                command.told[0] += self.spoil
            before, a_before = v, a
            q, v = advance(robot, q, v, command, dt)
            a = (v - before) / dt
            moved[0], moved[1], moved[2], moved[3] = robot.coordinates(q), v, a, (a - a_before) / dt
            self.made += 1
            if solution.yielded:  # limits that contradict torques were left, in the order that is documented
                self.statuses[solution.status.name] += 1
                return ""
            what = self._judged(moved, solution)
            if not what and self.asked[k]:
                what = self._proven(solution)
            if what:
                return what
        return ""

    def _judged(self, moved: np.ndarray, solution: cc.Solution) -> str:
        if not np.isfinite(moved).all():
            return "not a number"
        over = np.maximum(self.low - moved, moved - self.high) / self.room
        worst = over.max()
        if worst > 1.0:
            self.size = float(worst) * _KEPT
            quantity = ("position", "velocity", "acceleration", "jerk")[int(over.max(axis=1).argmax())]
            return f"{quantity} outside"
        self.excess = max(self.excess, float(worst) * _KEPT)
        status = solution.status
        self.statuses[status.name] += 1
        if status is cc.Status.FAILED or solution.recovering or (status is cc.Status.INFEASIBLE and self.exact):
            return f"status {status.name}"
        return ""

    def _proven(self, solution: cc.Solution) -> str:
        what, size, checked = proven(solution)
        self.certificates += checked
        if what:
            self.size = size
        else:
            self.worst = max(self.worst, size)
        return what


def rooms(scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lower and upper limits of positions, velocities, accelerations and jerks, and by how much each may be left."""
    lim = scene.limits
    pairs = [(lim.position_lower, lim.position_upper), (lim.velocity_lower, lim.velocity_upper)]
    pairs.append((lim.acceleration_lower, lim.acceleration_upper))
    pairs.append((lim.jerk_lower, lim.jerk_upper))
    low, high = np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])
    if not scene.jerk:
        low[3], high[3] = -np.inf, np.inf
    width = high - low
    room = _KEPT * np.where(np.isfinite(width), width, 1.0) + 1e-12
    # a difference quotient of values that are rounded: what their last digits amount to
    dt = scene.controller.dt
    room[2] += 1e-15 * high[1] / dt
    room[3] += 4e-15 * high[1] / dt**2
    room[~np.isfinite(room)] = 1.0
    return low, high, room


def proven(solution: cc.Solution) -> tuple[str, float, int]:
    """What a solution's certificate leaves open, its worst residual, and whether there was one."""
    if solution.outcome is cc.Status.UNPROVEN:  # it says so itself
        return "", 0.0, 0
    try:
        certificate = solution.certificate()
    except UnsupportedProblem:
        return "", 0.0, 0
    if certificate.worst <= _TOLERANCE:
        return "", certificate.worst, 1
    level = max(certificate.levels, key=lambda c: c.worst)
    return f"certificate of {level.name} ({level.claim})", certificate.worst, 1
