# %% [markdown]
# # 5 · Priorities and conflicts
#
# $$ v_k = v_{k-1} + (A_k P_{k-1})^{\#}\,(b_k - A_k v_{k-1}), \qquad
# P_k = P_{k-1} - (A_k P_{k-1})^{\#} A_k P_{k-1}, \qquad v_0 = 0,\; P_0 = I $$
#
# Each task $A_k v = b_k$ gets what the null space of those above it leaves. **What does the
# order change when not all tasks can be met, and what happens at the border between can and
# cannot?**
#
# $A_k$ and $b_k$ are Jacobian and command of the $k$-th task, the most important one first
# (Siciliano & Slotine 1991).

# %%
import matplotlib.pyplot as plt
import numpy as np

import cartctl as cc
from cartctl import analysis

plt.style.use("cartctl.report.lecture")

# %% [markdown]
# ## Two tasks that contradict each other
#
# A. De Luca, *Robotics 2*, Sapienza, midterm of 15 April 2020: a 3R arm with unit links at (45°,
# 0°, 45°). The last link shall keep its direction (first task), the tip shall move at (2, −1) m/s
# (second task). Here the two exclude each other: each Jacobian has full rank, both together have
# not. That is an *algorithmic* singularity; the arm by itself is regular.

# %%
state = cc.planar([1.0, 1.0, 1.0]).state(np.radians([45.0, 0.0, 45.0]))
J = state.jacobian("tool")
direction, tip = (J[5:], [0.0]), (J[:2], [2.0, -1.0])
verdict = analysis.algorithmic_singularity(J[5:], J[:2])
assert verdict.occurs and not analysis.kinematic_singularity(J[:2])
print(verdict.reason)

stacked = cc.solve(cc.Problem([direction, tip]), "pinv")
ranked = cc.solve(cc.Problem([direction, tip]), "task-priority")
for name, solution in (("stacked", stacked), ("ranked", ranked)):
    miss = np.concatenate([b - A @ solution.u for A, b in (direction, tip)])
    print(f"{name:8s} v = {solution.u.round(4) + 0.0}, missed: {miss.round(4) + 0.0}")

assert np.allclose(stacked.u, [-0.8873, -0.1111, 0.6650], atol=2e-3)  # as published
assert np.allclose(ranked.u, [-1.0607, 0.0, 1.0607], atol=2e-3)
assert np.allclose(stacked.residuals, [1 / 3, np.sqrt(2) / 3]) and np.allclose(
    ranked.residuals, [0, np.sqrt(0.5)]
)

# %% [markdown]
# Stacked, the pseudo-inverse spreads the miss over all three rows, a third each, radians and
# metres alike. Ranked, the first task is met and the second pays for it, and pays more in sum.
#
# ## The formula by hand
#
# Two lines of linear algebra give the same. One trap is in them: $A_2 P_1$ may be *zero up to
# round-off*. A cutoff relative to its own largest singular value then inverts noise; it has to be
# relative to $A_2$.


# %%
def pinv(A, norm):
    """A#, with singular values below 1e-10 of ``norm`` taken for zero."""
    U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
    kept = sigma > 1e-10 * norm
    return Vt[kept].T @ (U[:, kept] / sigma[kept]).T


v, P = np.zeros(3), np.eye(3)
for A, b in (direction, tip):
    inverse = pinv(A @ P, np.linalg.norm(A))
    v, P = v + inverse @ (b - A @ v), P - inverse @ A @ P
assert np.allclose(v, ranked.u)

# %% [markdown]
# ## Across the border, in the loop
#
# A 4R arm draws a circle with its tip; its elbow, the end of the second link, shall stay where it
# is. The two outer links reach 2 m from the elbow, and the far side of the circle is farther than
# that. We ask four methods:
#
# * *stacked, damped*: both tasks in one matrix, damped least squares;
# * *ranked*: the formula above, tip first;
# * *ranked, damped*: the same with a damped inverse of $A_k P_{k-1}$;
# * *robust*: $v = A_1^{\#} b_1 + P_1 A_2^{\#} b_2$, each task solved alone and then
#   projected (Chiaverini 1997).

