"""The shapes of a robot, loaded only when somebody looks."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

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
            loaded = self._loaded[kind] = pin.buildGeomFromUrdfString(model, self._text, kind)
            for shape in loaded.geometryObjects if self._turn is not None else ():
                if shape.meshPath.lower().endswith(".dae"):
                    shape.placement = shape.placement * self._turn
        return self._loaded[kind]
