"""One fitted level: least ``sum_i dist(a_i . u, [low_i, high_i])^2`` under all that is in force, by a primal method.

Among the inequalities that hold with equality (the members), the step p is the least-squares one for the rows that
miss their interval, ``p = (A_V N)# (target - A_V u)`` in the members' null space: as far as the first inequality in its
way, and to the lowest point of the sum, which is quadratic by pieces. At rest ``A_V^T (A_V u - target)`` is
``sum_j lam_j n_j``, and a member with lam_j < 0 is let go. Rows that miss in the end are equations from then on (how
much they miss is the same in every optimum), as are members with lam_j > 0; rows that are met go on as inequalities.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import part
from cartctl.solvers.exact.descent import STALLED, most_negative
from cartctl.solvers.exact.inequalities import Inequalities, drop, look_again, normal_of, take_in
from cartctl.solvers.exact.line_search import blocked_at, lowest_at
from cartctl.solvers.exact.proof import write_multipliers
from cartctl.solvers.exact.scaled import MET
from cartctl.solvers.exact.working_set import (
    EXACT,
    FREE,
    KIND,
    LAM,
    NEAR,
    NEARLY,
    NUM,
    SUM,
    WHO,
    H,
    WorkingSet,
    Z,
    combine,
    largest_entry,
    length,
    orthogonalise,
    unsure,
)

_NOISE = 2e-8  # of the rows' size: singular values below this lead nowhere
_GAIN, _OFTEN = 1e-14, 6  # of the sum: so many steps one after another that lower it by less lead nowhere
_REST = 1e-11  # of the largest miss: a step that changes the rows by less is none
_ROUND_OFF = 1e-14  # of the rows' size times that of u: rows that move or miss by less do not
_NOTHING = 1e-12  # of what is added up in a row, or may have been: a miss below this is none
_FAINT = 1e-9  # of the rows' size times that of u: a fit that misses by less, and by more than nothing, is in doubt
_SURE = 1e3  # times the round-off in it: a multiplier this large is one
_MAGNIFIED = 1e9  # times round-off: no multiplier this large is due to it
_PULLS = 1e-9  # of the rows' size times the largest miss: a multiplier below this is none


@part
def fitted_level(
    w: WorkingSet,
    q: Inequalities,
    rows: FloatArray,
    low: FloatArray,
    high: FloatArray,
    size: float,
    norm: FloatArray,
    proof: FloatArray,
    u: FloatArray,
    most: int,
) -> tuple[int, bool]:
    """Move u, which is feasible, to an optimum: outcome, and whether the rows have lost rank."""
    m, n = rows.shape
    miss = np.empty(m)
    p = np.empty(n)
    gradient = np.empty(n)
    stays = np.zeros(q.state.shape[0], np.bool_)  # let go once and met again at once: its multiplier is round-off
    gone, lost = np.empty(1, np.int64), False
    gone[0] = -1
    before, unblocked, in_vain = np.inf, False, 0
    for turn in range(most):
        count = _misses(rows, low, high, u, miss)
        total = length(miss, m) ** 2
        in_vain = in_vain + 1 if unblocked and total >= (1.0 - _GAIN) * before else 0
        rank = _step(w, rows, miss, count, size, p)
        if turn == 0:
            lost = rank < min(m, n - w.K[NUM, 0])
        largest = _largest(rows, u, float(q.norm[q.state.shape[0]]), miss)
        round_off = _ROUND_OFF * size * largest_entry(u)
        if in_vain < _OFTEN and _moves(rows, p, largest, round_off):
            most_far, code = blocked_at(q, u, p)
            far = lowest_at(rows, low, high, u, p, most_far)
            for k in range(n):
                u[k] += far * p[k]
            before, unblocked = total, far < most_far or code < 0
            if not unblocked:
                left = normal_of(q, code, w)
                take_in(q, w, code, left, 0.0)
                stays[code >> 1] |= code == gone[0]
            gone[0] = -1
            continue
        if blocked_at(q, u, p)[0] >= 1.0:  # what is left of the way, so that the gradient is as exact as u
            for k in range(n):
                u[k] += p[k]
            _misses(rows, low, high, u, miss)
            largest = _largest(rows, u, float(q.norm[q.state.shape[0]]), miss)
        _slope(rows, miss, gradient)
        weakest = _multipliers(w, gradient, size * max(_PULLS * largest, round_off), stays)
        if weakest < 0:
            if 0.0 < largest <= _FAINT * size * max(float(q.norm[q.state.shape[0]]), largest_entry(u)):
                w.K[NEARLY, 0] = 1  # what presses against so faint a miss may be its round-off
            write_multipliers(w, q, norm, proof)
            _keep_sure(w, _SURE * size * (round_off + size * unsure(w, u)))
            return MET, lost
        gone[0], unblocked = w.K[WHO, weakest], False
        drop(q, w, weakest)
        look_again(q, w)
    return STALLED, lost


@part
def _misses(rows: FloatArray, low: FloatArray, high: FloatArray, u: FloatArray, miss: FloatArray) -> int:
    """What is missing from each row to its interval, signed, 0 inside; how many rows count."""
    count = 0
    for i in range(rows.shape[0]):
        x = 0.0
        for k in range(rows.shape[1]):
            x += rows[i, k] * u[k]
        if low[i] == high[i] or x < low[i]:
            miss[i] = low[i] - x
            count += 1
        elif x > high[i]:
            miss[i] = high[i] - x
            count += 1
        else:
            miss[i] = 0.0
    return count


@part
def _step(w: WorkingSet, rows: FloatArray, miss: FloatArray, count: int, size: float, p: FloatArray) -> int:
    """The shortest least-squares step inside the members' null space; the rank of the rows there."""
    m, n = rows.shape
    for k in range(n):
        p[k] = 0.0
    if count == 0 or size == 0.0:
        return 0
    B = np.zeros((m, n))
    for i in range(m):
        if miss[i] == 0.0 and count < m:
            continue
        t = 0.0
        for k in range(n):
            w.V[Z, k] = rows[i, k]
            t += rows[i, k] * rows[i, k]
        orthogonalise(w, math.sqrt(t))
        for k in range(n):
            B[i, k] = w.V[Z, k]
    U, s, Vt = np.linalg.svd(B, full_matrices=False)
    rank = 0
    for j in range(s.shape[0]):
        if EXACT * size < s[j] < NEAR * size:
            w.K[NEARLY, 0] = 1
        if s[j] <= _NOISE * size:
            break
        rank += 1
        t = 0.0
        for i in range(m):
            t += U[i, j] * miss[i]
        t /= s[j]
        for k in range(n):
            p[k] += t * Vt[j, k]
    for k in range(n):
        w.V[Z, k] = p[k]
    orthogonalise(w, 0.0)
    for k in range(n):
        p[k] = w.V[Z, k]
    return rank