# %%
arm, dt = cc.planar([1.0, 1.0, 1.0, 1.0]), 5e-3
q0 = np.radians([75.0, -100.0, 75.0, -110.0])
start, elbow = arm.state(q0).position("tool"), arm.state(q0).position("link3")
circle = cc.Circle.starting_at(start, radius=0.6, period=6.0, towards=[1.0, 0.0, 0.0])
tasks = [
    cc.FrameTask("tool", "xy", gain=10.0, target=circle),
    cc.FrameTask("link3", "xy", gain=10.0, target=elbow),
]
methods = {
    "stacked, damped": cc.DLS(damping=0.1),
    "ranked": "task-priority",
    "ranked, damped": cc.TaskPriority(policy=cc.Damped(0.1)),
    "robust": "singularity-robust-priority",
}
runs, missed, fastest = {}, {}, {}
for name, solver in methods.items():
    run = runs[name] = cc.simulate(
        cc.Controller(arm, tasks, solver=solver, limits=None, dt=dt), q0, duration=7.0
    )
    missed[name] = [np.linalg.norm(task.error, axis=1) for task in run.tasks]
    fastest[name] = abs(run.v).max(axis=1)

far = np.linalg.norm([circle(t).position - elbow for t in run.time], axis=1)
beyond = dt * np.sum(far > 2.0)
print(f"the target is up to {far.max():.2f} m from the elbow; out of its reach for {beyond:.1f} s")

# %% [markdown]
# Ranking alone keeps its promise only as long as the joints are fast enough: at the border
# $A_2 P_1$ loses rank, and in steps of 5 ms the undamped formula throws the arm away. With
# damping the tip is served to millimetres and the elbow takes the whole conflict. Stacked, both
# tasks give way alike. The robust formula is the calmest, and it pays with an elbow that drifts
# even where nothing is in conflict.

# %%
worst = {name: [errors.max() for errors in pair] for name, pair in missed.items()}
for name, (at_tip, at_elbow) in worst.items():
    speed = fastest[name].max()
    if speed < 20.0:
        print(f"{name:16s} tip {1e3 * at_tip:5.1f} mm, elbow {1e3 * at_elbow:5.1f} mm", end=", ")
        print(f"joints up to {speed:.1f} rad/s")
    else:
        print(f"{name:16s} joints beyond 20 rad/s")
assert fastest["ranked"].max() > 500.0  # rad/s
assert worst["ranked, damped"][0] < 5e-3 < 0.3 < worst["ranked, damped"][1]
assert np.isclose(*worst["stacked, damped"], rtol=0.05) and worst["stacked, damped"][0] > 0.15
before = run.time < run.time[np.argmax(far > 2.0)] - 0.5  # no conflict yet
assert missed["robust"][1][before].max() > 0.1 > 0.01 > missed["ranked, damped"][1][before].max()
assert fastest["robust"].max() < min(fastest[name].max() for name in methods if name != "robust")

# %%
fig, (a, b, c) = plt.subplots(1, 3, width_ratios=[1.35, 1, 1])
colors = dict(zip(methods, ("C0", "C3", "C2", "C1"), strict=True))
k = np.argmax(far)
a.plot(*np.array([circle(t).position[:2] for t in run.time]).T, color="0.6", lw=1.8)
for name in ("stacked, damped", "ranked, damped"):
    at = arm.state(runs[name].q[k])
    points = np.array([at.position(f)[:2] for f in ("link1", "link2", "link3", "link4", "tool")])
    a.plot(*points.T, "o-", color=colors[name], lw=5, ms=9)
a.plot(*circle(run.time[k]).position[:2], "*", color="k", ms=20, zorder=5)
a.plot(*elbow[:2], "x", color="k", ms=14, mew=4, zorder=5)
a.text(elbow[0], elbow[1] - 0.45, "elbow's place", ha="center")
a.text(circle(run.time[k]).position[0], start[1] + 0.12, "target", ha="center")
a.set(
    aspect="equal",
    xlabel="x (m)",
    ylabel="y (m)",
    title="The arm, half a lap on",
    xlim=(-0.1, 3.75),
    ylim=(-0.35, 1.25),
)

for name in ("stacked, damped", "ranked, damped", "robust"):
    b.plot(run.time, missed[name][0], color=colors[name])
    b.plot(run.time, missed[name][1], "--", color=colors[name])
b.plot([], [], color="0.3", label="tip")
b.plot([], [], "--", color="0.3", label="elbow")
b.axvspan(*run.time[far > 2.0][[0, -1]], color="0.93", zorder=0)
b.set(xlabel="time (s)", ylabel="task error (m)", title="Who pays", ylim=(-0.01, 0.75))
b.legend(loc="upper right")
b.text(run.time[k], 0.6, "conflict", ha="center", color="0.4")

for name in methods:
    c.semilogy(run.time, fastest[name], color=colors[name], label=name)
c.axvspan(*run.time[far > 2.0][[0, -1]], color="0.93", zorder=0)
c.set(xlabel="time (s)", ylabel="fastest joint (rad/s)", title="At what speed", ylim=(0.05, 2e4))
fig.legend(*c.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=15)
fig.suptitle("Ranking decides who pays for a conflict; damping decides how fast")
plt.show()
