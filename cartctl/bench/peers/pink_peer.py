"""pink (differential inverse kinematics as one quadratic program) on a request of the bench; knows pink and pin only.

Run as a script it reads the request from standard input and prints the answer as one line of JSON.
"""

from __future__ import annotations

import json
import sys
from time import perf_counter
from typing import Any

import numpy as np


def roll(request: dict[str, Any]) -> dict[str, Any]:
    """Follow the targets by a FrameTask, a posture of cost 1e-3 below if asked for, DAQP, all limits that it knows."""
    import pink
    import pinocchio as pin
    from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
    from pink.tasks import FrameTask, PostureTask

    model = reduced(pin, request)
    q = np.array(request["q0"])
    free = request["lower"] is None
    if not free:
        model.lowerPositionLimit, model.upperPositionLimit = np.array(request["lower"]), np.array(request["upper"])
        model.velocityLimit = np.array(request["speed"])
    configuration = pink.Configuration(model, model.createData(), q)
    hand = FrameTask(
        request["frame"], position_cost=1.0, orientation_cost=0.0 if request["position_only"] else 1.0,
    )  # fmt: skip
    tasks, limits = [hand], []
    if request["posture"]:
        tasks.append(PostureTask(cost=1e-3))
        tasks[1].set_target(np.array(request["home"]))
    if not free:
        limits = [ConfigurationLimit(model), VelocityLimit(model)]
        if np.min(request["acceleration"]) < 1e9:
            limits.append(AccelerationLimit(model, np.array(request["acceleration"])))
    path, times, status = [q.tolist()], [], []
    for target in request["targets"]:
        hand.set_target(pin.XYZQUATToSE3(np.array(target)))
        begun = perf_counter()
        velocity = pink.solve_ik(
            configuration, tasks, request["dt"], solver="daqp", limits=limits, safety_break=False, damping=1e-6
        )
        configuration.integrate_inplace(velocity, request["dt"])
        for limit in limits:
            if isinstance(limit, AccelerationLimit):
                limit.set_last_integration(velocity, request["dt"])
        times.append(perf_counter() - begun)
        path.append(configuration.q.tolist())
        status.append("DONE")
    return {"q": path, "times": times, "status": status, "version": pink.__version__}


def reduced(pin: Any, request: dict[str, Any]) -> Any:
    """The URDF's model with only the request's joints, in its order."""
    whole = pin.buildModelFromXML(request["urdf"])
    neutral = pin.neutral(whole)
    for name, value in request["locked"].items():
        if whole.existJointName(name):
            joint = whole.joints[whole.getJointId(name)]
            if joint.nq == 1:
                neutral[joint.idx_q] = value
    locked = [whole.getJointId(name) for name in list(whole.names)[1:] if name not in request["joints"]]
    model = pin.buildReducedModel(whole, locked, neutral) if locked else whole
    if list(model.names)[1:] != request["joints"]:
        raise ValueError(f"joints {list(model.names)[1:]} instead of {request['joints']}")
    return model


if __name__ == "__main__":
    print(json.dumps(roll(json.load(sys.stdin))))
