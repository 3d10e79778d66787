"""The dual active-set method of Goldfarb & Idnani (1983) for the point of least norm.

It starts from the least norm on the equalities alone, takes in the inequality missed by most, and lets go of members
whose multiplier would turn negative. Where the newcomer depends on the members and none can go, the inequalities
contradict each other at this scale: ``n_e = sum_j r_j n_j`` is the proof, left in the working set's ``r``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import part
from cartctl.solvers.exact.inequalities import (
    OUT,
    TOUCHED,
    Inequalities,
    drop,
    look_again,
    most_violated,
    normal_of,
    right_side,
    take_in,
)
from cartctl.solvers.exact.working_set import (
    C0,
    C1,
    FIXED,
    FREE,
    KIND,
    LAM,
    NEARLY,
    NUM,
    SUM,
    SURELY,
    G,
    H,
    WorkingSet,
    Z,
    combine,
    largest_entry,
    noise,
    place,
)

SETTLED, STALLED = -1, -2  # else the code of the inequality that cannot be met at this scale

_EPS = 2.0**-52
DEPENDENT = 1e-11  # of a unit normal: what is left of it is round-off
_SURELY = 30.0  # times the round-off in a sum
SMALL = 1e-11  # of the largest coefficient of a combination
_CLEARLY = 1e-6  # of a unit normal: a guess that adds less is left out
_SUMMED = 1e-12  # of the terms of a sum: round-off
_TOUCHED = 1e-9  # of the size of u: and in no case more than this
_BLURRED = 1e-7  # of the size of u: and no more than this where rows that nearly depend on each other magnify it
_NO_LOSS = 1e-10  # of a scale: nothing
_PASSED_ON = 1e-2  # of an equation's coefficient: 1e-13 of it may be in those of inequalities
_LEAST = 1e-3  # coefficients below this are not what others are compared with


@part
def settle(w: WorkingSet, q: Inequalities, u: FloatArray, s: float, blur: float, most: int) -> int:
    """Make u the point of least norm on the members within all inequalities; SETTLED, STALLED or a code.

    blur: by how much s is open to round-off, where something pins it.
    """
    shed_negative(w, q)
    for _ in range(most):
        place(w, u)
        code = most_violated(q, u)
        if code < 0:
            return SETTLED
        outcome = _bring_in(w, q, code, u, s, blur, most)
        if outcome != SETTLED:
            return outcome
    return STALLED


@part
def shed_negative(w: WorkingSet, q: Inequalities) -> None:
    """Let go of free members until no multiplier is negative, so that the dual method may start."""
    while w.K[NUM, 0] > 0:
        combine(w, w.V[G], w.V[LAM])
        found = most_negative(w)
        if found < 0:
            return
        drop(q, w, found)


@part
def most_negative(w: WorkingSet) -> int:
    """The free member of the most negative multiplier, -1 where there is none."""
    worst, found = 0.0, -1
    for j in range(w.K[NUM, 0]):
        if w.K[KIND, j] == FREE and w.V[LAM, j] < worst:
            worst, found = w.V[LAM, j], j
    return found


@part
def load(w: WorkingSet, q: Inequalities, start: NDArray[np.int64], s: float) -> None:
    """Take in a guess (a count, then codes) of what is active, as far as it is independent; any guess is valid."""
    for k in range(1, min(start.shape[0], 1 + start[0] if start.shape[0] > 0 else 0)):
        code = start[k]
        if code < 0 or code >> 1 >= q.state.shape[0] or q.state[code >> 1] != OUT or w.K[NUM, 0] >= w.Q.shape[1]:
            continue
        if abs(right_side(q, code)) == np.inf:
            continue
        left = normal_of(q, code, w)
        if left > _CLEARLY:
            take_in(q, w, code, left, s)


@part
def independence(w: WorkingSet) -> float:
    """The norm above which what is left of the unit normal taken apart last is more than round-off."""
    return max(DEPENDENT, w.V[SURELY, 0] * noise(w))  # type: ignore[no-any-return]


@part
def largest_coefficient(w: WorkingSet) -> float:
    """The size that coefficients of inequalities in ``r`` are compared with: theirs, or the round-off of the others."""
    largest = _LEAST
    for j in range(w.K[NUM, 0]):
        share = abs(w.V[SUM, j])
        largest = max(largest, share if w.K[KIND, j] != FIXED else _PASSED_ON * share)
    return largest


@part
def _first_in_the_way(w: WorkingSet, floor: float) -> tuple[int, float]:
    """The free member whose multiplier vanishes first as the newcomer's grows (-1: none), and by how much it grows."""
    blocking, first = -1, np.inf
    for j in range(w.K[NUM, 0]):
        if w.K[KIND, j] == FREE and w.V[SUM, j] > floor:
            step = max(w.V[LAM, j], 0.0) / w.V[SUM, j]
            if step < first:
                blocking, first = j, step
    return blocking, first


