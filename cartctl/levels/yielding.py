"""What gives way where limits contradict each other, and in which order.

Torque bounds take room away from the accelerations that position, velocity and acceleration limits, and constraints,
count on. Where nothing keeps all of them, they yield in this order: constraints first, then acceleration (with jerk),
velocity, position; torque bounds never. Among what is missed, each class is missed by as little as those above it
allow, in the sense of least squares over its rows:

    min over u, one after the other, of ||position miss||, ||velocity miss||, ||acceleration miss||, ||constraint miss||
    subject to the torque bounds,

which ``hqp`` answers, one level a class. The bounds are then widened to what that u attains, and the problem, which now
has an answer, is solved as it was meant to be.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cartctl.algebra.problem import Inequality, Problem
from cartctl.algebra.solution import Solution
from cartctl.braking import approach
from cartctl.checks import FloatArray
from cartctl.constraints import Box
from cartctl.kernels import kernel
from cartctl.levels.bounds import JointBounds
from cartctl.solvers import solve

ORDER = ("constraints", "acceleration", "velocity", "position")  # torque never
MISSED = 1e-9  # of a row, relative to its entries: what counts as missed
_ROOM = 1e-8  # relative: widened bounds leave this much, so that round-off cannot close them


class Layer(NamedTuple):
    """One class of limits, ``lower <= C u <= upper``."""

    name: str
    C: FloatArray
    lower: FloatArray
    upper: FloatArray


class Widened(NamedTuple):
    """The problem that has an answer; one of its answers (n,); the classes that gave way, first the first to yield."""

    problem: Problem
    u: FloatArray
    yielded: tuple[str, ...]


def missed(solution: Solution) -> bool:
    """Whether an answer misses a row of the constraints by more than round-off."""
    rows = solution.problem.constraints
    return rows is not None and misses.compiled(*rows, solution.u)


@kernel("bool(matrix, vector, vector, vector)")
def misses(C: FloatArray, lower: FloatArray, upper: FloatArray, u: FloatArray) -> bool:
    """Whether some row of ``lower <= C u <= upper`` does not hold, up to round-off."""
    for i in range(C.shape[0]):
        at, size = 0.0, 1.0
        for j in range(C.shape[1]):
            at += C[i, j] * u[j]
            size += abs(C[i, j] * u[j])
        if lower[i] - at > MISSED * (size + abs(lower[i])) or at - upper[i] > MISSED * (size + abs(upper[i])):
            return True
    return False


def intervals(bounds: JointBounds, q: FloatArray, v: FloatArray, box: Box) -> dict[str, Box]:
    """What position, velocity and acceleration limits each ask of a (nv,), at coordinates q (nv,).

    A class is kept within what outranks it where nothing yields (:class:`JointBounds`): joints that are outside a limit
    come back at a bounded rate. box: all of them together; with jerk limits, the acceleration's.
    """
    limits, dt = bounds.limits, bounds.dt
    a = Box(limits.acceleration_lower, limits.acceleration_upper)
    speed = Box((limits.velocity_lower - v) / dt, (limits.velocity_upper - v) / dt)
    low, high = np.empty(len(q)), np.empty(len(q))
    for i, packed in enumerate(bounds.packed.T):
        if packed[10]:  # disabled: brakes
            low[i] = high[i] = 0.0
            continue
        p = q[i] + 0.5 * dt * v[i]
        high[i] = approach(packed[1] - p, -packed[4], packed[5], -packed[8], dt)
        low[i] = min(-approach(p - packed[0], packed[5], -packed[4], packed[9], dt), high[i])
    position = _within(_within(Box((low - v) / dt, (high - v) / dt), speed), a)
    return {"position": position, "velocity": _within(speed, a), "acceleration": box if bounds.jerk else a}


def widened(problem: Problem, layers: list[Layer], hard: Box | Layer | None) -> Widened:
    """``problem`` with the bounds that exclude each other widened; layers: from the last to yield to the first.

    hard: the torque bounds, rows or a box on u; they stay. All layers become rows.
    """
    levels: tuple[Any, ...] = tuple(Inequality(layer.C, layer.lower, layer.upper, layer.name) for layer in layers)
    least, most = hard if isinstance(hard, Box) else (None, None)
    blocks = [hard] if isinstance(hard, Layer) else []
    best = solve(Problem(levels, least, most, _stacked(blocks)), "hqp").u
    yielded = []
    for layer in layers:
        C, lower, upper = layer.C, layer.lower, layer.upper
        at, room = C @ best, _ROOM * _size(C, lower, upper, best)
        if (np.maximum(lower - at, at - upper) > room).any():
            yielded.append(layer.name)
        blocks.append(Layer(layer.name, C, np.minimum(lower, at - room), np.maximum(upper, at + room)))
    again = Problem.trusted(problem.equations, problem.metric, problem.reference, least, most, _stacked(blocks))
    return Widened(again, best, tuple(sorted(yielded, key=ORDER.index)))


def _stacked(blocks: list[Layer]) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    if not blocks:
        return None
    C, lower, upper = (np.concatenate(part) for part in zip(*(block[1:] for block in blocks), strict=True))
    return C, lower, upper


def _size(C: FloatArray, lower: FloatArray, upper: FloatArray, u: FloatArray) -> FloatArray:
    """What round-off of a row is relative to."""
    finite = np.where(np.isfinite(lower), np.abs(lower), 0.0) + np.where(np.isfinite(upper), np.abs(upper), 0.0)
    return 1.0 + np.abs(C) @ np.abs(u) + finite  # type: ignore[no-any-return]


def _within(box: Box, outer: Box) -> Box:
    """The interval, or where it lies outside, the end of the outer one that is nearest to it."""
    return Box(
        np.minimum(np.maximum(box.lower, outer.lower), outer.upper),
        np.minimum(np.maximum(box.upper, outer.lower), outer.upper),
    )
