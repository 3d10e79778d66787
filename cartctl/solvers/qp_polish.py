"""The exact answer for a known active set, and the active set made right where the guess was nearly so.

With the active bounds and rows held, the programme is one linear system in the free unknowns v, in
``y = rho^-1/2 (A v - c)`` and in the multipliers z of the active rows over ``rho^1/2``,

    [ rho^1/2 W   A^T          C^T ] [v]   [0]
    [ A          -rho^1/2 I    0   ] [y] = [c]
    [ C           0            0   ] [z]   [bound]

whose condition is about 1/damping where that of ``A^T A + rho W`` is its square. A row whose multiplier pulls the
wrong way is let go, one that is overstepped is held, until neither happens: a primal-dual active set (Hintermueller,
Ito & Kunisch 2003), one row at a time once all at once makes no progress (Judice & Pires 1994). So answers are exact
to round-off whatever a backend's tolerance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import lstsq

from cartctl.checks import FloatArray
from cartctl.solvers.qp_program import Program
from cartctl.solvers.qp_saddle import solve_saddle

_ROUNDS = 30
_PATIENCE = 4  # rounds without progress
_PULL = 1e-14  # a multiplier below it is none; those of the null space are of the size of rho
_EXACT = 1e-13  # what a row that is held may be missed by
_CORRECTED = 1e-6  # missed by more, they exclude each other
_TOLERANCE = 1e-11  # of the programme's units, in which everything is of size one


class Point(NamedTuple):
    """An answer with multipliers, positive at the upper bound, negative at the lower."""

    v: FloatArray  # (n,)
    z: FloatArray  # (r,) of the rows
    z_box: FloatArray  # (n,)


def polish(p: Program, guess: Point) -> Point | None:
    """The exact answer next to a guess, or None where the active set does not settle."""
    limits = _Limits(p)
    sides = limits.guess(guess)
    fewest, patience = limits.count + 1, _PATIENCE
    for _ in range(_ROUNDS):
        held = _held(p, sides[: p.n], sides[p.n :])
        if held is None:
            return None
        wanted = limits.revised(held.point, sides)
        wrong = np.flatnonzero(wanted != sides)
        if wrong.shape[0] == 0:
            return held.point if held.exact else None
        if wrong.shape[0] < fewest:
            fewest, patience = wrong.shape[0], _PATIENCE
        else:
            patience -= 1
        if patience <= 0:  # all at once may go in circles, one by one does not
            wrong = wrong[-1:]
        sides = sides.copy()
        sides[wrong] = wanted[wrong]
    return None


class _Limits:
    """Bounds, then rows, as one list; a side is -1 where the lower one is held, +1 the upper, 0 neither."""

    def __init__(self, p: Program) -> None:
        self._C = p.C
        self._low, self._high = np.concatenate([p.low, p.c_low]), np.concatenate([p.high, p.c_high])
        self._equal = self._low == self._high
        self.count = self._low.shape[0]

    def _values(self, point: Point) -> tuple[FloatArray, FloatArray]:
        return np.concatenate([point.v, self._C @ point.v]), np.concatenate([point.z_box, point.z])

    def guess(self, point: Point) -> FloatArray:
        """A limit whose multiplier is larger than the gap is held."""
        values, z = self._values(point)
        sides = np.where(z > np.maximum(self._high - values, 0.0), 1.0, 0.0)
        sides[-z > np.maximum(values - self._low, 0.0)] = -1.0
        sides[self._equal] = 1.0
        return sides

    def revised(self, point: Point, sides: FloatArray) -> FloatArray:
        """Let go what pulls the wrong way, hold what is overstepped."""
        values, z = self._values(point)
        wrong_way = sides * z < -_PULL * max(1.0, float(np.abs(z).max(initial=0.0)))
        kept = np.where(wrong_way & ~self._equal, 0.0, sides)
        kept[(values > self._high + _TOLERANCE) & (sides <= 0.0)] = 1.0
        kept[(values < self._low - _TOLERANCE) & (sides >= 0.0) & ~self._equal] = -1.0
        return kept


class _Held(NamedTuple):
    """The answer with some limits as equations; exact unless these exclude each other."""

    point: Point
    exact: bool


def _held(p: Program, box: FloatArray, rows: FloatArray) -> _Held | None:
    """The answer with these bounds and rows as equations; None where it cannot be worked out."""
    free, held = box == 0.0, rows != 0.0
    v = np.where(box > 0.0, p.high, np.where(box < 0.0, p.low, 0.0))
    C, bounds = p.C[held], np.where(rows > 0.0, p.c_high, p.c_low)[held]
    k, m, root = int(free.sum()), p.A.shape[0], p.rho**0.5
    rhs = np.concatenate([-root * p.weigh(v)[free], p.c - p.A @ v, bounds - C @ v])
    W = root * (p.W[free] if p.W.ndim == 1 else p.W[np.ix_(free, free)])
    x = solve_saddle(W, p.A[:, free], C[:, free], root, rhs)
    if x is None:
        return None
    v[free] = x[:k]
    missed = bounds - C @ v
    if np.abs(missed).max(initial=0.0) > _EXACT and np.abs(missed).max() < _CORRECTED:
        # commands far beyond the limits leave few digits to the rows
        v[free] += lstsq(C[:, free], missed, lapack_driver="gelsy", check_finite=False)[0]
        missed = bounds - C @ v
    z = np.zeros(rows.shape[0])
    z[held] = root * x[k + m :]
    force = -(p.rho * p.weigh(v) + root * (p.A.T @ x[k : k + m]) + p.C.T @ z)
    return _Held(Point(v, z, np.where(free, 0.0, force)), bool(np.abs(missed).max(initial=0.0) <= _TOLERANCE))
