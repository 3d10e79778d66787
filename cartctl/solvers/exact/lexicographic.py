"""The engine: one compiled call, which checks its answer wherever it was in doubt.

Near singularities decisions come down to round-off: whether a row is dependent, a vertex degenerate, a contradiction
one. An answer that met such a decision, or that proves something impossible, is judged by its own multipliers
(:mod:`cartctl.algebra.proofs`); one that fails is sought again without the guess, then with joints, rows and the unit
of u in other orders, which take other ways to the same optimum, and last from what it ended with. The best by its
multipliers is kept, and what none of them proves is flagged UNPROVEN.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cartctl.algebra.proofs import check_proofs
from cartctl.checks import FloatArray
from cartctl.kernels import kernel, part
from cartctl.solvers.exact.by_priority import by_priority
from cartctl.solvers.exact.disguise import Given, disguised, order_of, unveiled
from cartctl.solvers.exact.kinds import CONTRADICTORY, DOUBT, EXTREME, STUCK, UNPROVEN

_check = part(check_proofs.function)

_PROVEN = 1e-7  # residuals of multipliers: an answer this good is taken
_WAYS = 12  # other orders that are tried
_ROUND_OFF = 30.0  # times what round-off leaves of a normal: nothing
_DUST = 5e3  # or 1e-12 of the entries, as in a URDF that writes pi with 12 digits


@kernel(
    "int(matrix, vector, vector, ints, ints, vector, vector, vector, matrix, vector, vector, vector, ints, "
    "out_vector, out_vector, out_ints, out_matrix)",
    fast=True,
)
def lexicographic(
    A: FloatArray,
    b: FloatArray,
    d: FloatArray,
    sizes: NDArray[np.int64],
    fits: NDArray[np.int64],
    natural: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    C: FloatArray,
    c_lower: FloatArray,
    c_upper: FloatArray,
    reference: FloatArray,
    start: NDArray[np.int64],
    out: FloatArray,
    scales: FloatArray,
    active: NDArray[np.int64],
    out_proofs: FloatArray,
) -> int:
    """:func:`by_priority`'s answer, or a better one if it was in doubt; the flags."""
    flags = by_priority(
        A, b, d, sizes, fits, natural, lower, upper, C, c_lower, c_upper, reference, start, out, scales, active,
        out_proofs, _ROUND_OFF,
    )  # fmt: skip
    if flags & DOUBT == 0 or flags & (EXTREME | CONTRADICTORY):
        return flags
    given = Given(A, b, d, sizes, fits, natural, lower, upper, C, c_lower, c_upper, reference)
    return _sure(given, start, flags, out, scales, active, out_proofs)


@part
def _sure(
    m: Given,
    start: NDArray[np.int64],
    flags: int,
    out: FloatArray,
    scales: FloatArray,
    active: NDArray[np.int64],
    out_proofs: FloatArray,
) -> int:
    """Judge the answer, and look for a better one until one is proven."""
    n, p = out.shape[0], scales.shape[0]
    nobody = np.zeros(1, np.int64)
    best = np.inf
    u, s, members = np.empty(n), np.empty(p), np.empty(n + 2, np.int64)
    for way in range(-2 if start.shape[0] > 0 and start[0] > 0 else -1, _WAYS + 1):
        order = order_of(m, n, max(way, -1) if way < _WAYS else -1)
        guess = start if way == -2 else active.copy() if way == _WAYS else nobody
        other = disguised(m, order)
        proofs = np.zeros((p + 1, m.A.shape[0] + n + m.C.shape[0]))
        found = by_priority(
            other.A, other.b, other.d, other.sizes, other.fits, other.natural, other.lower, other.upper, other.C,
            other.c_lower, other.c_upper, other.reference, guess, u, s, members, proofs,
            _DUST if way >= 0 and way % 3 == 0 else _ROUND_OFF,
        )  # fmt: skip
        if found & (EXTREME | CONTRADICTORY):
            continue
        unveiled(m, order, u, members, proofs)
        size = np.inf if found & STUCK else _judged(m, u, s, proofs.copy())
        if size < best:
            best, flags = size, found
            out[:] = u
            scales[:] = s
            active[: 1 + members[0]] = members[: 1 + members[0]]
            if out_proofs.shape[1] > 0:
                out_proofs[:, :] = proofs
        if best <= _PROVEN:
            break
    return flags if best <= _PROVEN else flags | UNPROVEN


@part
def _judged(m: Given, u: FloatArray, scales: FloatArray, proofs: FloatArray) -> float:
    """The worst residual of an answer's own multipliers."""
    residuals, worst = residuals_of(m, u, scales, proofs), 0.0
    for k in range(residuals.shape[0]):
        for j in range(3):
            if not residuals[k, j] <= worst:
                worst = residuals[k, j] if residuals[k, j] == residuals[k, j] else np.inf
    return worst


@part
def residuals_of(m: Given, u: FloatArray, scales: FloatArray, proofs: FloatArray) -> FloatArray:
    """Primal, dual and gap of every level (p + 1, 3) by multipliers, which are completed in place."""
    force, reach = u.copy(), np.abs(u).max()
    if m.reference.shape[0] > 0:
        force -= m.reference
        reach = (np.abs(u) + np.abs(m.reference)).max()
    residuals = np.zeros((proofs.shape[0], 3))
    _check(
        m.A, m.b, m.d, m.sizes, m.fits, m.natural, m.lower, m.upper, m.C, m.c_lower, m.c_upper, force, reach, reach,
        u, scales, proofs, residuals,
    )  # fmt: skip
    return residuals
