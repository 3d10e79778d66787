# %% [markdown]
# # 3 · Singularities and damping
#
# $$ v = J^T\bigl(J J^T + \lambda^2 I\bigr)^{-1} b \;=\; \sum_i \underbrace{\frac{\sigma_i}{\sigma_i^2 + \lambda^2}}_{\varphi(\sigma_i)}
# \, v_i \, u_i^T b \qquad\text{minimises}\qquad \lVert b - J v\rVert^2 + \lambda^2 \lVert v\rVert^2 $$
#
# Where the arm loses a direction, a singular value $\sigma_i$ goes to zero, and the
# pseudo-inverse's factor $1/\sigma_i$ to infinity. **How much does damping give away, and when is
# it needed?**
#
# $J = \sum_i \sigma_i u_i v_i^T$ is the singular value decomposition, $b$ the commanded
# velocity of the hand, $\lambda$ the damping factor.

# %%
import matplotlib.pyplot as plt
import numpy as np

import cartctl as cc

plt.style.use("cartctl.report.lecture")
arm = cc.planar([1.0, 1.0])

# %% [markdown]
# ## One configuration: an arm that is almost stretched
#
# From A. De Luca's slides of *Robotics 2*, Sapienza: a 2R arm with unit links at (45°, 1.5°); its
# tip shall move across the arm's direction at 1 m/s. The table on the slide, for four values of
# $\lambda^2$, is reproduced here.

# %%
J = arm.state(np.radians([45.0, 1.5])).jacobian("tool")[:2]
b = np.array([-1.0, 1.0]) / np.sqrt(2.0)
print("singular values", np.linalg.svd(J, compute_uv=False).round(4))

table = {}
for square in (1e-4, 1e-3, 1e-2, 10.0):
    u = cc.solve(cc.Problem([(J, b)]), cc.DLS(damping=np.sqrt(square))).u
    table[square] = np.linalg.norm(u), np.linalg.norm(b - J @ u)
    size, miss = table[square]
    print(f"lambda^2 = {square:<7g} |v| = {size:.4f} rad/s   |b - J v| = {miss:.4f} m/s")

norms, misses = np.array(list(table.values())).T
assert np.allclose(norms, [0.8954, 0.4755, 0.4467, 0.1490], atol=6e-5)  # as published
assert np.allclose(misses, [0.0066, 0.0140, 0.0160, 0.6668], atol=6e-4)
exact = cc.solve(cc.Problem([(J, b)]), "pinv").u
assert np.allclose(exact, [1.0, -1.0], atol=0.02)
print(f"undamped            |v| = {np.linalg.norm(exact):.4f} rad/s")
assert norms[1] < 0.34 * np.linalg.norm(exact) and misses[1] < 0.015

# %% [markdown]
# With $\lambda^2 = 0.001$ the joints turn at a third of the exact solution's speed, for 1.4 % of
# the hand's. Ten is far too much, and it acts on the direction that needs none, too: $\varphi$ is
# below $1/\sigma$ for every $\sigma$.
#
# ## Damp only where it is needed
#
# Other choices of $\varphi$ leave the pseudo-inverse alone until a singularity is near:
#
# | policy | $\lambda^2$ | source |
# |---|---|---|
# | `cc.Damped` | constant | Nakamura & Hanafusa 1986, Wampler 1986 |
# | `cc.SigmaDamped` | $\lambda_{\max}^2\,(1 - (\sigma_{\min}/\varepsilon)^2)$ where $\sigma_{\min} < \varepsilon$, else 0 | Chiaverini, Siciliano & Egeland 1994 |
# | `cc.Truncated` | 0, but $\varphi = 0$ below a cutoff | Penrose 1955 |
#
# Each policy is an object that turns singular values into factors. Its own scale, which makes a
# cutoff relative, is the norm of the Jacobian.

# %%
top, eps = 0.1, 0.3
policies = {
    "pseudo-inverse": cc.Truncated(),  # up to round-off
    "left out": cc.Truncated(cutoff=eps / 2),
    "damped": cc.Damped(top),
    "damped when near": cc.SigmaDamped(damping=top, threshold=eps),
}
sigmas = np.linspace(1e-3, 0.5, 400)
factors = {
    name: np.array([p.factors(np.array([1.0, s]), 1.0)[1] for s in sigmas])
    for name, p in policies.items()
}

