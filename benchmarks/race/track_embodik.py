"""The tracking job by embodik: a frame task, a posture below it, position and velocity limits, its C++ from Python.

requires: embodik==0.23.2

It ranks tasks instead of weighing them and slows the first one where limits demand it; a task's weight is its gain.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import embodik
import numpy as np
from worker import job, serve

data = job()
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder, "robot.urdf")
    file.write_text(str(data["urdf"]))
    robot = embodik.RobotModel(str(file), floating_base=False)
dt, positions, home, rotation = float(data["dt"]), data["positions"], data["home"], data["rotation"]
solver = embodik.KinematicsSolver(robot)
solver.dt = dt
solver.set_tolerance(1e-3)  # as shipped it damps singular values below 0.1, which this path has, and strays
solver.enable_position_limits(True)
solver.enable_velocity_limits(True)
hand = solver.add_frame_task("hand", str(data["frame"]))
hand.priority, hand.weight = 0, 1.0 / dt
posture = solver.add_posture_task("posture")
posture.priority, posture.weight = 1, float(data["posture_gain"])
posture.set_target_configuration(home)


def work() -> dict:
    """As its examples write the loop."""
    q, every = home.copy(), [home]
    for k in range(len(positions) - 1):
        hand.set_target_pose(positions[k + 1], rotation)
        found = solver.solve_velocity(q, apply_limits=True)
        if found.status != embodik.SolverStatus.SUCCESS:
            raise RuntimeError(f"step {k}: {found.status} {found.status_message}")
        q = robot.integrate(q, found.joint_velocities, dt)
        every.append(q)
    return {"q": np.array(every), "steps": np.array(len(positions) - 1)}


serve(("embodik", "numpy"), work)
