"""What a rollout of the behaviour benchmark says about rest, limits and its scenario's own aim."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

if TYPE_CHECKING:
    from behaviour_runs import Trace

BEST = {"unreach": 1.787107, "unreach_pos": 1.574863}  # cost of the best reachable pose, distance of the position
_COUNTED = 1e-6  # of a joint's speed limit: slower is no motion that could reverse


class Figures:
    """Figures of a trace. dt: s; top, hardest: (7,) limits of speed and acceleration; lower, upper: (7,) of position.

    centre, radius: of the circle that ``circle1`` is held against.
    """

    def __init__(self, trace: Trace, dt: float, limits: object, centre: np.ndarray, radius: float) -> None:
        self.trace, self.dt = trace, dt
        self.top, self.hardest = limits.velocity_upper, limits.acceleration_upper
        self.lower, self.upper = limits.position_lower, limits.position_upper
        self.centre, self.radius = centre, radius
        offset = trace.hand[:, :3, 3] - trace.target[:, :3, 3]
        turns = [pin.log3(t[:3, :3] @ h[:3, :3].T) for t, h in zip(trace.target, trace.hand, strict=True)]
        self.distance, self.turn = np.linalg.norm(offset, axis=1), np.linalg.norm(turns, axis=1)
        self.cost = self.distance if trace.name == "unreach_pos" else np.hypot(self.distance, self.turn)

    @property
    def speeds(self) -> np.ndarray:
        """(N,) of the joint nearest to its limit, as a share of it."""
        return (np.abs(self.trace.v) / self.top).max(axis=1)

    @property
    def accelerations(self) -> np.ndarray:
        """(N,) of the joint nearest to its limit, or furthest beyond."""
        change = np.diff(np.vstack([np.zeros(self.top.size), self.trace.v]), axis=0)
        return (np.abs(change) / self.dt / self.hardest).max(axis=1)

    def flips(self, seconds: float = 2.0) -> int:
        """Joint sign reversals in the last seconds."""
        last = self.trace.v[-round(seconds / self.dt) :] / self.top
        turned = (last[1:] * last[:-1] < 0.0) & (np.minimum(abs(last[1:]), abs(last[:-1])) > _COUNTED)
        return int(turned.sum())

    @property
    def inside(self) -> float:
        """Seconds until all joints are within their position limits; inf if they never are."""
        within = self._excess <= 1e-12
        return float(np.argmax(within)) * self.dt if within.any() else np.inf

    @property
    def violation(self) -> float:
        """Rad beyond a position limit, from the first step inside on."""
        first = 0.0 if self.inside == np.inf else self.inside
        return max(0.0, float(self._excess[round(first / self.dt) :].max()))

    @property
    def _excess(self) -> np.ndarray:
        return np.maximum(self.trace.q - self.upper, self.lower - self.trace.q).max(axis=1)

    def own(self) -> dict[str, float]:
        """The scenario's own figures, by column.

        excess_cost: m and rad, above the best there is. inside_s: until inside
        the limits. error_mm, error_mrad: the largest while the target is within reach. path_mean_mm, path_max_mm:
        distance from the circle, turn_max_mrad from its orientation, after the ramp; rounds: how far it came, 7.5 on
        time. settled_s: from the jump until position and orientation stay within 1e-3 m and rad.
        """
        name, cost = self.trace.name, self.cost
        if name in BEST:
            return {"excess_cost": cost[-1] - BEST[name]}
        if name.startswith("out"):
            return {"inside_s": self.inside, "final_cost": cost[-1]}
        if name == "sing_over":
            feasible = np.r_[0:201, len(cost) - 250 : len(cost)]
            return {"error_mm": 1e3 * self.distance[feasible].max(), "error_mrad": 1e3 * self.turn[feasible].max()}
        if name == "circle1":
            return self._circle()
        late = np.flatnonzero(cost[100:] > 1e-3)  # the target jumps at step 100
        return {"settled_s": (int(late[-1]) + 1 if late.size else 0) * self.dt}

    def _circle(self) -> dict[str, float]:
        """After the ramp of 1 s."""
        after = slice(round(1.0 / self.dt), None)
        x, *plane = (self.trace.hand[after, :3, 3] - self.centre).T
        off = 1e3 * np.hypot(x, np.hypot(*plane) - self.radius)
        turned = 1e3 * self.turn[after]
        rounds = self.trace.own_time - 0.5  # phi/(2 pi) = t - 1/2 after the ramp
        return {"path_mean_mm": off.mean(), "path_max_mm": off.max(), "turn_max_mrad": turned.max(), "rounds": rounds}

    def row(self) -> dict[str, float | str]:
        """All of them."""
        counts = Counter(self.trace.statuses).most_common()
        return {
            "final_speed": self.speeds[-1],
            "flips": self.flips(),
            "reversals": self.flips(len(self.trace.v) * self.dt),
            "peak_speed": self.speeds.max(),
            "peak_acceleration": self.accelerations.max(),
            "violation_rad": self.violation,
            **self.own(),
            "statuses": " ".join(f"{n} {status}" for status, n in counts),
            "median_us": self.trace.microseconds,
        }
