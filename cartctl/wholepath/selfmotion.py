"""Curves of self-motion: all configurations that hold the task at one instant, where one degree of freedom is left.

From a configuration the curve is followed both ways along ker J, with Newton's method after each step, until it closes,
leaves the position limits, or turns singular. Random starts find the curves of other postures.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.model.limits import Limits
from cartctl.wholepath.manifold import kernels, newton
from cartctl.wholepath.setting import Setting

SPACING = 0.2  # rad or m between neighbours on a curve
_MOST = 60  # points of one curve


class Grid(NamedTuple):
    """Configurations Q (G, nq) at one sample, all on the task, and the curve each is on (G,)."""

    Q: FloatArray
    curve: NDArray[np.int64]


def inside(setting: Setting, Q: FloatArray) -> NDArray[np.bool_]:
    """Which configurations (G, nq) are within the position limits."""
    limits: Limits | None = setting.limits
    if limits is None or not len(Q):
        return np.ones(len(Q), dtype=bool)
    at = setting.coordinates(Q)
    room = 1e-9
    return np.asarray(((at >= limits.position_lower - room) & (at <= limits.position_upper + room)).all(axis=1))


def random_postures(setting: Setting, k: int, count: int, rng: np.random.Generator) -> FloatArray:
    """Configurations (G, nq) that hold the task at sample k, found from ``count`` random ones."""
    starts = np.array([setting.robot.random_configuration(rng) for _ in range(count)])
    found, met = newton(setting, k, starts)
    return found[met & inside(setting, found)]


def curves(setting: Setting, k: int, starts: FloatArray) -> Grid:
    """The self-motion curves through ``starts`` (G, nq) at sample k, each once."""
    robot = setting.robot
    points: list[FloatArray] = []
    labels: list[int] = []
    count = 0
    for q in starts:
        if points and _nearest(setting, np.array(points), q) < SPACING:
            continue
        curve = [q]
        for way in (1.0, -1.0):
            more, closed = _follow(setting, k, q, way)
            curve = [*reversed(more), *curve] if way < 0.0 else [*curve, *more]
            if closed:
                break
        points += curve
        labels += [count] * len(curve)
        count += 1
    if not points:
        return Grid(np.zeros((0, robot.nq)), np.zeros(0, dtype=np.int64))
    return Grid(np.array(points), np.array(labels, dtype=np.int64))


def _follow(setting: Setting, k: int, q0: FloatArray, way: float) -> tuple[list[FloatArray], bool]:
    """The points of a curve from q0 on, without it, and whether it came back to it."""
    robot, q, before = setting.robot, q0, None
    found: list[FloatArray] = []
    for _ in range(_MOST):
        setting.errors(k, q)
        Z = kernels(setting.jacobian()[None])[0]
        if Z.shape[1] != 1:
            break
        z = Z[:, 0]
        z = way * z if before is None else z * np.sign(z @ before or 1.0)
        stepped, met = newton(setting, k, robot.integrate(q, SPACING * z)[None])
        if not met[0] or not inside(setting, stepped)[0]:
            break
        step = robot.difference(q, stepped[0])
        if not 0.2 * SPACING < np.linalg.norm(step) < 3.0 * SPACING:
            break
        q, before = stepped[0], step
        if len(found) > 2 and setting.apart(q0, q) < 0.8 * SPACING:
            return found, True
        found.append(q)
    return found, False


def _nearest(setting: Setting, Q: FloatArray, q: FloatArray) -> float:
    if setting.robot.has_plain_coordinates:
        return float(np.linalg.norm(setting.shortest(Q - q), axis=1).min())
    return min(setting.apart(q, other) for other in Q)
