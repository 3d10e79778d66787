"""What the viewer understands (three.js JSON), for the things meshcat's own classes lack.

A mesh with normals and colours in bytes, the floor that shows nothing but shadows, and the light that casts them.
Array types are MessagePack extensions, as the viewer's decoder names them.
"""

from __future__ import annotations

from typing import Any

import meshcat.geometry as mg
import numpy as np
import umsgpack
from numpy.typing import NDArray

from cartctl.report.mesh import Array, Shaded

_KINDS = {"int8": ("Int8Array", 0x11), "uint8": ("Uint8Array", 0x12), "uint16": ("Uint16Array", 0x14),
          "uint32": ("Uint32Array", 0x16), "float32": ("Float32Array", 0x17)}  # fmt: skip


def packed(array: NDArray[Any], normalized: bool = False) -> dict[str, Any]:
    """Lower rows of ``array`` (n, k) or a flat index (n,) to a buffer attribute."""
    name, code = _KINDS[array.dtype.name]
    size = 1 if array.ndim == 1 else array.shape[1]
    return {"itemSize": size, "type": name, "array": umsgpack.Ext(code, array.tobytes()), "normalized": normalized}


class ShadedGeometry(mg.Geometry):  # type: ignore[misc]
    """A mesh with its own normals and colours, 18 bytes a vertex."""

    def __init__(self, mesh: Shaded) -> None:
        super().__init__()
        self.mesh = mesh

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:
        """Return the viewer's BufferGeometry."""
        mesh = self.mesh
        index = mesh.faces.ravel().astype(np.uint16 if len(mesh.vertices) < 2**16 else np.uint32)
        attributes = {
            "position": packed(mesh.vertices.astype(np.float32)),
            "normal": packed(np.rint(127 * mesh.normals).astype(np.int8), normalized=True),
            "color": packed(mesh.colors, normalized=True),
        }
        data = {"attributes": attributes, "index": packed(index)}
        return {"uuid": self.uuid, "type": "BufferGeometry", "data": data}


class BorrowedGeometry(mg.Geometry):  # type: ignore[misc]
    """The geometry of another object; the page lends it, so that a copy costs no bytes and no graphics memory."""

    def __init__(self, owner: mg.Geometry) -> None:
        super().__init__()
        self.owner = owner

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:
        """Return an empty BufferGeometry that names the one to put in its place."""
        borrowed = {"borrows": self.owner.uuid}
        return {"uuid": self.uuid, "type": "BufferGeometry", "data": {"attributes": {}}, "userData": borrowed}


def ghost(owner: mg.Geometry, color: int, opacity: float, rank: int) -> Any:
    """Return a drawable translucent copy of what ``owner`` shows, in one colour (0xRRGGBB).

    Where copies coincide with it and with each other, the one of the lowest ``rank`` (the owner's is 0) is seen.
    """
    material = mg.MeshPhongMaterial(
        color=color, opacity=opacity, transparent=True, specular=0x1C1C1C, shininess=35, **_behind(rank)
    )
    return mg.Mesh(BorrowedGeometry(owner), material)


def _behind(rank: int) -> dict[str, Any]:
    return {"polygonOffset": True, "polygonOffsetFactor": rank, "polygonOffsetUnits": 4 * rank} if rank else {}


def solid(mesh: Shaded, opacity: float = 1.0) -> Any:
    """Return a drawable object with a matt surface in the mesh's own colours."""
    material = mg.MeshPhongMaterial(vertexColors=True, opacity=opacity, specular=0x1C1C1C, shininess=35)
    return mg.Mesh(ShadedGeometry(mesh), material)


def glow(mesh: Shaded, opacity: float = 1.0, through: bool = False, rank: int = 0) -> Any:
    """Return a drawable object that no light changes: markers and paths keep the colour of the legend.

    ``through=True`` shows it even where something stands in front. All of them are drawn after the solid things, in
    the order of their nodes' ``renderOrder``. ``rank``: as of a :func:`ghost`.
    """
    material = mg.MeshBasicMaterial(
        vertexColors=True, opacity=opacity, depthTest=not through, transparent=True, **_behind(rank)
    )
    return mg.Mesh(ShadedGeometry(mesh), material)


class LineGeometry(mg.Geometry):  # type: ignore[misc]
    """Pairs of ``points`` (2k, 3) with colours (2k, 4), RGBA in bytes."""

    def __init__(self, points: Array, colors: NDArray[np.uint8]) -> None:
        super().__init__()
        self.points, self.colors = points, colors

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:
        """Return the viewer's BufferGeometry."""
        attributes = {
            "position": packed(self.points.astype(np.float32)),
            "color": packed(self.colors, normalized=True),
        }
        return {"uuid": self.uuid, "type": "BufferGeometry", "data": {"attributes": attributes}}


def lines(points: Array, colors: NDArray[np.uint8]) -> Any:
    """Return line segments between pairs of ``points`` (2k, 3), translucent where their colours (2k, 4) are."""
    return mg.LineSegments(LineGeometry(points, colors), mg.LineBasicMaterial(vertexColors=True, transparent=True))


class ShadowMaterial(mg.GenericMaterial):  # type: ignore[misc]
    """Invisible but for the shadows that fall on it."""

    _type = "ShadowMaterial"


class Sun(mg.Object):  # type: ignore[misc]
    """Parallel light from ``position`` (3,) towards the world's origin, with shadows within ``reach`` m of it."""

    _type = "DirectionalLight"

    def __init__(self, position: Array, reach: float, intensity: float) -> None:
        super().__init__(None, None)
        self.position, self.reach, self.intensity = position, reach, intensity

    def lower(self) -> dict[str, Any]:
        """Return the light with the orthographic camera that renders its shadows."""
        r, far = self.reach, float(np.linalg.norm(self.position)) + self.reach
        camera = {"type": "OrthographicCamera", "left": -r, "right": r, "top": r,
                  "bottom": -r, "near": 0.01, "far": far}  # fmt: skip
        matrix = np.eye(4)
        matrix[3, :3] = self.position  # column-major, as three.js stores it
        shadow = {"camera": camera, "mapSize": [2048, 2048], "radius": 4.0, "bias": -2e-4, "normalBias": 0.01 * r / 2}
        light = {"uuid": self.uuid, "type": self._type, "color": 0xFFFFFF, "intensity": self.intensity,
                 "matrix": matrix.ravel().tolist(), "shadow": shadow}  # fmt: skip
        metadata = {"version": 4.5, "type": "Object"}
        return {"metadata": metadata, "geometries": [], "materials": [], "object": light}
