"""Coloured triangle meshes as arrays, and their shading.

The robot's meshes come as bare triangles (STL, OBJ) or as Collada files with materials. Both become one kind of
mesh here, so that the page needs no mesh parser, loads no texture and stays small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

CREASE = np.deg2rad(35.0)  # rad; edges that bend further than this are drawn sharp


@dataclass(frozen=True)
class Mesh:
    """Triangles with one colour each.

    ``vertices`` (n, 3) in m, ``faces`` (k, 3) indices, ``colors`` (k, 3) uint8 RGB.
    """

    vertices: Array
    faces: IntArray
    colors: NDArray[np.uint8]

    @classmethod
    def painted(cls, vertices: ArrayLike, faces: ArrayLike, rgb: ArrayLike) -> Mesh:
        """Build a mesh in one colour, ``rgb`` (3,) in [0, 1]."""
        faces = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
        return cls(np.asarray(vertices, dtype=float), faces, np.tile(to_bytes(rgb), (len(faces), 1)))

    def moved(self, transform: Array) -> Mesh:
        """Return the mesh under a homogeneous ``transform`` (4, 4); a mirroring one keeps its outside out."""
        faces = self.faces[:, ::-1] if np.linalg.det(transform[:3, :3]) < 0 else self.faces
        return replace(self, vertices=self.vertices @ transform[:3, :3].T + transform[:3, 3], faces=faces)

    def scaled(self, factors: ArrayLike) -> Mesh:
        """Return the mesh stretched along its axes by ``factors`` (3,)."""
        return self.moved(np.diag([*np.asarray(factors, dtype=float), 1.0]))

    def bounds(self) -> Array:
        """Return the lowest and highest corner (2, 3) of the box around the used vertices."""
        used = self.vertices[self.faces.ravel()]
        return np.stack([used.min(axis=0), used.max(axis=0)])


@dataclass(frozen=True)
class Shaded:
    """A mesh ready to draw: a vertex wherever position, normal or colour change.

    ``vertices`` (n, 3) m, ``normals`` (n, 3) unit, ``colors`` (n, 3) uint8, ``faces`` (k, 3).
    """

    vertices: Array
    normals: Array
    colors: NDArray[np.uint8]
    faces: IntArray


def to_bytes(rgb: ArrayLike) -> NDArray[np.uint8]:
    """Convert colours in [0, 1] to bytes."""
    return np.asarray(np.rint(255 * np.clip(np.asarray(rgb, dtype=float), 0, 1)), dtype=np.uint8)


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Join meshes (at least one) into one."""
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + offset for m, offset in zip(meshes, offsets, strict=True)]),
        np.concatenate([m.colors for m in meshes]),
    )


def weld(mesh: Mesh, cell: float = 1e-6) -> Mesh:
    """Merge the vertices that share a grid cell of side ``cell`` (m) and drop triangles that collapse.

    With a tiny cell it joins the duplicates that file formats make; with a larger one it thins the mesh out.
    """
    # int32 keys: a coordinate beyond +-2^31 cells is no robot
    keys = np.ascontiguousarray(np.clip(np.rint(mesh.vertices / cell), -(2**31), 2**31 - 1).astype(np.int32))
    rows: Any = keys.view([("", np.int32)] * 3).ravel()
    _, first, index = np.unique(rows, return_index=True, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces]
    alive = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return Mesh(mesh.vertices[first], faces[alive], mesh.colors[alive])


def thin(mesh: Mesh, triangles: int) -> Mesh:
    """Weld ever more coarsely until at most ``triangles`` are left (or the cells reach 5 % of the size)."""
    size = float(np.ptp(mesh.vertices, axis=0).max(initial=0.0))
    cell = 5e-4 * size
    while len(mesh.faces) > triangles and cell < 0.05 * size:
        mesh, cell = weld(mesh, cell), 1.5 * cell
    return mesh


def shade(mesh: Mesh) -> Shaded:
    """Give a welded mesh its normals: smooth across flat edges, sharp across creases and colour borders.

    Two triangles that share an edge and bend by less than ``CREASE`` share their normals along it. The corners of
    all triangles form a graph with these ties; each connected component becomes one drawn vertex, whose normal is
    the area-weighted mean over the component.
    """
    faces, corners = mesh.faces, np.arange(3 * len(mesh.faces)).reshape(-1, 3)
    a, b, c = (mesh.vertices[faces[:, i]] for i in range(3))
    area = np.cross(b - a, c - a)  # (k, 3), length = twice the area
    first, second = _smooth_edges(mesh, area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300))
    graph = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(corners.size,) * 2)
    count, found = connected_components(graph, directed=False)
    label = np.asarray(found, dtype=np.int64)
    total = np.stack([np.bincount(label, np.repeat(area[:, i], 3), count) for i in range(3)], axis=1)
    normals: Array = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
    one = np.empty(count, dtype=np.int64)  # any corner of each component stands for its position and colour
    one[label] = corners.ravel()
    return Shaded(mesh.vertices[faces.ravel()[one]], normals, mesh.colors[one // 3], label.reshape(-1, 3))


def _smooth_edges(mesh: Mesh, normals: Array) -> tuple[IntArray, IntArray]:
    """Return pairs of corners (flat indices 3 face + i) that share a vertex across a smooth edge."""
    count = len(mesh.faces)
    tail, head = np.arange(3 * count), (np.arange(3 * count).reshape(-1, 3)[:, [1, 2, 0]]).ravel()
    start, end = mesh.faces.ravel()[tail], mesh.faces.ravel()[head]
    swap = start > end  # so that both triangles name the edge's ends in the same order
    low, high = np.where(swap, head, tail), np.where(swap, tail, head)
    key = np.minimum(start, end) * len(mesh.vertices) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    left, right = order[:-1], order[1:]
    f, g = left // 3, right // 3
    smooth = (key[left] == key[right]) & (np.einsum("ij,ij->i", normals[f], normals[g]) > np.cos(CREASE))
    smooth &= (mesh.colors[f] == mesh.colors[g]).all(axis=1)
    left, right = left[smooth], right[smooth]
    return np.concatenate([low[left], high[left]]), np.concatenate([low[right], high[right]])
