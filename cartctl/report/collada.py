"""Reading the coloured triangles out of a Collada file (.dae).

Only what a report needs: positions, polygons, the diffuse colour of each material, and the placement of each node.
Textures, lights, animations and every reference to another file are left out, so that a mesh from elsewhere can
neither read a file nor reach the network. Entities are refused by defusedxml.

Source: COLLADA 1.4.1 specification, Khronos 2008, chapter 5.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import defusedxml.ElementTree
import numpy as np

from cartctl.report.mesh import Array, IntArray, Mesh, merge

Element = Any  # xml.etree.ElementTree.Element, which defusedxml hands out untyped
GREY = (0.8, 0.8, 0.8)  # RGB where a material has a texture or nothing instead of a colour
NODES = 10_000  # visited at most: nodes may instance each other many times over, or in a circle


def read_collada(path: Path) -> Mesh:
    """Return the file's visual scene as one mesh in the file's own axes, scaled to metres.

    The up axis is ignored, as the URDF world does. Raises ValueError for a file without triangles or with
    contradictory indices, and what defusedxml raises for a malformed one.
    """
    return _Document(defusedxml.ElementTree.parse(path).getroot()).mesh()


class _Document:
    """A parsed file, its elements found by id."""

    def __init__(self, root: Element) -> None:
        for element in root.iter():
            element.tag = element.tag.rpartition("}")[2]
        self.root = root
        self.by_id = {e.get("id"): e for e in root.iter() if e.get("id")}

    def mesh(self) -> Mesh:
        """Join every instance of a geometry in the scene."""
        unit = self.root.find("asset/unit")
        scale = float(unit.get("meter", 1)) if unit is not None else 1.0
        world = np.diag([scale, scale, scale, 1.0])
        nodes = self.root.findall("library_visual_scenes/visual_scene/node")
        parts = [part for node, world in self.placed(nodes, world) for part in self.parts(node, world)]
        if not parts:
            raise ValueError("no triangles in the visual scene")
        return merge(parts)

    def placed(self, nodes: list[Element], world: Array) -> Iterator[tuple[Element, Array]]:
        """Yield every node below ``nodes``, instanced ones too, with its transform (4, 4) to the world."""
        waiting = [(node, world) for node in nodes]
        for _ in range(NODES):
            if not waiting:
                return
            node, parent = waiting.pop()
            world = parent @ _transform(node)
            yield node, world
            linked = [self.target(instance.get("url")) for instance in node.findall("instance_node")]
            waiting += [(child, world) for child in (*node.findall("node"), *linked)]
        raise ValueError(f"more than {NODES} nodes, or a circle of them")

    def parts(self, node: Element, world: Array) -> Iterator[Mesh]:
        """Yield the meshes that hang on one node."""
        for instance in node.findall("instance_geometry"):
            yield from (part.moved(world) for part in self.geometry(instance))

    def geometry(self, instance: Element) -> Iterator[Mesh]:
        """Yield the polygon groups of one instance, each in its material's colour."""
        mesh = self.target(instance.get("url")).find("mesh")
        bound = {m.get("symbol"): m.get("target") for m in instance.iter("instance_material")}
        for group in [] if mesh is None else mesh:
            if group.tag in ("triangles", "polylist", "polygons"):
                vertices, faces = self.polygons(mesh, group)
                if len(faces):
                    yield Mesh.painted(vertices, faces, self.color(bound.get(group.get("material"))))

    def polygons(self, mesh: Element, group: Element) -> tuple[Array, IntArray]:
        """Return the positions (n, 3) and triangles (k, 3) of one polygon group."""
        inputs = group.findall("input")
        stride = 1 + max(int(i.get("offset", 0)) for i in inputs)
        vertex = next(i for i in inputs if i.get("semantic") == "VERTEX")
        positions = next(i for i in self.target(vertex.get("source")) if i.get("semantic") == "POSITION")
        vertices = _numbers(self.target(positions.get("source")).find("float_array")).reshape(-1, 3)
        loops = [_integers(p).reshape(-1, stride)[:, int(vertex.get("offset", 0))] for p in group.findall("p")]
        if group.tag == "triangles":
            faces = np.concatenate([*loops, np.empty(0, dtype=np.int64)]).reshape(-1, 3)
        else:
            if group.tag == "polylist":
                loops = np.split(loops[0], np.cumsum(_integers(group.find("vcount")))[:-1]) if loops else []
            faces = _fans(loops)
        if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
            raise ValueError("a polygon names a vertex that is not there")
        return vertices, faces

    def color(self, material: str | None) -> tuple[float, ...]:
        """Return the diffuse colour (RGB) of a material, grey where it has none."""
        found = None if material is None else self.by_id.get(material.lstrip("#"))
        effect = None if found is None else found.find("instance_effect")
        if effect is None:
            return GREY
        diffuse = next(self.target(effect.get("url")).iter("diffuse"), None)
        color = None if diffuse is None else diffuse.find("color")
        return GREY if color is None else tuple(_numbers(color)[:3])

    def target(self, url: str | None) -> Element:
        """Return the element of this very document that ``url`` (#id) names."""
        if not url or url.lstrip("#") not in self.by_id:
            raise ValueError(f"dangling reference {url!r}")
        return self.by_id[url.lstrip("#")]


def _fans(loops: list[IntArray]) -> IntArray:
    """Cut polygons into triangles that share their first vertex."""
    fans = [np.stack([np.full(len(p) - 2, p[0]), p[1:-1], p[2:]], axis=1) for p in loops if len(p) > 2]
    return np.concatenate(fans) if fans else np.empty((0, 3), dtype=np.int64)


def _transform(node: Element) -> Array:
    """Multiply the node's own transforms (4, 4) in document order."""
    total = np.eye(4)
    for step in node:
        if step.tag == "matrix":
            total = total @ _numbers(step).reshape(4, 4)
        elif step.tag == "translate":
            total = total @ _homogeneous(np.eye(3), _numbers(step))
        elif step.tag == "scale":
            total = total @ _homogeneous(np.diag(_numbers(step)), np.zeros(3))
        elif step.tag == "rotate":
            x, y, z, degrees = _numbers(step)
            total = total @ _homogeneous(_rotation(np.array([x, y, z]), np.deg2rad(degrees)), np.zeros(3))
    return total


def _rotation(axis: Array, angle: float) -> Array:
    """Return Rodrigues' rotation matrix about ``axis`` (3,), which need not have unit length, by ``angle`` rad."""
    x, y, z = axis / max(float(np.linalg.norm(axis)), 1e-300)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)


def _homogeneous(linear: Array, translation: Array) -> Array:
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = linear, translation
    return out


def _numbers(element: Element) -> Array:
    """Read an element's text as floats; an absent or empty one has none."""
    values = np.array((element.text or "").split() if element is not None else [], dtype=float)
    if not np.isfinite(values).all():
        raise ValueError("a number that is not finite")
    return values


def _integers(element: Element) -> IntArray:
    """Read an element's text as integers; an absent or empty one has none."""
    return np.array((element.text or "").split() if element is not None else [], dtype=np.int64)
