"""The methods that spend what the task leaves free."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

import cartctl as cc
from pictures.scenarios import laps, self_motion
from pictures.style import OTHER, OURS, SECOND, arm, curve, panels, workspace


def projected_gradient() -> tuple[Figure, str]:
    """The arm moves, its tip does not."""
    figure, (plane, value) = panels("Every half second", "Objective and tip", widths=(1.0, 1.4))
    objective = cc.Posture([0.6, 0.6, 0.6, 0.6], gain=1.0)
    run = self_motion("projected-gradient", objective)
    robot = run.robot
    for k in range(0, len(run.time), 250):
        arm(plane, robot, run.q[k], color=OURS, alpha=0.18 + 0.75 * k / len(run.time), width=2.4)
    workspace(plane)
    H = [objective.value(robot.state(q)) for q in run.q[::5]]
    value.plot(run.time[::5], H, color=OURS)
    value.set(xlabel="time, s", ylabel="H, rad²", ylim=(0.0, None))
    tip = np.linalg.norm(run.tasks[0].error, axis=1)
    twin = value.twinx()
    twin.spines["right"].set_visible(True)
    twin.grid(False)
    curve(twin, run.time, 1e6 * tip, color=SECOND, lw=1.0)
    twin.set_ylabel("tip off its place, µm", color=SECOND)
    return figure, (
        f"A 4R arm goes towards a posture with its tip held: H falls from {H[0]:.1f} to {H[-1]:.1f} rad², where the "
        f"tip lets it go no further, and the tip is never more than {1e6 * tip.max():.1f} µm away, the error of the "
        "steps of 2 ms."
    )


def reduced_gradient() -> tuple[Figure, str]:
    """The same start, objective and gain as the projected gradient."""
    figure, (value, speed) = panels("Objective", "Joint speed")
    objective = cc.Posture([0.6, 0.6, 0.6, 0.6], gain=1.0)
    found = {}
    for solver, color in (("projected-gradient", OTHER), ("reduced-gradient", OURS)):
        run = self_motion(solver, objective)
        H = np.array([objective.value(run.robot.state(q)) for q in run.q[::4]])
        rates = np.linalg.norm(run.command, axis=1)
        value.plot(run.time[::4], H, color=color, label=solver)
        curve(speed, run.time[:-1], rates, color=color)
        found[solver] = (run.time[::4][np.argmax(0.5 * (H[0] + H[-1]) > H)], rates.max(), H[-1])
    value.set(xlabel="time, s", ylabel="H, rad²")
    speed.set(xlabel="time, s", ylabel="rad/s", ylim=(0.0, None))
    value.legend()
    (t_p, v_p, H_p), (t_r, v_r, H_r) = found["projected-gradient"], found["reduced-gradient"]
    return figure, (
        "The same 4R arm, start, objective and gain, the tip held. The reduced gradient has half of the descent "
        f"behind it after {t_r:.2f} s, the projected one after {t_p:.2f} s, with joint speeds up to {v_r:.1f} against "
        f"{v_p:.1f} rad/s. They end at H = {H_r:.3f} and {H_p:.3f} rad²."
    )


def extended_jacobian() -> tuple[Figure, str]:
    """Closed paths of the tip, closed paths of the joints."""
    figure, (path, drift) = panels("Two joints over five laps", "How far from the start, after each lap")
    ends = {}
    for solver, color in (("pinv", OTHER), ("extended-jacobian", OURS)):
        runs = laps(solver, 5, cc.JointRange() if solver == "extended-jacobian" else None)
        q = np.concatenate([run.q for run in runs])
        curve(path, q[:, 1], q[:, 2], color=color, lw=1.3, label=solver)
        away = [np.linalg.norm(run.q[-1] - q[0]) for run in runs]
        drift.semilogy(range(1, 6), away, "o-", color=color, label=solver)
        ends[solver] = away[-1]
    path.set(xlabel="joint 2, rad", ylabel="joint 3, rad")
    drift.set(xlabel="laps", ylabel="rad", xticks=range(1, 6))
    path.legend()
    return figure, (
        f"The tip goes round a circle five times. Under the pseudo-inverse the joints end {ends['pinv']:.2f} rad from "
        f"where they began; the extended Jacobian keeps joint range extremal and brings them back to within "
        f"{ends['extended-jacobian']:.0e} rad."
    )
