"""What a scene plays on: background, floor with shadows, light and a camera, for any size of robot."""

from __future__ import annotations

from typing import Any

import meshcat.geometry as mg
import numpy as np

from cartctl.report.camera import FOV, LIFT, MARGIN, View, view
from cartctl.report.elements import ShadowMaterial, Sun, lines
from cartctl.report.mesh import Array, to_bytes

SKY, HORIZON = (0.925, 0.945, 0.965), (0.76, 0.80, 0.84)  # RGB of the background
LOW = (1.17, 0.13)  # margin and lift in a picture so low that the player covers more of it
LINES = (0.42, 0.48, 0.55)  # RGB of the grid


class Stage:
    """Stands below ``points`` (n, 3) and looks at them.

    ``size`` (m) is the scale of what there is to see, ``view`` the camera, ``floor`` (m) the height of the ground.
    ``low``: the picture will be low and wide.
    """

    def __init__(self, points: Array, floor: float, low: bool = False) -> None:
        self.size = float(np.ptp(points, axis=0).max())
        self.floor = floor
        self.view: View = view(
            np.concatenate([points, points * [1, 1, 0] + [0, 0, floor]]), *(LOW if low else (MARGIN, LIFT))
        )

    def draw(self, visualizer: Any) -> None:
        """Send everything."""
        self._backdrop(visualizer)
        self._light(visualizer)

    def _backdrop(self, vis: Any) -> None:
        """Background, camera, and a grid that fades out, with the shadow of the robot on it."""
        look = self.view
        for path in ("/Grid", "/Axes"):
            vis[path].set_property("visible", False)
        vis["/Background"].set_property("top_color", list(SKY))
        vis["/Background"].set_property("bottom_color", list(HORIZON))
        vis.set_transform(translation(-look.center))  # the viewer's camera looks at, and turns about, the origin
        x, y, z = look.offset  # the viewer's camera lives in axes with y up
        vis["/Cameras/default/rotated/<object>"].set_property("position", [float(x), float(z), float(-y)])
        vis["/Cameras/default/rotated/<object>"].set_property("fov", FOV)
        under = np.array([look.center[0], look.center[1], self.floor - 1e-3 * self.size])
        vis["floor/grid"].set_object(_grid(under, self.size))
        shadow = ShadowMaterial(0, opacity=0.20, depthWrite=False, polygonOffset=True, polygonOffsetFactor=1)
        vis["floor/shadow"].set_object(mg.Box([4 * self.size] * 2 + [1e-6]), shadow)
        vis["floor/shadow"].set_transform(translation(under))

    def _light(self, vis: Any) -> None:
        """Replace the viewer's fixed lights by ones that suit any size of robot."""
        for name in ("SpotLight", "PointLightNegativeX", "PointLightPositiveX"):
            vis[f"/Lights/{name}"].set_property("visible", False)
        toward = self.view.offset / np.linalg.norm(self.view.offset)
        left = np.array([toward[1], -toward[0], 0.0])
        sun = 0.5 * toward + 0.35 * left + np.array([0.0, 0.0, 1.0])  # over the viewer's left shoulder
        reach = 1.2 * self.size
        vis["/Lights/Sun"].set_object(Sun(2 * reach * sun / np.linalg.norm(sun), reach, 0.44))
        vis["/Lights/FillLight/<object>"].set_property("position", (10 * (0.4 * toward - left)).tolist())
        vis["/Lights/FillLight/<object>"].set_property("intensity", 0.26)
        vis["/Lights/AmbientLight/<object>"].set_property("intensity", 0.44)


def translation(offset: Array) -> Array:
    """Return a homogeneous transform (4, 4) that moves by ``offset`` (3,)."""
    out = np.eye(4)
    out[:3, 3] = offset
    return out


def _grid(center: Array, size: float) -> Any:
    """Return a floor grid around ``center`` whose lines fade out; its step is 1, 2 or 5 times 10^k m."""
    step = size / 8
    decade = 10.0 ** np.floor(np.log10(step))
    step = decade * min((s for s in (1, 2, 5, 10)), key=lambda s: abs(np.log(s * decade / step)))
    count, pieces = int(np.ceil(1.7 * size / step)), 24
    start = np.round(center / step) * step * [1, 1, 0] + [0, 0, center[2]]
    across = step * np.arange(-count, count + 1)
    ends = np.linspace(-count * step, count * step, pieces * 2 + 1)
    a, b = np.meshgrid(across, np.repeat(ends, 2)[1:-1], indexing="ij")  # every line in short pieces
    flat = np.stack([np.concatenate([a.ravel(), b.ravel()]), np.concatenate([b.ravel(), a.ravel()])], axis=1)
    points = np.column_stack([flat, np.zeros(len(flat))]) + start
    fade = np.clip(1.0 - np.linalg.norm(flat, axis=1) / (count * step), 0.0, 1.0)
    return lines(points, to_bytes(np.column_stack([np.tile(LINES, (len(flat), 1)), 0.6 * fade])))
