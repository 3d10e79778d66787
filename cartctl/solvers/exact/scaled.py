"""One scaled level: ``A u = base + s slope`` with s as large as possible in [0, 1], under all that is in force.

s starts at 1. Where the inequalities contradict the equations, Farkas' lemma gives unit normals that cancel,
``n_e + sum_j y_j n_j = 0`` with y_j >= 0 on inequalities, so that every s obeys
``c_e + sum_j y_j (c0_j + s c1_j) <= 0``. s is cut down to where this holds; the inequalities in it are then met with
equality whatever else happens (they are TIED), until a further cut replaces the proof. No cut possible: no s is
feasible.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import part
from cartctl.solvers.exact.descent import SMALL, STALLED, independence, largest_coefficient, load, settle
from cartctl.solvers.exact.inequalities import (
    EQUAL,
    IMPLIED,
    OUT,
    Inequalities,
    drop,
    forget_touched,
    normal_of,
    right_side,
    take_in,
)
from cartctl.solvers.exact.proof import NOBODY, write_proof
from cartctl.solvers.exact.rows import END, Equations, add_rows, rise
from cartctl.solvers.exact.working_set import (
    C0,
    C1,
    FIXED,
    FREE,
    KIND,
    NEARLY,
    NUM,
    SUM,
    TIED,
    WHO,
    H,
    WorkingSet,
    Y,
    Z,
    append,
    combine,
    largest_entry,
    place,
    refill,
    remove,
)

MET, SKIPPED = 0, 1  # how a level went; or STALLED

_NOTHING = 1e-13  # s below this is zero
_STEEP = 1e3  # a share this large in what limits s: it magnifies round-off
_LAST_BITS = 1e-15  # of a unit normal: round-off in its components
_WORSE = 10.0  # a normal with a share this large stands better outside the working set


@part
def scaled_level(
    w: WorkingSet,
    q: Inequalities,
    e: Equations,
    first: int,
    last: int,
    size: float,
    members: int,
    start: NDArray[np.int64],
    proof: FloatArray,
    u: FloatArray,
    most: int,
) -> tuple[int, float, bool]:
    """Rows first..last, the first ``members`` of which are in the set already: outcome, s, whether rank was lost."""
    possible, s, blur, implied, lost = add_rows(w, q, e, first + members, last, size, proof)
    if not possible:
        return SKIPPED, math.nan, lost
    pinned = implied != NOBODY
    load(w, q, start, s)
    code = STALLED
    for _ in range(most):
        code = settle(w, q, u, s, blur, most)
        if code < 0:
            break
        if pinned:
            _prove_contradiction(w, q, e, code, implied, 0.0, proof)
            return SKIPPED, math.nan, lost
        possible, s, implied = _cut(w, q, e, code, implied, s, proof)
        if not possible:
            return SKIPPED, math.nan, lost
        code = STALLED
    if code == STALLED:
        return STALLED, math.nan, lost
    if implied != NOBODY:
        if largest_entry(w.V[Y, : w.K[NUM, 0]]) > _STEEP:
            w.K[NEARLY, 0] += 1
        write_proof(w, q, e.norm, implied, proof)
        if rise(w, e, implied) < 0.0:  # a row that pins s proves both directions
            for i in range(proof.shape[0]):
                proof[i] = -proof[i]
    if s < _NOTHING and not pinned:
        s = 0.0
        refill(w, s)
    _freeze(w, q, implied, first, s)
    place(w, u)
    return MET, s, lost


@part
def _cut(
    w: WorkingSet, q: Inequalities, e: Equations, code: int, implied: int, s: float, proof: FloatArray
) -> tuple[bool, float, int]:
    """Lower s to where the inequality that contradicts the members can be met: possible, s, the implied code."""
    leaving, share = _tightest(w) if implied != NOBODY else (-1, 0.0)
    slope, size = 0.0, 0.0
    for j in range(w.K[NUM, 0]):
        term = (share * w.V[Y, j] - w.V[SUM, j]) * w.V[C1, j]
        slope += term
        size += abs(term)
    if slope <= 1e-13 * size:
        _prove_contradiction(w, q, e, code, implied, share, proof)
        return False, s, implied
    if leaving >= 0:  # the old proof is mixed in until its tightest member cancels; its implied one takes that place
        drop(q, w, leaving)
        left = normal_of(q, implied, w)
        take_in(q, w, implied, left, s)
        w.K[KIND, w.K[NUM, 0] - 1] = TIED
        normal_of(q, code, w)
        combine(w, w.V[H], w.V[SUM])  # afresh: updated from cut to cut, it would gather round-off
    elif implied != NOBODY:
        q.state[implied >> 1] = OUT
    _round_off(w)
    constant, slope = right_side(q, code), 0.0
    for j in range(w.K[NUM, 0]):
        constant -= w.V[SUM, j] * w.V[C0, j]
        slope -= w.V[SUM, j] * w.V[C1, j]
        w.V[Y, j] = -w.V[SUM, j]
        if w.K[KIND, j] != FIXED:
            w.K[KIND, j] = TIED if w.V[Y, j] > w.V[Z, j] else FREE
            if w.K[KIND, j] == FREE:
                w.V[Y, j] = 0.0
    if not slope > 0.0 or constant > END * slope:
        write_proof(w, q, e.norm, code, proof)
        return False, s, code
    s = max(min(s, -constant / slope), 0.0)
    q.state[code >> 1] = IMPLIED
    forget_touched(q)
    refill(w, s)
    return True, s, code


@part
def _round_off(w: WorkingSet) -> None:
    """Into z what is round-off in each share of ``sum``, which a member that is near others magnifies."""
    R, z, q = w.R, w.V[Z], w.K[NUM, 0]
    floor = SMALL * largest_coefficient(w)
    for j in range(q - 1, -1, -1):
        t = _LAST_BITS
        for k in range(j + 1, q):
            t += abs(R[k, j]) * z[k]
        z[j] = t / R[j, j]
    for j in range(q):
        z[j] = max(z[j], floor)


@part
def _tightest(w: WorkingSet) -> tuple[int, float]:
    """How much of the old proof keeps every share of the new one positive, and the member that then cancels (-1)."""
    _round_off(w)
    leaving, share = -1, 0.0
    for j in range(w.K[NUM, 0]):
        if w.K[KIND, j] == TIED and w.V[SUM, j] > w.V[Z, j] and w.V[SUM, j] > share * w.V[Y, j]:
            leaving, share = j, w.V[SUM, j] / w.V[Y, j]
    return leaving, share


@part
def _prove_contradiction(
    w: WorkingSet, q: Inequalities, e: Equations, code: int, implied: int, share: float, proof: FloatArray
) -> None:
    """The proof that no s will do: the new contradiction plus so much of the old proof that s cancels."""
    if proof.shape[0] == 0:
        return
    if implied != NOBODY:
        rising, falling = rise(w, e, implied), 0.0
        for j in range(w.K[NUM, 0]):
            falling += w.V[SUM, j] * w.V[C1, j]
        if rising != 0.0:
            share = falling / rising
        write_proof(w, q, e.norm, implied, proof)
        for i in range(proof.shape[0]):
            proof[i] *= share
    for j in range(w.K[NUM, 0]):
        w.V[Y, j] = -w.V[SUM, j]
    write_proof(w, q, e.norm, code, proof)


@part
def _freeze(w: WorkingSet, q: Inequalities, implied: int, first: int, s: float) -> None:
    """Make equalities of what the scale depends on; the implied one changes places with a worse conditioned member."""
    found = _ill_conditioned(w, first) if implied >= 0 else -1
    if implied >= 0:
        q.state[implied >> 1] = EQUAL
    for j in range(w.K[NUM, 0]):
        if w.K[KIND, j] == TIED:
            w.K[KIND, j] = FIXED
            q.state[w.K[WHO, j] >> 1] = EQUAL
    if found >= 0:
        remove(w, found)
        left = normal_of(q, implied, w)
        if left > independence(w):
            append(w, implied, left, right_side(q, implied), 0.0, s)
    for j in range(w.K[NUM, 0]):
        w.V[C0, j] += s * w.V[C1, j]
        w.V[C1, j] = 0.0
        w.V[Y, j] = 0.0
    refill(w, 0.0)


@part
def _ill_conditioned(w: WorkingSet, first: int) -> int:
    """The member of this level with a share so large that the implied one stands better in its place, or -1."""
    worst, found = _WORSE, -1
    for j in range(w.K[NUM, 0]):
        own = w.K[KIND, j] == TIED or w.K[WHO, j] < -first
        if own and abs(w.V[Y, j]) > worst:
            worst, found = abs(w.V[Y, j]), j
    return found
