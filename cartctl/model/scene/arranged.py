"""Arrangements for those who keep a scene for whatever robot comes: made once a robot, anew when the scene changes."""

from __future__ import annotations

from typing import Any

from cartctl.errors import ParameterError
from cartctl.model.robot import Robot
from cartctl.model.scene.arrangement import Arrangement
from cartctl.model.scene.pairs import with_itself, with_scene
from cartctl.model.scene.scene import Scene


class AroundScene:
    """A robot's links, or ``points``, against the obstacles of a scene; raises ParameterError for what is no Scene."""

    def __init__(self, scene: Scene, points: Any = None) -> None:
        if not isinstance(scene, Scene):
            raise ParameterError(f"scene is a {type(scene).__name__}; expected a cc.Scene")
        self._scene, self._points = scene, points
        self._known: tuple[Robot, int, Arrangement] | None = None

    def __call__(self, robot: Robot) -> Arrangement:
        """Of this robot and the scene as it is; raises FrameNotFound, ParameterError."""
        known = self._known
        if known is None or known[0] is not robot or known[1] != self._scene.version:
            known = self._known = (robot, self._scene.version, with_scene(robot, self._scene, self._points))
        return known[2]


class AroundItself:
    """A robot's links against each other, but for pairs that ``srdf`` (a file) disables."""

    def __init__(self, srdf: Any = None) -> None:
        self._srdf = srdf
        self._known: tuple[Robot, Arrangement] | None = None

    def __call__(self, robot: Robot) -> Arrangement:
        """Of this robot; raises UrdfError."""
        if self._known is None or self._known[0] is not robot:
            self._known = (robot, with_itself(robot, self._srdf))
        return self._known[1]
