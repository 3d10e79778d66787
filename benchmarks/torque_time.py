"""What a step costs above the velocity level: medians in us, and as ratios against raw calls made in the same run.

    python benchmarks/torque_time.py            # print the table
    python benchmarks/torque_time.py --save     # and write benchmarks/results/torque_time.csv

Panda, the pose of its tool, under limits: torque bounds as a box and joint limits as rows at the torque level, torque
bounds as rows at the acceleration level.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
from harness import SHORT, interleaved, one_table, ratios
from step_time import REFERENCE

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "torque_time.csv"


def candidates() -> dict[str, Callable[[], object]]:
    """Raw calls, then whole controller steps."""
    robot = cc.load("panda")
    q, v, rest = np.array(robot.home + 0.01), np.zeros(robot.nv), np.zeros(robot.nv)
    data, frame = robot.model.createData(), robot.frame_id(robot.tool)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def terms() -> None:
        pin.crba(robot.model, data, q)
        pin.nonLinearEffects(robot.model, data, q, v)
        pin.forwardKinematics(robot.model, data, q, v, rest)

    found: dict[str, Callable[[], object]] = {
        REFERENCE: lambda: pin.computeFrameJacobian(robot.model, data, q, frame, world),
        "pin.crba, nonLinearEffects, forwardKinematics": terms,
        "pin.aba": lambda: pin.aba(robot.model, data, q, v, rest),
    }
    hand = cc.FrameTask(robot.tool, target=robot.state(robot.home).placement(robot.tool))
    for name, solver, level, limits in (
        ("velocity, dls, no limits", "dls", "velocity", None),
        ("acceleration, sns, no limits", "sns", "acceleration", None),
        ("acceleration, sns, limits and torque bounds", "sns", "acceleration", robot.limits),
        ("torque, sns, no limits, u0 = 0", "sns", cc.TorqueLevel(0.0), None),
        ("torque, sns, torque bounds and limits", "sns", cc.TorqueLevel(0.0), robot.limits),
        ("torque, sns, the same, damped null space", "sns", "torque", robot.limits),
    ):
        controller = cc.Controller(robot, hand, solver, level, limits=limits)
        found[f"Controller.step, {name}"] = lambda c=controller: c.step(q, v, 0.0)
    return found


def measured() -> list[dict[str, str]]:
    """The table."""
    return ratios(interleaved(candidates(), **SHORT), REFERENCE)


def main() -> None:
    """Measure, print and, if asked, save."""
    one_table(
        __doc__,
        RESULTS,
        f"One step on the Panda, 7 dof, 6D pose; ratio to {REFERENCE}",
        lambda: ratios(interleaved(candidates(), **SHORT), REFERENCE),
    )


if __name__ == "__main__":
    main()
