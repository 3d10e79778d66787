"""What stood around the robot during a run: the obstacles of the scenes its controller minds, for pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from cartctl.checks import FloatArray
from cartctl.model.scene import Scene
from cartctl.model.scene.obstacles import Obstacle
from cartctl.model.state import State
from cartctl.objectives.weighted_sum import WeightedSum

if TYPE_CHECKING:
    from cartctl.motion.controller import Controller

_STILL = 1e-12  # m, and of a quaternion: what is no motion


@dataclass(eq=False)
class ObstacleRecord:
    """One obstacle over a run.

    points (k, 3) m, in its own axes: the corners of its convex parts, one part after the other, sizes (p,) of each;
    radii (p,) m about them. plane: whether it is all below z = 0 of its axes. pose: (N+1, 7) x y z qx qy qz qw in the
    world, or (1, 7) where it stood still.
    """

    name: str
    plane: bool
    points: FloatArray
    sizes: FloatArray
    radii: FloatArray
    pose: FloatArray


class Surroundings:
    """Notes where the obstacles are, sample by sample: those that are there at the first one."""

    def __init__(self, controller: Controller) -> None:
        self._scenes = list(_scenes(controller))
        self._known: list[tuple[Scene, Obstacle]] = []
        self._poses: list[list[FloatArray]] = []

    def see(self, state: State) -> None:
        """One more sample, at the time of the state; an obstacle that was taken away stays where it was."""
        if not self._poses:
            self._known = [(scene, obstacle) for scene in self._scenes for obstacle in scene.obstacles]
            self._poses = [[] for _ in self._known]
        for poses, (scene, first) in zip(self._poses, self._known, strict=True):
            now = next((o for o in scene.obstacles if o.name == first.name), None)
            if now is None:
                poses.append(poses[-1])
                continue
            pose = now.pose(state.time)
            if now.frame is not None:
                pose = state.placement(now.frame) * pose
            poses.append(np.array(pin.SE3ToXYZQUAT(pose)))

    def records(self, samples: int) -> list[ObstacleRecord]:
        """What was noted in the first ``samples``."""
        found = []
        for (_, obstacle), poses in zip(self._known, self._poses, strict=True):
            pose = np.array(poses[:samples]).reshape(-1, 7)
            if len(pose) and np.ptp(pose, axis=0).max() <= _STILL:
                pose = pose[:1]
            parts = obstacle.parts
            points, sizes = np.concatenate([p.points for p in parts]), np.array([float(len(p.points)) for p in parts])
            radii = np.array([p.radius for p in parts])
            found.append(ObstacleRecord(obstacle.name, parts[0].plane, points, sizes, radii, pose))
        return found


def _scenes(controller: Controller) -> Iterator[Scene]:
    """The scenes of its constraints, tasks and objectives, each once."""
    goal = controller.objective
    terms = [o for _, o in goal.terms] if isinstance(goal, WeightedSum) else [goal]
    seen: list[Scene] = []
    for thing in (*controller.constraints, *controller.tasks, *terms):
        scene = getattr(thing, "scene", None)
        if isinstance(scene, Scene) and not any(scene is other for other in seen):
            seen.append(scene)
            yield scene
