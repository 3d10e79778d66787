"""The methods under bounds."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

import cartctl as cc
from pictures.style import FAINT, OTHER, OURS, curve, panels
from pictures.velocities import COLORS, COMMAND, circle, paths, reach, turned, velocities


def task_scaling() -> tuple[Figure, str]:
    """The slowed pseudo-inverse, beside what joints at their limits could still give."""
    figure, (plane, share) = panels("Hand velocities", "Share of the command, on a circle too fast", widths=(1.0, 1.3))
    found = velocities(plane, "task-scaling", "sns")
    for name in ("sns", "task-scaling"):
        run, _ = circle(name)
        curve(share, run.time[:-1], run.tasks[0].scale, color=COLORS[name], label=name)
    share.set(xlabel="time, s", ylabel="s", ylim=(0.0, 1.05))
    share.legend(loc="lower right")
    less, more = (np.linalg.norm(found[name]) / np.linalg.norm(COMMAND) for name in ("task-scaling", "sns"))
    return figure, (
        "Left, grey: all hand velocities within 1 rad/s a joint; dotted: those of them that the pseudo-inverse finds. "
        f"Task scaling goes along the command until the first joint is at its limit, {100 * less:.0f} % of what was "
        f"told; with that joint held there and the others going on, {100 * more:.0f} % were possible. The clipped "
        f"pseudo-inverse is {turned(found['clipped']):.0f} degrees off."
    )


def sns() -> tuple[Figure, str]:
    """The farthest along the command, and the circle it does not leave."""
    figure, (plane, way) = panels("Hand velocities", "The tip on a circle too fast", widths=(1.0, 1.0))
    found = velocities(plane, "sns", "hqp")
    off = paths(way, "hqp", "sns")
    run, _ = circle("sns")
    most = max(int(np.isclose(np.abs(c), 1.0, atol=1e-9).sum()) for c in run.command)
    return figure, (
        "Left: `sns` keeps the direction of the command and gives all the arm has along it, "
        f"{100 * np.linalg.norm(found['sns']) / np.linalg.norm(COMMAND):.0f} % of what was told. Right: on a circle "
        f"that asks for too much the tip stays within {off['sns']:.1f} mm of the curve and arrives later, with up to "
        f"{most} of 4 joints at their limits; `hqp` is in time and leaves it by {off['hqp']:.0f} mm."
    )


def hqp() -> tuple[Figure, str]:
    """The nearest there is, and an inequality with a priority."""
    figure, (plane, value) = panels("Hand velocities", "An inequality above and below a task", widths=(1.0, 1.2))
    found = velocities(plane, "sns", "hqp")
    near, far = (np.linalg.norm(found[name] - COMMAND) for name in ("hqp", "sns"))
    J, _, _ = reach()
    stay = cc.Inequality(J[1:], lower=[-0.3], upper=[0.3])
    told = np.linspace(-1.0, 1.0, 81)
    value.axhspan(-0.3, 0.3, color=FAINT, alpha=0.6, lw=0)
    for label, color, first in (("inequality above", COLORS["hqp"], True), ("inequality below", OTHER, False)):
        given = []
        for y in told:
            move = cc.Equation(J[1:], [y])
            levels = [stay, move] if first else [move, stay]
            given.append((J @ cc.solve(cc.Problem(levels, lower=-np.ones(4), upper=np.ones(4)), "hqp").u)[1])
        value.plot(told, given, color=color, label=label)
    value.set(xlabel="y velocity told, m/s", ylabel="y velocity given, m/s")
    value.legend(loc="upper left")
    _, distance = circle("hqp")
    return figure, (
        f"Left: `hqp` gives the velocity nearest to the command, {near:.2f} m/s from it (`sns`: {far:.2f}), and turns "
        f"it by {turned(found['hqp']):.0f} degrees; on the circle of the page of `sns`, which asks for too much, its "
        f"tip cuts across by up to {1e3 * distance.max():.0f} mm. Right: |y| <= 0.3 m/s as an inequality above a task "
        "clamps it, below it yields."
    )


def qp() -> tuple[Figure, str]:
    """Two tasks that cannot both be met, by the ratio of their weights."""
    figure, (plane, weights) = panels("Hand velocities", "Two tasks in conflict, by weight", widths=(1.0, 1.3))
    found = velocities(plane, "sns", "qp")
    J, _, _ = reach()
    ratios = np.logspace(-3, 6, 73)
    first, second = (J, COMMAND / 2.0), (np.eye(4), [0.5, -0.5, 0.5, -0.5])
    misses = []
    for ratio in ratios:
        equations = [cc.Equation(*first, weight=ratio), cc.Equation(*second)]
        misses.append(cc.solve(cc.Problem(equations, lower=-np.ones(4), upper=np.ones(4)), "qp").residuals)
    strict = cc.solve(cc.Problem([first, second], lower=-np.ones(4), upper=np.ones(4)), "hqp").residuals
    misses = np.array(misses)
    weights.plot(ratios, misses[:, 0], color=COLORS["qp"], label="hand")
    weights.plot(ratios, misses[:, 1], color=COLORS["qp"], ls="--", label="posture")
    weights.axhline(strict[1], color=COLORS["hqp"], lw=0.9)
    weights.annotate("posture under hqp", (1e-3, strict[1]), (0, 4), textcoords="offset points", color=COLORS["hqp"])
    weights.set(xscale="log", xlabel="weight of the hand, that of the posture being 1", ylabel="missed by")
    weights.legend(loc="center right")
    alone = J @ cc.solve(cc.Problem([(J, COMMAND)], lower=-np.ones(4), upper=np.ones(4)), "hqp").u
    equal = misses[np.argmin(np.abs(ratios - 1.0)), 0]
    return figure, (
        "Left: alone, the task's answer is the nearest velocity, as `hqp` has it, "
        f"{np.linalg.norm(found['qp'] - alone):.0e} m/s apart by the damping. Right: two tasks share by weight; with "
        f"equal weights the hand misses {equal:.2f} m/s of {np.linalg.norm(COMMAND) / 2:.2f}, with a million times "
        f"the weight {misses[-1, 0]:.0e}: near to a priority, never one. At the far right the damping, which is "
        "relative to the weighted tasks, begins to outweigh the posture."
    )


def sns_greedy() -> tuple[Figure, str]:
    """How far the published iteration is from the optimum, over random problems."""
    figure, (against, gap) = panels("Scale reached, 400 random problems", "Those that fall short", widths=(1.0, 1.3))
    rng = np.random.default_rng(7)
    scales = []
    while len(scales) < 400:
        A, b = rng.normal(size=(6, 7)), rng.normal(size=6)
        problem = cc.Problem([(A, 3.0 * b)], lower=-rng.uniform(0.2, 1.0, 7), upper=rng.uniform(0.2, 1.0, 7))
        best = cc.solve(problem, "sns").scales[0]
        if best < 1.0:
            scales.append((best, cc.solve(problem, "sns-greedy").scales[0]))
    best, greedy = np.array(scales).T
    lost = 1.0 - greedy / best
    against.plot([0, 1], [0, 1], color=OTHER, lw=0.8)
    against.plot(best, greedy, ".", color=OURS, ms=3, alpha=0.6)
    against.set(xlabel="s of sns, the optimum", ylabel="s of sns-greedy", aspect="equal")
    short = np.sort(lost[lost > 1e-6])[::-1]
    gap.semilogy(100.0 * short, ".-", color=OURS, ms=4, lw=0.8)
    gap.set(xlabel="problems, the worst first", ylabel="of the scale lost, %")
    return figure, (
        f"One task of 6 rows for 7 joints, 400 random commands that must be slowed. In {len(short)} of them the "
        f"iteration keeps a joint saturated that the optimum frees, and loses up to {100.0 * short.max():.1f} % of "
        "the scale; in the others it finds the optimum."
    )
