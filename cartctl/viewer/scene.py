"""The robot in the browser: its bodies, a handle on each target, the hand's trace, what the hand is able to."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl.analysis import velocity_ellipsoid
from cartctl.checks import FloatArray
from cartctl.model.robot import Robot
from cartctl.report.actor import rgb
from cartctl.report.bodies import Body, bodies
from cartctl.report.mesh import shade
from cartctl.report.palette import COLORS
from cartctl.tasks import FrameTask
from cartctl.viewer.backdrop import set_stage

_TRACE, _GAP = 600, 2e-3  # points of the trace, and the m between two of them
_REACH = 0.25  # m drawn for 1 m/s of the velocity ellipsoid
_GREY = 26  # of 255: how much of a body's colours may differ without a mesh of its own


class Scene:
    """Draws ``robot`` into viser's ``server`` and gives each of ``tasks`` a handle at its hand's pose at q (nq,)."""

    def __init__(self, server: Any, robot: Robot, tasks: list[FrameTask], q: FloatArray) -> None:
        self._server, self._scene, self._robot = server, server.scene, robot
        self._data = pin.Data(robot.model)
        self._tasks = tasks
        parts = bodies(robot.model, robot.visual_model, robot.tool)
        pin.framesForwardKinematics(robot.model, self._data, q)
        seen = np.concatenate([np.zeros((1, 3)), *(_corners(body, self._data.oMi[body.joint]) for body in parts)])
        self.size = float(max(np.ptp(seen, axis=0).max(), 1e-2))
        self._joints = sorted({body.joint for body in parts})
        self._nodes = {j: self._scene.add_frame(f"/robot/{j}", show_axes=False) for j in self._joints}
        for index, body in enumerate(parts):
            self._body(index, body)
        # Where a task minds some of the world's axes only, its handle has the world's axes, too.
        self._offsets = [np.eye(3) if _own_axes(task) else np.array(self.pose(task).rotation) for task in tasks]
        self.handles = [self._handle(k, task) for k, task in enumerate(tasks)]
        self._hand = [deque[FloatArray](maxlen=_TRACE) for _ in tasks]
        self._lines: list[Any] = [None] * len(tasks)
        self.trace, self.ellipsoids = True, False
        self._ellipsoids = [self._ball(k) for k in range(len(tasks))]
        set_stage(server, seen, self.size)
        self.show(q)

    def _body(self, index: int, body: Body) -> None:
        """One mesh a colour: viser's know only one each."""
        mesh = shade(body.mesh)
        tone = mesh.colors[mesh.faces[:, 0]]
        for k, color in enumerate(np.unique(tone // _GREY, axis=0)):
            chosen = np.flatnonzero((tone // _GREY == color).all(axis=1))
            used, faces = np.unique(mesh.faces[chosen], return_inverse=True)
            self._scene.add_mesh_simple(
                f"/robot/{body.joint}/{index}-{k}", mesh.vertices[used].astype(np.float32), faces.reshape(-1, 3),
                color=tuple(int(c) for c in tone[chosen].mean(axis=0)),
                opacity=None if body.opacity == 1.0 else body.opacity, side="double",
            )  # fmt: skip

    def _handle(self, index: int, task: FrameTask) -> Any:
        """Arrows, planes and rings to drag; only those that the task controls."""
        rows = set(task.rows)
        pose = self.pose(task)
        return self._scene.add_transform_controls(
            f"/target{index}", scale=0.24 * self.size, line_width=3.0, depth_test=False,
            disable_rotations=not rows & {3, 4, 5}, active_axes=tuple(row in rows for row in (0, 1, 2)),
            position=tuple(pose.translation), wxyz=wxyz(pose.rotation @ self._offsets[index].T),
        )  # fmt: skip

    def _ball(self, index: int) -> Any:
        return self._scene.add_icosphere(
            f"/ellipsoid{index}", radius=1.0, subdivisions=4, color=_bytes(COLORS[2]), opacity=0.35, visible=False,
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def pose(self, task: FrameTask) -> pin.SE3:
        """Where the hand of ``task`` is."""
        return pin.SE3(self._data.oMf[self._robot.frame_id(task.frame)])

    def target(self, index: int) -> pin.SE3:
        """Where a handle is."""
        handle = self.handles[index]
        w, x, y, z = handle.wxyz
        rotation = pin.Quaternion(w, x, y, z).normalized().matrix() @ self._offsets[index]
        return pin.SE3(rotation, np.array(handle.position, dtype=np.float64))

    def put(self, index: int, pose: pin.SE3) -> None:
        """Move a handle."""
        self.handles[index].position = tuple(pose.translation)
        self.handles[index].wxyz = wxyz(pose.rotation @ self._offsets[index].T)

    def show(self, q: FloatArray) -> None:
        """Draw the robot at q (nq,)."""
        pin.framesForwardKinematics(self._robot.model, self._data, q)
        with self._server.atomic():
            for joint in self._joints:
                placed = self._data.oMi[joint]
                self._nodes[joint].position = tuple(placed.translation)
                self._nodes[joint].wxyz = wxyz(placed.rotation)
            for index, task in enumerate(self._tasks):
                at = np.array(self.pose(task).translation)
                points = self._hand[index]
                if not points or np.linalg.norm(at - points[-1]) > _GAP * self.size:
                    points.append(at)
                    self._draw_trace(index)
                self._ellipsoids[index].visible = self.ellipsoids
                if self.ellipsoids:
                    self._draw_ellipsoid(index, task, q, at)

    def _draw_trace(self, index: int) -> None:
        points = np.array(self._hand[index], dtype=np.float32)
        if not self.trace or len(points) < 2:
            if self._lines[index] is not None:
                self._lines[index].visible = False
            return
        pieces = np.stack([points[:-1], points[1:]], axis=1)
        self._lines[index] = self._scene.add_line_segments(
            f"/trace{index}", pieces, _bytes(COLORS[0]), thickness=0.005 * self.size
        )  # fmt: skip

    def _draw_ellipsoid(self, index: int, task: FrameTask, q: FloatArray, at: FloatArray) -> None:
        found = velocity_ellipsoid(self._robot.state(q).jacobian(task.frame)[:3])
        axes = found.axes * np.sign(np.linalg.det(found.axes))
        ball = self._ellipsoids[index]
        ball.scale = tuple(max(_REACH * float(length), 1e-3) for length in found.lengths)
        ball.position, ball.wxyz = tuple(at), wxyz(axes)


def wxyz(rotation: FloatArray) -> tuple[float, float, float, float]:
    """A rotation (3, 3) as viser's quaternion."""
    quaternion = pin.Quaternion(np.asarray(rotation))
    return float(quaternion.w), float(quaternion.x), float(quaternion.y), float(quaternion.z)


def _own_axes(task: FrameTask) -> bool:
    """Whether a task's handle may turn with the hand."""
    return len(task.rows) == 6 or task.expressed_in != "world"


def _corners(body: Body, placed: pin.SE3) -> FloatArray:
    """Some of a body's vertices in the world, (n, 3) m."""
    some = body.mesh.vertices[:: max(len(body.mesh.vertices) // 100, 1)]
    return np.asarray(some @ placed.rotation.T + placed.translation)


def _bytes(color: str) -> tuple[int, int, int]:
    r, g, b = (round(255 * float(c)) for c in rgb(color))
    return r, g, b
