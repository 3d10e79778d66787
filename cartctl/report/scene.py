"""Runs as a meshcat scene: the robots, their targets, the path of each hand, on one stage.

Everything is drawn through meshcat's ``Visualizer``, so the same scene could go to a live viewer; only the copies of a
robot's bodies borrow their geometry, which the page hands out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cartctl.report import surroundings
from cartctl.report.actor import DESIRED, NEUTRAL, Actor
from cartctl.report.bodies import bodies
from cartctl.report.palette import COLORS
from cartctl.report.stage import Stage
from cartctl.report.timeline import Timeline, frames, samples_at

if TYPE_CHECKING:
    from cartctl.motion.run import Run


class Scene:
    """Draws runs of one robot, the first as it is, the others as ghosts in their colours.

    ``colors``: "#rrggbb" of each run's paths and ghost. With several runs, each hangs below a node ``run<k>``, to be
    switched on and off. ``stage`` holds the camera that was chosen.
    """

    def __init__(self, runs: Sequence[Run], visualizer: Any, colors: Sequence[str] = COLORS[:1]) -> None:
        self.visualizer = visualizer
        longest = max(runs, key=lambda run: float(run.time[-1] - run.time[0]))
        moments = longest.time[frames(longest.time)] - longest.time[0]
        self.timeline = Timeline(moments)
        robot = runs[0].robot
        self.bodies = bodies(robot.model, robot.visual_model, robot.tool)
        self.actors = [
            Actor(run, samples_at(run.time, moments), color, rank)
            for rank, (run, color) in enumerate(zip(runs, colors, strict=True))
        ]
        self.records = self.actors[0].records
        reached = np.concatenate([actor.seen(self.bodies) for actor in self.actors])
        self.obstacles = runs[0].obstacles
        paths = [path for actor in self.actors for path in actor.paths()]
        points = np.concatenate([reached, *paths, surroundings.seen(self.obstacles, reached)])
        self.stage = Stage(points, floor=min(float(reached[:, 2].min()), 0.0), low=len(runs) > 1)

    def draw(self) -> None:
        """Send the whole scene, then the animation."""
        size = self.stage.size
        self.stage.draw(self.visualizer)
        desired = DESIRED if len(self.actors) == 1 else NEUTRAL
        surroundings.draw(
            self.visualizer["obstacles"], self.timeline, self.obstacles, self.actors[0].shown, self.stage.size
        )
        owners: list[Any] = []
        for actor in self.actors:
            node = self.visualizer[f"run{actor.rank}"] if len(self.actors) > 1 else self.visualizer
            if actor.rank == 0:
                owners = actor.draw_robot(node["robot"], self.visualizer["robot"], self.timeline, self.bodies)
            else:
                actor.draw_ghost(node["robot"], self.timeline, self.bodies, owners)
            for index, record in enumerate(actor.records):
                if actor.rank == 0:  # the same for all
                    actor.draw_target(self.visualizer[f"task{index}"], self.timeline, record, size, desired)
                actor.draw_trace(node[f"task{index}"], self.timeline, record, size)
        self.timeline.send(self.visualizer)
