"""Convex shapes as a few points with a radius about them: all that distances and their rows need to know.

A shape is the convex hull of ``points`` with a ball of ``radius`` about each of its points: a sphere is one point, a
capsule two, a box eight and no radius, a convex mesh its corners. Its extent along a direction n is ``max_i n . p_i +
radius``, so that "everything is behind a plane" is one condition a point. A cylinder is a prism of 24 sides about it
(0.9 % wider at its edges); a plane is a half-space, one point of its surface and its z axis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
from scipy.spatial import ConvexHull

from cartctl.checks import FloatArray

SIDES = 24  # of the prism about a cylinder


@dataclass(frozen=True, eq=False)
class Shape:
    """points (k, 3), m, in the shape's own axes; radius m; plane: whether it is a half-space below z = 0."""

    points: FloatArray
    radius: float
    coal: Any
    plane: bool = False

    @property
    def middle(self) -> FloatArray:
        """The middle of the box about the points, (3,)."""
        middle: FloatArray = 0.5 * (self.points.min(axis=0) + self.points.max(axis=0))
        return middle

    @property
    def half(self) -> FloatArray:
        """Half the sides of the box about the whole shape, (3,)."""
        half: FloatArray = 0.5 * np.ptp(self.points, axis=0) + self.radius
        return half

    @property
    def reach(self) -> float:
        """The radius of the ball about ``middle`` that holds the shape."""
        return float(np.linalg.norm(self.points - self.middle, axis=1).max()) + self.radius


def sphere(radius: float) -> Shape:
    """A ball about the origin; radius 0 is a point."""
    return Shape(np.zeros((1, 3)), radius, coal.Sphere(radius))


def capsule(radius: float, length: float) -> Shape:
    """Along z; length is that of its cylinder."""
    ends = np.array([[0.0, 0.0, -0.5 * length], [0.0, 0.0, 0.5 * length]])
    return Shape(ends, radius, coal.Capsule(radius, length))


def box(size: FloatArray) -> Shape:
    """About the origin, sides size (3,)."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    return Shape(corners, 0.0, coal.Box(*size))


def cylinder(radius: float, length: float) -> Shape:
    """Along z; a prism about it."""
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    wide = radius / np.cos(np.pi / SIDES)
    ring = np.column_stack([wide * np.cos(angle), wide * np.sin(angle), np.full(SIDES, 0.5 * length)])
    return polytope(np.concatenate([ring, ring * [1.0, 1.0, -1.0]]))


def plane() -> Shape:
    """All below z = 0 of its own axes."""
    return Shape(np.zeros((1, 3)), 0.0, coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), True)


def polytope(points: FloatArray, radius: float = 0.0) -> Shape:
    """The hull of ``points`` (k, 3) with a radius; flat ones, too: points, segments, polygons."""
    points = np.asarray(points, dtype=np.float64)
    geometry = _coal_convex(points)
    geometry.setSweptSphereRadius(radius)
    return Shape(points, radius, geometry)


def _coal_convex(points: FloatArray) -> Any:
    """Their hull; a triangle has two sides."""
    simplices = [[0, 1, 2], [0, 2, 1]] if len(points) == 3 else ConvexHull(points).simplices.tolist()
    faces = coal.StdVec_Triangle()
    for a, b, c in simplices:
        faces.append(coal.Triangle(a, b, c))
    corners = coal.StdVec_Vec3s()
    for point in points:
        corners.append(point)
    return coal.Convex(corners, faces)


def of_coal(geometry: Any, hull: Callable[[FloatArray], Shape]) -> Shape | None:
    """A coal geometry as a shape; ``hull`` encloses meshes. None for what is neither (octrees, height fields)."""
    if isinstance(geometry, coal.Box):
        return box(2.0 * np.array(geometry.halfSide))
    if isinstance(geometry, coal.Sphere):
        return sphere(float(geometry.radius))
    if isinstance(geometry, coal.Capsule):
        return capsule(float(geometry.radius), 2.0 * float(geometry.halfLength))
    if isinstance(geometry, coal.Cylinder):
        return cylinder(float(geometry.radius), 2.0 * float(geometry.halfLength))
    if isinstance(geometry, coal.BVHModelBase):
        return hull(np.array(geometry.vertices()))
    if isinstance(geometry, coal.ConvexBase):
        return hull(np.array(geometry.points()))
    return None
