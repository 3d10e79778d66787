"""Random torque-controlled rollouts: no torque beyond its bound, wherever they start and whatever they are asked for.

    python benchmarks/torque_rollouts.py --robots panda,lwr --starts 1000 --steps 200 --save

A third of the starts are at singular postures (stretched or folded joints), targets jump at random, most of them out
of reach. The plant takes four steps of its integrator to one of the controller; the semi-implicit one, of first order,
adds errors of its own to where the joints come to. Beside the worst excess over the torque bounds: how often other
limits yielded, and how far they were missed.
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

import numpy as np
from rollouts import inside, limits_of

import cartctl as cc
from cartctl.motion.forward import INTEGRATORS, Work

RESULTS = Path(__file__).parent / "results" / "torque_rollouts.csv"
METRICS = ("identity", "inverse-inertia", "inverse-inertia-squared")
KINDS = ("torque", "position", "velocity", "acceleration")


class Tally:
    """What many rollouts came to."""

    def __init__(self):
        self.steps, self.yielded, self.peak = 0, Counter(), 0.0
        self.worst = dict.fromkeys(KINDS, 0.0)
        self.kept = dict.fromkeys(KINDS, 0.0)  # worst excess in rollouts in which nothing had yielded yet

    def see(self, limits, calm, **values):
        self.steps += 1
        self.peak = max(self.peak, float(np.max(np.abs(values["torque"]) / limits.torque_upper)))
        for kind, value in values.items():
            low, high = getattr(limits, f"{kind}_lower"), getattr(limits, f"{kind}_upper")
            excess = max(float(np.max(low - value)), float(np.max(value - high)), 0.0)
            self.worst[kind] = max(self.worst[kind], excess)
            if calm:
                self.kept[kind] = max(self.kept[kind], excess)

    def add(self, other):
        self.steps += other.steps
        self.yielded += other.yielded
        self.peak = max(self.peak, other.peak)
        for kind in KINDS:
            self.worst[kind] = max(self.worst[kind], other.worst[kind])
            self.kept[kind] = max(self.kept[kind], other.kept[kind])


def start(rng, robot, limits):
    """Anywhere, or with some joints where arms are singular: at zero, or at the limit nearest to it."""
    q = inside(rng, limits)
    if rng.random() < 1.0 / 3.0:
        chosen = rng.random(robot.nv) < 0.5
        q[chosen] = np.clip(0.0, limits.position_lower, limits.position_upper)[chosen] + 1e-6 * rng.normal()
        q = np.clip(q, limits.position_lower, limits.position_upper)
    return q


def rollout(robot, limits, rng, steps, solver="sns", level="torque", slowest=-2.3, plant="rk4"):
    """One start: a random dt from 0.5 ms to 10^slowest s, gain, metric and tasks, targets that jump now and then."""
    dt = float(10.0 ** rng.uniform(-3.3, slowest))
    hand = cc.FrameTask(robot.tool, ("pose", "position")[int(rng.integers(2))], gain=float(rng.uniform(1.0, 0.2 / dt)))
    tasks = [hand, cc.PostureTask(gain=3.0)] if rng.random() < 0.5 else [hand]
    metric = METRICS[int(rng.integers(3))] if level == "torque" else None
    how = cc.TorqueLevel() if level == "torque" else cc.AccelerationLevel(damping=5.0)
    controller = cc.Controller(robot, tasks, solver, how, limits=limits, metric=metric, dt=dt)
    body, advance = cc.Plant().body(robot), INTEGRATORS[plant]
    q, v, tally, calm = start(rng, robot, limits), np.zeros(robot.nv), Tally(), True
    for k in range(steps):
        if k % 97 == 0:
            hand.target = rng.normal(size=3) * rng.choice([0.5, 1.5])
        command = controller.step(q, v, k * dt)
        calm = calm and not command.solution.yielded
        tally.yielded.update(command.solution.yielded)
        tally.yielded[command.solution.status.name] += 1
        before, part = v, dt / 4
        for i in range(4):
            q, v, _ = advance(body, q, v, command.torque, k * dt + i * part, part, Work())
        assert np.isfinite(q).all() and np.isfinite(v).all()
        a = (v - before) / dt
        tally.see(limits, calm, torque=command.torque, position=robot.coordinates(q), velocity=v, acceleration=a)
    return tally


def many(robot_name, solver, level, seeds, steps, slowest, plant):
    """Several starts in one process."""
    robot, total = cc.load(robot_name), Tally()
    limits = limits_of(robot)
    for seed in seeds:
        total.add(rollout(robot, limits, np.random.default_rng(seed), steps, solver, level, slowest, plant))
    return total


def row(robot, solver, level, starts, total):
    """One line of the table."""
    share = {name: f"{total.yielded[name] / total.steps:.2%}" for name in ("acceleration", "velocity", "position")}
    worst = {f"worst_{kind}": f"{total.worst[kind]:.1e}" for kind in KINDS}
    kept = {f"worst_{kind}_before_any_yield": f"{total.kept[kind]:.1e}" for kind in KINDS[1:]}
    states = {name.lower(): f"{total.yielded[name] / total.steps:.2%}" for name in ("INFEASIBLE", "SKIPPED", "FAILED")}
    return {
        "robot": robot,
        "solver": solver,
        "level": level,
        "starts": str(starts),
        "steps": str(total.steps),
        "peak_torque_share": f"{total.peak:.12f}",
        **worst,
        **{f"{name}_yielded": value for name, value in share.items()},
        **kept,
        **states,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", default="panda,lwr")
    parser.add_argument("--solvers", default="sns")
    parser.add_argument("--levels", default="torque")
    parser.add_argument("--plants", default="rk4,semi-implicit", help="integrators")
    parser.add_argument("--slowest", type=float, default=5.0, help="the longest step in ms; the shortest is 0.5")
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--steps", type=int, default=500)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--save", action="store_true")
    options = parser.parse_args()
    from harness import save_rows, setting, show

    rows, slowest = [], float(np.log10(options.slowest * 1e-3))
    choices = (options.robots, options.solvers, options.levels, options.plants)
    with ProcessPoolExecutor(options.workers) as pool:
        for robot, solver, level, plant in product(*(choice.split(",") for choice in choices)):
            shares = np.array_split(np.arange(options.starts), 4 * options.workers)
            given = (options.steps, slowest, plant)
            jobs = [pool.submit(many, robot, solver, level, s, *given) for s in shares if len(s)]
            total = Tally()
            for job in jobs:
                total.add(job.result())
            also = {"dt_ms": f"0.5 to {options.slowest:g}", "plant": plant}
            rows.append(row(robot, solver, level, options.starts, total) | also)
    show("Torque-controlled rollouts", rows)
    if options.save:
        save_rows(RESULTS, rows, setting())


if __name__ == "__main__":
    main()
