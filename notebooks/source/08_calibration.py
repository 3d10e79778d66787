# %% [markdown]
# # 8 · Calibration
#
# $$ \Delta r = \Phi\, \Delta\pi, \qquad \Phi = \begin{bmatrix} J_a & J_\alpha & J_d & J_\theta \end{bmatrix}, \qquad
# \Delta\pi = \Phi^{\#}\, \Delta r $$
#
# The Jacobian once more, but with respect to the robot's *geometry*: if the lengths and angles in
# its table are off by $\Delta\pi$, the hand is off by $\Delta r$. Measure the hand in many
# configurations, stack the rows, solve. **What can be found that way, how surely, and what can
# never be found?**
#
# $a$, $\alpha$, $d$, $\theta$ are the columns of the Denavit-Hartenberg table, $\pi$ all of them
# together.

# %%
import matplotlib.pyplot as plt
import numpy as np

import cartctl as cc
from cartctl import calibration, spatial

plt.style.use("cartctl.report.lecture")

# %% [markdown]
# ## The smallest case: two link lengths
#
# A. De Luca, *Robotics 2*, Sapienza, midterm of 13 April 2022: the links of a 2R arm should be 1 m
# long. Four positions of its tip were measured. The tip is linear in the lengths, so one step is
# exact.

# %%
arm = cc.DHChain(a=[1.0, 1.0], alpha=[0, 0], d=[0, 0])
q = np.radians([[0, 0], [90, 0], [45, -45], [0, 45]])
tips = np.array([[2.0, 0, 0], [0, 2.0, 0], [1.6925, 0.7425, 0], [1.7218, 0.6718, 0]])

a1, a12 = q[:, 0], q.sum(axis=1)
Phi = (
    np.array([[np.cos(a1), np.cos(a12)], [np.sin(a1), np.sin(a12)]])
    .transpose(2, 0, 1)
    .reshape(-1, 2)
)
by_hand = np.linalg.lstsq(Phi, (tips - arm.positions(q))[:, :2].ravel())[0]
found = calibration.link_lengths(arm, q, tips)
print(
    "lengths",
    found.lengths.round(4),
    "m, misses at most",
    f"{1e3 * abs(found.residuals).max():.3f} mm",
)

assert np.allclose(found.lengths, [1.05, 0.95], atol=1e-4)  # as published
assert np.allclose(found.delta, by_hand)

# %% [markdown]
# In the first two configurations the arm is stretched: they see only the sum of the lengths, which
# is right, so alone they would have found nothing wrong.

# %%
stretched = calibration.link_lengths(arm, q[:2], tips[:2])
print(f"rank {stretched.rank} of 2: cannot be told apart:", stretched.unidentifiable[0].parameters)
assert stretched.rank == 1

# %% [markdown]
# ## What a six-joint arm shows of itself
#
# A PUMA 560 has 24 numbers in its table. A laser tracker sees the position of one target on the
# hand. Parameters that have no effect, or the same effect as others, make $\Phi$ lose rank. How
# many there are depends on where the target sits: on the axis of the last joint, or beside it.

# %%
half = np.pi / 2
table = {
    "a": [0, 0.4318, 0.0203, 0, 0, 0],
    "alpha": [half, 0, -half, half, -half, 0],
    "d": [0.672, 0, 0.15, 0.4318, 0, 0],
}
targets = {"on the last axis": [0.0, 0.0, 0.1], "beside it": [0.08, 0.0, 0.1]}
chains = {name: cc.DHChain(**table, tool=spatial.pose(p=p)) for name, p in targets.items()}

rng, noise = np.random.default_rng(4), 1e-4  # m: the tracker's standard deviation
where = rng.uniform(-2.5, 2.5, (40, 6))
spectra = {}
for name, chain in chains.items():
    exact = cc.calibrate(
        chain, where, chain.positions(where), kind="position", parameters="table", noise=noise
    )
    spectra[name] = exact.seen.values
    print(
        f"target {name}: {exact.rank} of {len(exact.names)} combinations are seen; not told apart:"
    )
    print("    ", *(" ~ ".join(hidden.parameters) for hidden in exact.unidentifiable), sep="   ")
    assert {"on the last axis": 20, "beside it": 22}[name] == exact.rank
    assert exact.seen.values[exact.rank] < 1e-14 * exact.seen.values[0]

