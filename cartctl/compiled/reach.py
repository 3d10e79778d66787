"""Pose inverse kinematics for one target or ten thousand: restarts inside the joint limits, in one compiled loop.

The descent is :mod:`cartctl.compiled.reach_kernel`'s: Levenberg-Marquardt damping by the error (Chan & Lawrence 1988;
Sugihara 2011), limits by an active set. Starts are drawn once, uniform inside the limits; each target begins at those
whose poses lie nearest to it.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray, IntArray
from cartctl.compiled.best import improved
from cartctl.compiled.motion_kernel import frame_poses
from cartctl.compiled.reach_kernel import reach
from cartctl.compiled.threads import thread_count
from cartctl.compiled.tree import Tree, tree_of
from cartctl.errors import ParameterError, ShapeError, TargetError
from cartctl.model.limits import Limits
from cartctl.model.robot import Robot
from cartctl.objectives.base import Objective

_STARTS = 512  # drawn once: more would cost more to look through than they save
_STEPS = 60  # of one attempt, at most
_CANDIDATES = 4  # answers to choose from, where there is an objective
_CHUNKS = 4  # a thread, so that no thread waits long for the others
_PATTERN = np.array([0.0, 0.0, 0.0, 1.0])


class Reached(Enum):
    """How one target went; the value is a sentence for the user."""

    REACHED = "The frame is at its target within both tolerances, inside the joint limits."
    LIMITED = "Not reached: the best attempt ends with joints at their limits. Move the base, or choose another grasp."
    MISSED = "Not reached by any attempt: the target may lie outside the workspace. More restarts may find it."

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, eq=False)
class InverseKinematics:
    """Answers to N targets: one row a target, in the targets' order.

    q: (N, nq) configurations, inside the limits; of a target that was not reached, the best attempt. success: (N,)
    bool. position_error: (N,) m. orientation_error: (N,) rad. iterations: (N,) steps over all attempts. restarts: (N,)
    attempts after the first one. status: (N,) a Reached each.
    """

    q: FloatArray
    success: Any
    position_error: FloatArray
    orientation_error: FloatArray
    iterations: IntArray
    restarts: IntArray
    status: tuple[Reached, ...]

    def __len__(self) -> int:
        return len(self.q)

    def __repr__(self) -> str:
        return f"InverseKinematics({int(self.success.sum())} of {len(self)} targets reached)"


class _Job(NamedTuple):
    """What the kernel is told about all targets."""

    tree: Tree
    frame: FloatArray
    limits: FloatArray
    starts: FloatArray
    table: FloatArray
    near: float
    aligned: float
    span: float
    restarts: int

    def run(self, first: FloatArray, targets: FloatArray, found: FloatArray, said: FloatArray) -> None:
        arguments = (self.tree.joints, self.frame, self.limits, self.starts, self.table, first, targets)
        tolerances = (self.near, self.aligned, self.span, self.restarts, _STEPS)
        reach.compiled(*arguments, *tolerances, found, said)


def inverse_kinematics(
    robot: Robot,
    targets: Any,
    frame: str | None = None,
    q0: Any = None,
    *,
    restarts: int = 100,
    position_tolerance: float = 1e-4,
    orientation_tolerance: float = 1e-3,
    objective: Objective | None = None,
    candidates: int | None = None,
    limits: Limits | None = None,
    seed: int = 0,
    threads: int | None = None,
) -> InverseKinematics:
    """Configurations q with ``T_frame(q) = target`` inside the joint limits: an InverseKinematics of N rows.

    targets: a pose (pin.SE3 or 4x4), a sequence of them, or (N, 4, 4), in the world. frame: the robot's tool if None.
    q0: (nq,) or (N, nq), where the first attempt begins (by default all begin at random starts); joints that do not
    move the frame stay there, or at home. restarts: attempts after the first one. position_tolerance: m,
    orientation_tolerance: rad; every answer is verified against both and against the limits. objective: an Objective
    that the self-motion shall bring as far down (or up) as it goes from the best of several answers. candidates: how
    many answers to look for, of which the best is kept: by the objective, or the nearest to q0 (by default 1, with an
    objective 4). limits: position limits, the robot's own if None. seed: of the random starts. threads: all cores if
    None; the answers are the same for any number.

    A target that is not reached is no error: its ``success`` is False, its q the best attempt.

    Raises UnsupportedJoint for a robot whose joints compiled kinematics cannot express (a floating base, mimicking
    joints), FrameNotFound, TargetError, ShapeError, NonFiniteError, ConfigurationError, ParameterError.

    >>> import cartctl as cc
    >>> robot = cc.load("panda")
    >>> answer = cc.inverse_kinematics(robot, robot.state(robot.home).placement(robot.tool))
    >>> print(answer.success, answer.position_error[0] < 1e-4)
    [ True] True
    """
    if not isinstance(robot, Robot):
        raise ParameterError(f"robot is a {type(robot).__name__}; expected a Robot from cc.load(...)")
    tree = tree_of(robot)
    placed = tree.frame(robot.tool if frame is None else frame)
    goals = _targets(targets)
    first = _first(robot, q0, len(goals))
    count = checks.whole(
        "candidates", (1 if objective is None else _CANDIDATES) if candidates is None else candidates, 1
    )
    if count > 1 and objective is None and not len(first):
        raise ParameterError(f"candidates is {count}; expected an objective or a q0 to choose the best by, or 1")
    if objective is not None:
        if not isinstance(objective, Objective):
            raise ParameterError(f"objective is a {type(objective).__name__}; expected one such as cc.JointRange()")
        objective.check(robot)
    bounds = _bounds(robot, limits)
    rng = np.random.default_rng(checks.whole("seed", seed, 0))
    starts = _starts(robot, bounds, rng, _chain(tree, placed))
    table = np.empty((_STARTS, 12))
    frame_poses.compiled(tree.joints, placed, starts, table)
    span = max(float(np.sqrt(np.mean(np.var(table[:, 9:], axis=0)))), 1e-3)
    near = checks.number("position_tolerance", position_tolerance, low=0.0, strict=True)
    aligned = checks.number("orientation_tolerance", orientation_tolerance, low=0.0, strict=True)
    job = _Job(tree, placed, bounds, starts, table, near, aligned, span, checks.whole("restarts", restarts, 0))
    found, said = _all(job, first, goals, count, robot.nq, thread_count(threads))
    if objective is not None:
        improved(robot, objective, robot.tool if frame is None else frame, bounds, goals, found, said, job.run)
    elif count > 1:
        _nearest(robot, first, found, said)
    return _answer(robot, bounds, found[:, 0], said[:, 0])


def _all(
    job: _Job, first: FloatArray, goals: FloatArray, count: int, nq: int, threads: int
) -> tuple[FloatArray, FloatArray]:
    """Answers (N, count, nq) and what is said of them (N, count, 5)."""
    n = len(goals)
    found, said = np.zeros((n * count, nq)), np.zeros((n * count, 5))
    _ = reach.compiled
    edges = np.linspace(0, n, (1 if threads == 1 else min(n, threads * _CHUNKS)) + 1).astype(int)

    def part(k: int) -> None:
        own, rows = slice(edges[k], edges[k + 1]), slice(edges[k] * count, edges[k + 1] * count)
        if own.start < own.stop:
            job.run(first[own] if len(first) > 1 else first, goals[own], found[rows], said[rows])

    if threads == 1:
        part(0)
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(part, range(len(edges) - 1)))
    return found.reshape(n, count, nq), said.reshape(n, count, 5)


def _nearest(robot: Robot, first: FloatArray, found: FloatArray, said: FloatArray) -> None:
    """Put the answer nearest to q0 in front."""
    for i in range(len(found)):
        start = first[i if len(first) > 1 else 0]
        gaps = np.array([np.linalg.norm(robot.difference(start, q)) for q in found[i]])
        best = int(np.argmin(np.where(said[i, :, 0] > 0.0, gaps, np.inf)))
        found[i, 0], said[i, 0, :3] = found[i, best].copy(), said[i, best, :3].copy()
        said[i, 0, 3:] = said[i, :, 3:].max(axis=0)


def _answer(robot: Robot, bounds: FloatArray, q: FloatArray, said: FloatArray) -> InverseKinematics:
    at = q if robot.has_plain_coordinates else np.array([robot.coordinates(row) for row in q]).reshape(-1, robot.nv)
    free = robot.continuous
    inside = ((at >= bounds[0]) & (at <= bounds[1]) | free).all(axis=1)
    success = (said[:, 0] > 0.0) & inside
    tight = (((at == bounds[0]) | (at == bounds[1])) & ~free).any(axis=1)
    status = tuple(
        Reached.REACHED if ok else Reached.LIMITED if stuck else Reached.MISSED
        for ok, stuck in zip(success.tolist(), tight.tolist(), strict=True)
    )
    steps, attempts = said[:, 3].astype(np.int64), said[:, 4].astype(np.int64)
    return InverseKinematics(q.copy(), success, said[:, 1].copy(), said[:, 2].copy(), steps, attempts, status)


def _targets(value: Any) -> FloatArray:
    """(N, 12) poses; raises TargetError, NonFiniteError."""
    if isinstance(value, pin.SE3):
        value = value.homogeneous
    elif isinstance(value, (list, tuple)) and any(isinstance(pose, pin.SE3) for pose in value):
        value = [pose.homogeneous if isinstance(pose, pin.SE3) else pose for pose in value]
    try:
        poses = checks.floats("targets", value)
    except ShapeError as error:  # a path, a name, a list of unlike things: what is wanted here are poses
        reason = str(error).partition("; ")[0]
        raise TargetError(f"{reason}; expected a pose (pin.SE3 or 4x4), or (N, 4, 4) of them") from None
    if poses.shape == (4, 4):
        poses = poses[None]
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise TargetError(f"targets has shape {poses.shape}; expected a pose (pin.SE3 or 4x4), or (N, 4, 4) of them")
    i, j, k = (
        np.unravel_index(int(np.argmin(np.abs(poses) <= checks.LARGEST)), poses.shape) if poses.size else (0, 0, 0)
    )
    if poses.size and not abs(poses[i, j, k]) <= checks.LARGEST:
        checks.number(f"targets[{i}, {j}, {k}]", poses[i, j, k], low=-checks.LARGEST, high=checks.LARGEST)
    R = poses[:, :3, :3]
    off = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2))
    off = np.maximum(np.where(np.linalg.det(R) > 0.0, off, 1.0), np.abs(poses[:, 3] - _PATTERN).max(axis=1))
    if (off > 1e-6).any():
        i = int(np.argmax(off > 1e-6))
        raise TargetError(
            f"targets[{i}] is off a pose by {off[i]:.2g}; expected a rotation matrix, and the last row 0 0 0 1"
        )
    return np.concatenate([R.reshape(-1, 9), poses[:, :3, 3]], axis=1)


def _first(robot: Robot, q0: Any, n: int) -> FloatArray:
    """(0, nq), (1, nq) or (n, nq)."""
    if q0 is None:
        return np.zeros((0, robot.nq))
    given = checks.floats("q0", q0)
    rows = given[None] if given.ndim == 1 else given
    if rows.ndim != 2 or rows.shape[1] != robot.nq or len(rows) not in (1, n):
        raise ShapeError(f"q0 has shape {given.shape}; expected ({robot.nq},) or ({n}, {robot.nq})")
    return np.array([robot.check_configuration(row, f"q0[{i}]") for i, row in enumerate(rows)])


def _bounds(robot: Robot, limits: Limits | None) -> FloatArray:
    if limits is None:
        limits = robot.limits
    if not isinstance(limits, Limits):
        raise ParameterError(f"limits is a {type(limits).__name__}; expected Limits such as robot.limits, or None")
    if len(limits.position_lower) != robot.nv:
        raise ShapeError(f"limits have {len(limits.position_lower)} joints; expected {robot.nv} as {robot.name!r}")
    return np.array([limits.position_lower, limits.position_upper])


def _chain(tree: Tree, frame: FloatArray) -> Any:
    """(nv,) whether a joint moves the frame."""
    moves, j = np.zeros(tree.nv, dtype=bool), int(frame[0])
    while j >= 0:
        moves[j] = True
        j = int(tree.joints[j, 0])
    return moves


def _starts(robot: Robot, bounds: FloatArray, rng: np.random.Generator, moves: Any) -> FloatArray:
    """(K, nq) uniform inside the limits, +-pi or +-1 m about home where there are none; home where nothing moves."""
    home = np.clip(robot.coordinates(robot.home), *bounds)
    reach_of = np.array([1.0 if robot.is_prismatic(name) else np.pi for name in robot.single_joints])
    low = np.where(np.isfinite(bounds[0]), bounds[0], np.minimum(home, bounds[1]) - reach_of)
    high = np.where(np.isfinite(bounds[1]), bounds[1], np.maximum(home, low) + reach_of)
    drawn = np.where(moves, rng.uniform(low, high, (_STARTS, robot.nv)), home)
    if robot.has_plain_coordinates:
        return drawn
    return np.array([robot.integrate(robot.neutral, row) for row in drawn])
