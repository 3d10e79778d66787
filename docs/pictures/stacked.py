"""The methods that see one stack of rows: pseudo-inverse, transpose, main variables."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

import cartctl as cc
from pictures.scenarios import laps
from pictures.style import FAINT, OTHER, OURS, SECOND, THIRD, arm, curve, panels, workspace


def pinv() -> tuple[Figure, str]:
    """Least norm of all answers, and the joint path that does not close."""
    figure, (norm, path) = panels("All answers to one command", "Two joints over five laps of a closed path")
    robot = cc.planar([1.0, 0.8, 0.6])
    A = robot.state([0.4, 0.9, 0.7]).jacobian("tool")[:2]
    solution = cc.solve(cc.Problem([(A, [0.4, -0.3])]), "pinv")
    along = np.linalg.svd(A)[2][2]
    alpha = np.linspace(-1.0, 1.0, 101)
    norm.plot(alpha, [np.linalg.norm(solution.u + a * along) for a in alpha], color=OTHER)
    norm.plot([0.0], [np.linalg.norm(solution.u)], "o", color=OURS, ms=7)
    norm.annotate("pinv", (0.0, np.linalg.norm(solution.u)), (-10, 8), textcoords="offset points", color=OURS)
    norm.set(xlabel="self-motion added to it, rad/s", ylabel="norm of the joint rates, rad/s", ylim=(0.0, None))
    q = np.concatenate([run.q for run in laps("pinv", 5)])
    curve(path, q[:, 1], q[:, 2], color=OURS, lw=1.1)
    path.plot(*q[0, 1:], "o", color=THIRD, label="start")
    path.plot(*q[-1, 1:], "o", color=SECOND, label="after five laps")
    path.set(xlabel="joint 2, rad", ylabel="joint 3, rad")
    path.legend()
    drift = np.linalg.norm(q[-1] - q[0])
    return figure, (
        f"Left: of all joint rates that move the tip as told, the shortest ({np.linalg.norm(solution.u):.2f} rad/s). "
        f"Right: its price. The tip is back on its circle after five laps, the joints {drift:.2f} rad from where they "
        "began."
    )


def transpose() -> tuple[Figure, str]:
    """Gradient steps towards a fixed target."""
    figure, (plane, error) = panels("The tip on its way", "Distance left", widths=(1.0, 1.3))
    robot = cc.planar([1.0, 0.8, 0.6])
    goal, start, count = np.array([0.3, 1.6]), np.array([0.2, 0.4, 0.5]), 40
    left = {}
    for solver, color, label in (
        ("pinv", OTHER, "pinv"), (cc.Transpose(alpha=0.15), SECOND, "alpha = 0.15"), ("transpose", OURS, "steepest"),
    ):  # fmt: skip
        q, tips = start.copy(), []
        for _ in range(count + 1):
            state = robot.state(q)
            tips.append(state.position("tool")[:2])
            q = q + cc.solve(cc.Problem([(state.jacobian("tool")[:2], goal - tips[-1])]), solver).u
        left[label] = np.maximum(np.linalg.norm(np.array(tips) - goal, axis=1), 1e-9)
        plane.plot(*np.array(tips).T, ".-", ms=3.5, lw=1.0, color=color)
        error.plot(left[label], color=color, label=label)
    arm(plane, robot, start, color=FAINT)
    plane.plot(*goal, "+", color="black", ms=9)
    workspace(plane)
    error.set(yscale="log", xlabel="steps", ylabel="m", ylim=(1e-7, 3.0))
    error.legend()
    return figure, (
        f"Whole steps towards a fixed point. After ten the pseudo-inverse has arrived; the steepest transpose step is "
        f"{1e3 * left['steepest'][10]:.0f} mm away, a fixed one {1e3 * left['alpha = 0.15'][10]:.0f} mm; after "
        f"{count}: {1e3 * left['steepest'][count]:.2f} and {1e3 * left['alpha = 0.15'][count]:.2f} mm."
    )


def main_variables() -> tuple[Figure, str]:
    """Rows that depend on each other, with commands that agree and commands that do not."""
    figure, (agreed, torn) = panels("Commands that agree", "Commands that do not")
    robot = cc.planar([1.0, 0.8, 0.6])
    xy = robot.state([0.4, 0.9, 0.7]).jacobian("tool")[:2]
    A = np.vstack([xy, xy.sum(axis=0) / np.sqrt(2.0)])
    fair = np.array([0.4, -0.3, 0.1 / np.sqrt(2.0)])
    misses = {}
    for ax, b in ((agreed, fair), (torn, fair + [0.0, 0.0, 0.2])):
        for k, (solver, color) in enumerate((("pinv", OTHER), ("main-variables", OURS))):
            miss = np.abs(A @ cc.solve(cc.Problem([(A, b)]), solver).u - b)
            ax.bar(np.arange(3) + 0.36 * (k - 0.5), miss, 0.34, color=color, label=solver)
            misses[solver] = miss
        ax.set(xticks=range(3), xticklabels=["x", "y", "along x + y"], ylabel="missed by, m/s", ylim=(0.0, 0.22))
        ax.grid(axis="x", visible=False)
    agreed.text(1.0, 0.1, "both meet all three", ha="center", color="#555555")
    torn.legend(loc="upper left")
    whole = [name for name, m in zip(("x", "y", "x + y"), misses["main-variables"], strict=True) if m < 1e-9]
    return figure, (
        "Three rows of rank two. Where the commands agree both methods meet all three; where they do not the "
        f"pseudo-inverse spreads the contradiction, and `main-variables` meets {' and '.join(whole)} exactly and "
        f"leaves the third {misses['main-variables'].max():.2f} m/s off."
    )
