"""Random prioritised problems with an answer that is known to be possible, and what decides whether one is optimal.

A problem is built around a point u inside the box and the rows: the commands are those that u delivers at chosen
scales, so that the lexicographic optimum is at least that. Whether an answer is optimal is left to linear programmes:
s_k is the most that the levels above leave, and a convex cost is least at u where its gradient cannot be descended.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from cartctl import Equation, Inequality, Problem
from tests import oracles

SCALE = 1e-7  # of a scale, against HiGHS
DESCENT = 1e-7  # of a gradient times the room there is
TIGHT = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


class Made(NamedTuple):
    """A problem, a point that respects its bounds, and the scales of the equations there (nan: not known)."""

    problem: Problem
    u: np.ndarray
    floor: np.ndarray


# ---------------------------------------------------------------- problems


def pick(rng, **shares):
    """A name, as often as its share says."""
    total = sum(shares.values())
    return str(rng.choice(list(shares), p=[share / total for share in shares.values()]))


def task_matrix(rng, m, n, above, kind, near=0):
    """A (m, n) of a kind that gives trouble, or not."""
    if kind == "whole":  # ties wherever one looks
        return rng.integers(-1, 2, size=(m, n)).astype(float)
    if kind == "joints":
        A = np.zeros((m, n))
        A[np.arange(m), rng.integers(0, n, m)] = rng.choice([1.0, -1.0, 2.0], m)
        return A
    if kind == "near":  # singular, up to something
        return oracles.matrix_with(rng, m, n, 10.0 ** -rng.uniform(0.0, near, min(m, n)))
    A = oracles.matrix(rng, m, n, int(rng.integers(0, min(m, n) + 1)) if kind == "deficient" else None)
    if kind == "repeats" and above and above[-1].shape[0]:
        A[: m - m // 2] = rng.normal(size=(m - m // 2, above[-1].shape[0])) @ above[-1]
    if kind == "gaps" and m:
        A[:, rng.integers(0, n)] = 0.0
        A[rng.integers(0, m)] *= rng.integers(0, 2)
    return A


def box(rng, n, kind):
    """lower, upper of one kind."""
    if kind == "equal":
        limit = np.full(n, float(rng.integers(1, 4)))
        return -limit, limit
    lower, upper = -rng.uniform(0.1, 2.0, n), rng.uniform(0.1, 2.0, n)
    if kind == "away":  # rest is not inside
        shift = rng.uniform(-4.0, 4.0, n) * (rng.random(n) < 0.4)
        lower, upper = lower + shift, upper + shift
    if kind == "open":
        lower[rng.random(n) < 0.4], upper[rng.random(n) < 0.4] = -np.inf, np.inf
    if kind == "locked":
        lower = np.where(rng.random(n) < 0.3, upper, lower)
    return lower, upper


def inside(rng, lower, upper):
    """A point in a box, some of it on the bounds."""
    low, high = np.maximum(lower, np.minimum(upper, 0.0) - 3.0), np.minimum(upper, np.maximum(lower, 0.0) + 3.0)
    where = rng.choice([0.0, 1.0, -1.0], size=lower.shape[0], p=[0.3, 0.3, 0.4])
    return low + (high - low) * np.where(where < 0.0, rng.random(lower.shape[0]), where)


def rows_around(rng, u, whole):
    """A few rows of C and an interval each that u respects, or touches."""
    n, r = u.shape[0], int(rng.integers(1, 5))
    C = rng.integers(-1, 2, size=(r, n)).astype(float) if whole else rng.normal(size=(r, n))
    x = C @ u
    below, above = (rng.uniform(0.0, 1.5, r) * (rng.random(r) < 0.7) for _ in range(2))
    low, high = x - below, x + above
    return C, np.where(rng.random(r) < 0.4, -np.inf, low), np.where(rng.random(r) < 0.4, np.inf, high)


def made(seed, most=40, levels=5, fits=("scale",), inequalities=False, contradict=False, near=0):
    """One problem; ``fits`` are drawn from, ``contradict`` adds hard rows that the box forbids."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9)) if rng.random() < 0.7 else int(rng.integers(1, most + 1))
    whole = rng.random() < 0.25
    lower, upper = box(rng, n, "equal" if whole else pick(rng, random=3, away=1, open=1, locked=1, equal=1))
    u = inside(rng, lower, upper)
    u = np.clip(np.round(u), lower, upper) if whole else u
    constraints = rows_around(rng, u, whole) if rng.random() < 0.35 else None
    if contradict:
        C = rng.normal(size=(2, n))
        far = np.maximum(C, 0.0) @ np.minimum(upper, 5.0) + np.minimum(C, 0.0) @ np.maximum(lower, -5.0)
        upper, lower = np.minimum(upper, 5.0), np.maximum(lower, -5.0)
        constraints = (C, far + rng.uniform(-1.0, 1.0, 2), np.full(2, np.inf))
    equations, floor, matrices = [], [], []
    for _ in range(int(rng.integers(1, levels + 1))):
        kind = "whole" if whole else pick(rng, random=6, deficient=1, repeats=1, gaps=1, joints=1, near=float(near > 0))
        m = int(rng.integers(0, 3 + min(n, 6)))
        A = task_matrix(rng, m, n, matrices, kind, near)
        matrices.append(A)
        if inequalities and rng.random() < 0.35:
            shift = rng.choice([0.0, 3.0]) * rng.normal(size=m)
            low = A @ u + shift - rng.random(m) * (rng.random(m) < 0.8)
            equations.append(Inequality(A, np.where(rng.random(m) < 0.3, -np.inf, low), A @ u + shift + rng.random(m)))
            floor.append(1.0 if not shift.any() else np.nan)
            continue
        equation, s = command(rng, A, u, str(rng.choice(fits)), whole)
        equations.append(equation)
        floor.append(s)
    W = oracles.metric(rng, n, pick(rng, identity=12, diagonal=2, full=1))
    u0 = rng.normal(size=n) if rng.random() < 0.3 else None
    sides = {"lower": lower, "upper": upper} if rng.random() < 0.95 else {}
    return Made(Problem(equations, **sides, constraints=constraints, metric=W, reference=u0), u, np.array(floor))


