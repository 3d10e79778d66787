# %% [markdown]
# # 7 · Torque norms and the growth
#
# $$ \min_\tau \tfrac12\, \tau^T W \tau \quad\text{subject to}\quad J M^{-1} \tau = c, \qquad
# c = \ddot r - \dot J v + J M^{-1} h $$
#
# A redundant arm has infinitely many torques that accelerate its hand alike; a norm chooses.
# **Which norm, and why can the least torque at every instant be a disaster in the long run?**
#
# $M$ is the inertia matrix, $h$ the Coriolis, centrifugal and gravity torques, $\ddot r$ the
# commanded acceleration of the hand. Three norms are classical, each with a closed form:
#
# | least | $W$ | $\tau$ |
# |---|---|---|
# | torque | $I$ | $(J M^{-1})^{\#} c$ |
# | in the norm of the operational space (Khatib 1987) | $M^{-1}$ | $J^T (J M^{-1} J^T)^{-1} c$ |
# | acceleration | $M^{-2}$ | $M J^{\#} c$ |

# %%
import warnings

import matplotlib.pyplot as plt
import numpy as np

import cartctl as cc

plt.style.use("cartctl.report.lecture")
NORMS = {"identity": "$I$", "inverse-inertia": "$M^{-1}$", "inverse-inertia-squared": "$M^{-2}$"}

# %% [markdown]
# ## The first formula is not the third
#
# A. De Luca, *Robotics 2*, Sapienza, exam of 15 June 2010: an RP arm with
# $M = \mathrm{diag}(m_{11}, m_{22})$ controls the height of its tip only,
# $J = [(d_2 + q_2) \cos q_1,\; \sin q_1]$. The exam's $(J M^{-1})^{\#}$ differs from
# $M J^{\#}$, unless $M$ is a multiple of the identity:

# %%
m, d2, (q1, q2) = np.array([0.402, 1.7]), 0.3, (0.7, 0.4)
J = np.array([[(d2 + q2) * np.cos(q1), np.sin(q1)]])
A = J / m  # J M^-1
least = {
    name: cc.solve(cc.Problem([(A, [1.0])], metric=W), "pinv").u
    for name, W in (
        ("identity", None),
        ("inverse-inertia", 1.0 / m),
        ("inverse-inertia-squared", 1.0 / m**2),
    )
}
for name, tau in least.items():
    print(f"W = {NORMS[name]:10s} tau = {tau.round(4)}, norm {np.linalg.norm(tau):.4f}")
assert np.allclose(
    least["identity"], [0.6946177196468347, 0.19764496682114327]
)  # the exam's formula at this point
assert np.allclose(least["inverse-inertia-squared"], m * np.linalg.lstsq(J, [1.0])[0])
assert not np.allclose(least["identity"], least["inverse-inertia-squared"], rtol=0.1)

# %% [markdown]
# ## One instant of a 4R arm
#
# The same with a full inertia matrix, and the closed forms of the table. Each answer is the
# smallest in its own norm.

# %%
arm = cc.planar([0.5, 0.5, 0.5, 0.5])  # 0.5 kg each, in a horizontal plane: no gravity in the way
q0 = np.radians([30.0, 40.0, -70.0, 60.0])
state = arm.state(q0)
J, M = state.jacobian("tool")[:2], state.mass_matrix
c = np.array([-1.0, -1.0])  # m/s^2, from rest: h = 0, J_dot v = 0
inverse = np.linalg.solve(M, np.eye(4))
weights = {
    "identity": np.eye(4),
    "inverse-inertia": inverse,
    "inverse-inertia-squared": inverse @ inverse,
}
tau = {
    name: cc.solve(cc.Problem([(J @ inverse, c)], metric=W), "pinv").u
    for name, W in weights.items()
}

assert np.allclose(tau["inverse-inertia"], J.T @ np.linalg.solve(J @ inverse @ J.T, c))
assert np.allclose(tau["inverse-inertia-squared"], M @ J.T @ np.linalg.solve(J @ J.T, c))
for name, W in weights.items():
    sizes = {other: np.sqrt(t @ W @ t) for other, t in tau.items()}
    assert min(sizes, key=sizes.get) == name
    print(f"{NORMS[name]:10s} tau = {tau[name].round(3)} N m")

