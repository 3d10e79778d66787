"""The tracking job by pink: a frame and a posture task, configuration and velocity limits, DAQP.

requires: pin-pink==4.4.0 pin==4.1.0 qpsolvers==4.13.0 daqp==0.11.0
"""

from __future__ import annotations

import numpy as np
import pink
import pinocchio as pin
from worker import job, serve

data = job()
model = pin.buildModelFromXML(str(data["urdf"]))
dt, positions, frame = float(data["dt"]), data["positions"], str(data["frame"])
home = data["home"]
# a gain there is the share of the error made good in a step; what the path does in the step comes on top
hand = pink.FrameTask(frame, position_cost=1.0, orientation_cost=1.0, gain=1.0)
posture = pink.PostureTask(cost=1e-3, gain=float(data["posture_gain"]) * dt)
posture.set_target(home)


def work() -> dict:
    """As its examples write the loop."""
    at = pink.Configuration(model, model.createData(), home.copy())
    every = [home]
    for k in range(len(positions) - 1):
        hand.set_target(pin.SE3(data["rotation"], positions[k + 1]))
        v = pink.solve_ik(at, [hand, posture], dt, solver="daqp")
        at.integrate_inplace(v, dt)
        every.append(at.q.copy())
    return {"q": np.array(every), "steps": np.array(len(positions) - 1)}


serve(("pin-pink", "pin", "qpsolvers", "daqp", "numpy"), work)
