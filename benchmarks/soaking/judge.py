"""One problem solved and judged, inside a kernel: by the engine's own parts and by the check of its multipliers."""

from __future__ import annotations

import numpy as np

from cartctl.kernels import part
from cartctl.solvers.exact.disguise import Given
from cartctl.solvers.exact.kinds import CONTRADICTORY, FITTED, INTERVAL, SCALED, STUCK, UNPROVEN
from cartctl.solvers.exact.lexicographic import lexicographic, residuals_of

_solve = part(lexicographic.function)

# What is counted.
LEVELS_FULL, LEVELS_SCALED, LEVELS_SKIPPED, LEVELS_FITTED, LEVELS_INTERVAL = range(5)
CONTRADICTIONS, COARSE, GREY, TOLD, AT = range(5, 10)
# What is a failure.
FINE, NOT_A_NUMBER, OUTSIDE, NOT_A_SCALE, STUCK_AT, PRIMAL, DUAL, GAP = range(8)
WHAT = ("", "nan", "outside bounds", "no scale", "stuck", "primal", "dual", "gap")

TOLERANCE = 1e-6  # of a certificate's residuals
_BOUNDS = 1e-10  # relative
_NOTED = 1e-8  # residuals above this are counted


@part
def demoted(m, hard):
    """The problem with its hard rows as a level above all others."""
    p = m.sizes.shape[0]
    sizes, fits, natural = np.empty(p + 1, np.int64), np.empty(p + 1, np.int64), np.zeros(p + 1)
    sizes[0], fits[0] = hard, INTERVAL
    sizes[1:], fits[1:], natural[1:] = m.sizes, m.fits, m.natural
    return Given(m.A, m.b, m.d, sizes, fits, natural, m.lower, m.upper, m.C, m.c_lower, m.c_upper, m.reference)


@part
def solved(m, n, guess, proofs):
    """u, scales, flags."""
    u, scales, active = np.empty(n), np.empty(m.sizes.shape[0]), np.empty(n + 2, np.int64)
    flags = _solve(
        m.A, m.b, m.d, m.sizes, m.fits, m.natural, m.lower, m.upper, m.C, m.c_lower, m.c_upper, m.reference, guess,
        u, scales, active, proofs,
    )  # fmt: skip
    return u, scales, flags


@part
def judged(made, n, spoilt, worst, counts):
    """Solve, from a guess if there is one, and check by proofs of another solution or its own."""
    nobody, none = np.zeros(1, np.int64), np.empty((0, 0))
    m = made.arrays
    hard = m.C.shape[0]
    for k in range(m.sizes.shape[0]):
        hard -= m.sizes[k] if m.fits[k] == INTERVAL else 0
    proofs = np.zeros((m.sizes.shape[0] + 1, m.A.shape[0] + n + m.C.shape[0]))
    u, scales, flags = solved(m, n, nobody, proofs)
    if flags & CONTRADICTORY:
        counts[CONTRADICTIONS] += 1
        if hard == 0:
            return STUCK_AT, 1.0
        m = demoted(m, hard)
        proofs = np.zeros((m.sizes.shape[0] + 1, m.A.shape[0] + n + m.C.shape[0]))
        u, scales, flags = solved(m, n, nobody, proofs)
    if made.guess[0] > 0:
        u, scales, again = solved(m, n, made.guess, none)
        flags |= again
    if flags & CONTRADICTORY:
        return STUCK_AT, float(flags)
    if flags & STUCK:  # status FAILED, with nothing to follow
        counts[TOLD] += 1
        return FINE, 0.0
    if spoilt:
        u[0] += 1e-3 * (np.abs(u).max() + 1e-3)
    failure, size = _plausible(m, u, scales, counts)
    if failure != FINE:
        return failure, size
    if flags & UNPROVEN:
        counts[TOLD] += 1
        return FINE, 0.0
    failure, size = _proven(m, u, scales, proofs, worst, counts)
    if failure != FINE and made.guess[0] > 0:  # any proof will do
        proofs[:] = 0.0
        solved(m, n, made.guess, proofs)
        failure, size = _proven(m, u, scales, proofs, worst, counts)
    return failure, size


@part
def _plausible(m, u, scales, counts):
    """Numbers, inside the box, scales in [0, 1]."""
    largest = np.abs(u).max()
    for i in range(u.shape[0]):
        if not abs(u[i]) < np.inf:
            return NOT_A_NUMBER, 1.0
        if m.lower.shape[0] > 0:
            outside = max(m.lower[i] - u[i], u[i] - m.upper[i])
            if outside > _BOUNDS * largest:
                return OUTSIDE, outside
    for k in range(scales.shape[0]):
        s = scales[k]
        if s != s and m.fits[k] != SCALED:
            return NOT_A_NUMBER, 2.0
        if s < 0.0 or s > 1.0:
            return NOT_A_SCALE, s
        if m.fits[k] == SCALED:
            counts[LEVELS_SKIPPED if s != s else LEVELS_FULL if s == 1.0 else LEVELS_SCALED] += 1
        else:
            counts[LEVELS_FITTED if m.fits[k] == FITTED else LEVELS_INTERVAL] += 1
    return FINE, 0.0


@part
def _proven(m, u, scales, proofs, worst, counts):
    """What the multipliers leave open."""
    residuals = residuals_of(m, u, scales, proofs)
    failure, size = FINE, 0.0
    for k in range(residuals.shape[0]):
        for j in range(3):
            value = residuals[k, j]
            if not value <= TOLERANCE and (failure == FINE or value > size):
                failure, size = PRIMAL + j, value
    if failure == FINE:
        largest = 0.0
        for k in range(residuals.shape[0]):
            for j in range(3):
                worst[j] = max(worst[j], residuals[k, j])
                largest = max(largest, residuals[k, j])
        counts[COARSE] += 1 if largest > _NOTED else 0
    return failure, size
