"""What the live robot stands on and is seen against: floor, sky and the first view, as in the report."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.report.stage import HORIZON, SKY, Stage

_FOV, _ASIDE = 36.0, 0.09  # deg, vertical; shift of the view in its own distance
_ROOM = 1.3  # times the robot at home that is in the picture at first


def set_stage(server: Any, seen: FloatArray, size: float) -> None:
    """Set viser's ``server`` up for a robot whose points are ``seen`` (n, 3) and whose size is ``size``, m."""
    floor = min(float(seen[:, 2].min()), 0.0)
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    look = Stage(middle + _ROOM * (seen - middle), floor).view
    right = np.cross([0.0, 0.0, 1.0], look.offset)
    aside = _ASIDE * np.linalg.norm(look.offset) * right / np.linalg.norm(right)  # the panel covers the right side
    camera = server.initial_camera
    camera.fov = float(np.deg2rad(_FOV))
    camera.look_at, camera.position = tuple(look.center + aside), tuple(look.center + look.offset + aside)
    cell = 10.0 ** np.round(np.log10(size / 8.0))
    server.scene.add_grid(
        "/floor", infinite_grid=True, cell_size=cell, section_size=5 * cell, cell_color=(205, 212, 219),
        section_color=(176, 186, 196), fade_distance=7.0 * size, shadow_opacity=0.25,
        position=(0.0, 0.0, floor - 1e-3 * size),
    )  # fmt: skip
    server.scene.set_background_image(_sky())
    server.scene.world_axes.visible = False


def _sky() -> NDArray[np.uint8]:
    """A picture that goes from the sky's colour to the horizon's."""
    colors = np.linspace(SKY, HORIZON, 64)[:, None, :]
    return np.rint(255 * np.repeat(colors, 2, axis=1)).astype(np.uint8)
