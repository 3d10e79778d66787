"""The quadratic programme of weighted tasks, in units in which tasks, rows and answer are of size one.

    minimise 1/2 ||A v - c||^2 + rho/2 v^T W v   subject to   low <= v <= high,  c_low <= C v <= c_high

with u = u0 + t v. A and c stack ``w_k^1/2 A_k`` and ``w_k^1/2 (b_k - d_k - A_k u0)``, divided by the Frobenius norm
alpha of the whitened stack; rho = damping^2. Solvers' tolerances are absolute: this makes them mean something.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cartctl.algebra.metric import Whitening, weighed
from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import norm, scale
from cartctl.checks import FloatArray
from cartctl.solvers.inequalities import Inequalities


class Program(NamedTuple):
    """The programme, and the way back: u = origin + size v."""

    A: FloatArray  # (m, n)
    c: FloatArray  # (m,)
    W: FloatArray  # (n,) or (n, n), largest entry 1
    rho: float
    low: FloatArray  # (n,)
    high: FloatArray  # (n,)
    C: FloatArray  # (r, n), rows of length one
    c_low: FloatArray  # (r,)
    c_high: FloatArray  # (r,)
    origin: FloatArray  # (n,)
    size: float
    alpha: float
    lengths: FloatArray  # (r,) of the rows as they were given

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return int(self.low.shape[0])

    @property
    def is_free(self) -> bool:
        """Whether no bound and no row is finite."""
        return not any(np.isfinite(x).any() for x in (self.low, self.high, self.c_low, self.c_high))

    def violation(self, v: FloatArray) -> float:
        """The largest amount by which v leaves bounds or rows."""
        at = self.C @ v
        gaps = (self.low - v, v - self.high, self.c_low - at, at - self.c_high)
        return max(float(x.max(initial=0.0)) for x in gaps)

    def has_room(self) -> bool:
        """Whether bounds and rows leave any point at all."""
        if self.C.shape[0] == 0:
            return True
        low, high = np.concatenate([self.low, self.c_low]), np.concatenate([self.high, self.c_high])
        return Inequalities(np.concatenate([np.eye(self.n), self.C]), low, high).nearest_to_rest() is not None

    def weigh(self, v: FloatArray) -> FloatArray:
        """``W v``, (n,)."""
        return weighed(self.W, v)

    def hessian(self) -> FloatArray:
        """``A^T A + rho W``, (n, n)."""
        H = self.A.T @ self.A
        if self.W.ndim == 1:
            H.ravel()[:: self.n + 1] += self.rho * self.W
        else:
            H += self.rho * self.W
        return H  # type: ignore[no-any-return]


def program_of(problem: Problem, damping: float) -> Program:
    """The programme of a problem; FloatingPointError where its numbers over- or underflow."""
    n = problem.n
    W = np.ones(n) if problem.metric is None else problem.metric / np.abs(problem.metric).max()
    origin = np.zeros(n) if problem.reference is None else problem.reference
    A, c = _stack(problem, origin)
    alpha = scale(A if problem.metric is None else Whitening(W).matrix(A))
    rho = damping * damping if alpha > 0.0 else 1.0  # with no task to weigh against, any will do
    alpha = alpha or 1.0
    A, c = A / alpha, c / alpha
    rows = Inequalities.of(problem)
    low, high, C = rows.low[:n] - origin, rows.high[:n] - origin, rows.G[n:]
    lengths = np.sqrt(np.einsum("ij,ij->i", C, C))
    lengths[lengths == 0.0] = 1.0
    at = C @ origin
    c_low, c_high = (rows.low[n:] - at) / lengths, (rows.high[n:] - at) / lengths
    size = _size(norm(c), low, high, c_low, c_high)
    limits = (low / size, high / size, C / lengths[:, None], c_low / size, c_high / size)
    p = Program(A, c / size, W, rho, *limits, origin, size, alpha, lengths)
    if not (np.isfinite(p.A).all() and np.isfinite(p.c).all() and np.isfinite(p.C).all() and np.isfinite(alpha)):
        raise FloatingPointError("the numbers of the problem over- or underflow")
    return p


def _stack(problem: Problem, origin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """All rows by the root of their weight; those of weight 0 left out."""
    kept = [(e.weight**0.5, e) for e in problem.equations if e.weight > 0.0]
    if not kept:
        return np.zeros((0, problem.n)), np.zeros(0)
    if len(kept) == 1:
        root, e = kept[0]
        return root * e.A, root * (e.rhs - e.A @ origin)
    A = np.concatenate([root * e.A for root, e in kept])
    return A, np.concatenate([root * (e.rhs - e.A @ origin) for root, e in kept])


def _size(command: float, low: FloatArray, high: FloatArray, c_low: FloatArray, c_high: FloatArray) -> float:
    """About how large v will be: as the command wants, no more than the box allows, no less than it forces."""
    room = max(float(np.abs(low).max()), float(np.abs(high).max()))
    forced = max(float(x.max(initial=0.0)) for x in (low, -high, c_low, -c_high))
    size = max(min(command, room), forced)
    return size if np.isfinite(size) and size > 0.0 else 1.0
