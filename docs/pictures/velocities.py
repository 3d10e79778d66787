"""The plane of hand velocities that bounded joints can give, and a circle that is too fast for them."""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from scipy.spatial import ConvexHull

import cartctl as cc
from pictures.scenarios import four_joints, too_fast
from pictures.style import FAINT, OTHER, OURS, SECOND, THIRD, curve, workspace

COMMAND = np.array([-1.15, 1.0])  # m/s, more than the arm can give
COLORS = {"task-scaling": THIRD, "sns": OURS, "hqp": SECOND, "qp": "#7b4bb3", "sns-greedy": OURS}


@lru_cache
def reach() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """J (2, 4) in one posture, the hull of what rates within 1 rad/s can give, that of what the pseudo-inverse can."""
    J = four_joints().state([0.5, 0.6, 0.9, 0.7]).jacobian("tool")[:2]
    corners = np.array([J @ signs for signs in product((-1.0, 1.0), repeat=4)])
    angles = np.linspace(0.0, 2.0 * np.pi, 721)
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    rates = np.array([cc.solve(cc.Problem([(J, ray)]), "pinv").u for ray in rays])
    return J, corners[ConvexHull(corners).vertices], rays / np.abs(rates).max(axis=1)[:, None]


def velocities(ax: Axes, *names: str) -> dict[str, np.ndarray]:
    """Draw the plane of hand velocities, with the answers of the methods named and of a clipped pseudo-inverse."""
    J, hull, plain = reach()
    ax.fill(*hull.T, color=FAINT, alpha=0.55, lw=0)
    ax.plot(*np.vstack([hull, hull[:1]]).T, color=OTHER, lw=1.0)
    ax.plot(*plain.T, color=OTHER, lw=0.8, ls=":")
    ax.plot([0.0, COMMAND[0]], [0.0, COMMAND[1]], color="#555555", lw=0.8, ls="--")
    ax.plot(*COMMAND, "*", color="black", ms=9)
    ax.annotate("told", COMMAND, (5, 2), textcoords="offset points")
    clipped = J @ np.clip(cc.solve(cc.Problem([(J, COMMAND)]), "pinv").u, -1.0, 1.0)
    ax.plot(*clipped, "x", color="#777777", ms=7)
    ax.annotate("pinv, clipped", clipped, (6, -9), textcoords="offset points", color="#666666")
    found = {"clipped": clipped}
    for name in names:
        u = cc.solve(cc.Problem([(J, COMMAND)], lower=-np.ones(4), upper=np.ones(4)), name).u
        found[name] = J @ u
        ax.plot(*found[name], "o", color=COLORS[name], ms=6.5)
        at, side = ((6, -11), "left") if name == "sns" else ((-7, -3), "right")
        ax.annotate(name, found[name], at, textcoords="offset points", color=COLORS[name], ha=side)
    ax.set_aspect("equal")
    ax.set(
        xlabel="hand velocity x, m/s",
        ylabel="y, m/s",
        xlim=(-2.0, 0.25),
        ylim=(-0.15, 1.2),
        xticks=[-2, -1.5, -1, -0.5, 0],
    )
    return found


def turned(v: np.ndarray) -> float:
    """The angle to the command, deg."""
    c = COMMAND @ v / np.linalg.norm(COMMAND) / np.linalg.norm(v)
    return float(np.degrees(np.arccos(min(1.0, c))))


@lru_cache
def circle(solver: str) -> tuple[cc.Run, np.ndarray]:
    """The circle that is too fast, and the distance of the tip from the path as a curve, (N+1,) m."""
    run = too_fast(solver)
    tips, target = run.tasks[0].pose[:, :2], run.tasks[0].target[:, :2]
    centre = 0.5 * (target.max(axis=0) + target.min(axis=0))
    return run, np.abs(np.linalg.norm(tips - centre, axis=1) - 0.3)


def paths(ax: Axes, *names: str) -> dict[str, float]:
    """Draw the way of the tips; the largest distance from the circle, mm."""
    off = {}
    for name in names:
        run, distance = circle(name)
        tips = run.tasks[0].pose[:, :2]
        centre = 0.5 * (run.tasks[0].target[:, :2].max(axis=0) + run.tasks[0].target[:, :2].min(axis=0))
        ring = np.linspace(0.0, 2.0 * np.pi, 91)
        ax.plot(centre[0] + 0.3 * np.cos(ring), centre[1] + 0.3 * np.sin(ring), color=FAINT, lw=5, zorder=0)
        curve(ax, *tips.T, color=COLORS[name], lw=1.4, label=name)
        off[name] = 1e3 * float(distance.max())
    workspace(ax)
    ax.legend(loc="center")
    return off
