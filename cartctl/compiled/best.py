"""The self-motion of an answer, run down an objective: projected gradient steps, the pose restored after each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cartctl.algebra.nullspace import null_part
from cartctl.algebra.svd import norm, round_off, svd
from cartctl.checks import FloatArray
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective

_STEPS = 60
_FIRST, _LONGEST, _LEAST = 0.2, 0.5, 1e-4  # rad or m: a step's length
_FLAT = 1e-9  # of the gradient: what is left of it in the null space where the objective is extremal

Solve = Callable[[FloatArray, FloatArray, FloatArray, FloatArray], None]


def improved(
    robot: Robot,
    objective: Objective,
    frame: str,
    bounds: FloatArray,
    goals: FloatArray,
    found: FloatArray,
    said: FloatArray,
    solve: Solve,
) -> None:
    """Put the best answer to each target in front, its self-motion run to where the objective ends.

    found (N, c, nq), said (N, c, 5) as :mod:`reach_kernel` fills them; solve: one attempt of its, from a start (1, nq)
    to a target (1, 12).
    """
    state = State(robot)
    rest, sign = np.zeros(robot.nv), 1.0 if objective.maximise else -1.0

    def rate(q: FloatArray) -> float:
        state.set(q, rest)
        value = sign * float(objective.value(state))
        return value if np.isfinite(value) else -np.inf

    for i in range(len(found)):
        best = -np.inf
        for c in np.flatnonzero(said[i, :, 0]):
            q, s, value = _climb(
                robot, objective, frame, bounds, goals[i : i + 1], found[i, c], said[i, c], solve, rate
            )
            if value > best:
                best, chosen, errors = value, q, s[:3]
        if best > -np.inf:
            said[i, 0, 3:] = said[i, :, 3:].max(axis=0)
            found[i, 0], said[i, 0, :3] = chosen, errors


def _climb(
    robot: Robot,
    objective: Objective,
    frame: str,
    bounds: FloatArray,
    goal: FloatArray,
    q: FloatArray,
    s: FloatArray,
    solve: Solve,
    rate: Callable[[FloatArray], float],
) -> tuple[FloatArray, FloatArray, float]:
    q, s = np.array(q), np.array(s)
    value, length = rate(q), _FIRST
    found, said = np.zeros((1, robot.nq)), np.zeros((1, 5))
    for _ in range(_STEPS):
        way = _way(robot, objective, frame, bounds, q)
        if way is None or length < _LEAST:
            break
        solve(robot.integrate(q, way * length)[None], goal, found, said)
        risen = rate(found[0]) if said[0, 0] else -np.inf
        if risen > value:
            q, s, value, length = found[0].copy(), said[0].copy(), risen, min(1.5 * length, _LONGEST)
        else:
            length *= 0.5
    return q, s, value


def _way(robot: Robot, objective: Objective, frame: str, bounds: FloatArray, q: FloatArray) -> FloatArray | None:
    """A unit self-motion (nv,) along the objective's slope that leaves no limit, or None where there is none."""
    state = robot.state(q)
    slope = np.asarray(objective.direction(state), dtype=np.float64)
    J, at = np.array(state.jacobian(frame)), robot.coordinates(q)
    free = np.ones(robot.nv, dtype=bool)
    size = norm(slope)
    if not np.isfinite(size) or size == 0.0:
        return None
    for _ in range(robot.nv):
        A = np.asfortranarray(J * free)
        way = null_part(svd(A), round_off(J), slope * free) * free
        out = free & (((at <= bounds[0]) & (way < 0.0)) | ((at >= bounds[1]) & (way > 0.0)))
        if not out.any():
            break
        free &= ~out
    length = norm(way)
    return way / length if length > _FLAT * size else None
