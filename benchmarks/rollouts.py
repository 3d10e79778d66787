"""Random starts with aggressive targets: how far any joint ever leaves a position, velocity or acceleration limit.

    python benchmarks/rollouts.py --robots panda,lwr --starts 1000 --steps 1000 --save

Targets jump at random, most of them out of reach; the worst excess is in rad, rad/s and rad/s^2.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import cartctl as cc
from cartctl.motion.integrate import advance

RESULTS = Path(__file__).parent / "results" / "rollouts.csv"
ACCELERATION = 15.0  # rad/s^2, where a robot brings none along


class Excess:
    """The worst excess over each kind of limit, and how many steps were looked at."""

    def __init__(self):
        self.steps, self.worst = 0, {"position": 0.0, "velocity": 0.0, "acceleration": 0.0}

    def see(self, limits, **values):
        self.steps += 1
        for kind, value in values.items():
            low, high = getattr(limits, f"{kind}_lower"), getattr(limits, f"{kind}_upper")
            self.worst[kind] = max(self.worst[kind], float(np.max(low - value)), float(np.max(value - high)))

    def add(self, other):
        self.steps += other.steps
        self.worst = {kind: max(value, other.worst[kind]) for kind, value in self.worst.items()}


def limits_of(robot):
    """The robot's own, with an acceleration limit where it has none."""
    own = robot.limits
    given = np.isfinite(own.acceleration_upper)
    a = np.where(given, own.acceleration_upper, ACCELERATION)
    return own.replace(acceleration_lower=-a, acceleration_upper=a)


def inside(rng, limits):
    """A configuration inside the position limits; joints without any anywhere in a turn."""
    low = np.where(np.isfinite(limits.position_lower), limits.position_lower, -np.pi)
    high = np.where(np.isfinite(limits.position_upper), limits.position_upper, np.pi)
    return rng.uniform(low, high)


def rollout(robot, limits, rng, steps, level="velocity", solver="sns"):
    """One start: a random dt, gain and set of tasks, targets that jump now and then."""
    dt = float(10.0 ** rng.uniform(-4.0, np.log10(2e-2)))
    hand = cc.FrameTask(robot.tool, ("pose", "position")[int(rng.integers(2))], gain=float(rng.uniform(1.0, 0.9 / dt)))
    tasks = [hand, cc.PostureTask()] if rng.random() < 0.5 else [hand]
    controller = cc.Controller(robot, tasks, solver=solver, level=level, limits=limits, dt=dt)
    q, v, excess = inside(rng, limits), np.zeros(robot.nv), Excess()
    for k in range(steps):
        if k % 97 == 0:
            hand.target = rng.normal(size=3) * rng.choice([0.5, 1.5])
        command = controller.step(q, v, k * dt)
        before = v
        q, v = advance(robot, q, v, command, dt)
        a = (v - before) / dt if command.acceleration is None else command.acceleration
        assert np.isfinite(q).all() and np.isfinite(v).all()
        excess.see(limits, position=robot.coordinates(q), velocity=v, acceleration=a)
    return excess


def many(robot_name, level, solver, seeds, steps):
    """Several starts in one process."""
    robot, total = cc.load(robot_name), Excess()
    limits = limits_of(robot)
    for seed in seeds:
        total.add(rollout(robot, limits, np.random.default_rng(seed), steps, level, solver))
    return total


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", default="panda,lwr")
    parser.add_argument("--levels", default="velocity")
    parser.add_argument("--solver", default="sns")
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--save", action="store_true")
    options = parser.parse_args()
    from harness import save_rows, setting, show

    rows = []
    with ProcessPoolExecutor(options.workers) as pool:
        for robot in options.robots.split(","):
            for level in options.levels.split(","):
                shares = np.array_split(np.arange(options.starts), 4 * options.workers)
                jobs = [pool.submit(many, robot, level, options.solver, s, options.steps) for s in shares if len(s)]
                total = Excess()
                for job in jobs:
                    total.add(job.result())
                worst = {f"worst_{kind}": f"{max(value, 0.0):.1e}" for kind, value in total.worst.items()}
                rows.append(
                    {"robot": robot, "level": level, "solver": options.solver, "steps": str(total.steps), **worst}
                )
    show("Excess over the limits", rows)
    if options.save:
        save_rows(RESULTS, rows, setting())


if __name__ == "__main__":
    main()
