"""What one step costs: medians in us, and as ratios against raw calls made in the same run.

    python benchmarks/step_time.py            # print the tables
    python benchmarks/step_time.py --save     # and write step_time.csv and whole_steps.csv for the page of measurements

Rounds of all candidates are interleaved, so that a machine that changes its pace changes it for all of them; the ratio
is the median of the rounds' ratios against Pinocchio's computeFrameJacobian. The second table is that of
:mod:`whole_steps`: steps one by one, along a motion.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
from harness import interleaved, ratios, save_rows, setting, show
from whole_steps import measured as whole_steps

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "step_time.csv"
REFERENCE = "pin.computeFrameJacobian"


def candidates() -> dict[str, Callable[[], object]]:
    """Panda, 7 dof, the pose of its tool: raw calls, then whole controller steps."""
    robot = cc.load("panda")
    q, v = np.array(robot.home + 0.01), np.zeros(robot.nv)
    data, frame = robot.model.createData(), robot.frame_id(robot.tool)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    J = np.array(pin.computeFrameJacobian(robot.model, data, q, frame, world))
    target = robot.state(robot.home).placement(robot.tool)
    found: dict[str, Callable[[], object]] = {
        REFERENCE: lambda: pin.computeFrameJacobian(robot.model, data, q, frame, world),
        "numpy.linalg.pinv alone": lambda: np.linalg.pinv(J),
    }
    for solver in ("dls", "pinv", "projected-gradient", "task-priority"):
        objective = cc.JointRange() if solver == "projected-gradient" else None
        tasks: list[cc.Task] = [cc.FrameTask(robot.tool, target=target)]
        if solver == "task-priority":
            tasks.append(cc.PostureTask())
        controller = cc.Controller(robot, tasks, solver=solver, objective=objective, limits=None)
        extra = {"projected-gradient": ", joint range", "task-priority": ", pose and posture"}.get(solver, "")
        found[f"Controller.step, {solver}{extra}"] = lambda c=controller: c.step(q, v, 0.0)
    circle = cc.Circle.starting_at(target, 0.1, period=4.0)
    moving = cc.Controller(robot, cc.FrameTask(robot.tool, target=circle), solver="dls", limits=None)
    found["Controller.step, dls, target on a circle"] = lambda: moving.step(q, v, 1.3)
    return found


def main() -> None:
    """Measure, print and, if asked, save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help=f"write {RESULTS.name} and whole_steps.csv")
    save = parser.parse_args().save
    found = ratios(interleaved(candidates()), REFERENCE)
    show(f"One step on the Panda, 7 dof, 6D pose; ratio to {REFERENCE}", found)
    whole = whole_steps()
    show("Steps one by one, along a motion under limits, sns", whole)
    if save:
        save_rows(RESULTS, found, setting())
        save_rows(RESULTS.with_name("whole_steps.csv"), whole, setting())


if __name__ == "__main__":
    main()