@part
def _largest(rows: FloatArray, u: FloatArray, unit: float, miss: FloatArray) -> float:
    """The largest miss; those that are nothing are set to zero."""
    largest, reach = 0.0, max(unit, largest_entry(u))
    for i in range(rows.shape[0]):
        total, length = 0.0, 0.0
        for k in range(rows.shape[1]):
            total += abs(rows[i, k] * u[k])
            length = max(length, abs(rows[i, k]))
        if abs(miss[i]) <= _NOTHING * (total + length * reach):
            miss[i] = 0.0
        largest = max(largest, abs(miss[i]))
    return largest


@part
def _moves(rows: FloatArray, p: FloatArray, largest: float, round_off: float) -> bool:
    """Whether the step changes what the rows miss by more than round-off."""
    change = 0.0
    for i in range(rows.shape[0]):
        x = 0.0
        for k in range(rows.shape[1]):
            x += rows[i, k] * p[k]
        change = max(change, abs(x))
    return largest > 0.0 and change > max(_REST * largest, round_off)


@part
def _slope(rows: FloatArray, miss: FloatArray, gradient: FloatArray) -> None:
    """``A_V^T (A_V u - target)``."""
    for k in range(rows.shape[1]):
        t = 0.0
        for i in range(rows.shape[0]):
            t -= rows[i, k] * miss[i]
        gradient[k] = t


@part
def _multipliers(w: WorkingSet, gradient: FloatArray, nothing: float, stays: NDArray[np.bool_]) -> int:
    """The gradient as a combination of the members, into lam; the free one that pulls away most, or -1."""
    for k in range(gradient.shape[0]):
        w.V[Z, k] = gradient[k]
    orthogonalise(w, np.inf)
    combine(w, w.V[H], w.V[LAM])
    for j in range(w.K[NUM, 0]):
        if w.K[WHO, j] < 0:
            continue  # of an equation it has either sign, and levels below may need it a million times over
        returned = w.V[LAM, j] < 0.0 and w.K[KIND, j] == FREE and stays[w.K[WHO, j] >> 1]
        if returned or abs(w.V[LAM, j]) <= nothing:
            w.V[LAM, j] = 0.0
    return most_negative(w)


@part
def _keep_sure(w: WorkingSet, round_off: float) -> None:
    """Forget multipliers that an error along Q may account for: column j of R^-1 magnifies it."""
    R, x, q = w.R, w.V[SUM], w.K[NUM, 0]
    for j in range(q):
        share = w.V[LAM, j]
        if w.K[KIND, j] != FREE or share > _MAGNIFIED * round_off:
            continue
        total = 0.0
        for i in range(j, q):
            t = 1.0 if i == j else 0.0
            for k in range(j, i):
                t -= R[i, k] * x[k]
            x[i] = t / R[i, i]
            total += x[i] * x[i]
        if share <= round_off * math.sqrt(total):
            w.V[LAM, j] = 0.0
