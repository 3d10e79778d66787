"""Equation rows: taking them into the working set, and what a dependent row says about the scale."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import part
from cartctl.solvers.exact.inequalities import Inequalities
from cartctl.solvers.exact.kinds import INTERVAL
from cartctl.solvers.exact.proof import NOBODY, credit, write_proof
from cartctl.solvers.exact.working_set import (
    C0,
    C1,
    NUM,
    SUM,
    WHO,
    G,
    H,
    WorkingSet,
    Y,
    Z,
    append,
    append_at,
    combine,
    length,
    noise,
    orthogonalise,
    refill,
)

END = 1e-9  # s this far outside [0, 1] is round-off
_DEPENDENT = 2e-8  # of the task's own size: what is left of a row is noise
_ROUND_OFF = 1e-12  # of s, or of the size of u
_BLUR = 2e-15  # of the largest term of a row that pins s: its round-off
_BLURRED = 1e-6  # s is never less sure than this
_SAME = 1e-8  # relative: sides that differ by less agree
_GRAIN = 10.0  # times round-off: what is left of a sum may be due to it
_NEGLECTED = 3.0  # times what is neglected of a row: or by less than this


class Equations(NamedTuple):
    """Rows ``A u = base + s slope``, the norm of each, and the size each task has by nature."""

    A: FloatArray  # (M, n)
    norm: FloatArray  # (M,)
    base: FloatArray  # (M,)
    slope: FloatArray  # (M,)


class Levels(NamedTuple):
    """What each level is, and its first row: of the equations, or of C for an interval level."""

    sizes: NDArray[np.int64]  # (p,)
    fits: NDArray[np.int64]  # (p,)
    natural: FloatArray  # (p,) the norm a task has by nature
    begin: NDArray[np.int64]  # (p,)
    hard: int  # how many rows of C outrank every level; those of interval levels follow


@part
def level_table(sizes: NDArray[np.int64], fits: NDArray[np.int64], natural: FloatArray, rows: int) -> Levels:
    """Where the levels' rows are; rows: how many C has."""
    begin = np.empty(sizes.shape[0], np.int64)
    hard = rows
    for k in range(sizes.shape[0]):
        if fits[k] == INTERVAL:
            hard -= sizes[k]
    row, soft = 0, hard
    for k in range(sizes.shape[0]):
        begin[k] = soft if fits[k] == INTERVAL else row
        if fits[k] == INTERVAL:
            soft += sizes[k]
        else:
            row += sizes[k]
    return Levels(sizes, fits, natural, begin, hard)


@part
def task_size(e: Equations, first: int, last: int, natural: float) -> float:
    """The norm of a task's rows, or what it is by nature if that is more."""
    t = 0.0
    for i in range(first, last):
        t += e.norm[i] * e.norm[i]
    return max(math.sqrt(t), natural)


@part
def take_apart(w: WorkingSet, e: Equations, i: int, size: float) -> float:
    """Make z the part of row i's unit normal orthogonal to the members, h its components; the norm of z.

    0 where the row depends on the members, up to the noise in a task of norm ``size`` (z is what is neglected), or is
    nothing but noise.
    """
    norm, z = e.norm[i], w.V[Z]
    if norm <= _DEPENDENT * size:
        for k in range(w.Q.shape[1]):
            z[k] = 0.0
        for j in range(w.K[NUM, 0]):
            w.V[H, j] = 0.0
        return 0.0
    for k in range(w.Q.shape[1]):
        z[k] = e.A[i, k] / norm
    left = orthogonalise(w, 1.0)
    return left if left * norm > _DEPENDENT * size else 0.0


@part
def fix_rows(w: WorkingSet, e: Equations, first: int, last: int, size: float, u: FloatArray) -> None:
    """Make equalities of what rows first..last are at u; those that depend on the members say nothing new."""
    for i in range(first, last):
        if w.K[NUM, 0] >= u.shape[0]:
            return
        left = take_apart(w, e, i, size)
        if left > 0.0:
            append_at(w, -1 - i, left, u)