# %% [markdown]
# Axes 2 and 3 are parallel: sliding the elbow along them changes nothing, so only $d_2 + d_3$
# can be known, wherever the target sits. Such directions stay at their nominal values here.
# Inverting their singular values would magnify the noise $10^{14}$ times and more.
#
# ## How surely?
#
# Now the arm is wrong: every entry that can be told apart is off by up to 2 mm or 5 mrad, and the
# tracker has 0.1 mm of noise. `cc.calibrate` iterates $\Delta\pi = \Phi^{\#}\Delta r$ and gives
# 95 % intervals.

# %%
nominal = chains["beside it"]
names = exact.independent
units = dict(zip(names, nominal.units(names), strict=True))
truth = {name: rng.uniform(-1, 1) * (2e-3 if units[name] == "m" else 5e-3) for name in names}
robot = nominal.changed(truth)  # instead of a real one
measured = robot.positions(where) + noise * rng.normal(size=(40, 3))

result = cc.calibrate(nominal, where, measured, kind="position", parameters=names)
low, high = np.array(result.interval()).T
actual = np.array([truth[name] for name in result.names])
hits = np.sum((low <= actual) & (actual <= high))
print(f"{result.iterations} iterations; noise estimated at {1e3 * result.noise['m']:.3f} mm")
print(f"{hits} of {len(names)} intervals hold the truth")
assert hits >= 19 and abs(result.noise["m"] - noise) < 2e-5

# %% [markdown]
# The proof is in configurations that were not measured:

# %%
fresh = rng.uniform(-2.5, 2.5, (300, 6))
miss = {
    "before": 1e3 * np.linalg.norm(robot.positions(fresh) - nominal.positions(fresh), axis=1),
    "after": 1e3 * np.linalg.norm(robot.positions(fresh) - result.chain.positions(fresh), axis=1),
}
for name, sizes in miss.items():
    print(f"{name:7s} {np.median(sizes):.3f} mm in the median, {sizes.max():.3f} mm at most")
assert np.median(miss["after"]) < 0.15 < 2.0 < np.median(miss["before"])

# %%
fig, (a, b, c) = plt.subplots(1, 3, width_ratios=[1, 1.25, 1])
for (name, values), marker, color in zip(spectra.items(), "so", ("C1", "C0"), strict=True):
    a.semilogy(
        np.arange(1, 25), np.maximum(values / values[0], 1e-17), marker, color=color, label=name
    )
a.axhline(1e-6, color="0.4", ls="--", lw=1.8)
a.text(1, 2e-7, "below: not inverted", color="0.35", va="top", size=14)
a.set(
    xlabel="combination of parameters",
    ylabel=r"$\sigma_i/\sigma_1$ of $\Phi$",
    title="What can be seen",
    ylim=(1e-18, 10),
)
a.legend(title="target", title_fontsize=14, loc="lower left")

metres = np.array([units[name] == "m" for name in result.names])
order = np.argsort(~metres, kind="stable")
middle, half_width = 0.5 * (low + high)[order], 0.5 * (high - low)[order]
places = np.arange(len(order))
b.errorbar(
    1e3 * middle,
    places,
    xerr=1e3 * half_width,
    fmt="none",
    ecolor="C0",
    elinewidth=5,
    capsize=0,
    label="95 % interval",
)
b.plot(1e3 * actual[order], places, "o", color="C3", ms=6, label="truth")
labels = [
    result.names[i].replace("alpha", r"$\alpha$").replace("theta", r"$\theta$") for i in order
]
b.set_yticks(places, labels, size=11)
b.axvline(0, color="0.4", lw=1.5)
b.set(xlabel="off by (mm, mrad)", title="What is found", ylim=(len(order) - 0.3, -0.7))
b.legend(loc="upper left", handlelength=1.2)

bins = np.geomspace(0.01, 30, 28)
for (name, sizes), color in zip(miss.items(), ("C1", "C0"), strict=True):
    c.hist(sizes, bins, color=color, label=name)
c.set(
    xscale="log",
    xlabel="position error (mm)",
    ylabel="of 300 fresh configurations",
    title="What it is worth",
)
c.legend()
fig.suptitle("Calibration: solve for what the measurements see, and say what they do not")
plt.show()
