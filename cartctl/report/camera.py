"""Where to look from, so that everything that moves fits into the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cartctl.report.mesh import Array

FOV = 32.0  # deg, vertical; a long lens keeps a robot's proportions
ASPECT = 1.6  # width over height of the window the distance is chosen for
MARGIN = 1.10  # room left around the picture
LIFT = 0.05  # share of half the window's height by which all is raised: the player lies below


@dataclass(frozen=True)
class View:
    """A camera at ``center + offset`` (m) looking at ``center``; ``aspect`` is the narrowest window that it fills."""

    center: Array
    offset: Array
    aspect: float


def view(points: Array, margin: float = MARGIN, lift: float = LIFT) -> View:
    """Return the closest view that shows all ``points`` (n, 3), with ``margin`` and ``lift`` as the constants above.

    With tan = tan(FOV / 2), a point at (x, y) across and z towards the camera is inside the picture from the
    distance D where |y| <= (D - z) tan and |x| <= (D - z) tan * aspect.
    """
    toward, right, up = _axes(np.ptp(points, axis=0))
    tan = np.tan(np.deg2rad(FOV) / 2)
    box = np.stack([points @ right, points @ up, points @ toward], axis=1)
    middle = (box.min(axis=0) + box.max(axis=0)) / 2
    x, y, z = np.abs(box[:, 0] - middle[0]), np.abs(box[:, 1] - middle[1]), box[:, 2] - middle[2]
    distance = float(max(margin * np.max(z + np.maximum(y, x / ASPECT) / tan), 0.05))
    aspect = margin * float(np.max(x / (distance - z))) / tan
    middle[1] -= lift * distance * tan
    return View(middle @ np.stack([right, up, toward]), distance * toward, max(aspect, 0.1))


def _axes(extent: Array) -> tuple[Array, Array, Array]:
    """Return towards the camera, right and up (3,): from the front right, or square onto a flat robot."""
    azimuth, elevation = np.deg2rad(-52.0), np.deg2rad(17.0)
    if extent[2] < 0.3 * max(extent[0], extent[1]):  # lies flat: look down on it
        azimuth, elevation = np.deg2rad(-90.0), np.deg2rad(52.0)
    elif extent[1] < 0.3 * extent[0]:  # stands in the x-z plane
        azimuth = np.deg2rad(-75.0)
    elif extent[0] < 0.3 * extent[1]:  # stands in the y-z plane
        azimuth = np.deg2rad(-15.0)
    toward = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    return toward, right, np.cross(toward, right)
