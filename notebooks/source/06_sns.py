# %% [markdown]
# # 6 · SNS against clamping and scaling
#
# $$ \max\; s \in [0, 1], \quad\text{then}\quad \min_v \tfrac12 \lVert v \rVert^2 \quad\text{subject to}\quad
# J v = s\, b, \qquad -V \le v \le V $$
#
# The pseudo-inverse knows no limits. **What should a redundant arm do when a joint cannot turn as
# fast as asked?** Three answers: clamp that joint, slow all of them, or let the others take over
# (saturation in the null space, SNS: Flacco, De Luca & Khatib 2012).
#
# $b$ is the hand's command, $V$ the largest joint speeds, $s$ the share of the command that is
# carried out.

# %%
from dataclasses import dataclass
from typing import ClassVar

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial import ConvexHull

import cartctl as cc

plt.style.use("cartctl.report.lecture")

# %% [markdown]
# ## One step
#
# From A. De Luca's slides of *Robotics 2*, Sapienza: a 4R arm with unit links, folded like stairs,
# the tip to move at (−4, −1.5) m/s. Clamping is what many controllers do without saying so; as a
# solver it takes three lines.


# %%
@dataclass(frozen=True)
class Clamp(cc.Solver):
    """The pseudo-inverse's answer, each joint cut off at its limit."""

    name: ClassVar[str] = "clamp"
    honours: ClassVar[frozenset[str]] = frozenset({"bounds"})

    def _solve_impl(self, problem):
        u = cc.solve(problem.without_bounds(), "pinv").u
        return cc.Solution(problem, problem.clip(u), self.name)


arm = cc.planar([1.0, 1.0, 1.0, 1.0])
q0 = np.radians([90.0, -90.0, 90.0, -90.0])
J, b, V = arm.state(q0).jacobian("tool")[:2], np.array([-4.0, -1.5]), np.array([2.0, 2.0, 4.0, 4.0])
problem = cc.Problem([(J, b)], lower=-V, upper=V)
free = cc.solve(problem.without_bounds(), "pinv").u
answers = {
    "clamped": cc.solve(problem, Clamp()),
    "scaled": cc.solve(problem, "task-scaling"),
    "SNS": cc.solve(problem, "sns"),
}

print("no limits", free.round(4), "rad/s")
for name, answer in answers.items():
    moves, s = (J @ answer.u).round(3), answer.scales[0]
    print(f"{name:9s} {answer.u.round(4)} -> tip {moves} m/s, s = {s:.4f}")

assert np.allclose(free, [2.4545, -2.1364, 1.2273, -3.3636], atol=6e-5)  # as published, all of it
assert np.isclose(answers["scaled"].scales[0], 0.8148, atol=6e-5)
assert (
    np.allclose(answers["SNS"].u, [2.0, -1.8333, 1.8333, -3.6667], atol=6e-5)
    and answers["SNS"].scales[0] == 1.0
)

# %% [markdown]
# Clamped, the tip moves in another direction. Scaled, it keeps the direction and loses 19 % of its
# speed. SNS holds the first joint at its limit and asks the three others for the rest: the full
# command, within all limits.
#
# ## How SNS does it
#
# Hold what is saturated, solve again with the free columns, repeat. That greedy iteration can end
# with the wrong joints held; `"sns"` therefore checks the multipliers and returns the exact
# optimum, with a certificate anyone can recompute.

# %%
held = np.array([V[0], 0.0, 0.0, 0.0])  # the first joint, at its upper limit
rest = cc.solve(cc.Problem([(J[:, 1:], b - J @ held)]), "pinv").u
by_hand = held + np.concatenate([[0.0], rest])
assert np.allclose(by_hand, answers["SNS"].u)
assert answers["SNS"].certificate().holds(1e-9)
print("saturated:", answers["SNS"].saturated, " certificate: worst residual below 1e-9")

# %% [markdown]
# ## How much could the hand have?
#
# All velocities that the joints can give the tip within their limits form a polygon, the box
# $|v_i| \le V_i$ seen through $J$. The command lies inside, so slowing it down was never
# necessary. Along $b$, SNS reaches the very edge:

# %%
box = np.array(np.meshgrid(*[(-x, x) for x in V])).reshape(4, -1)
shadow = (J @ box).T
polygon = shadow[ConvexHull(shadow).vertices]

