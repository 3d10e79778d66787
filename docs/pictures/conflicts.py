"""The methods that rank tasks, where tasks are in each other's way."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

import cartctl as cc
from pictures.scenarios import four_joints
from pictures.style import OTHER, OURS, SECOND, arm, curve, panels, workspace

BENDS = np.linspace(-0.8, 0.8, 321)  # of joint 2; at 0 tip and orientation of a 3R arm are in conflict


TASKS = [([0, 1], [0.3, 0.1]), ([5], [0.6])]  # rows of the tip's Jacobian and their commands


def task_priority() -> tuple[Figure, str]:
    """A tip and an elbow that cannot both be where they should."""
    figure, (plane, error) = panels("At the end", "Tip off its place", widths=(1.0, 1.4))
    robot = four_joints()
    tip, elbow = [0.9, 0.5, 0.0], [-0.2, 0.75, 0.0]
    ends = {}
    methods = (("stacked", cc.DLS(0.1), OTHER), ("ranked", cc.TaskPriority(cc.Damped(0.1)), OURS))
    for label, solver, color in methods:
        tasks = [
            cc.FrameTask("tool", "xy", target=tip, gain=4.0), cc.FrameTask("link3", "xy", target=elbow, gain=4.0),
        ]  # fmt: skip
        controller = cc.Controller(robot, tasks, solver=solver, limits=None, dt=2e-3)
        run = cc.simulate(controller, [0.5, 0.6, 0.5, 0.5], duration=6.0)
        arm(plane, robot, run.q[-1], color=color)
        misses = [np.linalg.norm(task.error, axis=1) for task in run.tasks]
        curve(error, run.time, np.maximum(misses[0], 1e-9), color=color, label=label)
        ends[label] = [1e3 * m[-1] for m in misses]
    plane.plot(*tip[:2], "+", color="black", ms=9)
    plane.plot(*elbow[:2], "x", color=SECOND, ms=8)
    plane.annotate("elbow's", elbow[:2], (5, 4), textcoords="offset points", color=SECOND)
    plane.annotate("tip's", tip[:2], (5, 4), textcoords="offset points")
    workspace(plane)
    error.set(yscale="log", xlabel="time, s", ylabel="m", ylim=(1e-7, 3.0))
    error.legend()
    (tip_p, elbow_p), (_, elbow_r) = ends["stacked"], ends["ranked"]
    return figure, (
        f"Tip and elbow cannot both be where they should. Stacked, both are wrong, the tip by {tip_p:.0f} mm and the "
        f"elbow by {elbow_p:.0f}; ranked, the tip arrives and the elbow stays {elbow_r:.0f} mm away."
    )


def _sweep(solver, ranked: list[tuple[list[int], list[float]]]) -> tuple[np.ndarray, np.ndarray]:
    """Joint speeds (N,) and what each task misses (N, p), over postures that pass the conflict at 0."""
    robot = cc.planar([1.0, 0.8, 0.6])
    speeds, misses = [], []
    for bend in BENDS:
        J = robot.state([0.3, bend, 0.8]).jacobian("tool")
        solution = cc.solve(cc.Problem([(J[rows], b) for rows, b in ranked]), solver)
        speeds.append(np.linalg.norm(solution.u))
        misses.append(solution.residuals)
    return np.array(speeds), np.array(misses)


def singularity_robust_priority() -> tuple[Figure, str]:
    """Tip first, orientation second, through postures where the second is impossible."""
    figure, (speed, miss) = panels("Joint speed", "What the second task misses")
    found = {}
    for solver, color in (("task-priority", OTHER), ("singularity-robust-priority", OURS)):
        speeds, misses = _sweep(solver, TASKS)
        speed.plot(BENDS, speeds, color=color, label=solver)
        miss.plot(BENDS, misses[:, 1], color=color)
        found[solver] = speeds.max(), np.median(misses[:, 1]), misses[:, 0].max()
    speed.set(xlabel="joint 2, rad", ylabel="rad/s", yscale="log")
    miss.set(xlabel="joint 2, rad", ylabel="rad/s")
    speed.legend(loc="upper right")
    ours, strict = found["singularity-robust-priority"], found["task-priority"]
    return figure, (
        "A 3R arm's tip and, below it, its orientation, in postures where they come into conflict (at 0). Task "
        f"priority asks for {strict[0]:.0f} rad/s beside the conflict, this method never for more than {ours[0]:.1f}; "
        f"away from it the orientation is missed by {ours[1]:.2f} rad/s, where task priority meets it. The tip moves "
        "as told under both."
    )


def reverse_priority() -> tuple[Figure, str]:
    """More tasks than joints, over random postures; and a conflict passed with coarse cutoffs."""
    figure, (bars, speed) = panels("Three tasks on three joints: median miss", "Joint speed at a conflict")
    robot, rng = cc.planar([1.0, 0.8, 0.6]), np.random.default_rng(5)
    misses: dict[str, list[np.ndarray]] = {"task-priority": [], "reverse-priority": []}
    for _ in range(400):
        state = robot.state(rng.uniform(-2.5, 2.5, 3))
        J, elbow = state.jacobian("tool"), state.jacobian("link3")[:2]
        problem = cc.Problem([(J[:1], [0.3]), (elbow, [0.2, 0.4]), (J[5:], [0.6])])
        for solver, found in misses.items():
            found.append(cc.solve(problem, solver).residuals)
    for k, (solver, found) in enumerate(misses.items()):
        means = np.median(found, axis=0)
        bars.bar(np.arange(3) + 0.36 * (k - 0.5), means, 0.34, color=(OTHER, OURS)[k], label=solver)
    bars.set(xticks=range(3), xticklabels=["tip's x", "elbow", "orientation"], ylabel="m/s, rad/s")
    bars.grid(axis="x", visible=False)
    bars.legend(loc="upper left")
    exact, _ = _sweep("reverse-priority", TASKS)
    coarse, left = _sweep(cc.ReversePriority(cutoff=0.05), TASKS)
    speed.plot(BENDS, exact, color=OTHER, label="cutoff 1e-10")
    speed.plot(BENDS, coarse, color=OURS, label="cutoff 0.05")
    speed.set(xlabel="joint 2, rad", ylabel="rad/s", yscale="log")
    speed.legend(loc="upper right")
    strict, reverse = (np.median(found, axis=0) for found in misses.values())
    return figure, (
        "Left: tasks that cannot all be met, in 400 random postures. Both orders meet the first; of the others the "
        f"second is missed by {reverse[1]:.2f} m/s (the median) in reverse order and {strict[1]:.2f} in the usual "
        f"one, the third by {reverse[2]:.2f} and {strict[2]:.2f} rad/s. Right: where tip and orientation of a 3R arm "
        f"come into conflict, a coarse cutoff keeps the joints below {coarse.max():.0f} rad/s, and the tip still "
        f"moves as told to within {left[:, 0].max():.0e} m/s."
    )
