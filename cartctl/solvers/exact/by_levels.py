"""Level after level on one working set; a level that cannot be met leaves no trace."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import part
from cartctl.solvers.exact.descent import SETTLED, STALLED, load, settle
from cartctl.solvers.exact.fitted import fitted_level
from cartctl.solvers.exact.inequalities import EQUAL, OUT, SILENT, Inequalities, drop_all_free, normal_of
from cartctl.solvers.exact.kinds import CONTRADICTORY, DOUBT, FITTED, LOST_RANK, SCALED, STUCK
from cartctl.solvers.exact.proof import write_multipliers
from cartctl.solvers.exact.rows import Equations, Levels, fix_rows, task_size
from cartctl.solvers.exact.scaled import MET, SKIPPED, scaled_level
from cartctl.solvers.exact.working_set import (
    FIXED,
    FREE,
    KIND,
    LAM,
    NUM,
    WHO,
    G,
    WorkingSet,
    append,
    combine,
    copy_members,
    largest_entry,
    new_working_set,
)

_MISSED = 1e-9  # relative: a row of an interval level that is missed by less is met
_DRIFTED = 1e-9  # relative: a dependent row that is missed by more was not what it seemed


@part
def by_levels(
    w: WorkingSet,
    q: Inequalities,
    e: Equations,
    levels: Levels,
    members: int,
    start: NDArray[np.int64],
    u: FloatArray,
    scales: FloatArray,
    proofs: FloatArray,
    most: int,
) -> int:
    """Fill u, scales and proofs; flags. The first ``members`` rows may be in the set already.

    CONTRADICTORY, and nothing else, where hard rows and box exclude each other.
    """
    sizes, fits, begin, hard = levels.sizes, levels.fits, levels.begin, levels.hard
    n, p = u.shape[0], sizes.shape[0]
    saved, states = new_working_set(n, 0.0), np.empty(q.state.shape[0], np.int64)
    flags = 0
    for i in range(n + hard, q.state.shape[0]):
        q.state[i] = SILENT
    if p > 0 and fits[0] == SCALED and 0 < sizes[0] <= members:
        members = sizes[0]
        w.K[NUM, 0] = members
    else:
        members = 0
        w.K[NUM, 0] = 0
        _lock(w, q)
    k, settled, feasible = 0, False, hard == 0
    while k < p:
        first, last = begin[k], begin[k] + sizes[k]
        drop_all_free(q, w)
        if members > 0:
            saved.K[NUM, 0] = 0
        else:
            copy_members(w, saved)
        for i in range(q.state.shape[0]):
            states[i] = q.state[i]
        proof = proofs[min(k, proofs.shape[0] - 1)]
        scales[k] = 1.0
        if fits[k] == SCALED:
            size = task_size(e, first, last, levels.natural[k])
            outcome, scales[k], lost = scaled_level(w, q, e, first, last, size, members, start, proof, u, most)
            settled = outcome == MET
            if lost and settled and _astray(e, first, last, scales[k], u):
                flags |= DOUBT
        else:
            load(w, q, start, 1.0)
            settled = False
            code = settle(w, q, u, 1.0, 0.0, most)
            if code != SETTLED:
                outcome, lost = (SKIPPED if code >= 0 else STALLED), False
            elif fits[k] == FITTED:
                size = task_size(e, first, last, levels.natural[k])
                target = e.base[first:last]
                outcome, lost = fitted_level(w, q, e.A[first:last], target, target, size, e.norm, proof, u, most)
                if outcome == MET:
                    _press(w, q)
                    fix_rows(w, e, first, last, size, u)
            else:
                outcome, lost = _keep_interval(w, q, first, last, e.norm, proof, u, most), False
                if outcome == MET:
                    _press(w, q)
                    _settle_interval(w, q, first, last, u)
        members = 0
        if lost:
            flags |= LOST_RANK
        if outcome != MET:
            copy_members(saved, w)
            for i in range(q.state.shape[0]):
                q.state[i] = states[i]
            if not feasible and settle(w, q, u, 1.0, 0.0, most) != SETTLED:
                return CONTRADICTORY
            feasible = True
            scales[k] = math.nan
            # a scaled level that came to no end is skipped without a proof; a fitted one cannot be
            flags |= DOUBT if outcome >= 0 or fits[k] == SCALED else DOUBT | STUCK
        feasible = feasible or outcome == MET
        k += 1
    if not settled:
        drop_all_free(q, w)
        load(w, q, start, 1.0)
        code = settle(w, q, u, 1.0, 0.0, most)
        if code != SETTLED and not feasible:
            return CONTRADICTORY
        if code != SETTLED:
            flags |= DOUBT | STUCK
    if proofs.shape[1] > 0:
        combine(w, w.V[G], w.V[LAM])
        write_multipliers(w, q, e.norm, proofs[p])
    return flags


@part
def _lock(w: WorkingSet, q: Inequalities) -> None:
    """Joints with one value are equalities from the start."""
    for i in range(w.Q.shape[1]):
        if q.B[0, i] == q.B[1, i]:
            left = normal_of(q, 2 * i, w)
            append(w, 2 * i, left, q.B[0, i], 0.0, 0.0)
            q.state[i] = EQUAL


@part
def _astray(e: Equations, first: int, last: int, s: float, u: FloatArray) -> bool:
    """Whether a row that says nothing beside the others is missed: what they magnify hides what it says."""
    reach = largest_entry(u)
    for i in range(first, last):
        x, side = 0.0, e.base[i] + s * e.slope[i]
        for k in range(u.shape[0]):
            x += e.A[i, k] * u[k]
        if abs(x - side) > _DRIFTED * (e.norm[i] * reach + abs(e.base[i]) + abs(e.slope[i])):
            return True
    return False


@part
def _press(w: WorkingSet, q: Inequalities) -> None:
    """Inequalities that a fit presses against are equalities from then on; the others leave."""
    for j in range(w.K[NUM, 0]):
        if w.K[KIND, j] == FREE and w.V[LAM, j] > 0.0:
            w.K[KIND, j] = FIXED
            q.state[w.K[WHO, j] >> 1] = EQUAL
    drop_all_free(q, w)


@part
def _keep_interval(
    w: WorkingSet,
    q: Inequalities,
    first: int,
    last: int,
    norm: FloatArray,
    proof: FloatArray,
    u: FloatArray,
    most: int,
) -> int:
    """Rows first..last of C missed by as little as possible."""
    n, size = u.shape[0], 0.0
    for r in range(first, last):
        size += q.norm[n + r] * q.norm[n + r]
    low, high = q.B[0, n + first : n + last], q.B[1, n + first : n + last]
    outcome, _ = fitted_level(w, q, q.C[first:last], low, high, math.sqrt(size), norm, proof, u, most)
    return outcome


@part
def _settle_interval(w: WorkingSet, q: Inequalities, first: int, last: int, u: FloatArray) -> None:
    """Rows that are met go on as inequalities, rows that are missed as equalities."""
    n, reach = u.shape[0], max(q.norm[q.state.shape[0]], largest_entry(u))
    for r in range(first, last):
        x, miss = _miss(q, r, u)
        if abs(miss) <= _MISSED * q.norm[n + r] * reach:
            q.state[n + r] = OUT  # and as wide as it is met, or the levels below would find it contradictory
            q.B[0, n + r], q.B[1, n + r] = min(q.B[0, n + r], x), max(q.B[1, n + r], x)
            continue
        left = normal_of(q, 2 * (n + r), w)
        if w.K[NUM, 0] < n and left > _MISSED:
            append(w, 2 * (n + r), left, x / q.norm[n + r], 0.0, 0.0)
        q.state[n + r] = EQUAL


@part
def _miss(q: Inequalities, r: int, u: FloatArray) -> tuple[float, float]:
    """Row r at u, and how far it is from its interval."""
    n, x = u.shape[0], 0.0
    for k in range(n):
        x += q.C[r, k] * u[k]
    return x, min(x - q.B[0, n + r], 0.0) + max(x - q.B[1, n + r], 0.0)
