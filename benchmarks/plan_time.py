"""The time of a whole plan: 300 samples of 7 joints, all local methods and starts included.

    python benchmarks/plan_time.py --save

The first plan of a process compiles kernels; it is shown apart. The ratio is against numpy's SVD of all 300 Jacobians
in the same round. CPU time counts this process alone, wall time whatever else the machine is busy with.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "plan_time.csv"
SAMPLES, ROUNDS = 300, 3
KINDS = {"start fixed": {}, "start free": {"free": True}, "closed, start fixed": {"closed": True},
         "closed, start free": {"closed": True, "free": True}}  # fmt: skip


def once(robot, hand, free=False, closed=False, **how):
    wall, cpu = perf_counter(), process_time()
    plan = cc.plan(robot, hand, samples=SAMPLES, q0=None if free else robot.home, closed=closed, **how)
    return plan, perf_counter() - wall, process_time() - cpu


def svds(rng):
    J = rng.normal(size=(SAMPLES, 6, 7))
    start = process_time()
    for _ in range(20):
        np.linalg.svd(J)
    return (process_time() - start) / 20


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", default="panda")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--radius", type=float, default=0.15)
    parser.add_argument("--save", action="store_true")
    options = parser.parse_args()
    from harness import save_rows, setting, show

    rows, rng = [], np.random.default_rng(0)
    for name in options.robots.split(","):
        robot = cc.load(name)
        start = robot.state(robot.home).placement(robot.tool)
        hand = cc.FrameTask(robot.tool, target=cc.Circle.starting_at(start, radius=options.radius, period=4.0))
        first = once(robot, hand)[1]
        for kind, how in KINDS.items():
            found = [(*once(robot, hand, **how), svds(rng)) for _ in range(options.rounds)]
            wall, cpu = (float(np.median([f[i] for f in found])) for i in (1, 2))
            ratio = float(np.median([f[2] / f[3] for f in found]))
            report = found[0][0].report
            rows.append(
                {
                    "robot": name, "what": kind, "samples": str(SAMPLES), "first_of_the_process_s": f"{first:.1f}",
                    "median_wall_s": f"{wall:.2f}", "longest_wall_s": f"{max(f[1] for f in found):.2f}",
                    "median_cpu_s": f"{cpu:.2f}", "x_svd_of_all_jacobians": f"{ratio:.0f}",
                    "iterations": str(report.iterations), "osqp_programmes": str(report.qps),
                    "status": report.status.name,
                }
            )  # fmt: skip
    show(f"A plan of {SAMPLES} samples", rows)
    if options.save:
        save_rows(RESULTS, rows, setting())


if __name__ == "__main__":
    main()
