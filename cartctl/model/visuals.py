"""The shapes of a robot, loaded only when somebody looks."""

from __future__ import annotations

import warnings
from xml.etree.ElementTree import tostring

import coal
import numpy as np
import pinocchio as pin
from defusedxml import ElementTree as SafeTree

from cartctl.errors import CartctlWarning
from cartctl.model.console import console_of_c

_Y_TO_Z = pin.SE3(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), np.zeros(3))


class Geometry:
    """Visual and collision shapes from a URDF text whose mesh paths are absolute.

    collada_y_up: the robot's Collada files mean their up_axis Y_UP, which Pinocchio's mesh loader passes over.
    """

    def __init__(self, urdf_text: str, collada_y_up: bool = False) -> None:
        self._text = urdf_text
        self._turn = _Y_TO_Z if collada_y_up else None
        self._loaded: dict[pin.GeometryType, pin.GeometryModel] = {}

    def visual(self, model: pin.Model) -> pin.GeometryModel:
        """The visual shapes, attached to the joints of ``model``."""
        return self._load(model, pin.GeometryType.VISUAL)

    def collision(self, model: pin.Model) -> pin.GeometryModel:
        """The collision shapes, attached to the joints of ``model``."""
        return self._load(model, pin.GeometryType.COLLISION)

    def _load(self, model: pin.Model, kind: pin.GeometryType) -> pin.GeometryModel:
        if kind not in self._loaded:
            loaded = self._loaded[kind] = self._build(model, kind)
            for shape in loaded.geometryObjects if self._turn is not None else ():
                if shape.meshPath.lower().endswith(".dae"):
                    shape.placement = shape.placement * self._turn
        return self._loaded[kind]

    def _build(self, model: pin.Model, kind: pin.GeometryType) -> pin.GeometryModel:
        """All shapes, or those whose mesh files can be read, with one CartctlWarning for the others."""
        try:
            with console_of_c([]):
                return pin.buildGeomFromUrdfString(model, self._text, kind)
        except (ValueError, RuntimeError, MemoryError):
            text, broken = without_broken_meshes(self._text)
        warnings.warn(
            f"{model.name}: {len(broken)} mesh file(s) cannot be read, first {broken[:1]}; shown without these shapes",
            CartctlWarning,
            stacklevel=4,
        )
        return pin.buildGeomFromUrdfString(model, text, kind)


def without_broken_meshes(text: str) -> tuple[str, list[str]]:
    """A URDF text without the shapes whose mesh files the loader refuses, and the names of these files."""
    root = SafeTree.fromstring(text)
    broken: list[str] = []
    for link in root.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "").removeprefix("file://")
            try:
                with console_of_c([]):
                    coal.MeshLoader().load(name, np.ones(3))
            except (ValueError, RuntimeError, MemoryError):
                broken.append(name)
                link.remove(shape)
    return tostring(root, encoding="unicode"), broken
