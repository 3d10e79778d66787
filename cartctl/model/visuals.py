"""The shapes of a robot, loaded only when somebody looks."""

from __future__ import annotations

import pinocchio as pin


class Geometry:
    """Visual and collision shapes from a URDF text whose mesh paths are absolute."""

    def __init__(self, urdf_text: str) -> None:
        self._text = urdf_text
        self._loaded: dict[pin.GeometryType, pin.GeometryModel] = {}

    def visual(self, model: pin.Model) -> pin.GeometryModel:
        """The visual shapes, attached to the joints of ``model``."""
        return self._load(model, pin.GeometryType.VISUAL)

    def collision(self, model: pin.Model) -> pin.GeometryModel:
        """The collision shapes, attached to the joints of ``model``."""
        return self._load(model, pin.GeometryType.COLLISION)

    def _load(self, model: pin.Model, kind: pin.GeometryType) -> pin.GeometryModel:
        if kind not in self._loaded:
            self._loaded[kind] = pin.buildGeomFromUrdfString(model, self._text, kind)
        return self._loaded[kind]
