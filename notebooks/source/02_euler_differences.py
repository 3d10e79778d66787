# %% [markdown]
# # 2 · Why differences of Euler angles fail
#
# $$ \omega = T(\phi)\,\dot\phi \qquad\text{so}\qquad J_A = T(\phi)^{-1} J_\omega , \qquad\text{and}\qquad
# e = \log\bigl(R_d R^T\bigr) $$
#
# A hand at orientation $R$ shall turn to $R_d$. For positions, gain times difference is the
# velocity to command. **What goes wrong if we do the same with Euler angles and command
# $\omega = k\,(\phi_d - \phi)$?**
#
# $\phi$ are the Euler angles of $R$, $\omega$ its angular velocity in base axes, $J_\omega$ the
# angular rows of the Jacobian; $\log$ gives axis times angle of a rotation.

# %%
import matplotlib.pyplot as plt
import numpy as np

import cartctl as cc
from cartctl import spatial

plt.style.use("cartctl.report.lecture")

# %% [markdown]
# ## Rates of angles are not an angular velocity
#
# Column $i$ of $T$ is the axis about which angle $i$ turns, where the other turns have left it.
# These axes are neither fixed nor at right angles. For roll, pitch and yaw (about fixed $x$, $y$,
# $z$), with $\beta$ the pitch and $\gamma$ the yaw, $T$ is printed in A. De Luca's slides of
# *Robotics 1*, Sapienza:

# %%
beta, gamma = 0.4, -0.9
T = spatial.euler_rates("XYZ", [0.3, beta, gamma], about="fixed")
cb, sb, cg, sg = np.cos(beta), np.sin(beta), np.cos(gamma), np.sin(gamma)
assert np.allclose(T, [[cb * cg, -sg, 0], [cb * sg, cg, 0], [-sb, 0, 1]])  # as published
assert np.isclose(
    np.linalg.det(T), cb
)  # so it has no inverse at a pitch of 90 degrees: the gimbal lock

rate = np.array([0.0, 0.0, 1.0])
print("T =\n", T.round(3))
print("a yaw rate alone turns about  ", T @ rate)
print("a roll rate alone turns about ", (T @ np.array([1.0, 0.0, 0.0])).round(3))

# %% [markdown]
# ## Three ways to turn a Panda's hand
#
# All three command the hand's orientation with the same gain, from the same posture, to the same
# goal.

# %%
robot = cc.load("panda")
R0 = robot.state(robot.home).rotation(robot.tool)
Rd = spatial.euler_rotation("ZYX", np.radians([80.0, 15.0, -20.0])) @ R0
k, sequence = 2.0, "XYZ"

axis_angle = cc.FrameTask(robot.tool, "orientation", gain=k, target=Rd)
analytic = cc.FrameTask(
    robot.tool, "orientation", gain=k, target=Rd, orientation=sequence
)  # J_A = T^-1 J_omega
difference = cc.FunctionTask(
    lambda state: spatial.euler_angles(sequence, state.rotation(robot.tool)),
    lambda state: state.jacobian(robot.tool)[
        3:
    ],  # wrong on purpose: J_omega is not the derivative of the angles
    target=spatial.euler_angles(sequence, Rd),
    gain=k,
    unit="rad",
)


def angle(R):
    """Of the rotation that is left, degrees."""
    return np.degrees(np.linalg.norm(spatial.log3(Rd @ R.T)))


left = {}
for name, task in {
    "angle-axis": axis_angle,
    "Euler, with $J_A$": analytic,
    "Euler difference": difference,
}.items():
    run = cc.simulate(cc.Controller(robot, task, solver="pinv", limits=None, dt=0.01), duration=4.0)
    left[name] = [angle(robot.state(q).rotation(robot.tool)) for q in run.q]
    print(
        f"{name:18s} {left[name][0]:.1f} deg to go,",
        "arrives" if left[name][-1] < 0.1 else "does not arrive",
    )

