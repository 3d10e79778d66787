"""One task of the greedy saturation: u = u_S + (A F)# (s b - d - A u_S), F the joints that are still free.

Written for a task below others, u = u' + N y: u' is the answer so far, N (n, k) spans what the tasks above leave, and
saturating row i of ``low <= G u <= high`` is the equation ``G_i N y = bound - G_i u'``. With N = I and G = I it is
the formula above. Every saturated set gives an affine u(s), from which follow the interval of s that keeps all bounds
and the most critical row, the one that stops s first; that row is saturated next (Flacco, De Luca & Khatib 2015).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cartctl.algebra.svd import SVD, norm, numerical_rank, scale, svd
from cartctl.checks import FloatArray
from cartctl.solvers.inequalities import Inequalities

_REACH = 1e-11  # relative: a command this close to the range of the task is inside it
_FIXED = 1e-10  # relative: a row that the null space moves less than this cannot be saturated any more


class Task(NamedTuple):
    """``A u + d = s b`` divided by the size of A; cutoff: singular values of ``A N`` below it carry nothing."""

    A: FloatArray  # (m, n)
    b: FloatArray  # (m,)
    d: FloatArray  # (m,)
    cutoff: float


class Outcome(NamedTuple):
    """What became of a task: u (n,), its scale (nan: skipped), and whether lost rank alone kept s below 1."""

    u: FloatArray
    scale: float
    by_rank: bool


class _Motion(NamedTuple):
    """``u = base + free z`` with the saturated rows on their bounds, and the task's SVD over z up to its rank."""

    base: FloatArray  # (n,), the least motion that puts them there
    free: FloatArray  # (n, k)
    reduced: SVD

    def towards(self, c: FloatArray) -> FloatArray:
        """``free (A free)# c``, (n,)."""
        U, s, Vt = self.reduced
        return self.free @ (Vt.T @ ((U.T @ c) / s))  # type: ignore[no-any-return]


class _Saturation:
    """The rows saturated so far, from u and along N."""

    def __init__(self, rows: Inequalities, u: FloatArray, N: FloatArray) -> None:
        self.rows, self._u, self._N = rows, u, N
        self._moves, self._start = rows.G @ N, rows.G @ u
        self.member = rows.low == rows.high  # locked ones cannot be anything but saturated
        self._bounds = np.where(self.member, rows.low, 0.0)

    def add(self, i: int, bound: float) -> None:
        self.member[i] = True
        self._bounds[i] = bound

    def motion(self, task: Task) -> _Motion | None:
        """What is left to the task; None where a saturated row cannot be brought to its bound."""
        fixed = np.asfortranarray(self._moves[self.member])
        gap = self._bounds[self.member] - self._start[self.member]
        U, s, Vt = svd(fixed)
        r = numerical_rank(s, _FIXED * scale(self._N))
        y = Vt[:r].T @ ((U[:, :r].T @ gap) / s[:r])
        if norm(fixed @ y - gap) > _REACH * (norm(self._bounds) + norm(self._u)):
            return None
        free = self._N @ Vt[r:].T
        U, s, Vt = svd(np.asfortranarray(task.A @ free))
        r = numerical_rank(s, task.cutoff)
        return _Motion(self._u + self._N @ y, free, SVD(U[:, :r], s[:r], Vt[:r]))


def most_scaled(task: Task, u: FloatArray, N: FloatArray, rows: Inequalities, units: FloatArray) -> Outcome:
    """The largest s the iteration meets; skipped (u as it came, nan) where it meets none."""
    saturation, best, rank = _Saturation(rows, u, N), Outcome(u, np.nan, False), 0
    for _ in range(rows.low.shape[0] + 1):
        motion = saturation.motion(task)
        if motion is None or motion.reduced.s.shape[0] < rank:  # too few free joints are left to carry the task
            break
        rank = motion.reduced.s.shape[0]
        offset = task.d + task.A @ motion.base
        size = norm(task.d) + scale(task.A) * norm(motion.base)
        window = _deliverable(motion.reduced.U, task.b, offset, size)
        if window is None:
            return best._replace(by_rank=bool(np.isnan(best.scale)))
        start, rate = motion.base - motion.towards(offset), motion.towards(task.b)
        shares = _shares(rows, saturation.member, units, start, rate, window)
        if shares.critical < 0:
            return Outcome(start + window[1] * rate, window[1], window[1] < 1.0)
        if shares.low <= shares.high and not shares.high <= best.scale:
            best = Outcome(start + shares.high * rate, shares.high, False)
        saturation.add(shares.critical, shares.bound)
    return best


