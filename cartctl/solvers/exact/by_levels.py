"""Level after level on one working set; a level that cannot be met leaves no trace."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import part
from cartctl.solvers.exact.descent import SETTLED, load, settle
from cartctl.solvers.exact.fitted import fitted_level, misses
from cartctl.solvers.exact.inequalities import EQUAL, OUT, SILENT, Inequalities, drop_all_free, normal_of
from cartctl.solvers.exact.kinds import FITTED, INTERVAL, LOST_RANK, RELAXED, SCALED, STUCK
from cartctl.solvers.exact.proof import write_multipliers
from cartctl.solvers.exact.rows import Equations, fix_rows, task_size
from cartctl.solvers.exact.scaled import MET, scaled_level
from cartctl.solvers.exact.working_set import (
    FIXED,
    FREE,
    WorkingSet,
    append,
    combine,
    copy_members,
    new_working_set,
)

_MISSED = 1e-9  # relative: a row of an interval level that is missed by less is met
_SLACK = 1e-11  # relative: what a relaxed row is given beyond what it needs


@part
def by_levels(
    w: WorkingSet,
    q: Inequalities,
    e: Equations,
    sizes: NDArray[np.int64],
    fits: NDArray[np.int64],
    natural: FloatArray,
    members: int,
    start: NDArray[np.int64],
    u: FloatArray,
    scales: FloatArray,
    proofs: FloatArray,
    most: int,
) -> int:
    """Fill u, scales and proofs; flags. The first ``members`` rows may be in the set already."""
    n, p = u.shape[0], sizes.shape[0]
    saved, states = new_working_set(n), np.empty(q.state.shape[0], np.int64)
    nothing = np.empty(0)
    flags = 0
    hard = q.norm.shape[0]
    for k in range(p):
        if fits[k] == INTERVAL:
            hard -= sizes[k]
    for i in range(n + hard, q.state.shape[0]):
        q.state[i] = SILENT
    if p > 0 and fits[0] == SCALED and 0 < sizes[0] <= members:
        members = sizes[0]
        w.num[0] = members
    else:
        members = 0
        w.num[0] = 0
        _lock(w, q)
    row, soft, k = 0, hard, 0
    settled, feasible = False, hard == 0
    while k < p:
        drop_all_free(q, w)
        if members > 0:
            saved.num[0] = 0
        else:
            copy_members(w, saved)
        for i in range(q.state.shape[0]):
            states[i] = q.state[i]
        proof = proofs[k] if proofs.shape[0] > 0 else nothing
        scales[k] = 1.0
        if fits[k] == SCALED:
            size = task_size(e, row, row + sizes[k], natural[k])
            outcome, scales[k], lost = scaled_level(
                w, q, e, row, row + sizes[k], size, members, start, proof, u, most
            )
            settled = outcome == MET
        else:
            load(w, q, start, 1.0)
            settled = False
            code = settle(w, q, u, 1.0, most)
            if code != SETTLED:
                outcome, lost = code, False
            elif fits[k] == FITTED:
                size = task_size(e, row, row + sizes[k], natural[k])
                outcome, lost = fitted_level(
                    w,
                    q,
                    e.A[row : row + sizes[k]],
                    e.base[row : row + sizes[k]],
                    e.base[row : row + sizes[k]],
                    size,
                    e.norm,
                    proof,
                    u,
                    most,
                )
                if outcome == MET:
                    _press(w, q)
                    fix_rows(w, e, row, row + sizes[k], size, u)
            else:
                outcome, lost = _keep_interval(w, q, soft, soft + sizes[k], e.norm, proof, u, most)
                if outcome == MET:
                    _press(w, q)
                    _settle_interval(w, q, soft, soft + sizes[k], u, hard)
        members = 0
        if lost:
            flags |= LOST_RANK
        if outcome != MET:
            copy_members(saved, w)
            for i in range(q.state.shape[0]):
                q.state[i] = states[i]
            if not feasible:  # the rows may contradict the box: then they yield, and this level has another try
                feasible = True
                if settle(w, q, u, 1.0, most) != SETTLED:
                    drop_all_free(q, w)
                    flags |= RELAXED
                    _relax(w, q, hard, e.norm, u, most)
                    if proof.shape[0] > 0:
                        proof[:] = 0.0
                    continue
            scales[k] = math.nan
            if outcome < 0:
                flags |= STUCK
        feasible = feasible or outcome == MET
        if fits[k] == INTERVAL:
            soft += sizes[k]
        else:
            row += sizes[k]
        k += 1
    if not settled:
        drop_all_free(q, w)
        load(w, q, start, 1.0)
        code = settle(w, q, u, 1.0, most)
        if code != SETTLED and not feasible:
            drop_all_free(q, w)
            flags |= RELAXED
            _relax(w, q, hard, e.norm, u, most)
            code = settle(w, q, u, 1.0, most)
        if code != SETTLED:
            flags |= STUCK
    if proofs.shape[0] > 0:
        combine(w, w.g, w.lam)
        write_multipliers(w, q, e.norm, proofs[p])
    return flags


@part
def _lock(w: WorkingSet, q: Inequalities) -> None:
    """Joints with one value are equalities from the start."""
    for i in range(q.lower.shape[0]):
        if q.lower[i] == q.upper[i]:
            left = normal_of(q, 2 * i, w)
            append(w, 2 * i, FIXED, left, q.lower[i], 0.0, 0.0)
            q.state[i] = EQUAL


@part
def _press(w: WorkingSet, q: Inequalities) -> None:
    """Inequalities that a fit presses against are equalities from then on; the others leave."""
    for j in range(w.num[0]):
        if w.kind[j] == FREE and w.lam[j] > 0.0:
            w.kind[j] = FIXED
            q.state[w.who[j] >> 1] = EQUAL
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
) -> tuple[int, bool]:
    """Rows first..last of C missed by as little as possible."""
    size = 0.0
    for r in range(first, last):
        size += q.norm[r] * q.norm[r]
    outcome, _ = fitted_level(
        w, q, q.C[first:last], q.c_lower[first:last], q.c_upper[first:last], math.sqrt(size), norm, proof, u, most
    )
    return outcome, False


@part
def _settle_interval(w: WorkingSet, q: Inequalities, first: int, last: int, u: FloatArray, hard: int) -> None:
    """Rows that are met go on as inequalities, rows that are missed as equalities."""
    n = u.shape[0]
    for r in range(first, last):
        x, miss = _miss(q, r, u)
        if abs(miss) <= _MISSED * max(abs(x), q.norm[r] * q.unit[0]):
            q.state[n + r] = OUT
            continue
        left = normal_of(q, 2 * (n + r), w)
        if w.num[0] < n and left > _MISSED:
            append(w, 2 * (n + r), FIXED, left, x / q.norm[r], 0.0, 0.0)
        q.state[n + r] = EQUAL


@part
def _miss(q: Inequalities, r: int, u: FloatArray) -> tuple[float, float]:
    """Row r at u, and how far it is from its interval."""
    x = 0.0
    for k in range(u.shape[0]):
        x += q.C[r, k] * u[k]
    return x, min(x - q.c_lower[r], 0.0) + max(x - q.c_upper[r], 0.0)


@part
def _relax(w: WorkingSet, q: Inequalities, hard: int, norm: FloatArray, u: FloatArray, most: int) -> None:
    """Widen the hard rows to the least-squares miss that the box allows."""
    n = u.shape[0]
    for r in range(hard):
        q.state[n + r] = SILENT
    settle(w, q, u, 1.0, most)
    _keep_interval(w, q, 0, hard, norm, np.empty(0), u, most)
    drop_all_free(q, w)
    for r in range(hard):
        x, _ = _miss(q, r, u)
        slack = _SLACK * max(abs(x), q.norm[r] * q.unit[0], 1e-3 * q.norm[r])
        q.c_lower[r] = min(q.c_lower[r], x - slack)
        q.c_upper[r] = max(q.c_upper[r], x + slack)
        q.state[n + r] = OUT