# %% [markdown]
# ## A short motion and a long one
#
# The tip follows a line for 1 s, or a circle lap after lap for 8 s, and nothing else is asked of
# the arm: $u_0 = 0$, the classical form. A motion that runs away ends its simulation, with a
# warning that we expect here and silence.


# %%
start = state.position("tool")
line = cc.Line(start, start + [-0.3, -0.3, 0.0], duration=1.0)
laps = cc.Circle.starting_at(start, radius=0.3, period=2.0, laps=4)


def motion(norm, path, damping):
    tip = cc.FrameTask("tool", "xy", gain=20.0, target=path)
    level = cc.TorqueLevel(damping)
    controller = cc.Controller(
        arm, tip, "projected-gradient", level, limits=None, metric=norm, dt=2e-3
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cc.CartctlWarning)
        return cc.simulate(controller, q0, path.duration, integrator="rk4")


short = {norm: motion(norm, line, damping=0.0) for norm in NORMS}
long = {norm: motion(norm, laps, damping=0.0) for norm in NORMS}
effort = {norm: run.metrics().torque_effort for norm, run in short.items()}
for norm, run in long.items():
    print(
        f"{NORMS[norm]:10s} short: {effort[norm]:.2f} N^2 m^2 s;  long: beyond 1,000 N m:",
        abs(run.torque).max() > 1e3,
    )

assert effort["identity"] < 0.5 * min(effort["inverse-inertia"], effort["inverse-inertia-squared"])
assert all(abs(run.torque).max() > 1e3 for run in long.values())  # N m
assert long["identity"].interrupted  # it ran away, and before the others
assert long["identity"].time[-1] < min(
    long["inverse-inertia"].time[-1], long["inverse-inertia-squared"].time[-1]
)

# %% [markdown]
# On the short motion the least torque is what its name says, by more than a factor of two. On the
# long one it is the first to run away: what is least *now* may leave the joints spinning in the
# null space, and those speeds must be paid for later (Hollerbach & Suh 1987). Nothing in the
# equation sees them. The other norms only last longer.
#
# ## The remedy: damp what the hand does not feel
#
# A reference for the torques that brakes, $u_0 = h - D v$ (with $M$ before $D$ in the other
# two norms), projected into the null space. The hand's motion stays the same.

# %%
damped = {norm: motion(norm, laps, damping=None) for norm in NORMS}  # None: the default D
for norm, run in damped.items():
    peak, speed = abs(run.torque).max(), abs(run.v).max()
    rms = 1e3 * run.metrics().tasks[0].rms_m
    print(f"{NORMS[norm]:10s} peak {peak:4.1f} N m, joints up to {speed:.1f} rad/s", end=", ")
    print(f"hand within {rms:.2f} mm (RMS)")
    assert peak < 50.0 and rms < 0.2 and not run.interrupted

# %%
fig, panels = plt.subplots(1, 3)
dashes = {"identity": "-", "inverse-inertia": "--", "inverse-inertia-squared": ":"}
titles = ("1 s, undamped: least torque wins", "8 s, undamped: all fail", "8 s, damped: all hold")
for axes, runs, title in zip(panels, (short, long, damped), titles, strict=True):
    for norm, run in runs.items():
        size = np.linalg.norm(run.torque, axis=1)
        axes.plot(run.time[:-1], size, dashes[norm], label=f"$W$ = {NORMS[norm]}")
        if run.interrupted:
            axes.plot(run.time[-2], size[-1], "X", color=axes.lines[-1].get_color(), ms=14)
    axes.set(xlabel="time (s)", title=title)
panels[0].set(ylabel=r"$\|\tau\|$ (N m)", ylim=(0, None))
panels[1].set(yscale="log", ylim=(1e-2, 1e6))
panels[2].set(ylim=(0, None))
panels[1].text(0.1, 2e5, "x: ran away", color="0.3")
fig.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=16)
fig.suptitle("The least torque now is not the least torque later")
plt.show()
