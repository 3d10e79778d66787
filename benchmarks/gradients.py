"""Reduced against projected gradient: the same arms, starts, objective and gain, the hand held.

    python benchmarks/gradients.py            # print the table
    python benchmarks/gradients.py --save     # and write results/gradients.csv

Eight starts about home each; the objective is the posture home, 1/2 ||q - home||^2, for 4 s at 2 ms, without limits, so
that a gain of 1000 1/s would be at the edge of what explicit steps bear in joint space. half_s: until half of what the
better of the two descends is behind it. H_end: what is left of H, in percent of the start. drift_um: the largest
distance of the hand from its place. us: one solve of the step's problem. Medians of the starts; unstable counts
rollouts whose rates at the end turn round from step to step.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
from harness import SHORT, interleaved, one_table

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "gradients.csv"
METHODS = ("projected-gradient", "reduced-gradient")
ARMS = (("planar4R", "xy"), ("panda", "pose"), ("panda", "position"), ("lwr", "pose"))
GAINS = (1.0, 10.0, 100.0, 500.0)
STARTS = 8


class Descent(NamedTuple):
    """One rollout: H (N,), its times (N,), peak rate, rad/s; whether it shakes at the end; the hand's drift, m."""

    H: np.ndarray
    time: np.ndarray
    peak: float
    shakes: bool
    drift: float


def descend(robot: cc.Robot, axes: str, method: str, gain: float, q0: np.ndarray) -> Descent:
    """Hold the hand and descend."""
    objective = cc.Posture(gain=gain)
    hand = cc.FrameTask(robot.tool, axes, gain=20.0)
    controller = cc.Controller(robot, hand, solver=method, objective=objective, limits=None, dt=2e-3)
    run = cc.simulate(controller, q0, duration=4.0)
    rates = np.linalg.norm(run.command, axis=1)
    drift = np.linalg.norm(run.tasks[0].error[:, : 2 if axes == "xy" else 3], axis=1).max()
    H = np.array([objective.value(robot.state(q)) for q in run.q[::5]])
    last = run.command[-50:]
    turned = np.einsum("ij,ij->i", last[1:], last[:-1]) < 0.0
    return Descent(H, run.time[::5], rates.max(), bool(rates[-1] > 1e-6 and turned.mean() > 0.5), drift)


def microseconds(robot: cc.Robot, axes: str, q0: np.ndarray) -> dict[str, float]:
    """One solve of either method on the same problem."""
    hand = cc.FrameTask(robot.tool, axes, gain=20.0)
    controller = cc.Controller(robot, hand, solver=METHODS[0], objective=cc.Posture(gain=1.0), limits=None)
    problem = controller.step(q0).solution.problem
    times = interleaved({m: partial(cc.solve, problem, m) for m in METHODS}, **SHORT)
    return {method: median(found) for method, found in times.items()}


def measured() -> list[dict[str, str]]:
    """All rows."""
    rows = []
    for name, axes in ARMS:
        robot, rng = cc.load(name), np.random.default_rng(3)
        starts = [robot.integrate(robot.home, rng.uniform(-0.4, 0.4, robot.nv)) for _ in range(STARTS)]
        times = microseconds(robot, axes, starts[0])
        for gain in GAINS:
            runs = {method: [descend(robot, axes, method, gain, q0) for q0 in starts] for method in METHODS}
            best = [min(run.H.min() for run in pair) for pair in zip(*runs.values(), strict=True)]
            for method, found in runs.items():
                halves = [
                    float(run.time[np.argmax(run.H <= 0.5 * (run.H[0] + low))])
                    if run.H.min() <= 0.5 * (run.H[0] + low) else 4.0
                    for run, low in zip(found, best, strict=True)
                ]  # fmt: skip
                rows.append(
                    {
                        "arm": name, "task": axes, "gain": f"{gain:g}", "method": method,
                        "half_s": f"{median(halves):.2f}",
                        "H_end": f"{median(100 * run.H[-1] / run.H[0] for run in found):.1f}",
                        "peak_rad_s": f"{median(run.peak for run in found):.2f}",
                        "drift_um": f"{1e6 * median(run.drift for run in found):.2f}",
                        "unstable": f"{sum(run.shakes for run in found)} of {STARTS}",
                        "us": f"{times[method]:.1f}",
                    }
                )  # fmt: skip
    return rows


if __name__ == "__main__":
    one_table(__doc__, RESULTS, "Reduced against projected gradient, the hand held", measured)
