"""The three classical norms of torque compared, on short and long motions, with and without damping of the null space.

    python benchmarks/torque_norms.py            # print the table
    python benchmarks/torque_norms.py --save     # and write results/torque_norms.csv and docs/torque-norms.png

The Panda, its torque bounds off, follows with the position of its hand a line of 0.3 m in 0.6 s (short) and a circle of
2 s, lap after lap, for 10 s (long); four joints to spare, simulated by rk4 at 1 ms, from eight postures near home. The
null space is classical (u0 = 0) without gravity, as in the published experiments; the same under gravity; and damped.
What textbooks advise: least torque is good on short motions and oscillates on long ones; M^-2 is good in general.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
from harness import save_rows, setting, show
from torque_norms_plot import draw

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "torque_norms.csv"
PICTURE = Path(__file__).parent.parent / "docs" / "torque-norms.png"
NORMS = {"identity": "I", "inverse-inertia": "M^-1", "inverse-inertia-squared": "M^-2"}
STARTS = 8
SHORT, LONG = 0.6, 10.0  # s
SETTINGS = {
    "classical, no gravity": (0.0, (0.0, 0.0, 0.0)),
    "classical": (0.0, (0.0, 0.0, -9.81)),
    "damped": (None, (0.0, 0.0, -9.81)),
}


class Figures(NamedTuple):
    """One motion: peak torque, N m; integral of ||tau||^2; top speed, rad/s; reversals a joint and s; error, m; s."""

    peak: float
    effort: float
    speed: float
    reversals: float
    rms: float
    lasted: float


def start_of(robot, rng):
    """A posture near home, so that no figure hangs on one of them."""
    return robot.integrate(robot.home, rng.uniform(-0.3, 0.3, robot.nv))


def target_of(robot, q0, long):
    """A circle of 0.1 m, 2 s a lap, or a line upwards and back to the robot."""
    at = robot.state(q0).placement(robot.tool)
    if long:
        return cc.Circle.starting_at(at, radius=0.1, period=2.0, laps=int(LONG / 2.0))
    return cc.Line(at.translation, at.translation + np.array([-0.15, 0.15, 0.2]), duration=SHORT)


def motion(robot, q0, norm, damping, long):
    """One motion as a Run; it ends early where it runs away."""
    task = cc.FrameTask(robot.tool, "position", gain=20.0, target=target_of(robot, q0, long))
    level, solver = cc.TorqueLevel(damping), "projected-gradient"
    controller = cc.Controller(robot, task, solver, level, limits=None, metric=norm, dt=1e-3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cc.CartctlWarning)
        return cc.simulate(controller, q0, LONG if long else SHORT, integrator="rk4")


def figures_of(run):
    """The figures of a run; one that ran away counts up to where it did."""
    torque, dt = run.torque, run.meta["dt"]
    turning = np.diff(np.sign(np.diff(torque, axis=0)), axis=0) != 0
    swing = np.abs(np.diff(torque, axis=0))[1:] > 1e-3  # N m a step: what a plot would show
    lasted = len(run) * dt
    return Figures(
        peak=float(np.abs(torque).max()),
        effort=float(np.sum(torque**2) * dt),
        speed=float(np.abs(run.v).max()),
        reversals=float((turning & swing).sum() / torque.shape[1] / lasted),
        rms=float(run.metrics().tasks[0].rms_m),
        lasted=lasted,
    )


def row(kind, setting, norm, figures):
    """Medians over the starts, and the worst peak."""
    median = Figures(*(float(np.median(values)) for values in zip(*figures, strict=True)))
    return {
        "motion": kind,
        "null_space": setting,
        "weight": NORMS[norm],
        "peak_torque_nm": f"{median.peak:.1f}",
        "worst_peak_nm": f"{max(f.peak for f in figures):.1f}",
        "effort_n2m2s": f"{median.effort:.3g}",
        "top_speed_rad_s": f"{median.speed:.2f}",
        "worst_speed_rad_s": f"{max(f.speed for f in figures):.1f}",
        "reversals_per_joint_s": f"{median.reversals:.1f}",
        "rms_mm": f"{1e3 * median.rms:.4f}",
        "ran_away": f"{sum(f.lasted < (LONG if kind == 'long' else SHORT) - 1e-9 for f in figures)} of {len(figures)}",
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true")
    save = parser.parse_args().save
    rows, drawn = [], {}
    for kind in ("short", "long"):
        for setting_name, (damping, gravity) in SETTINGS.items():
            robot = cc.load("panda", gravity=gravity)
            for norm in NORMS:
                rng, figures = np.random.default_rng(0), []
                for k in range(STARTS):
                    run = motion(robot, start_of(robot, rng), norm, damping, kind == "long")
                    figures.append(figures_of(run))
                    if k == 0:
                        drawn[kind, setting_name, NORMS[norm]] = run
                rows.append(row(kind, setting_name, norm, figures))
    show("The three norms on the Panda, position of the hand", rows)
    if save:
        save_rows(RESULTS, rows, setting())
        draw(drawn, PICTURE)


if __name__ == "__main__":
    main()
