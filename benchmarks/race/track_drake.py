"""The tracking job by Drake's differential inverse kinematics: pose tracked, joints centred in its null space, limits.

requires: drake==1.51.0

It has ranks instead of weights: the velocity towards the pose is kept in direction and slowed where limits demand it,
and the centring, whose gain is the posture's, acts below it.
"""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.inverse_kinematics import (
    DifferentialInverseKinematicsParameters,
    DifferentialInverseKinematicsStatus,
    DoDifferentialInverseKinematics,
)
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from worker import job, serve

data = job()
plant = MultibodyPlant(time_step=0.0)
Parser(plant).AddModelsFromString(str(data["urdf"]), "urdf")
plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
plant.Finalize()
context, frame = plant.CreateDefaultContext(), plant.GetFrameByName(str(data["frame"]))
dt, positions, home = float(data["dt"]), data["positions"], data["home"]
parameters = DifferentialInverseKinematicsParameters(plant.num_positions(), plant.num_velocities())
parameters.set_time_step(dt)
parameters.set_nominal_joint_position(home)
parameters.set_joint_centering_gain(float(data["posture_gain"]) * np.eye(plant.num_positions()))
parameters.set_joint_position_limits((plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()))
parameters.set_joint_velocity_limits((plant.GetVelocityLowerLimits(), plant.GetVelocityUpperLimits()))
rotation = RotationMatrix(data["rotation"])


def work() -> dict:
    """Its pose in, a velocity out, integrated: as its integrator system does."""
    q, every = home.copy(), [home]
    for k in range(len(positions) - 1):
        plant.SetPositions(context, q)
        wanted = RigidTransform(rotation, positions[k + 1])
        found = DoDifferentialInverseKinematics(plant, context, wanted, frame, parameters)
        if found.status != DifferentialInverseKinematicsStatus.kSolutionFound:
            raise RuntimeError(f"step {k}: {found.status}")
        q = q + dt * found.joint_velocities
        every.append(q)
    return {"q": np.array(every), "steps": np.array(len(positions) - 1)}


serve(("drake", "numpy"), work)
