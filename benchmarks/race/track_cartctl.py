"""The tracking job by cartctl: ``Controller.step`` in a Python loop, or the whole loop compiled."""

from __future__ import annotations

import sys

import numpy as np
from worker import job, serve

import cartctl as cc

data, how = job(), sys.argv[3]
robot = cc.load("panda")
dt, positions, twists = float(data["dt"]), data["positions"], data["twists"]


def path(t: float) -> cc.PathSample:
    """The job's samples: what the peers are given, too."""
    k = min(round(t / dt), len(positions) - 1)
    return cc.PathSample(positions[k], data["rotation"], twists[k], np.zeros(6))


hand = cc.FrameTask(robot.tool, gain=float(data["gain"]), target=path)
limits = robot.limits.replace(acceleration_lower=-np.inf, acceleration_upper=np.inf)
tasks = [hand, cc.PostureTask(gain=float(data["posture_gain"]))]
controller = cc.Controller(
    robot, tasks, solver="sns", limits=limits, dt=dt, path_clock=False, approach=how == "approach"
)
steps, starts = len(positions) - 1, np.tile(robot.home, (int(data["copies"]), 1))


def stepped() -> dict:
    """As a user writes the loop: step, integrate."""
    controller.reset()
    q, v = np.array(robot.home), np.zeros(robot.nv)
    every = [q]
    for k in range(steps):
        v = controller.step(q, v, k * dt).velocity
        q = robot.integrate(q, v * dt)
        every.append(q)
    return {"q": np.array(every), "steps": np.array(steps)}


def compiled() -> dict:
    """Copies of the job, on one thread."""
    batch = cc.simulate_batch(controller, starts, steps * dt, threads=1, history=True)
    assert batch.reason is None and batch.q is not None
    return {"q": batch.q[0], "steps": np.array(steps * len(starts))}


serve(("cartctl", "pin", "numba", "numpy"), stepped if how == "step" else compiled)
