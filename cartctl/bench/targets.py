"""From a target's table to a target: paths that begin where the frame is, in world axes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from cartctl import paths
from cartctl.checks import FloatArray


def make_target(spec: dict[str, Any], start: pin.SE3, *, turns: bool) -> Any:
    """The target of ``spec`` for a frame at ``start``; turns: whether the task has an orientation to keep.

    Raises PathError, ParameterError.
    """
    kind = spec["kind"]
    if kind == "hold":
        return None
    at, held = start.translation.copy(), start.rotation.copy()
    if kind in ("step", "point"):
        position = at + spec["offset"] if kind == "step" else np.array(spec["position"])
        return pin.SE3(held, position) if turns else position
    if kind == "turn":
        axis = np.array(spec["axis"]) / np.linalg.norm(spec["axis"])
        turned = pin.SE3(pin.exp3(spec["angle"] * axis) @ held, at)
        return paths.Waypoints([start, turned, start], duration=spec["period"], stop=True)
    origin = start if turns else at
    if kind == "circle":
        towards = None if spec["towards"] is None else np.array(spec["towards"])
        normal, period, laps = np.array(spec["normal"]), spec["period"], spec["laps"]
        return paths.Circle.starting_at(
            origin, spec["radius"], towards=towards, normal=normal, period=period, laps=laps
        )
    if kind == "line":
        corners = np.array([at, at + spec["offset"]])
        return paths.Polygon(
            corners, spec["laps"] * spec["period"], laps=spec["laps"], orientation=held if turns else None
        )
    return _through(spec, at, held, turns)


def _through(spec: dict[str, Any], at: FloatArray, held: FloatArray, turns: bool) -> Any:
    """Along several points, the start first."""
    corners = np.array([at, *(at + offset for offset in spec["offsets"])])
    orientation = held if turns else None
    if spec["kind"] == "polygon":
        laps = spec["laps"]
        return paths.Polygon(corners, laps * spec["period"], blend=spec["blend"], laps=laps, orientation=orientation)
    poses = [pin.SE3(held, corner) for corner in corners] if turns else list(corners)
    return paths.Waypoints(poses, duration=spec["period"], stop=spec["kind"] == "via")
