"""A run as a meshcat scene: the robot, its targets, the path of each hand, a floor to stand on, light and a camera.

Everything is drawn through meshcat's ``Visualizer``, so the same scene could go to a live viewer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import meshcat.geometry as mg
import numpy as np
import pinocchio as pin

from cartctl.report import shapes
from cartctl.report.bodies import Body, bodies
from cartctl.report.camera import FOV, View, view
from cartctl.report.elements import ShadowMaterial, Sun, glow, lines, solid
from cartctl.report.mesh import Array, IntArray, shade, to_bytes, weld
from cartctl.report.timeline import Timeline, frames

if TYPE_CHECKING:
    from cartctl.motion.run import Run, TaskRecord

SKY, HORIZON = (0.925, 0.945, 0.965), (0.76, 0.80, 0.84)  # RGB of the background
LINES = (0.42, 0.48, 0.55)  # RGB of the grid
DESIRED = "#e69f00"  # Okabe & Ito's palette: told apart by colour-blind eyes too
TRACED = "#0072b2"
SIDES = 8  # of a path's tube


class Scene:
    """Draws one run; ``view`` is the camera that was chosen, ``size`` (m) the scale of what there is to see."""

    def __init__(self, run: Run, visualizer: Any) -> None:
        self.run, self.visualizer = run, visualizer
        self.shown: IntArray = frames(run.time)
        self.timeline = Timeline(run.time[self.shown])
        self.placements = _placements(run.robot.model, run.q[self.shown])
        self.bodies = bodies(run.robot.model, run.robot.visual_model, run.robot.tool)
        self.records = [r for r in run.tasks if r.pose is not None and r.target is not None]
        robot = _seen(self.bodies, self.placements)
        paths = [p[:, :3] for r in self.records for p in (r.pose, r.target) if p is not None]
        points = np.concatenate([robot, *paths])
        self.size = float(np.ptp(points, axis=0).max())
        self.floor = min(float(robot[:, 2].min()), 0.0)
        self.view: View = view(np.concatenate([points, points * [1, 1, 0] + [0, 0, self.floor]]))

    def draw(self) -> None:
        """Send the whole scene, then the animation."""
        self._backdrop()
        self._light()
        self._robot()
        for index, record in enumerate(self.records):
            self._task(self.visualizer[f"task{index}"], record)
        self.timeline.send(self.visualizer)

    def _backdrop(self) -> None:
        """Background, camera, and a grid that fades out, with the shadow of the robot on it."""
        vis, look = self.visualizer, self.view
        for path in ("/Grid", "/Axes"):
            vis[path].set_property("visible", False)
        vis["/Background"].set_property("top_color", list(SKY))
        vis["/Background"].set_property("bottom_color", list(HORIZON))
        vis.set_transform(_translation(-look.center))  # the viewer's camera looks at, and turns about, the origin
        x, y, z = look.offset  # the viewer's camera lives in axes with y up
        vis["/Cameras/default/rotated/<object>"].set_property("position", [float(x), float(z), float(-y)])
        vis["/Cameras/default/rotated/<object>"].set_property("fov", FOV)
        under = np.array([look.center[0], look.center[1], self.floor - 1e-3 * self.size])
        vis["floor/grid"].set_object(_grid(under, self.size))
        shadow = ShadowMaterial(0, opacity=0.20, depthWrite=False, polygonOffset=True, polygonOffsetFactor=1)
        vis["floor/shadow"].set_object(mg.Box([4 * self.size] * 2 + [1e-6]), shadow)
        vis["floor/shadow"].set_transform(_translation(under))

    def _light(self) -> None:
        """Replace the viewer's fixed lights by ones that suit any size of robot."""
        vis = self.visualizer
        for name in ("SpotLight", "PointLightNegativeX", "PointLightPositiveX"):
            vis[f"/Lights/{name}"].set_property("visible", False)
        toward = self.view.offset / np.linalg.norm(self.view.offset)
        left = np.array([toward[1], -toward[0], 0.0])
        sun = 0.5 * toward + 0.35 * left + np.array([0.0, 0.0, 1.0])  # over the viewer's left shoulder
        reach = 1.2 * self.size
        vis["/Lights/Sun"].set_object(Sun(2 * reach * sun / np.linalg.norm(sun), reach, 0.44))
        vis["/Lights/FillLight/<object>"].set_property("position", (10 * (0.4 * toward - left)).tolist())
        vis["/Lights/FillLight/<object>"].set_property("intensity", 0.26)
        vis["/Lights/AmbientLight/<object>"].set_property("intensity", 0.44)

    def _robot(self) -> None:
        """Draw each body at its joint and let it follow."""
        for index, body in enumerate(self.bodies):
            node = self.visualizer[f"robot/{index}"]
            node.set_object(solid(shade(body.mesh), body.opacity))
            track = self.placements[body.joint]
            node.set_transform(pin.XYZQUATToSE3(track[0]).homogeneous)
            if np.ptp(track, axis=0).any():
                self.timeline.move(node, track[:, :3], track[:, 3:])

    def _task(self, node: Any, record: TaskRecord) -> None:
        """Draw a task's target with its whole path, and the path that was made, growing."""
        assert record.pose is not None and record.target is not None  # chosen so
        thick = 0.004 * self.size
        self._path(node["desired"], record.target[:, :3], thick, DESIRED, grow=False)
        self._path(node["traced"], record.pose[:, :3], 1.3 * thick, TRACED, grow=True)
        target, marker = record.target[self.shown], node["target"]
        ball = shade(weld(shapes.sphere(2.4 * thick, _rgb(DESIRED))))
        marker["ball"].set_object(glow(ball, 0.85, through=True))
        marker["ball/<object>"].set_property("renderOrder", 3)
        if target.shape[1] == 7:
            marker["axes"].set_object(solid(shade(weld(shapes.triad(0.09 * self.size)))))
        marker.set_transform(_translation(target[0, :3]))
        self.timeline.move(marker, target[:, :3], target[:, 3:] if target.shape[1] == 7 else None)

    def _path(self, node: Any, points: Array, thick: float, color: str, grow: bool) -> None:
        """Draw the tube through ``points`` (N+1, 3), unless they stay where they are."""
        kept = spaced(points, 0.7 * thick)
        if len(kept) < 2:
            return
        mesh = shade(shapes.tube(points[kept], thick / 2, _rgb(color), SIDES))
        passed = np.maximum(np.searchsorted(kept, self.shown, side="right") - 1, 0)
        order = 2 if grow else 1  # the veils first, so that they tint nothing; the actual path last
        for part, look, rank in (("veil", glow(mesh, 0.25, through=True), 0), ("line", glow(mesh), order)):
            node[part].set_object(look)
            node[part]["<object>"].set_property("renderOrder", rank)
            if grow:
                self.timeline.grow(node[part], 6 * SIDES * passed)


