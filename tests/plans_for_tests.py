"""Settings and joint paths on which the parts of the planner are tried."""

from __future__ import annotations

import numpy as np

import cartctl as cc
from cartctl.wholepath.manifold import Projected, look
from cartctl.wholepath.planning import _setting
from cartctl.wholepath.setting import Setting
from cartctl.wholepath.trace import Trace


def circle(robot: cc.Robot, radius: float, period: float = 2.0, axes: str = "pose", q0=None) -> cc.FrameTask:
    """The tool on a circle that begins where it is at q0 (home if None)."""
    start = robot.state(robot.home if q0 is None else q0).placement(robot.tool)
    target = cc.Circle.starting_at(start, radius=radius, period=period)
    return cc.FrameTask(robot.tool, axes, target=target)


def setting(
    robot: cc.Robot, task, samples: int = 9, q0=None, closed: bool = False, rest: bool = True, **more
) -> Setting:
    return _setting(robot, task, None, samples, more.get("limits", robot.limits), closed, q0, rest)[0]


def unprojected(given: Setting, Q: np.ndarray) -> Trace:
    """A path as it is, on its task or not."""
    E, J = look(given, Q)
    return Trace(given, Projected(Q, E, J, np.ones(len(Q), dtype=bool)))


def wandering(given: Setting, rng: np.random.Generator, size: float = 0.15) -> np.ndarray:
    """A joint path (S, nq) near home, every sample somewhere else."""
    robot = given.robot
    Q = np.array([robot.integrate(robot.home, size * rng.normal(size=robot.nv)) for _ in range(given.size)])
    if given.closed:
        Q[-1] = Q[0]
    return Q
