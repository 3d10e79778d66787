# %% [markdown]
# # 4 · Null-space motion
#
# $$ v = J^{\#} b + \bigl(I - J^{\#} J\bigr)\, u_0 , \qquad u_0 = -k\, \nabla H(q) $$
#
# A redundant arm can move while its hand stands still. **Where does it go, if we let it run
# downhill on an objective $H$, and where does it stop?**
#
# $b$ is the hand's command, zero while it stands still; $k > 0$ a gain; $P = I - J^{\#}J$
# the projector onto the joint motions that the hand does not feel.

# %%
import matplotlib.pyplot as plt
import numpy as np

import cartctl as cc
from cartctl import analysis

plt.style.use("cartctl.report.lecture")

# %% [markdown]
# ## One step
#
# A. De Luca, *Robotics 2*, Sapienza, exam of 12 January 2021: a 3R arm in a vertical plane, links
# of 0.5, 0.4 and 0.3 m and 5, 3 and 2 kg, centres of mass half-way, lowers its potential energy
# while the tip stays where it is. So $H = U$, and $\nabla U = g(q)$ is the vector of gravity
# torques.

# %%
lengths = np.array([0.5, 0.4, 0.3])
arm = cc.planar(lengths, masses=[5.0, 3.0, 2.0], gravity=(0.0, -9.81, 0.0))
q0 = np.array([np.pi, 0.0, -np.pi / 2])
state = arm.state(q0)
J = state.jacobian("tool")[:2]
gradient = cc.dynamics.gravity_torques(state)
step = cc.solve(cc.Problem([(J, np.zeros(2))], reference=-gradient), "projected-gradient").u
print(
    "grad U =", gradient.round(3), "N m\nv      =", step.round(4), "rad/s with k = 1 rad/s per N m"
)

assert np.allclose(gradient, [-50.522, -13.734, 0.0], atol=6e-4)  # as published
assert np.allclose(step, [2.5731, -5.7895, 3.2164], atol=6e-4)
assert np.allclose(J @ step, 0.0, atol=1e-12)

# %% [markdown]
# ## Why it goes downhill
#
# $P$ is symmetric and $P^2 = P$, an orthogonal projector. Therefore
# $\dot U = g^T v = -k\, g^T P g = -k\, \lVert P g\rVert^2 \le 0$: energy falls
# until the gradient has no part left in the null space. An oblique projector, as other generalised
# inverses have, promises nothing of the kind.

# %%
P = np.column_stack(
    [
        cc.solve(cc.Problem([(J, np.zeros(2))], reference=c), "projected-gradient").u
        for c in np.eye(3)
    ]
)
check = analysis.check_projector(P, J)
assert check.passed and check.rank == 1
assert np.isclose(gradient @ step, -(np.linalg.norm(P @ gradient) ** 2))
print(f"U changes at {gradient @ step:.1f} W with k = 1 rad/s per N m")

# %% [markdown]
# ## All postures with the tip there
#
# With three joints and two equations the self-motion is a curve. The direction of the last link
# and the elbow's side tell its points apart, and the cosine rule gives the joints, so we can draw
# the landscape on which the arm runs down.


# %%
def potential(state):
    return cc.dynamics.energy(state).potential


def postures(tip, elbow, angles):
    """Joints (n, 3) for directions (n,) of the last link; elbow is +1 or -1. nan out of reach."""
    wrist = tip - lengths[2] * np.column_stack([np.cos(angles), np.sin(angles)])
    cosine = (np.sum(wrist**2, axis=1) - lengths[0] ** 2 - lengths[1] ** 2) / (
        2 * lengths[0] * lengths[1]
    )
    q2 = elbow * np.arccos(np.where(abs(cosine) <= 1.0, cosine, np.nan))
    q1 = np.arctan2(wrist[:, 1], wrist[:, 0]) - np.arctan2(
        lengths[1] * np.sin(q2), lengths[0] + lengths[1] * np.cos(q2)
    )
    return np.column_stack([q1, q2, angles - q1 - q2])


tip, angles = state.position("tool")[:2], np.radians(np.linspace(88.0, 236.0, 741))
landscape = {}
for elbow in (1, -1):
    q = postures(tip, elbow, angles)
    landscape[elbow] = np.array(
        [potential(arm.state(x)) if np.isfinite(x).all() else np.nan for x in q]
    )
    assert np.allclose([arm.state(x).position("tool")[:2] for x in q if np.isfinite(x).all()], tip)
    lowest, highest = np.nanmin(landscape[elbow]), np.nanmax(landscape[elbow])
    print(f"elbow {elbow:+d}: U from {lowest:.2f} to {highest:.2f} J")

