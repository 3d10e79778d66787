"""placo (kinematics as a quadratic program in C++) on a request of the bench; knows placo and numpy only.

Run as a script it reads the request from standard input and prints the answer as one line of JSON.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np


def roll(request: dict[str, Any]) -> dict[str, Any]:
    """A soft task, below it a posture of weight 1e-6 if asked for; joint and velocity limits where there are any."""
    import placo

    robot = _robot(placo, request)
    names = request["joints"]
    for name, value in zip(names, request["q0"], strict=True):
        robot.set_joint(name, value)
    if request["lower"] is not None:
        for name, low, high, speed in zip(names, request["lower"], request["upper"], request["speed"], strict=True):
            robot.set_joint_limits(name, low, high)
            robot.set_velocity_limit(name, speed)
    robot.update_kinematics()
    solver = placo.KinematicsSolver(robot)
    solver.mask_fbase(True)
    solver.dt = request["dt"]
    for name in robot.joint_names():
        if name not in names:
            solver.mask_dof(name)
    solver.enable_joint_limits(request["lower"] is not None)
    solver.enable_velocity_limits(request["lower"] is not None)
    first = _pose(request["targets"][0])
    if request["position_only"]:
        hand = solver.add_position_task(request["frame"], first[:3, 3])
    else:
        hand = solver.add_frame_task(request["frame"], first)
    hand.configure("hand", "soft", *((1.0,) if request["position_only"] else (1.0, 1.0)))
    if request["posture"]:
        posture = solver.add_joints_task()
        posture.set_joints(dict(zip(names, request["home"], strict=True)))
        posture.configure("posture", "soft", 1e-6)
    else:
        solver.add_regularization_task(1e-6)
    path, times = [list(request["q0"])], []
    for target in map(_pose, request["targets"]):
        begun = perf_counter()
        if request["position_only"]:
            hand.target_world = target[:3, 3]
        else:
            hand.T_world_frame = target
        solver.solve(True)
        robot.update_kinematics()
        times.append(perf_counter() - begun)
        path.append([robot.get_joint(name) for name in names])
    return {"q": path, "times": times, "version": version("placo")}


def _robot(placo: Any, request: dict[str, Any]) -> Any:
    bare = re.sub(r"<(visual|collision)\b.*?</\1>", "", request["urdf"], flags=re.DOTALL)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "robot.urdf").write_text(bare, encoding="utf-8")
        robot = placo.RobotWrapper(folder, placo.Flags.ignore_collisions)
    for name, value in request["locked"].items():
        if name in list(robot.joint_names()):
            robot.set_joint(name, value)
    return robot


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


if __name__ == "__main__":
    print(json.dumps(roll(json.load(sys.stdin))))
