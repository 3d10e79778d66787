"""Runs as a meshcat scene: the robots, their targets, the path of each hand, on one stage.

Everything is drawn through meshcat's ``Visualizer``, so the same scene could go to a live viewer; only the copies of a
robot's bodies borrow their geometry, which the page hands out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cartctl.report import ellipsoids, surroundings
from cartctl.report.actor import DESIRED, NEUTRAL, Actor
from cartctl.report.bodies import bodies
from cartctl.report.lifting import ghost_postures as postures
from cartctl.report.palette import COLORS
from cartctl.report.stage import Stage
from cartctl.report.timeline import Timeline, frames, samples_at

if TYPE_CHECKING:
    from cartctl.motion.run import Run, TaskRecord

GHOST = COLORS[4]
GHOST_WORDS = (
    "The posture in which the arm would be now had its joints only followed the hand, by the least rates from the same "
    "start: without anything in the null space, and without limits"
)
ELLIPSOID_WORDS = {
    "velocity": "How fast the hand can move each way with joint rates of norm 1; 1 m of it is {unit} m/s",
    "force": "What force the hand can bear each way with joint torques of norm 1; 1 m of it is {unit} N, long axes are "
    "cut",
}


class Switch(NamedTuple):
    """Something that can be shown or hidden: ``paths`` of its nodes, whether it is on, and what it is."""

    label: str
    color: str
    paths: str
    on: bool
    words: str


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
        self.switches: list[Switch] = []
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
        self._draw_extras(owners, size)
        self.timeline.send(self.visualizer)

    def _draw_extras(self, owners: list[Any], size: float) -> None:
        """What can be switched on: the ghost and the ellipsoids of a run that has the page to itself."""
        traced = " ".join(f"task{index}/traced" for index in range(len(self.records)))
        if len(self.actors) > 1 or not len(self.timeline.keys) > 1:
            return
        if self.records:
            self.switches.append(Switch("trace", self.actors[0].color, traced, True, ""))
        (actor,) = self.actors
        ghosts = postures(actor.run, actor.shown)
        if ghosts is not None:
            other = Actor(actor.run, actor.shown, GHOST, 1)
            other.pose_as(ghosts)
            other.draw_ghost(self.visualizer["ghost"], self.timeline, self.bodies, owners)
            self.switches.append(Switch("ghost", GHOST, "ghost", False, GHOST_WORDS))
        hands = [r for r in self.records if r.frame is not None and r.pose is not None]
        if hands and actor.run.robot.nv:
            self._draw_ellipsoids(actor, hands, size)
        for switch in self.switches:
            for path in switch.paths.split():
                self.visualizer[path].set_property("visible", switch.on)

    def _draw_ellipsoids(self, actor: Actor, hands: list[TaskRecord], size: float) -> None:
        for index, record in enumerate(hands):
            assert record.pose is not None  # chosen so
            at = record.pose[actor.shown, :3]
            both = ellipsoids.shapes_of(actor.run, record, actor.shown, size)
            for name, shape, color in zip(
                ("velocity", "force"), both, (ellipsoids.VELOCITY, ellipsoids.FORCE), strict=True
            ):
                ellipsoids.draw(self.visualizer[f"{name}{index}"], self.timeline, shape, at, color)
        for name, shape, color in zip(
            ("velocity", "force"), both, (ellipsoids.VELOCITY, ellipsoids.FORCE), strict=True
        ):
            paths = " ".join(f"{name}{index}" for index in range(len(hands)))
            words = ELLIPSOID_WORDS[name].format(unit=f"{shape.unit:.2g}")
            self.switches.append(Switch(f"{name} ellipsoid", color, paths, False, words))