more = cc.solve(cc.Problem([(J, 10.0 * b)], lower=-V, upper=V), "sns")
A, c = ConvexHull(shadow).equations[:, :2], -ConvexHull(shadow).equations[:, 2]
edge = np.min((c / (A @ b))[A @ b > 0])
print(f"the edge is at {edge:.3f} b, SNS gets to {10.0 * more.scales[0]:.3f} b", end=", ")
print(f"the scaled pseudo-inverse to {answers['scaled'].scales[0]:.3f} b")
assert np.isclose(10.0 * more.scales[0], edge)

# %% [markdown]
# ## A circle that is too fast
#
# One lap of 0.8 m radius, planned in 1 s. With `sns` and `task-scaling` the path waits for the
# slowed hand; the clamped arm runs after a target that does not wait.

# %%
start = arm.state(q0).position("tool")
circle = cc.Circle.starting_at(start, radius=0.8, period=1.0)
limits = arm.limits.replace(velocity_lower=-V, velocity_upper=V)
hand = cc.FrameTask("tool", "xy", gain=10.0, target=circle)
runs, off, arrival = {}, {}, {}
for name, solver in {"clamped": Clamp(), "scaled": "task-scaling", "SNS": "sns"}.items():
    run = runs[name] = cc.simulate(
        cc.Controller(arm, hand, solver=solver, limits=limits, dt=2e-3), q0, duration=2.0
    )
    at = run.tasks[0].pose[:, :2]
    off[name] = np.abs(np.linalg.norm(at - circle.center[:2], axis=1) - 0.8).max()
    away = np.flatnonzero(np.linalg.norm(at - start[:2], axis=1) > 0.01)
    arrival[name] = run.time[away[-1] + 1]
    print(
        f"{name:8s} at most {1e3 * off[name]:5.1f} mm off the circle, back at {arrival[name]:.2f} s"
    )
    assert np.all(abs(run.v) <= V + 1e-9)

assert off["clamped"] > 0.4 and max(off["scaled"], off["SNS"]) < 8e-3
assert arrival["SNS"] < 1.15 and arrival["scaled"] > 1.3

# %%
fig, (a, m, c) = plt.subplots(1, 3, width_ratios=[1.1, 1.1, 1])
colors, dashes = (
    {"clamped": "C3", "scaled": "C1", "SNS": "C0"},
    {"clamped": "-", "scaled": "--", "SNS": "-"},
)
a.fill(*polygon.T, color="C5", alpha=0.25, lw=0)
a.text(-6.3, 2.5, "all that the\njoints can give", va="top", color="0.35", size=13)
for name, width in (("SNS", 9), ("scaled", 5), ("clamped", 5)):
    a.plot(
        *np.column_stack([[0, 0], J @ answers[name].u]),
        color=colors[name],
        lw=width,
        solid_capstyle="round",
    )
    a.plot(*(J @ answers[name].u), "o", color=colors[name], ms=15)
a.plot(*b, "*", color="k", ms=12, zorder=5)
a.text(b[0] - 0.35, b[1] - 0.5, "$b$", size=22, ha="right")
a.set(
    aspect="equal",
    xlabel="x (m/s)",
    ylabel="y (m/s)",
    title="One step: velocity of the tip",
    xlim=(-6.6, 1),
    ylim=(-5.2, 2.8),
)

m.plot(*np.array([circle(t).position[:2] for t in np.linspace(0, 1, 200)]).T, color="0.8", lw=9)
for name, run in runs.items():
    m.plot(*run.tasks[0].pose[:, :2].T, dashes[name], color=colors[name], label=name)
for name in ("scaled", "SNS"):
    c.plot(runs[name].time[:-1], 100 * runs[name].tasks[0].scale, dashes[name], color=colors[name])
m.plot(*start[:2], "o", color="k", ms=9, zorder=5)
m.set(aspect="equal", xlabel="x (m)", ylabel="y (m)", title="One lap: path of the tip")
c.set(
    xlabel="time (s)",
    ylabel="share $s$ of the command (%)",
    title="One lap: what is carried out",
    xlim=(0, 1.5),
    ylim=(0, 105),
)
fig.legend(*m.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=15)
fig.suptitle("Saturated joints hand over to the others: on the path, and hardly late")
plt.show()