exact = left["angle-axis"][0] * np.exp(-k * run.time)
assert np.allclose(
    left["angle-axis"], exact, atol=1.0
)  # along the shortest turn, as the equation says
assert left["Euler, with $J_A$"][-1] < 0.1 < 30.0 < left["Euler difference"][-1]

# %% [markdown]
# ## Why it seems to work at first
#
# Close to $\phi = 0$ the matrix $T$ is the identity, and the mistake does not show. To see where
# it begins, let a free body obey $\omega = k(\phi_d - \phi)$ between random pairs of
# orientations, farther and farther from $\phi = 0$.


# %%
def by_difference(R, Rd):
    return spatial.euler_angles(sequence, Rd) - spatial.euler_angles(sequence, R)


def by_axis_angle(R, Rd):
    return spatial.log3(Rd @ R.T)


def arrives(law, R, Rd, dt=0.05, duration=4.0):
    """Whether it gets within 3 degrees."""
    for _ in range(int(duration / dt)):
        R = spatial.exp3(k * dt * law(R, Rd)) @ R
    return np.linalg.norm(spatial.log3(Rd @ R.T)) < np.radians(3.0)


def anywhere(rng, tilt):
    """A turn by ``tilt`` about a random axis."""
    axis = rng.normal(size=3)
    return spatial.exp3(tilt * axis / np.linalg.norm(axis))


tilts, pairs = np.radians([15, 45, 75, 105, 135, 165]), 20
share = {"angle-axis": [], "Euler difference": []}
for law, name in ((by_axis_angle, "angle-axis"), (by_difference, "Euler difference")):
    for tilt in tilts:
        rng = np.random.default_rng(3)
        share[name].append(
            np.mean([arrives(law, anywhere(rng, tilt), anywhere(rng, tilt)) for _ in range(pairs)])
        )
assert min(share["angle-axis"]) == 1.0
assert share["Euler difference"][0] == 1.0 and share["Euler difference"][-1] < 0.5

# %% [markdown]
# ## What the analytic Jacobian costs
#
# $J_A$ is right, but inverting it inverts $T$. Near $\beta = 90°$ a slow turn about the lost
# axis takes infinite rates of the angles; the hand itself notices nothing. `euler_lock` says how
# far away that is and which axis is lost.

# %%
pitch = np.radians(np.linspace(0.0, 89.5, 120))
needed = []
for beta in pitch:
    phi = [0.2, beta, 0.1]
    lost = spatial.euler_lock(sequence, phi).lost
    needed.append(np.abs(np.linalg.solve(spatial.euler_rates(sequence, phi), lost)).max())
assert np.allclose(needed, 1.0 / np.cos(pitch))  # rad/s of an angle for 1 rad/s of the hand

# %%
fig, (a, b, c) = plt.subplots(1, 3, width_ratios=[1.2, 1, 1])
for (name, angles), style in zip(left.items(), ("-", "--", "-"), strict=True):
    a.plot(run.time, angles, style, label=name, color={"Euler difference": "C3"}.get(name))
a.set(
    xlabel="time (s)",
    ylabel="angle left to the goal (deg)",
    title="A Panda's hand turns",
    ylim=(0, 225),
)
a.legend(loc="upper right")

for (name, values), marker in zip(share.items(), "os", strict=True):
    b.plot(
        np.degrees(tilts),
        100 * np.array(values),
        marker + "-",
        color="C3" if "diff" in name else "C0",
        label=name,
    )
b.set_xlabel(r"both poses' distance from $\phi = 0$ (deg)", size=14)
b.set(ylabel="arrived (%)", title="A free body, random turns", ylim=(-3, 108))

c.plot(np.degrees(pitch), needed, "--", color="C1")
c.axvline(90, color="0.4", lw=1.5, ls=":")
c.text(78, 14, "gimbal\nlock", ha="right", color="0.3")
c.set(
    xlabel=r"pitch $\beta$ (deg)",
    ylabel=r"largest $|\dot\phi_i|\,/\,\|\omega\|$",
    title="The price of $J_A$",
    ylim=(0, 20),
)
fig.suptitle("Differences of Euler angles are no rotation: use the axis and angle of $R_d R^T$")
plt.show()
