"""The robot as one mesh per moving body, from its visual model or, where there is none, from its joints alone."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import coal
import numpy as np

from cartctl.errors import CartctlWarning
from cartctl.report import shapes
from cartctl.report.collada import read_collada
from cartctl.report.mesh import Array, Mesh, merge, thin, weld

TRIANGLES = 200_000  # drawn at most: enough for every detail, and still fluent on a phone
DARKEST = 22.0  # of 255: what black becomes
LINK, JOINT = (0.93, 0.94, 0.95), (0.20, 0.28, 0.36)  # RGB of a robot without visuals


@dataclass(frozen=True)
class Body:
    """What one joint moves: its index in the model, and the mesh in the joint's frame.

    Parts seen through (``opacity`` < 1) are bodies of their own.
    """

    joint: int
    mesh: Mesh
    opacity: float = 1.0


def bodies(model: Any, visual_model: Any, tool: str | None = None) -> list[Body]:
    """Return the robot's bodies; a robot whose visuals are missing is drawn as capsules between its joints."""
    groups: dict[tuple[int, float], list[Mesh]] = {}
    for geometry in () if visual_model is None else visual_model.geometryObjects:
        opacity = float(np.clip(geometry.meshColor[3], 0.0, 1.0)) if geometry.overrideMaterial else 1.0
        mesh = None if opacity == 0 else surface(geometry)
        if mesh is not None and len(mesh.faces):
            moved = mesh.moved(geometry.placement.homogeneous)
            groups.setdefault((geometry.parentJoint, opacity), []).append(moved)
    if not groups:
        return skeleton(model, tool)
    welded = {key: lifted(weld(merge(parts))) for key, parts in groups.items()}
    total = sum(len(mesh.faces) for mesh in welded.values())
    if total > TRIANGLES:
        welded = {key: thin(mesh, len(mesh.faces) * TRIANGLES // total) for key, mesh in welded.items()}
    return [Body(joint, mesh, opacity) for (joint, opacity), mesh in welded.items() if len(mesh.faces)]


def lifted(mesh: Mesh) -> Mesh:
    """Return the mesh with its blacks raised to a dark grey, which light and shadow can still model."""
    return replace(mesh, colors=np.rint(DARKEST + mesh.colors * ((255 - DARKEST) / 255)).astype(np.uint8))


def surface(geometry: Any) -> Mesh | None:
    """Return one visual as a mesh in its own frame, or None for a kind that cannot be drawn (octrees, planes).

    A Collada mesh keeps the colours of its materials unless the URDF names one that is not black: exporters write
    black where they know of none.
    """
    shape, rgb = geometry.geometry, geometry.meshColor[:3]
    if isinstance(shape, coal.BVHModelBase):
        mesh = _triangles(shape.vertices(), shape.num_tris, shape.tri_indices, rgb)
        own = _own_colors(geometry, mesh) if not geometry.overrideMaterial or not np.any(rgb) else None
        return own or mesh
    if isinstance(shape, coal.ConvexBase):
        return _triangles(shape.points(), shape.num_polygons, shape.polygons, rgb)
    return _primitive(shape, rgb)


def _primitive(shape: Any, rgb: Array) -> Mesh | None:
    if isinstance(shape, coal.Box):
        return shapes.box(shape.halfSide, rgb)
    if isinstance(shape, coal.Sphere):
        return shapes.sphere(shape.radius, rgb)
    if isinstance(shape, coal.Ellipsoid):
        return shapes.sphere(1.0, rgb).scaled(shape.radii)
    for kind, build in ((coal.Cylinder, shapes.cylinder), (coal.Capsule, shapes.capsule), (coal.Cone, shapes.cone)):
        if isinstance(shape, kind):
            return build(shape.radius, shape.halfLength, rgb)
    return None


def _triangles(points: Array, count: int, triangle: Any, rgb: Array) -> Mesh:
    faces = [(t[0], t[1], t[2]) for t in map(triangle, range(count))]  # coal's triangles do not iterate
    return Mesh.painted(np.array(points), faces, rgb)


def _own_colors(geometry: Any, loaded: Mesh) -> Mesh | None:
    """Return the geometry's Collada file with its colours, or None if it disagrees with what Pinocchio loaded."""
    path = Path(geometry.meshPath)
    if path.suffix.lower() != ".dae" or not len(loaded.faces):
        return None
    try:
        mesh = read_collada(path).scaled(geometry.meshScale)
    except Exception as error:  # whatever is wrong with a stranger's file, its bare triangles still show
        warnings.warn(f"no colours from {path.name}: {error}", CartctlWarning, stacklevel=4)
        return None
    size = float(np.ptp(loaded.bounds(), axis=0).max())
    return mesh if np.allclose(mesh.bounds(), loaded.bounds(), rtol=0, atol=1e-3 * size) else None


def skeleton(model: Any, tool: str | None = None) -> list[Body]:
    """Draw a capsule from each joint to the next (and to the ``tool`` frame), and a knob on each axis."""
    spots = [(model.parents[j], model.jointPlacements[j].translation) for j in range(1, model.njoints)]
    if tool is not None and model.existFrame(tool):
        frame = model.frames[model.getFrameId(tool)]
        spots.append((frame.parentJoint, frame.placement.translation))
    lengths = [float(np.linalg.norm(spot)) for _, spot in spots]
    radius = 0.04 * max(sum(lengths) / max(len(lengths), 1), 0.02) + 0.02 * max(lengths, default=0.0)
    parts: dict[int, list[Mesh]] = {joint: list(_knobs(model, joint, radius)) for joint in range(1, model.njoints)}
    for (joint, spot), length in zip(spots, lengths, strict=True):
        if length > radius / 4:
            parts.setdefault(joint, []).append(shapes.segment(np.zeros(3), spot, 0.75 * radius, LINK))
    return [Body(joint, weld(merge(meshes))) for joint, meshes in parts.items() if meshes]


def _knobs(model: Any, joint: int, radius: float) -> Iterator[Mesh]:
    """Yield a cylinder about a revolute axis, a box about a prismatic one, a ball for anything else."""
    kind = model.joints[joint]
    if kind.nv != 1:
        yield shapes.sphere(1.3 * radius, JOINT)
        return
    subspace = kind.createData().S  # (6, 1), in the joint's frame, linear part first
    linear, angular = np.asarray(subspace).ravel()[:3], np.asarray(subspace).ravel()[3:]
    if np.linalg.norm(angular) > 0:
        yield shapes.cylinder(1.2 * radius, 1.3 * radius, JOINT).moved(shapes.along(angular))
    else:
        yield shapes.box(radius * np.array([0.9, 0.9, 2.2]), JOINT).moved(shapes.along(linear))
