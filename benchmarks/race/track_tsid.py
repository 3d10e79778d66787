"""The tracking job by tsid: its usual accelerations by inverse dynamics, a frame and a posture task under joint bounds.

requires: tsid==1.7.1 pin==3.4.0 cmeel-urdfdom==4.0.1 cmeel-tinyxml2==10.0.0

It commands accelerations, which are integrated; the path's own is fed forward, both poles lie at the job's gains. This
version is the newest whose wheels load together: those of tsid 1.9 and 1.10 lack a libtsid for most Pythons, and with
one that is built here they crash; 1.10 built here as a whole takes as long a step and finds the same.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin
from tsid import tsid_pywrap as tsid
from worker import job, serve

data = job()
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder, "robot.urdf")
    file.write_text(str(data["urdf"]))
    robot = tsid.RobotWrapper(str(file), [folder], False)
model = robot.model()
dt, home, at_rest = float(data["dt"]), data["home"], np.zeros(robot.nv)
formulation = tsid.InverseDynamicsFormulationAccForce("race", robot, False)
formulation.computeProblemData(0.0, home, at_rest)


def gains(task: object, size: int, gain: float) -> None:
    """Two poles at the gain."""
    task.setKp(gain**2 * np.ones(size))
    task.setKd(2.0 * gain * np.ones(size))


hand = tsid.TaskSE3Equality("hand", robot, str(data["frame"]))
hand.useLocalFrame(False)  # its velocities and accelerations in world axes
gains(hand, 6, float(data["gain"]))
formulation.addMotionTask(hand, 1.0, 1, 0.0)
posture = tsid.TaskJointPosture("posture", robot)
gains(posture, robot.nv, float(data["posture_gain"]))
posture.setReference(tsid.TrajectoryEuclidianConstant("home", home).computeNext())
formulation.addMotionTask(posture, 1e-6, 1, 0.0)  # of the squared error: 1e-3 of the error
bounds = tsid.TaskJointPosVelAccBounds("bounds", robot, dt, False)
bounds.setPositionBounds(model.lowerPositionLimit, model.upperPositionLimit)
bounds.setVelocityBounds(model.velocityLimit)
bounds.setImposeBounds(True, True, False, False)  # no acceleration limits, on which its viability rests
formulation.addMotionTask(bounds, 1.0, 0, 0.0)
solver = tsid.SolverHQuadProgFast("race")
solver.resize(formulation.nVar, formulation.nEq, formulation.nIn)
sample = tsid.TrajectorySample(12, 6)
turned = data["rotation"].T.ravel()  # column by column
poses = [np.concatenate([p, turned]) for p in data["positions"]]


def work() -> dict:
    """As its examples write the loop."""
    q, v, every = home.copy(), at_rest.copy(), [home]
    for k in range(len(poses) - 1):
        sample.value(poses[k])
        sample.derivative(data["twists"][k])
        sample.second_derivative(data["accelerations"][k])
        hand.setReference(sample)
        problem = formulation.computeProblemData(k * dt, q, v)
        found = solver.solve(problem)
        if found.status != 0:
            raise RuntimeError(f"step {k}: {found.status}")
        dv = formulation.getAccelerations(found)
        q = pin.integrate(model, q, dt * (v + 0.5 * dt * dv))
        v = v + dt * dv
        every.append(q)
    return {"q": np.array(every), "steps": np.array(len(poses) - 1)}


serve(("tsid", "pin", "eiquadprog", "numpy"), work)