@part
def add_rows(
    w: WorkingSet, q: Inequalities, e: Equations, first: int, last: int, size: float, proof: FloatArray
) -> tuple[bool, float, float, int, bool]:
    """Add rows first..last of one task of norm ``size``: possible, s, its blur, the row that pins s, rank lost.

    The row is NOBODY where none pins s. The blur is what round-off in that row may have changed s by.

    A row that depends on the members, ``n_i = sum_j r_j n_j``, reads ``s bt = at``: nothing where both are zero, no s
    where only bt is; else s is pinned.
    """
    s, blur, pin, lost = 1.0, 0.0, NOBODY, False
    largest = 0.0
    for i in range(first, last):
        largest = max(largest, abs(e.slope[i]))
    for i in range(first, last):
        left, norm = take_apart(w, e, i, size), e.norm[i]
        if left > 0.0 and w.K[NUM, 0] < w.Q.shape[1]:
            append(w, -1 - i, left, e.base[i] / norm, e.slope[i] / norm, s)
            continue
        neglected, part_of = length(w.V[Z], w.Q.shape[1]), 1.0
        combine(w, w.V[H], w.V[SUM])
        if norm <= _DEPENDENT * size:
            part_of = norm / size if size > 0.0 else 0.0
            norm = size if size > 0.0 else 1.0
            e.norm[i] = norm  # a row of zeros is as large as its task
        lost = True
        same, grain = max(_SAME, _NEGLECTED * part_of * neglected), _GRAIN * (_BLUR + noise(w))
        at, bt = -e.base[i] / norm, e.slope[i] / norm
        own_at, own_bt = abs(at), max(abs(bt), largest / norm)
        at_size, bt_size = own_at, own_bt  # with what nearly dependent members magnify, which is no surer than they are
        for j in range(w.K[NUM, 0]):
            at += w.V[SUM, j] * w.V[C0, j]
            bt -= w.V[SUM, j] * w.V[C1, j]
            own_at = max(own_at, part_of * abs(w.V[G, j]))
            at_size = max(at_size, own_at, abs(w.V[SUM, j] * w.V[C0, j]))
            bt_size = max(bt_size, abs(w.V[SUM, j] * w.V[C1, j]))
        no_bt = max(same * own_bt, min(grain, same) * bt_size)
        no_at = max(same * max(own_at, own_bt), min(grain, same) * max(at_size, bt_size))
        if abs(bt) <= no_bt:
            if abs(at) <= max(no_at, _ROUND_OFF * q.norm[q.state.shape[0]]):
                continue
            _prove_row(w, q, e, i, pin, at, bt, proof)
            return False, math.nan, 0.0, pin, lost
        pinned = at / bt
        unsure = min((_BLUR + noise(w) + part_of * neglected) * max(at_size, bt_size) / abs(bt), _BLURRED)
        if pinned < 0.0 and abs(at) <= no_at:
            pinned = 0.0
        elif pinned > 1.0 and abs(at - bt) <= no_at:
            pinned = 1.0
        outside = max(-pinned, pinned - 1.0) > END + unsure
        if outside or (pin != NOBODY and abs(pinned - s) > same + unsure + blur):
            _prove_row(w, q, e, i, pin, at, bt, proof)
            return False, math.nan, 0.0, pin, lost
        if pin == NOBODY or unsure < blur:  # the surest row pins s
            pin, s, blur = -1 - i, max(0.0, pinned) if pinned < 1.0 - _ROUND_OFF else 1.0, unsure
            for j in range(w.K[NUM, 0]):
                w.V[Y, j] = -w.V[SUM, j]
            refill(w, s)
    return True, s, blur, pin, lost


@part
def rise(w: WorkingSet, e: Equations, implied: int) -> float:
    """How the proof's bound rises with s: the slopes of its members and of the implied one."""
    total = 0.0 if implied >= 0 else e.slope[-1 - implied] / e.norm[-1 - implied]
    for j in range(w.K[NUM, 0]):
        total += w.V[Y, j] * w.V[C1, j]
    return total


@part
def _prove_row(
    w: WorkingSet, q: Inequalities, e: Equations, i: int, pin: int, at: float, bt: float, proof: FloatArray
) -> None:
    """The combination of members and row i that cancels, which reads ``s bt - at > 0`` for every s in question."""
    if proof.shape[0] == 0:
        return
    share = 0.0
    if pin != NOBODY:  # another row has pinned s: eliminate it
        share = -bt / rise(w, e, pin)
        write_proof(w, q, e.norm, pin, proof)
        at -= share * (e.base[-1 - pin] / e.norm[-1 - pin])
        for j in range(w.K[NUM, 0]):
            at -= share * w.V[Y, j] * w.V[C0, j]
        bt = 0.0
    sign = 1.0 if 0.5 * bt - at > 0.0 else -1.0
    for k in range(proof.shape[0]):
        proof[k] *= sign * share
    for j in range(w.K[NUM, 0]):
        credit(q, e.norm, w.K[WHO, j], -sign * w.V[SUM, j], proof)
    credit(q, e.norm, -1 - i, sign, proof)
