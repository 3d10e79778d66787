"""The Robotics Toolbox for Python, as its users write the loop: pseudo-inverse, clipped rates; knows that package only.

Run as a script it reads the request from standard input and prints the answer as one line of JSON.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
import warnings
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np


def roll(request: dict[str, Any]) -> dict[str, Any]:
    """``v = pinv(J) (r_dot + K e)``, each rate clipped at its limit, each joint at its end."""
    import roboticstoolbox as rtb

    ets, mine, full = _chain(rtb, request)
    q, dt, gain = np.array(request["q0"]), request["dt"], request["gain"]
    rows = 3 if request["position_only"] else 6
    bounded = request["lower"] is not None
    full[mine] = q
    before = np.array(ets.fkine(full).A)
    path, times = [q.tolist()], []
    for target in map(_pose, request["targets"]):
        begun = perf_counter()
        full[mine] = q
        here = np.array(ets.fkine(full).A)
        twist = _error(before, here) * gain + _error(target, before) / dt
        rates = np.linalg.pinv(np.array(ets.jacob0(full))[:rows]) @ twist[:rows]
        v = np.zeros(len(q))
        v[[mine.index(joint.jindex) for joint in ets.joints()]] = rates
        if bounded:
            v = np.clip(v, -np.array(request["speed"]), request["speed"])
        q = q + dt * v
        if bounded:
            q = np.clip(q, request["lower"], request["upper"])
        times.append(perf_counter() - begun)
        before = target
        path.append(q.tolist())
    return {"q": path, "times": times, "version": rtb.__version__}


def _chain(rtb: Any, request: dict[str, Any]) -> tuple[Any, list[int], Any]:
    """The elementary transforms up to the frame, where the request's joints are, and a vector of all joints."""
    bare = re.sub(r"<(visual|collision)\b.*?</\1>", "", request["urdf"], flags=re.DOTALL)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file = Path(folder) / "robot.urdf"
        file.write_text(bare, encoding="utf-8")
        robot = rtb.Robot.URDF(str(file))
    place = {link._joint_name: link.jindex for link in robot.links if link.isjoint}
    full = np.zeros(robot.n)
    for name, value in request["locked"].items():
        if name in place:
            full[place[name]] = value
    return robot.ets(end=request["frame"]), [place[name] for name in request["joints"]], full


def _pose(target: list[float]) -> Any:
    """The pose (4, 4) of x y z qx qy qz qw."""
    x, y, z, w = target[3:]
    pose = np.eye(4)
    pose[:3, 3] = target[:3]
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return pose


def _error(wanted: Any, here: Any) -> Any:
    """From here to wanted, (6,): metres and the rotation vector in world axes."""
    R = wanted[:3, :3] @ here[:3, :3].T
    axis = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine, cosine = float(np.linalg.norm(axis)), 0.5 * (float(np.trace(R)) - 1.0)
    turn = axis if sine < 1e-12 else axis * (np.arctan2(sine, cosine) / sine)
    return np.concatenate([wanted[:3, 3] - here[:3, 3], turn])


if __name__ == "__main__":
    print(json.dumps(roll(json.load(sys.stdin))))