def command(rng, A, u, fit, whole):
    """An equation that u meets at a scale, which is returned; or one that it does not (nan)."""
    m, x = A.shape[0], A @ u
    drift = None if rng.random() < 0.7 else rng.integers(-1, 2, m).astype(float) if whole else 0.3 * rng.normal(size=m)
    d = np.zeros(m) if drift is None else drift
    kind = pick(rng, met=4, slowed=4 * (fit == "scale"), stopped=1 * (fit == "scale"), other=2)
    if kind == "met":
        return Equation(A, x + d, drift=drift, fit=fit), 1.0
    if kind == "slowed":
        s = float(rng.choice([0.5, rng.uniform(0.05, 1.0)]))
        return Equation(A, (x + d) / s, drift=drift, fit=fit), s
    b = rng.integers(-2, 3, m).astype(float) if whole else 3.0 * rng.normal(size=m) * rng.integers(0, 2)
    if kind == "stopped":
        return Equation(A, b, drift=-x, fit=fit), 0.0
    return Equation(A, b, drift=drift, fit=fit), np.nan


# ---------------------------------------------------------------- what decides


def below_floor(scales, floor, tolerance=1e-8):
    """Whether the scales are lexicographically less than those that are known to be possible."""
    for s, possible in zip(scales, floor, strict=True):
        if np.isnan(possible):
            return False
        if np.isnan(s) or s < possible - tolerance:
            return True
        if s > possible + tolerance:
            return False
    return False


