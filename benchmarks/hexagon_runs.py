"""Six via positions for the hand of a KUKA LWR, straight lines between them at a constant speed.

The experiment of Flacco, De Luca & Khatib (ICRA 2012, T-RO 2015): limits, start and speeds are theirs, the positions
were not printed. Chosen here: the vertices of a regular hexagon, all as far from the shoulder as the hand is at the
start, which is vertex 0 at the top; visited in the order 2, 4, 1, 3, 5, 0, which makes the way 4.57 m long.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np

import cartctl as cc

START = np.deg2rad([0.0, 45.0, 45.0, 45.0, 0.0, 0.0, 0.0])
SHOULDER = np.array([0.0, 0.0, 0.3105])  # m
LENGTH = 4.57  # m, as the published times say
SPEEDS = (0.5, 1.0, 2.0, 4.0)  # m/s
METHODS = ("pinv", "task-scaling", "sns-greedy", "sns", "hqp")
DT, GAIN = 0.002, 100.0  # s, 1/s
ARRIVED = 1e-3  # m
PATIENCE = 15.0  # s


def via_positions() -> np.ndarray:
    """(7, 3): the start and the six positions, m."""
    robot = cc.load("lwr")
    arm = robot.state(START).placement(robot.tool).translation - SHOULDER
    radius = LENGTH / (4.0 * np.sqrt(3.0) + 3.0)  # four chords over two sides, one diameter, one side
    reach = np.linalg.norm(arm)
    tilt = np.arcsin(radius / reach)  # between the arm and the hexagon's axis
    sideways = np.cross(arm, [0.0, 0.0, 1.0])
    down = np.cross(arm / reach, sideways / np.linalg.norm(sideways))
    axis = np.cos(tilt) * arm / reach + np.sin(tilt) * down
    centre = SHOULDER + axis * np.sqrt(reach**2 - radius**2)
    first = (SHOULDER + arm - centre) / radius
    second = np.cross(axis, first)
    angles = np.deg2rad(60.0) * np.array([0, 2, 4, 1, 3, 5, 0])
    return centre + radius * (np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second)


class Straight:
    """Via positions (n, 3) at constant speed: t -> PathSample, at rest before and after."""

    def __init__(self, points: np.ndarray, speed: float) -> None:
        edges = np.diff(points, axis=0)
        lengths = np.linalg.norm(edges, axis=1)
        self.points, self.speed = points, speed
        self.directions = edges / lengths[:, None]
        self.at = np.concatenate([[0.0], np.cumsum(lengths)])  # m travelled at each point
        self.duration = self.at[-1] / speed

    def __call__(self, t: float) -> cc.PathSample:
        """The target at t seconds."""
        moving = 0.0 <= t < self.duration
        s = min(max(t, 0.0), self.duration) * self.speed
        k = min(int(np.searchsorted(self.at, s, side="right")) - 1, len(self.directions) - 1)
        twist = np.zeros(6)
        if moving:
            twist[:3] = self.speed * self.directions[k]
        return cc.PathSample(self.points[k] + (s - self.at[k]) * self.directions[k], None, twist, np.zeros(6))

    def distance(self, positions: np.ndarray) -> np.ndarray:
        """Of positions (N, 3) from the lines, (N,)."""
        gaps = []
        for start, direction, length in zip(self.points, self.directions, np.diff(self.at), strict=False):
            along = np.clip((positions - start) @ direction, 0.0, length)
            gaps.append(np.linalg.norm(positions - start - along[:, None] * direction, axis=1))
        return np.min(gaps, axis=0)


@dataclass
class Race:
    """completion: s, nan if not within PATIENCE. speeds, accelerations: (N,) shares of the limits."""

    completion: float
    off_path: float  # m, the largest
    speeds: np.ndarray
    accelerations: np.ndarray
    microseconds: float


def race(method: str, speed: float, accelerations: bool, dt: float = DT) -> Race:
    """One method at one tip speed; limits are lifted for one that honours none."""
    robot = cc.load("lwr")
    limits = own = robot.limits
    if not accelerations:
        limits = limits.replace(acceleration_lower=-np.inf, acceleration_upper=np.inf)
    path = Straight(via_positions(), speed)
    hand = cc.FrameTask(robot.tool, "position", target=path, gain=GAIN)
    made = cc.Controller(robot, hand, method, limits=None if method == "pinv" else limits, dt=dt)
    q, v, t, end = START, np.zeros(robot.nv), 0.0, path.points[-1]
    places, moves, times = [], [v], []
    while t < PATIENCE:
        begin = perf_counter()
        command = made.step(q, v, t)
        times.append(perf_counter() - begin)
        v = command.velocity
        q, t = robot.integrate(q, v * dt), t + dt
        places.append(robot.state(q).placement(robot.tool).translation)
        moves.append(v)
        if made.step_times[0] + dt >= path.duration - 1e-9 and np.linalg.norm(places[-1] - end) < ARRIVED:
            break
    arrived = t < PATIENCE
    change = np.diff(moves, axis=0) / dt
    pairs = ((moves[1:], own.velocity_upper), (change, own.acceleration_upper))
    shares = [(np.abs(a) / b).max(axis=1) for a, b in pairs]
    off = float(path.distance(np.array(places)).max())
    return Race(t if arrived else np.nan, off, *shares, 1e6 * float(np.median(times)))
