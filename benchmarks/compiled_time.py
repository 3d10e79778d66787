"""What the compiled loops cost: us a step of a rollout, us a pose of inverse kinematics, s of an import.

    python benchmarks/compiled_time.py            # print the table
    python benchmarks/compiled_time.py --save     # and write benchmarks/results/compiled_time.csv

The job: the Panda's hand along a circle of 0.1 m in 4 s (6D pose), a posture below, position, velocity and acceleration
limits, ``sns``, dt = 1 ms; 5 copies of 4000 steps on one thread. Times are CPU time, so that other work on the machine
lengthens them less; the ratio, the median of the rounds', is to Pinocchio's computeFrameJacobian called from Python.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import process_time

import numpy as np
import pinocchio as pin
from harness import save_rows, setting, show

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "compiled_time.csv"
ROUNDS, COPIES, STEPS, POSES = 9, 5, 4000, 2000
IMPORT = "import time; t = time.perf_counter(); import cartctl; print(time.perf_counter() - t)"


def controller(solver: str = "sns", **given: object) -> cc.Controller:
    """The job's."""
    robot = cc.load("panda")
    start = robot.state(robot.home).placement(robot.tool)
    hand = cc.FrameTask(robot.tool, gain=20.0, target=cc.Circle.starting_at(start, 0.1, period=4.0))
    return cc.Controller(robot, [hand, cc.PostureTask()], solver=solver, **given)


def rollout(job: cc.Controller, copies: int = COPIES, steps: int = STEPS) -> Callable[[], int]:
    """One round: how many steps it makes. The table of the path is made once."""
    from cartctl.motion.batch import _compiled, _loop

    loop, home = _loop(job, 0.0, steps), job.robot.home
    starts, rates = np.tile(home, (copies, 1)), np.zeros((copies, len(home)))

    def run() -> int:
        _compiled(loop, starts, rates, False, 1)
        return copies * steps

    return run


def reachable(count: int) -> np.ndarray:
    """Poses of the tool at random configurations inside the limits, (count, 4, 4)."""
    robot, rng = cc.load("panda"), np.random.default_rng(1)
    Q = rng.uniform(robot.limits.position_lower, robot.limits.position_upper, (count, robot.nv))
    return np.array([robot.state(q).placement(robot.tool).homogeneous for q in Q])


def candidates() -> dict[str, Callable[[], int]]:
    """What is measured; every function returns how many steps, poses or calls it made."""
    robot, poses = cc.load("panda"), reachable(POSES)
    data, frame, world = robot.model.createData(), robot.frame_id(robot.tool), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    home, at_rest = robot.home, np.zeros(robot.nv)
    slow = robot.limits.replace(velocity_lower=-0.4, velocity_upper=0.4)
    steady = {name: controller(**given) for name, given in {"default": {}, "no approach": {"approach": False}}.items()}

    def jacobian() -> int:
        for _ in range(2000):
            pin.computeFrameJacobian(robot.model, data, home, frame, world)
        return 2000

    def reached() -> int:
        cc.inverse_kinematics(robot, poses, threads=1)
        return POSES

    def stepped(job: cc.Controller) -> Callable[[], int]:
        def run() -> int:
            for k in range(300):
                job.step(home, at_rest, 1.0 + 1e-3 * k)
            return 300

        return run

    return {
        "pin.computeFrameJacobian": jacobian,
        "simulate_batch, the job": rollout(controller()),
        "simulate_batch, approach=False": rollout(controller(approach=False)),
        "simulate_batch, approach=False, speeds of 0.4": rollout(controller(approach=False, limits=slow)),
        "simulate_batch, dls": rollout(controller("dls", limits=None)),
        "simulate_batch, task-priority": rollout(controller("task-priority", limits=None)),
        "Controller.step, the job": stepped(steady["default"]),
        "Controller.step, approach=False": stepped(steady["no approach"]),
        "inverse_kinematics, a pose": reached,
    }


def main() -> None:
    """Measure, print and, if asked, save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help=f"write {RESULTS.name}")
    save = parser.parse_args().save
    found = candidates()
    times: dict[str, list[float]] = {name: [] for name in found}
    for run in found.values():
        run()
    for _ in range(ROUNDS):
        for name, run in found.items():
            begun = process_time()
            count = run()
            times[name].append((process_time() - begun) / count * 1e6)
    reference = times["pin.computeFrameJacobian"]
    rows = [
        {
            "what": name,
            "median_us": f"{statistics.median(values):.2f}",
            "least_us": f"{min(values):.2f}",
            "ratio": f"{statistics.median(v / r for v, r in zip(values, reference, strict=True)):.2f}",
        }
        for name, values in times.items()
    ]
    imports = [
        float(subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, text=True, check=True).stdout)
        for _ in range(ROUNDS)
    ]
    us = [f"{1e6 * f(imports):.0f}" for f in (statistics.median, min)]
    rows.append({"what": "import cartctl", "median_us": us[0], "least_us": us[1], "ratio": ""})
    show("Compiled loops, one thread", rows)
    if save:
        save_rows(RESULTS, rows, setting())


if __name__ == "__main__":
    main()
