"""Bounds on u and constraint rows as one system, ``low <= G u <= high`` with ``G = [I; C]``.

Used by the methods that treat a row of C as they treat a joint (Fiore et al. 2023), and for the point nearest to rest:
``min ||x||^2 subject to G x >= h`` by non-negative least squares (Lawson & Hanson 1974, chapter 23).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import norm
from cartctl.checks import FloatArray

_SLACK = 1e-12  # relative: a bound met to round-off is met


class Inequalities(NamedTuple):
    """``low <= G u <= high``: the n bounds first, then the r rows of C; +-inf where there is none."""

    G: FloatArray  # (n + r, n)
    low: FloatArray  # (n + r,)
    high: FloatArray  # (n + r,)

    @classmethod
    def of(cls, problem: Problem) -> Inequalities:
        """All inequalities of a problem."""
        n = problem.n
        low = np.full(n, -np.inf) if problem.lower is None else problem.lower
        high = np.full(n, np.inf) if problem.upper is None else problem.upper
        if problem.constraints is None:
            return cls(np.eye(n), low, high)
        C, c_low, c_high = problem.constraints
        return cls(np.vstack([np.eye(n), C]), np.concatenate([low, c_low]), np.concatenate([high, c_high]))

    def slack(self, u: FloatArray) -> FloatArray:
        """How far outside of each row round-off may put u, (n + r,)."""
        sizes = np.abs(u)
        return _SLACK * (np.abs(self.G) @ sizes + sizes.max())  # type: ignore[no-any-return]

    def nearest_to_rest(self) -> FloatArray | None:
        """The u (n,) of least norm within all rows, or None where there is no room at all."""
        n = self.G.shape[1]
        u: FloatArray = np.minimum(np.maximum(0.0, self.low[:n]), self.high[:n])
        values = self.G @ u
        tol = self.slack(u)
        if (values >= self.low - tol).all() and (values <= self.high + tol).all():
            return u
        return self._least_distance()

    def _least_distance(self) -> FloatArray | None:
        """The same by the least-distance programme; rows and answer scaled to about one."""
        n = self.G.shape[1]
        lengths = np.sqrt((self.G * self.G).sum(axis=1))
        lengths[lengths == 0.0] = 1.0
        below, above = np.isfinite(self.low), np.isfinite(self.high)
        G = np.vstack([(self.G / lengths[:, None])[below], -(self.G / lengths[:, None])[above]])
        h = np.concatenate([(self.low / lengths)[below], -(self.high / lengths)[above]])
        size = float(np.maximum(h, 0.0).max(initial=0.0))  # the largest distance of a row from rest
        E = np.vstack([G.T, h / size])
        target = np.zeros(n + 1)
        target[n] = 1.0
        from scipy.optimize import nnls  # takes longer to import than all the rest, and is rarely needed

        try:
            weights, _ = nnls(E, target, maxiter=30 * E.shape[1])
        except RuntimeError:  # it ran out of iterations
            return None
        rest = E @ weights - target
        if -rest[n] <= 1e-12:  # a combination of rows that reads 0 >= 1
            return None
        u = np.minimum(np.maximum(size * rest[:n] / -rest[n], self.low[:n]), self.high[:n])
        missed = np.maximum(self.low - self.G @ u, self.G @ u - self.high).max()
        return u if missed <= 1e-9 * max(1.0, norm(u)) else None
