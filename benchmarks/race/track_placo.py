"""The tracking job by placo: a frame and a posture task under joint and velocity limits, its C++ from a Python loop.

requires: placo==0.10.2 pin==3.8.0
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import placo
from worker import job, serve

data = job()
with tempfile.TemporaryDirectory() as folder:
    Path(folder, "robot.urdf").write_text(str(data["urdf"]))
    robot = placo.RobotWrapper(folder, placo.Flags.ignore_collisions)
dt, positions, home = float(data["dt"]), data["positions"], data["home"]
names = [str(name) for name in data["joints"]]
solver = placo.KinematicsSolver(robot)
solver.mask_fbase(True)
solver.enable_joint_limits(True)
solver.enable_velocity_limits(True)
solver.dt = dt
target = np.eye(4)
target[:3, :3] = data["rotation"]
hand = solver.add_frame_task(str(data["frame"]), target)
hand.configure("hand", "soft", 1.0, 1.0)
posture = solver.add_joints_task()
posture.set_joints(dict(zip(names, home.tolist(), strict=True)))
posture.configure("posture", "soft", 1e-6)


def work() -> dict:
    """As its examples write the loop."""
    for name, value in zip(names, home.tolist(), strict=True):
        robot.set_joint(name, value)
    robot.update_kinematics()
    every = [home]
    for k in range(len(positions) - 1):
        target[:3, 3] = positions[k + 1]
        hand.T_world_frame = target
        solver.solve(True)
        robot.update_kinematics()
        every.append(np.array(robot.state.q[7:]))
    return {"q": np.array(every), "steps": np.array(len(positions) - 1)}


serve(("placo", "pin", "numpy"), work)
sys.stdout.flush()
