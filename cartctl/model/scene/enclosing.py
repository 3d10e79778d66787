"""Meshes enclosed in few points: a subset of the hull's corners, with a radius that covers the others."""

from __future__ import annotations

import coal
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from cartctl.checks import FloatArray
from cartctl.model.scene.shapes import Shape, capsule, polytope, sphere

MOST = 32  # corners kept
CLOSE = 0.002  # m: a cover this thin is good enough
_FLAT = 1e-6  # m: thinner than this, a cloud of points has no inside
_POINT = coal.Sphere(0.0)


def enclosed(points: FloatArray, most: int = MOST, close: float = CLOSE) -> Shape:
    """A shape that holds all ``points`` (k, 3), m, with at most ``most`` corners and the smallest radius found.

    Corners are added where the farthest point outside is, until all are within ``close``; the radius is what is left.
    """
    points = np.unique(np.asarray(points, dtype=np.float64).reshape(-1, 3), axis=0)
    if np.linalg.matrix_rank(points - points.mean(axis=0), tol=_FLAT) < 3:
        return _flat(points)
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:
        return _flat(points)
    if len(corners) <= most:
        return polytope(corners)
    kept = _spread(corners)
    while True:
        shape = polytope(corners[kept])
        away = np.array([_outside(shape, corner) for corner in corners])
        away[kept] = 0.0
        if len(kept) >= most or away.max() <= close:
            return polytope(corners[kept], float(away.max()))
        kept.append(int(away.argmax()))


def _spread(corners: FloatArray) -> list[int]:
    """Indices of corners that span a volume: the extremes along the principal axes."""
    axes = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)[2]
    along = corners @ axes.T
    kept = list(dict.fromkeys([*along.argmin(axis=0).tolist(), *along.argmax(axis=0).tolist()]))
    while np.linalg.matrix_rank(corners[kept] - corners[kept[0]], tol=_FLAT) < 3:
        kept.append(int(next(k for k in range(len(corners)) if k not in kept)))
    return kept


def _outside(shape: Shape, point: FloatArray) -> float:
    """How far a point is outside a shape, m; 0 inside."""
    result = coal.DistanceResult()
    place = coal.Transform3s(np.eye(3), point)
    return max(0.0, float(coal.distance(shape.coal, coal.Transform3s.Identity(), _POINT, place, _REQUEST, result)))


def _request() -> coal.DistanceRequest:
    request = coal.DistanceRequest()
    request.gjk_tolerance = 1e-9
    return request


_REQUEST = _request()


def _flat(points: FloatArray) -> Shape:
    """Points on one plane or line, or one point: three of them, or a thin body about them."""
    if len(points) == 1:
        return Shape(points, 0.0, sphere(0.0).coal) if not points.any() else _thick(points)
    if len(points) == 3:
        return polytope(points)
    return _thick(points)


def _thick(points: FloatArray) -> Shape:
    """The hull of small cubes about the points: 2 um wider than they are."""
    cube = _FLAT * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return polytope(_hull_corners((points[:, None] + cube).reshape(-1, 3)))


def _hull_corners(points: FloatArray) -> FloatArray:
    corners: FloatArray = points[ConvexHull(points).vertices]
    return corners


def fitted_capsule(start: FloatArray, end: FloatArray, radius: float) -> tuple[Shape, FloatArray, FloatArray]:
    """A capsule from ``start`` to ``end`` (3,), with its rotation (3, 3) and middle (3,)."""
    along = end - start
    length = float(np.linalg.norm(along))
    z = along / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x = x / np.linalg.norm(x)
    return capsule(radius, length), np.stack([x, np.cross(z, x), z], axis=1), 0.5 * (start + end)
