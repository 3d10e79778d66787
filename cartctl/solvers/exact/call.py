"""From a Problem to the engine's arrays, and from its answer to a Solution with a certificate.

The engine minimises ``||u - u0||``; a metric W = L L^T enters by y = L^T u. A diagonal one stretches the box; under a
full one the box becomes rows, and is restored to the last digit in the end.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cartctl.algebra.certificate import Certificate, LevelCertificate
from cartctl.algebra.metric import Whitening, weighed
from cartctl.algebra.problem import Problem
from cartctl.algebra.proofs import check_proofs
from cartctl.algebra.solution import Solution, Status
from cartctl.algebra.svd import scale
from cartctl.checks import FloatArray
from cartctl.solvers.exact.disguise import Given
from cartctl.solvers.exact.kinds import CONTRADICTORY, EXTREME, FITTED, INTERVAL, SCALED
from cartctl.solvers.exact.lexicographic import lexicographic

_KINDS = {"scale": SCALED, "least_squares": FITTED, "inequality": INTERVAL}
_CLAIMS = {SCALED: "scale", FITTED: "least squares", INTERVAL: "least squares"}

_EMPTY = np.zeros(0)
_NO_ROWS = np.zeros((0, 0))
_NO_GUESS = np.zeros(1, dtype=np.int64)


class Outcome(NamedTuple):
    """What the engine found."""

    u: FloatArray
    scales: FloatArray
    flags: int
    active: NDArray[np.int64]  # how many inequalities are members, then their codes


def answer(problem: Problem, fitted: bool, start: Solution | None) -> Outcome:
    """The exact answer; fitted: every equation by least squares, whatever its fit says. Raises FloatingPointError."""
    guess = _NO_GUESS if start is None or start.warm is None else start.warm
    if problem.metric is None:
        return _yielding(arrays_of(problem, fitted), problem, guess)
    white = Whitening(problem.metric)
    found = _yielding(whitened(arrays_of(problem, fitted), problem, white), problem, guess)
    return found._replace(u=problem.clip(white.back(found.u)))


def _yielding(arrays: Given, problem: Problem, guess: NDArray[np.int64]) -> Outcome:
    """The answer; where the box forbids the constraint rows, they are missed by as little as it allows."""
    found = _run(arrays, problem.n, guess, _NO_ROWS)
    if not found.flags & CONTRADICTORY:
        return found
    found = _run(_demoted(arrays, problem), problem.n, _NO_GUESS, _NO_ROWS)
    return found._replace(scales=found.scales[1:], flags=found.flags | CONTRADICTORY)


def _demoted(arrays: Given, problem: Problem) -> Given:
    """The constraint rows as a level of their own, above all others."""
    assert problem.constraints is not None
    return arrays._replace(
        sizes=np.append(problem.constraints[0].shape[0], arrays.sizes),
        fits=np.append(INTERVAL, arrays.fits),
        natural=np.append(0.0, arrays.natural),
    )


def _run(arrays: Given, n: int, guess: NDArray[np.int64], proofs: FloatArray) -> Outcome:
    u, scales = np.empty(n), np.empty(arrays.sizes.shape[0])
    active = np.empty(n + 2, dtype=np.int64)
    try:
        flags = lexicographic.compiled(*arrays, guess, u, scales, active, proofs)
        if flags & EXTREME:
            milder, shares = in_proportion(balanced(arrays))
            flags = lexicographic.compiled(*milder, guess, u, scales, active, proofs)
            scales *= shares
    except (ValueError, ArithmeticError) as error:  # a singular value decomposition met infinities
        raise FloatingPointError(str(error)) from None
    if flags & EXTREME:
        raise FloatingPointError("entries differ by too many orders of magnitude")
    return Outcome(u, scales, flags, active)


def balanced(arrays: Given) -> Given:
    """The same problem with every equation, and every row of C, divided by its largest entry."""
    A, b, d, natural = (np.array(x) for x in (arrays.A, arrays.b, arrays.d, arrays.natural))
    row = 0
    with np.errstate(over="ignore", under="ignore"):
        for k, (size, kind) in enumerate(zip(arrays.sizes, arrays.fits, strict=True)):
            if kind == INTERVAL:
                continue
            own = slice(row, row + size)
            largest = float(np.abs(A[own]).max(initial=0.0)) or 1.0
            A[own] /= largest
            b[own] /= largest
            d[own] = d[own] / largest if d.shape[0] else d[own]
            natural[k] /= largest
            row += size
        most = np.abs(arrays.C).max(axis=1, initial=0.0)
        most = np.where(most > 0.0, most, 1.0)
        C = arrays.C / most[:, None]
        return arrays._replace(
            A=A, b=b, d=d, natural=natural, C=C, c_lower=arrays.c_lower / most, c_upper=arrays.c_upper / most
        )


def in_proportion(arrays: Given) -> tuple[Given, FloatArray]:
    """Commands beyond 1e12 times what the box allows made milder, and the share of each level's that is left.

    Each level is slowed by far more than that, so that what it comes to is the same.
    """
    shares = np.ones(arrays.sizes.shape[0])
    reach = float(max(np.abs(arrays.lower).max(initial=0.0), np.abs(arrays.upper).max(initial=0.0)))
    if not 0.0 < reach < np.inf or not np.isfinite(arrays.b).all():
        return arrays, shares
    b, row = np.array(arrays.b), 0
    for k, (size, kind) in enumerate(zip(arrays.sizes, arrays.fits, strict=True)):
        if kind == INTERVAL:
            continue
        own = slice(row, row + size)
        row += size
        bearable = float(np.sqrt((arrays.A[own] ** 2).sum(axis=1)).max(initial=0.0)) * reach
        asked = float(np.abs(b[own]).max(initial=0.0))
        if kind == SCALED and asked > 1e9 * bearable > 0.0:
            shares[k] = 1e6 * (bearable / asked)
            b[own] *= shares[k]
    return arrays._replace(b=b), shares


def arrays_of(problem: Problem, fitted: bool) -> Given:
    """The engine's arguments, metric aside."""
    equations = problem.equations
    lower = _EMPTY if problem.lower is None else problem.lower
    upper = _EMPTY if problem.upper is None else problem.upper
    C, c_lower, c_upper = problem.constraints or (_NO_ROWS, _EMPTY, _EMPTY)
    u0 = _EMPTY if problem.reference is None else problem.reference
    if len(equations) == 1 and equations[0].fit != "inequality":
        e = equations[0]
        sizes, fits = _levels((e.A.shape[0],), (FITTED if fitted else _KINDS[e.fit],))
        natural = _sizes((e.size,))
        d = _EMPTY if e.drift is None else e.drift
        return Given(e.A, e.b, d, sizes, fits, natural, lower, upper, C, c_lower, c_upper, u0)
    A: list[FloatArray] = []
    b: list[FloatArray] = []
    drifts: list[FloatArray | None] = []
    counts: list[int] = []
    kinds: list[int] = []
    nature: list[float] = []
    soft = drifting = False
    for e in equations:  # one pass: this is in the way of every solve
        counts.append(e.A.shape[0])
        if e.fit == "inequality":
            soft = True
            kinds.append(INTERVAL)
            nature.append(0.0)
            continue
        kinds.append(FITTED if fitted else _KINDS[e.fit])
        nature.append(e.size)
        A.append(e.A)
        b.append(e.b)
        drifts.append(e.drift)
        drifting = drifting or e.drift is not None
    sizes, fits = _levels(tuple(counts), tuple(kinds))
    if soft:
        C, c_lower, c_upper = _with_soft_rows(problem, C, c_lower, c_upper)
    d = _EMPTY
    if drifting:
        d = np.concatenate([np.zeros(len(y)) if x is None else x for x, y in zip(drifts, b, strict=True)])
    rows, right = (np.concatenate(A), np.concatenate(b)) if A else (_NO_ROWS, _EMPTY)
    return Given(rows, right, d, sizes, fits, _sizes(tuple(nature)), lower, upper, C, c_lower, c_upper, u0)


