"""Obstacles and links as convex parts, and the distances between them."""

from cartctl.model.scene.arranged import AroundItself, AroundScene
from cartctl.model.scene.arrangement import Arrangement, Contacts
from cartctl.model.scene.bodies import Part
from cartctl.model.scene.pairs import excluded, with_itself, with_scene
from cartctl.model.scene.scene import Scene

__all__ = [
    "AroundItself",
    "AroundScene",
    "Arrangement",
    "Contacts",
    "Part",
    "Scene",
    "excluded",
    "with_itself",
    "with_scene",
]
