# %% [markdown]
# # 1 · One step, opened up
#
# $$ v \;=\; J^{\#}\,\bigl(\dot r_{\mathrm{ref}} + K e\bigr) \;+\; \bigl(I - J^{\#} J\bigr)\,u_0 $$
#
# The hand is told where to be; the joints must be told how fast to turn. **What happens in
# between, and why this joint motion and none of the infinitely many others that move the hand
# alike?**
#
# $r$ is the task (here the tip's position), $e$ its error, $K$ the gain,
# $J = \partial r / \partial q$ its Jacobian, $v$ the joint velocities, $u_0$ a velocity we
# would like the joints to have beside the task.

# %%
import matplotlib.pyplot as plt
import numpy as np

import cartctl as cc
from cartctl import analysis

plt.style.use("cartctl.report.lecture")
robot = cc.planar([2.0, 2.0, 2.0])
q = np.array([-np.pi / 2, 0.0, np.pi / 2])
state = robot.state(q)
r, J = state.position("tool")[:2], state.jacobian("tool")[:2]  # the task: x and y of the tip
print("tip at", r, "m\nJ =\n", J.round(4))

# %% [markdown]
# ## From the error to a command
#
# The tip should come onto a straight path that begins at (4, 2) m, faster across the path than
# along it: the gain is a matrix, diagonal in the path's own axes. The example, with its printed
# answer, is from A. De Luca, *Robotics 1*, Sapienza, exam of 3 February 2017.

# %%
along = np.array([-6.0, 2.0]) / np.sqrt(40.0)
across = np.array([-along[1], along[0]])
R = np.column_stack([along, across])
K = R @ np.diag([1.1513, 3.4539]) @ R.T  # 1/s
e = np.array([4.0, 2.0]) - r
b = K @ e  # the path is not moving yet: its rate is zero
print("e =", e, "m\nb =", b.round(4), "m/s")

# %% [markdown]
# ## From the command to the joints
#
# Two equations $Jv = b$, three unknowns. Of all solutions we take the shortest, with a Lagrange
# multiplier $\lambda$:
#
# $$ \min_v \tfrac12 v^T v \;\;\text{s.t.}\;\; J v = b \quad\Longrightarrow\quad v = J^T \lambda,\qquad J J^T \lambda = b
# \quad\Longrightarrow\quad v = \underbrace{J^T (J J^T)^{-1}}_{J^{\#}}\; b . $$
#
# With the singular value decomposition $J = U \Sigma V^T$ the same is $V \Sigma^{+} U^T b$,
# which also works where $J J^T$ has no inverse. `cc.solve` does the latter.

# %%
by_multipliers = J.T @ np.linalg.solve(J @ J.T, b)
U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
by_svd = Vt.T @ (U.T @ b / sigma)
solution = cc.solve(cc.Problem([(J, b)]), "pinv")
v = solution.u
print("v =", v.round(4), "rad/s,", solution.status.value)

assert np.allclose(v, [0.0, 3.4539, 6.9078], atol=3e-4)  # as published
assert np.allclose(v, by_multipliers) and np.allclose(v, by_svd)
assert analysis.penrose(
    J, np.column_stack([cc.solve(cc.Problem([(J, c)]), "pinv").u for c in np.eye(2)])
)

# %% [markdown]
# ## All the others
#
# $I - J^{\#}J$ projects onto the motions that the tip does not feel. Here that is one direction
# $n$, so every solution is $v + \alpha n$. Because $v \perp n$, Pythagoras says how much
# longer it is: $\lVert v + \alpha n\rVert^2 = \lVert v\rVert^2 + \alpha^2$. That is all
# there is to "minimum norm". A reference $u_0$ picks another $\alpha$.

# %%
n = np.linalg.svd(J)[2][2]
n *= np.sign(n[0])
wish = np.array([2.0, 0.0, 0.0])  # u0: turn the first joint, please
other = cc.solve(cc.Problem([(J, b)], reference=wish), "projected-gradient").u

assert np.allclose(J @ n, 0.0) and abs(v @ n) < 1e-12
assert np.allclose(other, v + (n @ wish) * n)  # the wish's share along n, nothing else
assert np.allclose(J @ other, b)  # the tip moves alike
print("v  =", v.round(3), " norm", np.linalg.norm(v).round(3))
print("v' =", other.round(3), " norm", np.linalg.norm(other).round(3))

# %% [markdown]
# ## The same, step after step
#
# A `Controller` does all this at every step. With one gain $k$ and a target that rests,
# $\dot e = -ke$, so a step of length $\Delta t$ leaves the share $1 - k\,\Delta t$ of the
# error, but for the curvature of the arm's motion.

# %%
k, dt = 2.0, 0.01
tip = cc.FrameTask("tool", "xy", gain=k, target=[4.0, 2.0, 0.0])
run = cc.simulate(cc.Controller(robot, tip, solver="pinv", limits=None, dt=dt), q, duration=3.0)
error = np.linalg.norm(run.tasks[0].error, axis=1)
share = error[1:] / error[:-1]
print(f"error {error[0]:.2f} m -> {error[-1]:.4f} m")
print(f"each step leaves {share.min():.4f} to {share.max():.4f} of it")
assert np.allclose(share, 1.0 - k * dt, atol=4e-3)

# %%
fig, (left, middle, right) = plt.subplots(1, 3, width_ratios=[0.9, 1, 1])
arrow = {
    "arrowstyle": "-|>",
    "lw": 4,
    "color": "C3",
    "mutation_scale": 24,
    "shrinkA": 0,
    "shrinkB": 0,
}
arm = np.array([state.position(name)[:2] for name in ("link1", "link2", "link3", "tool")])
left.plot(*arm.T, "o-", color="0.25", lw=8, ms=13, mfc="white", mew=3)
left.annotate("", r + 0.22 * b, r, arrowprops=arrow)
left.text(3.1, -2.4, "$b$", color="C3", size=22)
left.plot(4, 2, "*", color="C3", ms=18)
left.text(4, 2.5, "target", ha="center")
left.set(
    aspect="equal",
    xlabel="x (m)",
    ylabel="y (m)",
    title="What is asked",
    xlim=(-1.5, 5.5),
    ylim=(-5, 3.8),
)

choices = {-3: "C2", 0: "C0", 3: "C1"}
for a, color in choices.items():
    chain = np.cumsum(np.vstack([np.zeros(2), (J * (v + a * n)).T]), axis=0)
    middle.plot(*chain.T, "o-", color=color, label=rf"$\alpha = {a}$ rad/s")
    right.plot(a, np.linalg.norm(v + a * n), "o", color=color, ms=15, zorder=3)
middle.annotate("", b, (0, 0), arrowprops=arrow)
middle.text(1.0, 8.5, "$b$", color="C3", size=22)
middle.set(
    xlabel="x (m/s)", ylabel="y (m/s)", title="What each joint gives, end to end", xlim=(-6, 14)
)
middle.legend(loc="lower right")

alpha = np.linspace(-6, 6, 121)
right.plot(alpha, [np.linalg.norm(v + a * n) for a in alpha], color="0.25", zorder=1)
right.set(
    xlabel=r"$\alpha$ (rad/s)",
    ylabel=r"$\|v + \alpha n\|$ (rad/s)",
    title="What it costs",
    ylim=(7, None),
)
fig.suptitle("One hand velocity, many joint velocities: the pseudo-inverse takes the shortest")
plt.show()
