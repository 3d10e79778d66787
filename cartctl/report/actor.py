"""One run in a scene: the robot as it moves, and the paths of its hands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import meshcat.geometry as mg
import numpy as np
import pinocchio as pin

from cartctl.report import shapes
from cartctl.report.bodies import Body
from cartctl.report.elements import ghost, glow, solid
from cartctl.report.mesh import Array, IntArray, shade, weld
from cartctl.report.stage import translation
from cartctl.report.timeline import Timeline

if TYPE_CHECKING:
    from cartctl.motion.run import Run, TaskRecord

DESIRED = "#e69f00"  # Okabe & Ito's palette: told apart by colour-blind eyes too
NEUTRAL = "#4a5561"  # the same, where all colours stand for runs
SIDES = 8  # of a path's tube
GHOST = 0.35  # opacity


@dataclass
class Actor:
    """A run of which the samples ``shown`` are drawn; its paths in ``color``. The one of rank 0 is no ghost."""

    run: Run
    shown: IntArray
    color: str
    rank: int = 0

    def __post_init__(self) -> None:
        self.placements = _placements(self.run.robot.model, self.run.q[self.shown])
        self.records = [r for r in self.run.tasks if r.pose is not None and r.target is not None]

    def pose_as(self, configurations: Array) -> None:
        """Show the robot in other configurations (k, nq) than the run's."""
        self.placements = _placements(self.run.robot.model, configurations)

    def seen(self, robot: list[Body]) -> Array:
        """Return points (n, 3) that the robot reaches: some of its vertices at some of the frames."""
        found = [np.zeros((1, 3))]
        steps = np.unique(np.linspace(0, self.placements.shape[1] - 1, 16).astype(int))
        for body in robot:
            corners = body.mesh.vertices[:: max(len(body.mesh.vertices) // 100, 1)]
            for pose in self.placements[body.joint, steps]:
                placement = pin.XYZQUATToSE3(pose)
                found.append(corners @ placement.rotation.T + placement.translation)
        return np.concatenate(found)

    def paths(self) -> list[Array]:
        """Return the hands' paths and their targets', (N+1, 3) each."""
        return [p[:, :3] for r in self.records for p in (r.pose, r.target) if p is not None]

    def draw_robot(self, node: Any, still: Any, timeline: Timeline, robot: list[Body]) -> list[mg.Geometry]:
        """Draw each body at its joint, let it follow, and return what may be borrowed for copies.

        Below ``node``, or below ``still`` where the body stands on the ground.
        """
        drawn = [solid(shade(body.mesh), body.opacity) for body in robot]
        for index, (body, thing) in enumerate(zip(robot, drawn, strict=True)):
            self._body(node[str(index)] if body.joint else still[str(index)], timeline, body, thing)
        return [thing.geometry for thing in drawn]

    def draw_ghost(self, node: Any, timeline: Timeline, robot: list[Body], owners: list[mg.Geometry]) -> None:
        """Draw a translucent copy of the bodies that move; it casts no shadow."""
        paint = int(self.color[1:], 16)
        for index, (body, owner) in enumerate(zip(robot, owners, strict=True)):
            if body.joint:
                place = node[str(index)]
                self._body(place, timeline, body, ghost(owner, paint, GHOST * body.opacity, self.rank))
                place["<object>"].set_property("castShadow", False)

    def _body(self, node: Any, timeline: Timeline, body: Body, thing: Any) -> None:
        node.set_object(thing)
        track = self.placements[body.joint]
        node.set_transform(pin.XYZQUATToSE3(track[0]).homogeneous)
        if np.ptp(track, axis=0).any():
            timeline.move(node, track[:, :3], track[:, 3:])

    def draw_target(self, node: Any, timeline: Timeline, record: TaskRecord, size: float, color: str) -> None:
        """Draw a task's target with its whole path."""
        assert record.target is not None  # chosen so
        thick = 0.004 * size
        self._path(node["desired"], timeline, record.target[:, :3], thick, color, grow=False)
        target, marker = record.target[self.shown], node["target"]
        ball = shade(weld(shapes.sphere(2.4 * thick, rgb(color))))
        marker["ball"].set_object(glow(ball, 0.85, through=True))
        marker["ball/<object>"].set_property("renderOrder", 3)
        if target.shape[1] == 7:
            marker["axes"].set_object(solid(shade(weld(shapes.triad(0.09 * size)))))
        marker.set_transform(translation(target[0, :3]))
        timeline.move(marker, target[:, :3], target[:, 3:] if target.shape[1] == 7 else None)

    def draw_trace(self, node: Any, timeline: Timeline, record: TaskRecord, size: float) -> None:
        """Draw the path that was made, growing."""
        assert record.pose is not None
        self._path(node["traced"], timeline, record.pose[:, :3], 0.0052 * size, self.color, grow=True)

    def _path(self, node: Any, timeline: Timeline, points: Array, thick: float, color: str, grow: bool) -> None:
        """Draw the tube through ``points`` (N+1, 3), unless they stay where they are."""
        kept = spaced(points, 0.7 * thick)
        if len(kept) < 2:
            return
        mesh = shade(shapes.tube(points[kept], thick / 2, rgb(color), SIDES))
        passed = np.maximum(np.searchsorted(kept, self.shown, side="right") - 1, 0)
        last = 2 - 0.01 * self.rank if grow else 1  # the veils first, so that they tint nothing; the first run last
        for part, look, order in (
            ("veil", glow(mesh, 0.25, through=True), 0),
            ("line", glow(mesh, rank=self.rank), last),
        ):
            node[part].set_object(look)
            node[part]["<object>"].set_property("renderOrder", order)
            if grow:
                timeline.grow(node[part], 6 * SIDES * passed)


def spaced(points: Array, gap: float, most: int = 3000) -> IntArray:
    """Return indices of ``points`` (n, 3) at least ``gap`` (m) apart along the path, the first included.

    A path so long that more than ``most`` would remain gets a wider gap.
    """
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    gap = max(gap, length[-1] / most)
    return np.flatnonzero(np.diff(np.floor(length / gap), prepend=-1.0) > 0).astype(np.int64)


def rgb(color: str) -> Array:
    """Return "#rrggbb" as (3,) in [0, 1]."""
    return np.array([int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)])


def _placements(model: Any, configurations: Array) -> Array:
    """Return every joint's pose x y z qx qy qz qw, (njoints, k, 7), the universe first."""
    data = pin.Data(model)
    out = np.empty((model.njoints, len(configurations), 7))
    for k, q in enumerate(configurations):
        pin.forwardKinematics(model, data, q)
        for joint in range(model.njoints):
            out[joint, k] = pin.SE3ToXYZQUAT(data.oMi[joint])
    return out
