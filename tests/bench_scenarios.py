"""Scenarios so short that a test can afford them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cartctl as cc

TIP = {"axes": "xy", "target": {"kind": "circle", "radius": 0.2, "period": 1.0}}
SOLVERS = ("pinv", "dls", "transpose")


def short(name: str = "short", robot: str = "planar3R", **changes: Any) -> cc.Scenario:
    """A few steps of a planar arm on a circle."""
    given: dict[str, Any] = {"duration": 0.1, "dt": 0.01, "limits": "none", "tasks": [TIP]}
    return cc.Scenario(name=name, robot=robot, **{**given, **changes})


def toml(path: Path, count: int = 3, duration: float = 0.1, more: str = "") -> Path:
    """A file of that many scenarios."""
    head = f'[defaults]\nrobot = "planar3R"\nduration = {duration}\ndt = 0.01\nlimits = "none"\n{more}'
    task = 'tasks = [{ axes = "xy", target = { kind = "circle", radius = 0.2, period = 1.0 } }]\n'
    path.write_text(head + "".join(f'\n[[scenario]]\nname = "c{k}"\n{task}' for k in range(count)))
    return path