# %% [markdown]
# ## In the loop
#
# The arm starts with its elbow high, over the top of that curve by a little. The tip holds its
# place by feedback, the objective runs in what is left. `cc.FunctionObjective` takes any $H$ with
# its gradient, or without: then it is differenced.

# %%
high = postures(tip, 1, np.radians([200.0]))[0]
runs, fall = {}, {}
for k in (0.1, 0.2, 0.4):
    energy = cc.FunctionObjective(potential, cc.dynamics.gravity_torques, gain=k)
    hold = cc.FrameTask("tool", "xy", gain=10.0)  # no target: it holds what the first step finds
    controller = cc.Controller(
        arm, hold, solver="projected-gradient", objective=energy, limits=None, dt=2e-3
    )
    run = runs[k] = cc.simulate(controller, high, duration=8.0)
    fall[k] = np.array([potential(arm.state(q)) for q in run.q])
    moved = np.linalg.norm(run.tasks[0].error, axis=1).max()
    print(f"k = {k:4}: U from {fall[k][0]:.2f} to {fall[k][-1]:.2f} J")
    assert (
        np.all(np.diff(fall[k]) < 1e-9) and moved < 1e-3
    )  # always down, and the tip stays within a millimetre

# %% [markdown]
# It stops where the curve is level, $P\,\nabla U = 0$. That is a minimum *along the curve*; for
# a lower one the arm would have to let go of the tip. The gain decides when it gets there, not
# where.

# %%
end = runs[0.4].q[-1]
n = np.linalg.svd(arm.state(end).jacobian("tool")[:2])[2][2]
link, bend = np.degrees([end.sum(), abs(end[1])])
print(f"rests with the last link at {link:.1f} deg, the elbow bent by {bend:.1f} deg")
assert abs(n @ cc.dynamics.gravity_torques(arm.state(end))) < 1e-3  # N m: level
assert np.isclose(
    np.nanmin(landscape[-1]), fall[0.4][-1], atol=1e-3
)  # J: the lowest posture on its side
assert np.isclose(fall[0.2][-1], fall[0.4][-1], atol=0.01)

# %%
fig, (a, b, c) = plt.subplots(1, 3, width_ratios=[1.15, 1, 1])
run = runs[0.4]
speed = np.linalg.norm(np.diff(run.q, axis=0), axis=1)
travelled = np.concatenate([[0.0], np.cumsum(speed)]) / speed.sum()
shown = [run.q[np.searchsorted(travelled, x)] for x in np.linspace(0.0, 0.999, 9)]
shades = plt.cm.Blues(np.linspace(0.25, 1.0, len(shown)))
for q, shade in zip(shown, shades, strict=True):
    at = arm.state(q)
    points = np.array([at.position(name)[:2] for name in ("link1", "link2", "link3", "tool")])
    a.plot(*points.T, "o-", color=shade, lw=5, ms=9)
a.plot(*tip, "*", color="C3", ms=22, zorder=5)
a.annotate(
    "", (0.05, -0.32), (0.05, -0.1), arrowprops={"arrowstyle": "-|>", "lw": 3, "color": "0.35"}
)
a.text(0.01, -0.24, "gravity", ha="right", color="0.35")
a.set(
    aspect="equal",
    xlabel="x (m)",
    ylabel="y (m)",
    title="The arm sinks, the tip stays",
    xlim=(-1.0, 0.13),
    ylim=(-0.42, 0.55),
)

for elbow, color, label, place in (
    (1, "0.6", "elbow\nabove", (87, 20)),
    (-1, "0.25", "elbow\nbelow", (192, 6)),
):
    b.plot(np.degrees(angles), landscape[elbow], color=color)
    b.text(*place, label, color=color)
b.plot(
    np.degrees(run.q.sum(axis=1)), fall[0.4], color="C0", lw=8, alpha=0.45, solid_capstyle="round"
)
b.plot(np.degrees(high.sum()), fall[0.4][0], "o", color="C0", mfc="white", mew=3, ms=13, zorder=5)
b.plot(np.degrees(end.sum()), fall[0.4][-1], "o", color="C0", ms=14, zorder=5)
b.set(
    xlabel="direction of the last link (deg)",
    ylabel="potential energy $U$ (J)",
    title="All postures with this tip",
    xlim=(82, 240),
)

for (k, values), style in zip(fall.items(), (":", "--", "-"), strict=True):
    c.plot(run.time, values, style, color="C0", label=f"$k$ = {k}")
c.set(
    xlabel="time (s)",
    ylabel="potential energy $U$ (J)",
    title="The gain decides when, not where",
    ylim=b.get_ylim(),
)
c.legend(title="rad/s per N m", title_fontsize=13)
fig.suptitle(
    "Null-space motion runs downhill until the gradient has no part left in the null space"
)
plt.show()
