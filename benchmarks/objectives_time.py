"""What the gradient of each objective costs: medians in us, and as ratios against a raw call made in the same run.

    python benchmarks/objectives_time.py            # print the table
    python benchmarks/objectives_time.py --save     # and write benchmarks/results/objectives_time.csv

Panda, at a fresh state each time: what the gradient needs of kinematics and dynamics is in it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
from harness import SHORT, interleaved, one_table, ratios
from obstacles import ten_obstacles
from step_time import REFERENCE

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "objectives_time.csv"


def objectives(robot: cc.Robot) -> dict[str, cc.Objective]:
    """Each of them, with what it has to be given."""
    tool, load = robot.tool, np.array([0.0, 0.0, -20.0, 0.0, 0.0, 0.0])
    along = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    return {
        "JointRange": cc.JointRange(),
        "Posture": cc.Posture(robot.home),
        "Manipulability": cc.Manipulability(tool),
        "SmallestSingularValue": cc.SmallestSingularValue(tool),
        "InverseCondition": cc.InverseCondition(tool),
        "VelocityRatio": cc.VelocityRatio(tool, along=along),
        "TorquePerForce": cc.TorquePerForce(tool, along=along),
        "KineticEnergy": cc.KineticEnergy(velocity=np.linspace(0.5, 1.0, robot.nv)),
        "GravityTorque": cc.GravityTorque(),
        "TorqueDistribution": cc.TorqueDistribution(frame=tool, wrench=load),
        "Clearance, 10 obstacles": cc.Clearance(ten_obstacles()),
        "SelfClearance": cc.SelfClearance(),
        "WeightedSum of JointRange and Manipulability": 2.0 * cc.JointRange() + cc.Manipulability(tool),
        "FunctionObjective, by differences": cc.FunctionObjective(lambda state: float(state.position(tool)[2])),
    }


def candidates() -> dict[str, Callable[[], object]]:
    """The raw call, then every gradient."""
    robot = cc.load("panda")
    q, v = np.array(robot.home + 0.1), np.zeros(robot.nv)
    data, frame, state = robot.model.createData(), robot.frame_id(robot.tool), robot.state(robot.home)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    found: dict[str, Callable[[], object]] = {
        REFERENCE: lambda: pin.computeFrameJacobian(robot.model, data, q, frame, world)
    }
    for name, objective in objectives(robot).items():
        objective.check(robot)

        def gradient(objective: cc.Objective = objective) -> object:
            state.set(q, v)
            return objective.gradient(state)

        found[name] = gradient
    return found


def measured() -> list[dict[str, str]]:
    """The table."""
    return ratios(interleaved(candidates(), **SHORT), REFERENCE)


def main() -> None:
    """Measure, print and, if asked, save."""
    one_table(
        __doc__,
        RESULTS,
        f"Gradients on the Panda, 7 dof; ratio to {REFERENCE}",
        lambda: ratios(interleaved(candidates(), **SHORT), REFERENCE),
    )


if __name__ == "__main__":
    main()
