"""The tracking job by mink: a frame and a posture task, configuration and velocity limits, DAQP, on MuJoCo.

requires: mink==1.3.0 mujoco==4.0.0 qpsolvers==4.13.0 daqp==0.11.0

MuJoCo reads the URDF itself. A frame task there wants a body: links without a joint of their own are merged into their
parents unless told not to be, and joint speeds, which MuJoCo's model does not keep, are read from the job.
"""

from __future__ import annotations

import mink
import mujoco
import numpy as np
from worker import job, serve

data = job()
spec = mujoco.MjSpec.from_string(str(data["urdf"]))
spec.compiler.fusestatic = False
model = spec.compile()
dt, positions, home = float(data["dt"]), data["positions"], data["home"]
# a gain there is the share of the error made good in a step; what the path does in the step comes on top
hand = mink.FrameTask(str(data["frame"]), "body", position_cost=1.0, orientation_cost=1.0, gain=1.0)
posture = mink.PostureTask(model, cost=1e-3, gain=float(data["posture_gain"]) * dt)
posture.set_target(home)
speeds = {str(name): float(speed) for name, speed in zip(data["joints"], data["speeds"], strict=True)}
limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds)]
rotation = mink.SO3.from_matrix(data["rotation"])


def work() -> dict:
    """As its examples write the loop."""
    at = mink.Configuration(model, home.copy())
    every = [home]
    for k in range(len(positions) - 1):
        hand.set_target(mink.SE3.from_rotation_and_translation(rotation, positions[k + 1]))
        v = mink.solve_ik(at, [hand, posture], dt, solver="daqp", limits=limits)
        at.integrate_inplace(v, dt)
        every.append(at.q.copy())
    return {"q": np.array(every), "steps": np.array(len(positions) - 1)}


serve(("mink", "mujoco", "qpsolvers", "daqp", "numpy"), work)
