"""Random paths of the hand, planned from a fixed start: kinetic energy beside the local methods', same quadrature.

    python benchmarks/plan_paths.py --robots panda,lwr --paths 25 --save

A path is drawn from a random posture inside the limits: a line, circle, ellipse or eight, 2 to 5 s. It counts where at
least one local method does it within the limits; the others are counted apart. Task errors are in m and rad, the bound
is the one the report states for what lies between samples, excess in half-ranges of a limit.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import numpy as np

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "plan_paths.csv"
ACCELERATION = 15.0  # rad/s^2, where a robot brings none along
SAMPLES = 60


def limits_of(robot):
    """The robot's own, with an acceleration limit where it has none."""
    own = robot.limits
    a = np.where(np.isfinite(own.acceleration_upper), own.acceleration_upper, ACCELERATION)
    return own.replace(acceleration_lower=-a, acceleration_upper=a)


def random_path(robot, rng):
    """A start q0 and a path of the tool from there."""
    low, high = robot.limits.position_lower, robot.limits.position_upper
    while True:
        q0 = low + (high - low) * rng.uniform(0.15, 0.85, robot.nv)
        state = robot.state(q0)
        if np.linalg.svd(state.jacobian(robot.tool), compute_uv=False)[-1] > 0.08:
            break
    pose, size, period = state.placement(robot.tool), rng.uniform(0.04, 0.16), rng.uniform(2.0, 5.0)
    normal, kind = rng.normal(size=3), ("line", "circle", "ellipse", "eight")[int(rng.integers(4))]
    R, p = pose.rotation, pose.translation
    if kind == "line":
        return q0, kind, period, cc.Line(pose, pin_at(pose, p + 2.0 * size * unit(rng)), duration=period)
    if kind == "circle":
        return (
            q0,
            kind,
            period,
            cc.Circle.starting_at(pose, radius=size, normal=normal, towards=unit(rng), period=period),
        )
    if kind == "ellipse":
        x = np.cross(normal, unit(rng))
        x /= np.linalg.norm(x)
        return q0, kind, period, cc.Ellipse(p - size * x, (size, 0.5 * size), period, 1, normal, R, x_axis=x)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axes *= np.sign(np.linalg.det(axes))
    return q0, kind, period, cc.Lissajous(p, (size, 0.5 * size, 0.0), (1, 2, 0), (0, 0, 0), period, 1, R, axes=axes)


def unit(rng):
    x = rng.normal(size=3)
    return x / np.linalg.norm(x)


def pin_at(pose, position):
    moved = pose.copy()
    moved.translation = position
    return moved


def planned(robot, limits, q0, path, samples=SAMPLES, **how):
    """The plan, silently."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cc.CartctlWarning)
        hand = cc.FrameTask(robot.tool, target=path)
        return cc.plan(robot, hand, samples=samples, limits=limits, q0=q0, **how)


def row(robot_name, number, kind, period, report):
    best = report.best
    return {
        "robot": robot_name,
        "path": str(number),
        "kind": kind,
        "period_s": f"{period:.3f}",
        "status": report.status.name,
        "plan": f"{report.cost:.8g}",
        "best_local": "" if best is None else best.name,
        "local": "" if best is None else f"{best.cost:.8g}",
        "ratio": "" if best is None else f"{report.cost / best.cost:.8f}",
        "residual_m": f"{report.residual.m:.1e}",
        "residual_rad": f"{report.residual.rad:.1e}",
        "between_m": f"{report.between.m:.1e}",
        "between_rad": f"{report.between.rad:.1e}",
        "excess": f"{report.excess:.1e}",
        "iterations": str(report.iterations),
        "seconds": f"{report.seconds:.2f}",
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", default="panda,lwr")
    parser.add_argument("--paths", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--save", action="store_true")
    options = parser.parse_args()
    from harness import save_rows, setting

    rows = []
    for name in options.robots.split(","):
        robot, rng = cc.load(name), np.random.default_rng(options.seed)
        limits, counted, refused, number = limits_of(robot), [], 0, 0
        while len(counted) < options.paths:
            q0, kind, period, path = random_path(robot, rng)
            report = planned(robot, limits, q0, path).report
            number += 1
            if report.best is None:
                refused += 1
                print(f"{name} {number}: no local method keeps task and limits; plan {report.status.name}", flush=True)
                continue
            counted.append(row(name, number, kind, period, report))
            print(" ".join(f"{k}={v}" for k, v in counted[-1].items()), flush=True)
        ratios = np.array([float(r["ratio"]) for r in counted])
        print(
            f"{name}: {len(counted)} paths ({refused} more without a local method within task and limits): "
            f"largest ratio {ratios.max():.6f}, below 1 - 1e-6 on {(ratios < 1.0 - 1e-6).sum()}, "
            f"median {np.median(ratios):.4f}, least {ratios.min():.4f}"
        )
        rows += counted
    if options.save:
        save_rows(RESULTS, rows, setting())


if __name__ == "__main__":
    main()