def nearest(task: Task, u: FloatArray, N: FloatArray, rows: Inequalities, units: FloatArray) -> FloatArray:
    """The u (n,) of least ``||A u + d - b||`` the iteration meets, going straight from u to each target."""
    saturation, best = _Saturation(rows, u, N), u
    least = norm(task.A @ u + task.d - task.b)
    for _ in range(rows.low.shape[0] + 1):
        motion = saturation.motion(task)
        if motion is None:
            break
        step = motion.base + motion.towards(task.b - task.d - task.A @ motion.base) - u
        shares = _shares(rows, saturation.member, units, u, step, (0.0, 1.0))
        met = u + max(shares.high, 0.0) * step
        missed = norm(task.A @ met + task.d - task.b)
        if missed < least:
            best, least = met, missed
        if shares.critical < 0:
            break
        saturation.add(shares.critical, shares.bound)
    return best


def _deliverable(U: FloatArray, b: FloatArray, offset: FloatArray, size: float) -> tuple[float, float] | None:
    """The s in [0, 1] at which ``s b - offset`` lies in the range of U (m, rank): all, one, or none."""
    if U.shape[0] == U.shape[1]:
        return 0.0, 1.0
    beta, alpha = b - U @ (U.T @ b), offset - U @ (U.T @ offset)
    floor = _REACH * (size + norm(b))
    if norm(beta) <= _REACH * norm(b):
        return (0.0, 1.0) if norm(alpha) <= floor else None
    s = 0.0 if norm(alpha) <= _REACH * size else float(beta @ alpha / (beta @ beta))
    if norm(s * beta - alpha) > floor or not -_REACH <= s <= 1.0 + _REACH:
        return None
    s = min(max(s, 0.0), 1.0)
    return s, s


class _Shares(NamedTuple):
    """The s that keep every row, [low, high], and the row that stops s first with its bound; -1 if none does."""

    low: float
    high: float
    critical: int
    bound: float


def _shares(
    rows: Inequalities,
    done: NDArray[np.bool_],
    units: FloatArray,
    start: FloatArray,
    rate: FloatArray,
    window: tuple[float, float],
) -> _Shares:
    """What the rows leave of ``start + s rate`` for s within the window.

    units: (n + r,) how far a motion of length one takes each row, so that the metric decides which is furthest out.
    """
    first, last = window
    p, q = rows.G @ start, rows.G @ rate
    tol = rows.slack(np.maximum(np.abs(start + first * rate), np.abs(start + last * rate)))
    tol[done] = np.inf
    begin, end, excess = np.full(p.shape, first), np.full(p.shape, last), np.zeros(p.shape)
    for bound, sign in ((rows.low, -1.0), (rows.high, 1.0)):
        before, after = sign * (p + first * q - bound), sign * (p + last * q - bound)
        early, late = before > tol, after > tol
        if late.any():
            end[late] = np.where(early, -np.inf, np.maximum((bound - p) / q, first))[late]
            excess[late] = (after / units)[late]
        early &= ~late
        if early.any():
            begin[early] = np.minimum((bound - p) / q, last)[early]
    if not excess.any():
        return _Shares(float(begin.max()), last, -1, 0.0)
    ends = np.where(excess > 0.0, end, np.inf)
    critical = int(np.argmax(np.where(ends <= ends.min() + 1e-12, excess, -1.0)))  # of equals the furthest outside
    upper = p[critical] + last * q[critical] > rows.high[critical]
    return _Shares(float(begin.max()), float(end.min()), critical, float((rows.high if upper else rows.low)[critical]))