def _with_soft_rows(
    problem: Problem, C: FloatArray, c_lower: FloatArray, c_upper: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The constraint rows, and behind them those of the inequalities among the equations."""
    every: tuple[Any, ...] = problem.equations
    soft = [e for e in every if e.fit == "inequality"]
    if C.shape[0] == 0:
        C = np.zeros((0, problem.n))
    return (
        np.concatenate([C, *(e.A for e in soft)]),
        np.concatenate([c_lower, *(e.lower for e in soft)]),
        np.concatenate([c_upper, *(e.upper for e in soft)]),
    )


@lru_cache(maxsize=256)
def _levels(sizes: tuple[int, ...], kinds: tuple[int, ...]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    return np.array(sizes, dtype=np.int64), np.array(kinds, dtype=np.int64)


@lru_cache(maxsize=1024)
def _sizes(natural: tuple[float, ...]) -> FloatArray:
    return np.array(natural)


def whitened(arrays: Given, problem: Problem, white: Whitening) -> Given:
    """The same problem in y = L^T u."""
    n = problem.n
    natural = np.array(
        [0.0 if e.fit == "inequality" else e.ratio * scale(white.matrix(e.A)) for e in problem.equations]
    )
    u0 = arrays.reference if arrays.reference.shape[0] == 0 else white.forward(arrays.reference)
    C = arrays.C if arrays.C.shape[0] == 0 else white.matrix(arrays.C)
    A = arrays.A if arrays.A.shape[0] == 0 else white.matrix(arrays.A)
    assert problem.metric is not None
    if problem.metric.ndim == 1:
        root = np.sqrt(problem.metric)
        low = arrays.lower * root if arrays.lower.shape[0] else _EMPTY
        high = arrays.upper * root if arrays.upper.shape[0] else _EMPTY
        return arrays._replace(A=A, natural=natural, lower=low, upper=high, C=C, reference=u0)
    low = np.full(n, -np.inf) if arrays.lower.shape[0] == 0 else arrays.lower
    high = np.full(n, np.inf) if arrays.upper.shape[0] == 0 else arrays.upper
    box = white.matrix(np.eye(n))
    return arrays._replace(
        A=A,
        natural=natural,
        lower=_EMPTY,
        upper=_EMPTY,
        C=box if C.shape[0] == 0 else np.concatenate([box, C]),
        c_lower=np.concatenate([low, arrays.c_lower]),
        c_upper=np.concatenate([high, arrays.c_upper]),
        reference=u0,
    )


def certificate(solution: Solution, fitted: bool) -> Certificate:
    """Solve once more, asking for multipliers, and check them against the solution itself."""
    problem = solution.problem
    given, scales = arrays_of(problem, fitted), solution.scales
    entries = np.abs(np.concatenate([given.A.ravel(), given.C.ravel()]))
    if entries.max(initial=1.0) > 1e100 or entries.min(initial=1.0, where=entries > 0.0) < 1e-100:
        given = balanced(given)
    names = [e.name for e in problem.equations]
    arrays = given if problem.metric is None else whitened(given, problem, Whitening(problem.metric))
    if solution.outcome is Status.INFEASIBLE:
        arrays = _demoted(arrays, problem)
        given, scales, names = _demoted(given, problem), np.append(1.0, scales), ["constraints", *names]
    p, M, r = len(names), given.A.shape[0], given.C.shape[0]
    u, u0, W = solution.u, problem.reference, problem.metric
    force = weighed(W, u if u0 is None else u - u0)
    sizes = np.abs(u) if u0 is None else np.abs(u) + np.abs(u0)
    pull, reach = float(weighed(None if W is None else np.abs(W), sizes).max()), float(sizes.max())
    arguments = (given.A, given.b, given.d, given.sizes, given.fits, given.natural, given.lower, given.upper)
    rows = (given.C, given.c_lower, given.c_upper)
    claims = ["skipped" if s != s else _CLAIMS[int(kind)] for s, kind in zip(scales, given.fits, strict=True)]

    def from_start(guess: NDArray[np.int64]) -> Certificate:
        """By the multipliers that are found from that guess."""
        proofs, residuals = _proofs(arrays, problem, np.zeros((p + 1, M + problem.n + r)), guess), np.zeros((p + 1, 3))
        check_proofs.compiled(*arguments, *rows, force, pull, reach, u, scales, proofs, residuals)
        levels = zip([*names, "reference"], [*claims, "nearest"], residuals.tolist(), proofs, strict=True)
        return Certificate(tuple(LevelCertificate(name, claim, x[0], x[1], x[2], z) for name, claim, x, z in levels))

    cold = from_start(_NO_GUESS)
    if cold.holds() or solution.warm is None or solution.warm[0] == 0:
        return cold
    own = from_start(solution.warm)  # any proof will do: those of the way the answer came, if others do not
    return own if own.worst < cold.worst else cold


def _proofs(arrays: Given, problem: Problem, proofs: FloatArray, guess: NDArray[np.int64]) -> FloatArray:
    """Multipliers of every level, (p + 1, M + n + r), for the problem's own rows and bounds."""
    n, M, W = problem.n, arrays.A.shape[0], problem.metric
    if W is not None and W.ndim == 2:
        longer = np.zeros((proofs.shape[0], proofs.shape[1] + n))  # the box is n rows
        _run(arrays, n, guess, longer)
        return np.delete(longer, np.s_[M : M + n], axis=1)
    _run(arrays, n, guess, proofs)
    if W is not None:
        proofs[:, M : M + n] *= np.sqrt(W)
    return proofs
