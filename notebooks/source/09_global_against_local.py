# %% [markdown]
# # 9 · Global against local
#
# $$ \min_{q(\cdot)} \int_0^T \tfrac12\, v^T M(q)\, v \; dt \quad\text{subject to}\quad r(q(t)) = r_d(t), \qquad
# \bigl[\, q(T) = q(0) \,\bigr] $$
#
# The pseudo-inverse with the metric $W = M$ takes the least kinetic energy *at every instant*.
# **Is the sum of least instants the least sum? And does the arm come back to where it began, when
# its hand does?**
#
# $M$ is the inertia matrix; the last condition asks for a path that can be repeated.

# %%
import matplotlib.pyplot as plt
import numpy as np

import cartctl as cc

plt.style.use("cartctl.report.lecture")
arm = cc.planar([1.0, 1.0, 1.0])  # 1 kg a link
q0 = np.radians([30.0, 60.0, 60.0])
start = arm.state(q0).position("tool")
circle = cc.Circle.starting_at(start, radius=0.5, period=2.0, laps=3)
tip = cc.FrameTask("tool", "xy", gain=20.0, target=circle)

# %% [markdown]
# ## One instant: the least kinetic energy
#
# $v = M^{-1} J^T (J M^{-1} J^T)^{-1} b$ is the least of all. An exam problem shows how far
# it may be from the least norm (A. De Luca, *Robotics 2*, Sapienza, midterm of 19 April 2023):
# four sliding joints in a row, two along $x$ and two along $y$. The least norm shares the motion
# between the near joint and the far one, the least energy moves the far ones only, which carry
# less.

# %%
m1, m2, m3, m4 = 2.0, 1.5, 1.0, 0.7
M = np.array(
    [
        [m1 + m2 + m3 + m4, 0, m3 + m4, 0],
        [0, m2 + m3 + m4, 0, m4],
        [m3 + m4, 0, m3 + m4, 0],
        [0, m4, 0, m4],
    ]
)
J, b = np.array([[1.0, 0, 1, 0], [0, 1, 0, 1]]), np.array([0.3, -0.2])
norm = cc.solve(cc.Problem([(J, b)]), "pinv").u
energy = cc.solve(cc.Problem([(J, b)], metric=M), "pinv").u
print("least norm  ", norm.round(3), " least energy", energy.round(3) + 0.0)
assert np.allclose(norm, 0.5 * np.concatenate([b, b]))  # as published, both
assert np.allclose(energy, [0, 0, *b])

# %% [markdown]
# ## Instant by instant
#
# Now a 3R arm whose tip runs round a circle, three laps, by two local methods: least joint speed
# and least kinetic energy.

# %%
local = {}
for name, metric in (("least speed now", None), ("least energy now", "inertia")):
    controller = cc.Controller(arm, tip, solver="pinv", metric=metric, limits=None, dt=5e-3)
    local[name] = cc.simulate(controller, q0, duration=circle.duration)

# %% [markdown]
# ## The whole path at once
#
# `cc.plan` looks for the joint path with the least integral: a sparse nonlinear programme over all
# samples, the tip held on its circle at every one, from several starts. The answer is the best
# local optimum of those it found; nobody proves that there is no better one.

# %%
plans = {
    "planned": cc.plan(
        arm, tip, samples=121, objective="kinetic-energy", q0=q0, limits=None, methods=["pinv"]
    ),
    "planned, closed": cc.plan(
        arm,
        tip,
        samples=121,
        objective="kinetic-energy",
        q0=q0,
        limits=None,
        methods=["pinv"],
        closed=True,
    ),
}
for name, plan in plans.items():
    report = plan.report
    print(f"{name:16s} {report.status.name}, ends {report.closure:.3f} rad from its beginning")
    assert plan.report.feasible and plan.report.residual.m < 1e-6
assert plans["planned, closed"].report.closure < 1e-8


# %% [markdown]
# ## The bill
#
# All four do the same work at the hand. Kinetic energy over time, for all of them at the 121
# instants of the plans:


# %%
def kinetic(run):
    """``(t, T)`` between the instants, from how far the joints really went."""
    every = len(run) // 120
    q, t = run.q[::every], run.time[::every]
    v = np.diff(q, axis=0) / np.diff(t)[:, None]
    T = [
        cc.dynamics.energy(arm.state(x, u)).kinetic
        for x, u in zip(0.5 * (q[:-1] + q[1:]), v, strict=True)
    ]
    return 0.5 * (t[:-1] + t[1:]), np.array(T)


runs = {**local, **plans}
curves = {name: kinetic(run) for name, run in runs.items()}
cost = {name: curves[name][1].sum() * circle.duration / 120 for name in runs}
drift = {name: np.linalg.norm(run.q[-1] - run.q[0]) for name, run in runs.items()}
for name in runs:
    ratio = cost[name] / cost["planned, closed"]
    print(f"{name:17s} {cost[name]:6.2f} J s, {ratio:.2f} x the closed plan", end=", ")
    print(f"drift {drift[name]:.3f} rad")

assert cost["planned"] < cost["planned, closed"] < 0.75 * min(cost[name] for name in local)
assert cost["least energy now"] > cost["least speed now"]  # the greedy method loses at its own game
assert drift["least energy now"] > 0.5 > 1e-6 > drift["planned, closed"]

# %% [markdown]
# Least energy at every instant costs over 1.5 times the closed plan in sum, more even than least
# speed, which does not look at masses at all: the greedy choice slides into postures in which
# every later step is dear. The plan invests early, and pays for coming back with less than a
# tenth.

# %%
assert cost["least energy now"] > 1.5 * cost["planned, closed"]
assert cost["planned, closed"] < 1.1 * cost["planned"]

fig, (a, c, d) = plt.subplots(1, 3, width_ratios=[1.15, 1, 1])
colors = {
    "least speed now": "C1",
    "least energy now": "C3",
    "planned": "C5",
    "planned, closed": "C0",
}
dashes = {"planned": "--", "least speed now": ":"}
a.plot(
    *np.array([circle(t).position[:2] for t in np.linspace(0, circle.duration, 300)]).T,
    color="0.8",
    lw=7,
    zorder=0,
)
for name, color, width in (
    ("", "0.45", 11),
    *((n, colors[n], 4.5) for n in ("least energy now", "planned, closed")),
):
    at = arm.state(runs[name].q[-1] if name else q0)
    points = np.array([at.position(f)[:2] for f in ("link1", "link2", "link3", "tool")])
    a.plot(*points.T, "o-", color=color, lw=width, ms=1.6 * width)
a.set(aspect="equal", xlabel="x (m)", ylabel="y (m)", title="Start (grey), after three laps")
for name, (t, T) in curves.items():
    c.plot(t, T, dashes.get(name, "-"), color=colors[name], label=name)
    d.plot(t, np.cumsum(T) * (t[1] - t[0]), dashes.get(name, "-"), color=colors[name])
c.set(xlabel="time (s)", ylabel="kinetic energy (J)", title="At every instant")
d.set(xlabel="time (s)", ylabel=r"$\int \frac{1}{2} v^T M v \; dt$ (J s)", title="In sum")
fig.legend(*c.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=15)
fig.suptitle("Least at every instant is not least in sum")
plt.show()
