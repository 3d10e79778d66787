"""Compiled rollouts: many starts of one controller in one call, every step inside the limits and a number.

One start of each is stepped again by the controller, from the states that the compiled loop came through: the same
velocities, and now and then a certificate.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

import cartctl as cc
from soaking.loops import Loops, gathered, proven, rooms
from soaking.scenes import Scene, rolled_scene, start

STARTS, STEPS = 256, 250  # of one scene
_SAME = 1e-10  # of a joint's speed limit: what two ways to one velocity may differ by
_CERTIFIED = 50  # one of so many steps that are stepped again
_WRONG = ("FAILED", "RECOVERING")


def run(seed: int, first: int, seconds: float, scenes: int = 1 << 30, spoil: float = 0.0) -> tuple[Loops, int]:
    """Scenes first.. until the time is over or so many were made; and the next one's index."""
    return gathered(lambda index: Rolled(seed, index, spoil), f"--rollouts {seed}", first, seconds, scenes)


class Rolled:
    """One scene's starts being rolled out."""

    def __init__(self, seed: int, index: int, spoil: float = 0.0) -> None:
        self.scene, self.spoil = rolled_scene(seed, index), spoil
        self.rng = np.random.default_rng([seed, index, 3])
        self.made, self.certificates, self.worst, self.excess, self.size = 0, 0, 0.0, 0.0, 0.0
        self.statuses: Counter[str] = Counter()

    def run(self) -> str:
        """What went wrong, or nothing."""
        scene, controller = self.scene, self.scene.controller
        robot = controller.robot
        starts = np.array([scene.q, *(start(self.rng, robot, scene.limits) for _ in range(STARTS - 1))])
        batch = cc.simulate_batch(controller, starts, STEPS * controller.dt, history=True, threads=1)
        if batch.reason is not None:
            return f"not compiled: {batch.reason}"
        assert batch.q is not None and batch.v is not None
        if self.spoil:
            batch.v[:, 1:] += self.spoil
        self.made = STARTS * STEPS
        for name, counts in batch.statuses.items():
            self.statuses[name] += int(counts.sum())
        for name in _WRONG:
            if name in batch.statuses:
                at = int(np.argmax(batch.status.ravel() == name))
                return f"status {name} at step {at % STEPS} of start {at // STEPS}"
        return self._judged(scene, batch) or self._again(controller, batch)

    def _judged(self, scene: Scene, batch: cc.Batch) -> str:
        """Every step against the limits."""
        robot, dt = scene.controller.robot, scene.controller.dt
        if not (np.isfinite(batch.q).all() and np.isfinite(batch.v).all()):
            return "not a number"
        x = batch.q
        if robot.nq != robot.nv:
            x = np.array([[robot.coordinates(q) for q in own] for own in batch.q])
        low, high, room = rooms(scene)
        moved = (x, batch.v, np.diff(batch.v, axis=1) / dt)
        for k, name in enumerate(("position", "velocity", "acceleration")):
            over = np.maximum(low[k] - moved[k], moved[k] - high[k]) / room[k]
            worst = float(over.max())
            if worst > 1.0:
                self.size = worst
                at = np.unravel_index(int(over.argmax()), over.shape)
                return f"{name} outside at step {at[1]} of start {at[0]}"
            self.excess = max(self.excess, worst * 1e-9)
        return ""

    def _again(self, controller: cc.Controller, batch: cc.Batch) -> str:
        """One start again, by the controller's own steps from the same states."""
        b, dt = int(self.rng.integers(STARTS)), controller.dt
        asked = self.rng.random(STEPS) < 1.0 / _CERTIFIED
        same = _SAME * self.scene.limits.velocity_upper
        assert batch.q is not None and batch.v is not None
        controller.reset()
        for k in range(STEPS):
            command = controller.step(batch.q[b, k], batch.v[b, k], k * dt)
            apart = np.abs(command.velocity - batch.v[b, k + 1]) - same
            if not apart.max() <= 0.0:
                self.size = float(apart.max())
                return f"another velocity than the controller's at step {k} of start {b}"
            if asked[k]:
                what, size, checked = proven(command.solution)
                if what:
                    self.size = size
                    return f"{what} at step {k} of start {b}"
                self.certificates += checked
                self.worst = max(self.worst, size)
        return ""
