"""The shapes a report draws, as meshes: primitives of a URDF, lines that have a thickness, markers.

WebGL draws every line one pixel wide, so paths are tubes and frames are arrows here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cartctl.report.mesh import Array, Mesh, merge

AXES = ((0.84, 0.15, 0.16), (0.17, 0.63, 0.17), (0.12, 0.38, 0.85))  # RGB of x, y, z
SIDES = 48  # of anything round


def box(half: ArrayLike, rgb: ArrayLike) -> Mesh:
    """Return a box about the origin with half sides ``half`` (3,) in m."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.asarray(half)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return Mesh.painted(corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), rgb)


def lathe(profile: ArrayLike, rgb: ArrayLike, sides: int = SIDES) -> Mesh:
    """Turn a profile (n, 2) of (radius, height) in m about the z axis, from the bottom up."""
    radius, height = np.asarray(profile, dtype=float).T
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    flat = radius[:, None, None] * ring
    vertices = np.concatenate([flat, np.broadcast_to(height[:, None, None], (*flat.shape[:2], 1))], axis=2)
    return Mesh.painted(vertices.reshape(-1, 3), _lattice(len(radius), sides), rgb)


def sphere(radius: float, rgb: ArrayLike) -> Mesh:
    """Return a sphere about the origin."""
    return capsule(radius, 0.0, rgb)


def capsule(radius: float, half_length: float, rgb: ArrayLike) -> Mesh:
    """Return a capsule along z; ``half_length`` is half that of its cylinder."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 26)
    side = np.where(np.arange(26) < 13, -half_length, half_length)
    return lathe(np.stack([radius * np.cos(angle), radius * np.sin(angle) + side], axis=1), rgb)


def cylinder(radius: float, half_length: float, rgb: ArrayLike) -> Mesh:
    """Return a closed cylinder along z."""
    h = half_length
    return lathe([(0, -h), (radius, -h), (radius, h), (0, h)], rgb)


def cone(radius: float, half_length: float, rgb: ArrayLike) -> Mesh:
    """Return a closed cone along z, its tip at +half_length."""
    return lathe([(0, -half_length), (radius, -half_length), (0, half_length)], rgb)


def triad(length: float) -> Mesh:
    """Return a frame's three axes as arrows, x red, y green, z blue."""
    r = 0.035 * length
    profile = [(0, 0), (r, 0), (r, 0.74 * length), (2.6 * r, 0.74 * length), (0, length)]
    return merge([lathe(profile, rgb, 16).moved(along(axis)) for axis, rgb in zip(np.eye(3), AXES, strict=True)])


def along(direction: ArrayLike, origin: ArrayLike = (0, 0, 0)) -> Array:
    """Return a transform (4, 4) that takes the z axis to ``direction`` (3,) and the origin to ``origin``."""
    z = np.asarray(direction, dtype=float)
    z = z / np.linalg.norm(z)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), origin
    return out


def segment(start: ArrayLike, end: ArrayLike, radius: float, rgb: ArrayLike) -> Mesh:
    """Return a capsule from ``start`` to ``end`` (3,), which must differ."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    return capsule(radius, float(np.linalg.norm(b - a)) / 2, rgb).moved(along(b - a, (a + b) / 2))


def tube(points: Array, radius: float, rgb: ArrayLike, sides: int = 8) -> Mesh:
    """Sweep a disc of ``radius`` along ``points`` (n >= 2, 3), no two neighbours equal.

    The triangles lie in the order of the points, ``2 sides`` between one point and the next, so that the first
    part of the list is the first part of the path.
    """
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-300)
    normal = np.empty_like(tangent)
    previous = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    for k, t in enumerate(tangent):  # carry one normal along, so that the tube does not twist
        projected = previous - (previous @ t) * t
        size = float(np.linalg.norm(projected))
        previous = projected / size if size > 1e-6 else along(t)[:3, 0]
        normal[k] = previous
    angle = 2 * np.pi * np.arange(sides) / sides
    binormal = np.cross(tangent, normal)
    ring = np.cos(angle)[:, None] * normal[:, None, :] + np.sin(angle)[:, None] * binormal[:, None, :]
    vertices = points[:, None, :] + radius * ring
    return Mesh.painted(vertices.reshape(-1, 3), _lattice(len(points), sides), rgb)


def _lattice(rings: int, sides: int) -> Array:
    """Return the triangles between consecutive rings of ``sides`` vertices, outside out."""
    start = sides * np.arange(rings - 1)[:, None]
    a, b = np.arange(sides)[None, :], (np.arange(sides)[None, :] + 1) % sides
    quads = np.stack([start + a, start + b, start + sides + b, start + sides + a], axis=-1)
    return np.asarray(np.stack([quads[..., [0, 1, 2]], quads[..., [0, 2, 3]]], axis=-2).reshape(-1, 3))