@part
def _touches(w: WorkingSet, side: float, u: FloatArray, s: float, blur: float) -> bool:
    """Whether the newcomer, a combination of the members, contradicts them by no more than round-off in their sum."""
    missing, total, size = side, 0.0, max(abs(side), largest_entry(u))
    follows = 0.0  # how the combination of the members goes with s
    settled = True  # by levels above alone: it was met there, before their members were exchanged
    for j in range(w.K[NUM, 0]):
        missing -= w.V[SUM, j] * (w.V[C0, j] + s * w.V[C1, j])
        total += abs(w.V[SUM, j]) * max(abs(w.V[C0, j]), abs(s * w.V[C1, j]), size)
        follows += w.V[SUM, j] * w.V[C1, j]
        if (w.K[KIND, j] != FIXED or w.V[C1, j] != 0.0) and abs(w.V[SUM, j]) > DEPENDENT:
            settled = False
    round_off = _TOUCHED * size if settled else min(_SUMMED * total, _TOUCHED * size)
    magnified = max(blur * abs(follows), _SURELY * _EPS * total)
    if missing > round_off and missing <= -_NO_LOSS * follows:
        return False  # so little less of the scale makes room for it, and levels below are given a point that exists
    touches = missing <= max(round_off, min(magnified, _BLURRED * size))
    if touches and missing > _SUMMED * size:
        w.K[NEARLY, 0] = 1
    return touches


@part
def _bring_in(w: WorkingSet, q: Inequalities, code: int, u: FloatArray, s: float, blur: float, most: int) -> int:
    """Make the violated inequality a member, dropping those in its way."""
    side = right_side(q, code)
    n = w.Q.shape[1]
    combine(w, w.V[G], w.V[LAM])
    for _ in range(most):
        left = normal_of(q, code, w)
        combine(w, w.V[H], w.V[SUM])
        floor = SMALL * largest_coefficient(w)
        blocking, first = _first_in_the_way(w, floor)
        dependent = w.K[NUM, 0] >= n or left < independence(w)
        if dependent:
            if blocking < 0:
                if _touches(w, side, u, s, blur):
                    q.state[code >> 1] = TOUCHED
                    return SETTLED
                return code
        else:
            missing = side
            for i in range(w.K[NUM, 0]):  # n_e . u, the gap along what is left of the normal
                missing -= w.V[H, i] * w.V[G, i]
            x = 0.0
            for k in range(n):
                x += w.V[Z, k] * u[k]
            full = (missing - x) / (left * left)
            if full <= first:
                take_in(q, w, code, left, s)
                return SETTLED
            for k in range(n):
                u[k] += first * w.V[Z, k]
        for j in range(w.K[NUM, 0]):
            w.V[LAM, j] -= first * w.V[SUM, j]
        drop(q, w, blocking)
        look_again(q, w)
    return STALLED