def spaced(points: Array, gap: float, most: int = 3000) -> IntArray:
    """Return indices of ``points`` (n, 3) at least ``gap`` (m) apart along the path, the first included.

    A path so long that more than ``most`` would remain gets a wider gap.
    """
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    gap = max(gap, length[-1] / most)
    return np.flatnonzero(np.diff(np.floor(length / gap), prepend=-1.0) > 0).astype(np.int64)


def _placements(model: Any, configurations: Array) -> Array:
    """Return every joint's pose x y z qx qy qz qw, (njoints, k, 7), the universe first."""
    data = pin.Data(model)
    out = np.empty((model.njoints, len(configurations), 7))
    for k, q in enumerate(configurations):
        pin.forwardKinematics(model, data, q)
        for joint in range(model.njoints):
            out[joint, k] = pin.SE3ToXYZQUAT(data.oMi[joint])
    return out


def _seen(robot: list[Body], placements: Array) -> Array:
    """Return points (n, 3) that the robot reaches: some of its vertices at some of the frames."""
    found = [np.zeros((1, 3))]
    steps = np.unique(np.linspace(0, placements.shape[1] - 1, 16).astype(int))
    for body in robot:
        corners = body.mesh.vertices[:: max(len(body.mesh.vertices) // 100, 1)]
        for pose in placements[body.joint, steps]:
            placement = pin.XYZQUATToSE3(pose)
            found.append(corners @ placement.rotation.T + placement.translation)
    return np.concatenate(found)


def _grid(center: Array, size: float) -> Any:
    """Return a floor grid around ``center`` whose lines fade out; its step is 1, 2 or 5 times 10^k m."""
    step = size / 8
    decade = 10.0 ** np.floor(np.log10(step))
    step = decade * min((s for s in (1, 2, 5, 10)), key=lambda s: abs(np.log(s * decade / step)))
    count, pieces = int(np.ceil(1.7 * size / step)), 24
    start = np.round(center / step) * step * [1, 1, 0] + [0, 0, center[2]]
    across = step * np.arange(-count, count + 1)
    ends = np.linspace(-count * step, count * step, pieces * 2 + 1)
    a, b = np.meshgrid(across, np.repeat(ends, 2)[1:-1], indexing="ij")  # every line in short pieces
    flat = np.stack([np.concatenate([a.ravel(), b.ravel()]), np.concatenate([b.ravel(), a.ravel()])], axis=1)
    points = np.column_stack([flat, np.zeros(len(flat))]) + start
    fade = np.clip(1.0 - np.linalg.norm(flat, axis=1) / (count * step), 0.0, 1.0)
    return lines(points, to_bytes(np.column_stack([np.tile(LINES, (len(flat), 1)), 0.6 * fade])))


def _rgb(color: str) -> Array:
    return np.array([int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)])


def _translation(offset: Array) -> Array:
    out = np.eye(4)
    out[:3, 3] = offset
    return out
