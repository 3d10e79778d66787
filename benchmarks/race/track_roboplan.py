"""The tracking job by roboplan's OInK: a frame and a configuration task, position and velocity limits; C++.

requires: roboplan==0.7.0 roboplan-oink==0.7.0
"""

from __future__ import annotations

import numpy as np
from roboplan.core import CartesianConfiguration, Scene, loadUrdfSceneDescriptionFromXml
from roboplan.optimal_ik import (
    ConfigurationTask,
    ConfigurationTaskOptions,
    FrameTask,
    FrameTaskOptions,
    Oink,
    PositionLimit,
    VelocityLimit,
)
from worker import job, serve

data = job()
scene = Scene("race", loadUrdfSceneDescriptionFromXml(str(data["urdf"])))
dt, positions, home = float(data["dt"]), data["positions"], data["home"]
oink = Oink(scene)
goal = CartesianConfiguration()
goal.base_frame, goal.tip_frame = "base", str(data["frame"])
target = np.eye(4)
target[:3, :3], target[:3, 3] = data["rotation"], positions[0]
goal.tform = target
# a gain there is the share of the error made good in a step; what the path does in the step comes on top
hand = FrameTask(oink, scene, goal, FrameTaskOptions(position_cost=1.0, orientation_cost=1.0, task_gain=1.0))
centring = ConfigurationTaskOptions(task_gain=float(data["posture_gain"]) * dt)
posture = ConfigurationTask(oink, home, np.full(len(home), 1e-3), centring)
tasks, limits = [hand, posture], [PositionLimit(oink, gain=1.0), VelocityLimit(oink, dt, data["speeds"])]


def work() -> dict:
    """As its examples write the loop."""
    q, delta, every = home.copy(), np.zeros(oink.num_variables), [home]
    for k in range(len(positions) - 1):
        target[:3, 3] = positions[k + 1]
        hand.setTargetFrameTransform(target)
        oink.solveIk(q, tasks, limits, delta)
        q = scene.integrate(q, delta)
        every.append(q)
    return {"q": np.array(every), "steps": np.array(len(positions) - 1)}


serve(("roboplan", "roboplan-oink", "pin", "numpy"), work)
