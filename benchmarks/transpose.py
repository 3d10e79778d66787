"""Transpose against pseudo-inverse and damped least squares: following a circle, and going to a point.

    python benchmarks/transpose.py            # print the table
    python benchmarks/transpose.py --save     # and write results/transpose.csv

circle: radius 0.1 m (planar arms 0.3), 4 s, loop gain 20/s at 1 ms, no limits; rms_mm of the hand, peak joint rate.
point: whole steps q <- q + u for b the error, from ten random starts about home to where the hand is at home; median
of the steps until 1 mm (and 1 mrad where a pose is asked), and how many were there within 1000. us: one solve of the
same problem.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from statistics import median

import numpy as np
from harness import SHORT, interleaved, one_table

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "transpose.csv"
METHODS = ("pinv", "dls", "transpose")
ARMS = (("planar3R", "xy"), ("panda", "position"), ("panda", "pose"), ("ur5", "pose"))
MOST = 1000


def follow(robot: cc.Robot, axes: str, method: str) -> tuple[float, float]:
    """RMS error, mm, and peak rate, rad/s, on a circle."""
    start = robot.state(robot.home).placement(robot.tool)
    circle = cc.Circle.starting_at(start, radius=0.3 if axes == "xy" else 0.1, period=4.0)
    hand = cc.FrameTask(robot.tool, axes, gain=20.0, target=circle)
    controller = cc.Controller(robot, hand, solver=method, limits=None, dt=1e-3)
    run = cc.simulate(controller, robot.home, duration=4.5)
    return 1e3 * run.metrics().tasks[0].rms_m, float(np.linalg.norm(run.command, axis=1).max())


def reach(robot: cc.Robot, axes: str, method: str, q: np.ndarray) -> int | None:
    """Whole steps until the hand is where it is at home; None after MOST."""
    hand = cc.FrameTask(robot.tool, axes, gain=1.0, target=robot.state(robot.home).placement(robot.tool))
    controller = cc.Controller(robot, hand, solver=method, limits=None, dt=1.0)
    linear = 2 if axes == "xy" else 3
    for k in range(MOST):
        command = controller.step(q)
        error = command.solution.problem.equations[0].b
        if np.linalg.norm(error[:linear]) < 1e-3 and np.linalg.norm(error[linear:]) < 1e-3:
            return k
        q = robot.integrate(q, command.velocity)
    return None


def measured() -> list[dict[str, str]]:
    """All rows."""
    rows = []
    for name, axes in ARMS:
        robot, rng = cc.load(name), np.random.default_rng(11)
        starts = [robot.integrate(robot.home, rng.uniform(-0.5, 0.5, robot.nv)) for _ in range(10)]
        hand = cc.FrameTask(robot.tool, axes, target=robot.state(robot.home).placement(robot.tool))
        problem = cc.Controller(robot, hand, solver="pinv", limits=None).step(starts[0]).solution.problem
        times = interleaved({m: partial(cc.solve, problem, m) for m in METHODS}, **SHORT)
        for method in METHODS:
            rms, peak = follow(robot, axes, method)
            steps = [reach(robot, axes, method, q0) for q0 in starts]
            there = [k for k in steps if k is not None]
            rows.append(
                {
                    "arm": name, "task": axes, "method": method, "rms_mm": f"{rms:.3f}", "peak_rad_s": f"{peak:.2f}",
                    "steps": f"{median(there):.0f}" if there else "-", "there": f"{len(there)} of {len(starts)}",
                    "us": f"{median(times[method]):.1f}",
                }
            )  # fmt: skip
    return rows


if __name__ == "__main__":
    one_table(__doc__, RESULTS, "Transpose against pseudo-inverse", measured)
