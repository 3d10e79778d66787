"""The obstacles of a run in a scene: translucent, where they stand, or as they move."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from cartctl.report import shapes
from cartctl.report.elements import solid
from cartctl.report.mesh import Array, IntArray, Mesh, merge, shade, weld
from cartctl.report.timeline import Timeline

if TYPE_CHECKING:
    from cartctl.motion.surroundings import ObstacleRecord

RGB = (0.80, 0.36, 0.28)  # as the legend's
OPACITY, PLANE_OPACITY = 0.45, 0.12
_FAR = 2.0  # times the robot's reach: what is farther does not decide where the camera stands


def draw(visualizer: Any, timeline: Timeline, records: list[ObstacleRecord], shown: IntArray, size: float) -> None:
    """Draw each below a node of its own; shown: the samples of the frames; size: of the stage, m."""
    for index, record in enumerate(records):
        mesh = _mesh(record, size)
        if mesh is None or not len(record.pose):
            continue
        node = visualizer[str(index)]
        node.set_object(solid(shade(weld(mesh)), PLANE_OPACITY if record.plane else OPACITY))
        node["<object>"].set_property("castShadow", not record.plane)
        node.set_transform(pin.XYZQUATToSE3(record.pose[0]).homogeneous)
        if len(record.pose) > 1:
            track = record.pose[shown]
            timeline.move(node, track[:, :3], track[:, 3:])


def seen(records: list[ObstacleRecord], around: Array) -> Array:
    """Return corners (n, 3) of the obstacles near the points ``around`` (m, 3), at some of their samples."""
    middle, reach = around.mean(axis=0), float(np.ptp(around, axis=0).max())
    found = [np.zeros((0, 3))]
    for record in records:
        if record.plane:
            continue
        for k in np.unique(np.linspace(0, len(record.pose) - 1, 8).astype(int)):
            pose = pin.XYZQUATToSE3(record.pose[k])
            found.append(record.points @ pose.rotation.T + pose.translation)
    corners = np.concatenate(found)
    near: Array = corners[np.linalg.norm(corners - middle, axis=1) < _FAR * reach]
    return near


def _mesh(record: ObstacleRecord, size: float) -> Mesh | None:
    if record.plane:
        sheet = shapes.box([1.5 * size, 1.5 * size, 2e-3 * size], RGB)
        return sheet.moved(_lowered(2e-3 * size))
    parts = list(_parts(record))
    return merge(parts) if parts else None


def _parts(record: ObstacleRecord) -> Iterator[Mesh]:
    """Yield balls, capsules, triangles and hulls; a hull with a radius is drawn without it."""
    ends = np.cumsum(record.sizes).astype(int)
    for points, radius in zip(np.split(record.points, ends[:-1]), record.radii.tolist(), strict=True):
        if len(points) == 1 and radius > 0.0:
            yield shapes.sphere(radius, RGB).moved(_at(points[0]))
        elif len(points) == 2 and radius > 0.0:
            yield shapes.segment(points[0], points[1], radius, RGB)
        elif len(points) == 3:
            yield Mesh.painted(points, [[0, 1, 2], [0, 2, 1]], RGB)
        elif len(points) > 3:
            yield _hull(points)


def _hull(points: Array) -> Mesh:
    """Return the hull's triangles, outside out; flat ones with both sides."""
    try:
        hull = ConvexHull(points)
    except QhullError:  # in a plane
        hull = ConvexHull(points, qhull_options="QJ")
    faces = hull.simplices.copy()
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0.0
    faces[inwards] = faces[inwards][:, ::-1]
    return Mesh.painted(points, faces, RGB)


def _at(point: Array) -> Array:
    pose = np.eye(4)
    pose[:3, 3] = point
    return pose


def _lowered(depth: float) -> Array:
    return _at(np.array([0.0, 0.0, -depth]))