class Feasible:
    """The points that a level may choose from, as rows of a linear programme about u (n,)."""

    def __init__(self, problem, u):
        n = problem.n
        self.u, self.fixed = u, np.zeros((0, n))
        self.C, self.low, self.high = np.zeros((0, n)), np.zeros(0), np.zeros(0)
        room = 1.0 + 2.0 * np.abs(u).max(initial=0.0)  # convex costs: what is least nearby is least
        self.lower = u - room if problem.lower is None else np.maximum(problem.lower, u - room)
        self.upper = u + room if problem.upper is None else np.minimum(problem.upper, u + room)
        self.room = room

    def keep(self, A, low, high):
        """Rows from now on within an interval, or where u has them if u has left it."""
        x = A @ self.u
        self.C = np.vstack([self.C, A])
        self.low, self.high = np.append(self.low, np.minimum(low, x)), np.append(self.high, np.maximum(high, x))

    def fix(self, A):
        """Rows from now on as u has them."""
        self.fixed = np.vstack([self.fixed, A])

    def programme(self, cost, extra=None, s_cost=0.0, bounds=(0.0, 0.0)):
        """Least ``cost . v + s_cost s`` with ``extra = (A, b, d)``: A v + d = s b."""
        rows, sides = [], []
        finite_low, finite_high = np.isfinite(self.low), np.isfinite(self.high)
        rows += [-self.C[finite_low], self.C[finite_high]]
        sides += [-self.low[finite_low], self.high[finite_high]]
        A_ub, b_ub = np.vstack(rows), np.concatenate(sides)
        A_eq, b_eq, slope = self.fixed, self.fixed @ self.u, np.zeros(self.fixed.shape[0])
        if extra is not None:
            A_eq, b_eq = np.vstack([A_eq, extra[0]]), np.append(b_eq, -extra[2])
            slope = np.append(slope, -extra[1])
        return linprog(
            np.append(cost, s_cost),
            A_ub=np.column_stack([A_ub, np.zeros(A_ub.shape[0])]),
            b_ub=b_ub,
            A_eq=np.column_stack([A_eq, slope]),
            b_eq=b_eq,
            bounds=np.vstack([np.column_stack([self.lower, self.upper]), bounds]),
            options=TIGHT,
        )

    def descent(self, gradient, unit):
        """By how much a linear cost can still fall, relative to the room and to ``unit`` or its own size."""
        size = max(np.abs(gradient).sum(), unit)
        if size == 0.0:
            return 0.0
        result = self.programme(gradient / size)
        assert result.status == 0, result.message
        return float(gradient @ self.u / size - result.fun) / self.room


def shortcomings(solution, fitted=False):
    """How far each level, and then the norm, is from optimal by linear programming: ``(level, what, by how much)``.

    fitted: every equation is one of least squares.
    """
    p, u = solution.problem, solution.u
    free, found = Feasible(p, u), []
    if p.constraints is not None:
        C, low, high = p.constraints
        miss = np.minimum(C @ u - low, 0.0) + np.maximum(C @ u - high, 0.0)
        found.append(
            (
                -1,
                "rows",
                free.descent(
                    C.T @ miss,
                    1e-3 * float((np.abs(C).sum(axis=1) * np.linalg.norm(C, axis=1)).max(initial=0.0)) * free.room,
                ),
            )
        )
        free.keep(C, low, high)
    for k, (e, s) in enumerate(zip(p.equations, solution.scales, strict=True)):
        norms = np.linalg.norm(e.A, axis=1)
        unit = np.abs(e.A).sum(axis=0).max(initial=0.0) * 1e-3 * norms.max(initial=0.0) * free.room
        if e.fit == "inequality":
            found.append((k, "interval", free.descent(e.A.T @ e.miss(u, 1.0), unit)))
            free.keep(e.A, e.lower, e.upper)
        elif e.fit == "least_squares" or fitted:
            found.append((k, "fit", free.descent(e.A.T @ e.miss(u, 1.0), unit)))
            free.fix(e.A)
        else:
            d = np.zeros(e.b.shape[0]) if e.drift is None else e.drift
            best = free.programme(np.zeros(p.n), (e.A, e.b, d), -1.0, (0.0, 1.0))
            if np.isnan(s):
                found.append((k, "skipped", 0.0 if best.status == 2 else 1.0))
                continue
            met = np.abs(e.miss(u, s)).max(initial=0.0) / (
                norms.max(initial=0.0) * free.room + np.abs(e.b).max(initial=0) + 1e-300
            )
            # a programme that finds nothing is stricter with round-off than the answer
            found.append((k, "scale", max(met, -best.fun - s if best.status == 0 else 0.0)))
            free.fix(e.A)
    step = u if p.reference is None else u - p.reference
    found.append(
        (len(p.equations), "nearest", free.descent(oracles.full_metric(p.metric, p.n) @ step, 1e-3 * free.room))
    )
    return found