assert np.allclose(factors["pseudo-inverse"], 1.0 / sigmas)
assert np.isclose(factors["damped"].max(), 0.5 / top, rtol=1e-3)  # 1/(2 lambda), at sigma = lambda
assert np.allclose(factors["damped when near"][sigmas > eps], 1.0 / sigmas[sigmas > eps])

# %% [markdown]
# ## A path past a singularity
#
# With both links of 1 m, the arm is singular where the tip is at the base: folded, it cannot move
# along itself. The tip shall pass at a distance of 4 cm. All four runs have the same gain; the
# last one is not damped but waits: the hand's command is slowed as a whole, so that it stays on
# the path, and the path's clock with it.

# %%
first, last = np.array([-1.0, 0.04, 0.0]), np.array([1.0, 0.04, 0.0])
q2 = np.arccos(first @ first / 2.0 - 1.0)
start = np.array([np.arctan2(first[1], first[0]) - q2 / 2.0, q2])
path = cc.Line(first, last, duration=4.0)
tip = cc.FrameTask("tool", "xy", gain=10.0, target=path)
ways = {
    "pseudo-inverse": {"solver": "pinv"},
    "damped": {"solver": cc.DLS(damping=top)},
    "damped when near": {"solver": cc.DLSSigma(damping=top, threshold=eps)},
    "slowed when near": {"solver": "pinv", "singularity": cc.SlowDown(eps)},
}
runs = {}
for name, options in ways.items():
    controller = cc.Controller(arm, tip, limits=None, dt=2e-3, **options)
    run = runs[name] = cc.simulate(controller, start, duration=6.0)
    off = max(abs(run.tasks[0].pose[:, 1] - 0.04))
    print(
        f"{name:17s} fastest joint {abs(run.v).max():5.1f} rad/s, {1e3 * off:5.1f} mm off the line"
    )

speed = {name: abs(run.v).max() for name, run in runs.items()}
assert speed["pseudo-inverse"] > 5 * max(
    speed["damped"], speed["damped when near"], speed["slowed when near"]
)
assert max(abs(runs["slowed when near"].tasks[0].pose[:, 1] - 0.04)) < 1e-3
for run in runs.values():
    assert np.linalg.norm(run.tasks[0].pose[-1, :2] - last[:2]) < 1e-3  # all of them arrive

# %%
fig, (a, b, c) = plt.subplots(1, 3, width_ratios=[1, 1.15, 1])
colors = {
    "pseudo-inverse": "C0",
    "damped": "C1",
    "damped when near": "C2",
    "slowed when near": "C4",
    "left out": "C5",
}
dashes = {"damped when near": "--", "left out": ":", "slowed when near": "-."}
for name, values in factors.items():
    a.plot(sigmas, values, dashes.get(name, "-"), color=colors[name], label=name)
a.set(
    xlabel=r"singular value $\sigma$ (m)",
    ylabel=r"factor $\varphi(\sigma)$ (1/m)",
    title="What becomes of a direction",
    ylim=(0, 13),
)
a.legend(loc="upper right", handlelength=1.4)

for name, run in runs.items():
    style = {"color": colors[name], "ls": dashes.get(name, "-"), "label": name}
    b.plot(1e3 * run.tasks[0].pose[:, 0], 1e3 * run.tasks[0].pose[:, 1], **style)
    c.plot(run.time, abs(run.v).max(axis=1), **style)
b.plot(0, 0, "k+", ms=16, mew=3)
b.text(15, -1, "base", va="center")
b.set(
    xlabel="x (mm)",
    ylabel="y (mm)",
    title="The tip, past the base",
    xlim=(-300, 300),
    ylim=(-20, 120),
)
b.legend(loc="upper right")
c.set(xlabel="time (s)", ylabel="fastest joint (rad/s)", title="What the joints do", xlim=(0, 5))
fig.suptitle("Damping leaves the path to spare the joints; slowing down leaves the timetable")
plt.show()
