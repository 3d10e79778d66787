"""Iterated, damped Gauss-Newton: the calibration step repeated at the updated parameters until it no longer matters.

    J = W^1/2 Sigma^-1 H D V_r,   b = W^1/2 Sigma^-1 e,   z <- z + V diag(s / (s^2 + lambda)) U^T b

J = U diag(s) V^T; lambda = 0 unless the cost |b|^2 would grow (Levenberg 1944; Marquardt 1963). Weights and unknown
standard deviations are those of the residuals so far, renewed with every step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from cartctl.calibration import noise, robust
from cartctl.calibration.identifiability import Identifiability
from cartctl.calibration.measurements import Measurements
from cartctl.calibration.motions import Product
from cartctl.calibration.tall import tall_r
from cartctl.checks import FloatArray, IntArray

STILL = 1e-5  # standard errors: a smaller step changes nothing that the data could tell
_STEADY = 1e-3  # relative change of a standard deviation between steps
_FIRST = 1e-4  # lambda of the first damped trial, times s_1^2
_TRIALS = 16
_TURN, _SLIDE = 1.0, 10.0  # rad and m, of one step


class Outcome(Enum):
    """How a calibration ended, in a sentence."""

    AGREES = "the data agree with the nominal parameters already; nothing was changed"
    CONVERGED = "the last step was far below the standard errors"
    STALLED = "no step lowers the residuals further; the nominal values may be far off (see aligned() for the base)"
    ITERATIONS = "not converged when the iterations ended; check units and nominal values, or raise iterations="
    NOTHING_SEEN = "the measurements see none of these parameters; measure something else, or elsewhere"

    def __str__(self) -> str:
        return self.value


class Problem(NamedTuple):
    """Everything that stays as it is. chosen: numbers of the parameters in the product. sigma: None if unknown."""

    product: Product
    q: FloatArray
    data: Measurements
    chosen: IntArray
    seen: Identifiability
    sigma: FloatArray | None
    loss: str

    def residuals(self, z: FloatArray) -> FloatArray:
        """Residuals e (N, rows) at z (r,)."""
        return self.data.residuals(self.product.at(self.q, self.spread(z)))

    def linear(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals e and H D V_r, (N, rows, r)."""
        poses, Phi = self.product.regressor(self.q, self.chosen, self.spread(z))
        e = self.data.residuals(poses)
        return e, self.data.derivative(poses, Phi, e) @ self.seen.basis

    def is_long(self, step: FloatArray) -> bool:
        """Whether a step (r,) goes farther than a derivative can tell."""
        change = np.abs(self.spread(step))
        angles = self.product.angles
        return bool(change[angles].max(initial=0.0) > _TURN or change[~angles].max(initial=0.0) > _SLIDE)

    def spread(self, z: FloatArray) -> FloatArray:
        """All parameters of the product, those not chosen at 0."""
        x = np.zeros(len(self.product.names))
        x[self.chosen] = self.seen.basis @ z
        return x


@dataclass(frozen=True, eq=False)
class Fit:
    """z: (r,). residuals: (N, rows). sigma: one a unit. weights: (N,). factor: (r, r) of the covariance, R^T R = J^T J.

    inflation: of the covariance by the loss. norms: (N,) whitened residual norms. freedom: behind sigma, inf if given.
    """

    z: FloatArray
    residuals: FloatArray
    sigma: FloatArray
    weights: FloatArray
    factor: FloatArray
    inflation: float
    norms: FloatArray
    freedom: float
    iterations: int
    outcome: Outcome


def solve(problem: Problem, iterations: int, agreement: float) -> Fit:
    """From z = 0 to the least (robust) squares."""
    data, r = problem.data, problem.seen.rank
    z = np.zeros(r)
    e, J = problem.linear(z)
    agrees = bool(np.abs(e).max() <= agreement)
    known = problem.sigma is not None
    sigma = noise.start(data, e) if problem.sigma is None else problem.sigma
    freedom = math.inf if known else float(e.size)
    outcome, damping, done = Outcome.ITERATIONS, 0.0, 0
    if agrees or not r:
        outcome = Outcome.AGREES if agrees else Outcome.NOTHING_SEEN
        if not known:
            sigma, freedom = noise.spread(data, e, np.full(e.shape, r / e.size), problem.loss)
        return _finished(problem, z, (e, J), sigma, freedom, 0, outcome)
    for done in range(iterations + 1):
        w = _weights(problem, e, sigma)
        A, b = _whitened(problem, J, e, sigma, w)
        factor = _Factor(A, b)
        previous = sigma
        if not known:
            sigma, freedom = noise.spread(data, e, factor.leverage(A).reshape(e.shape), problem.loss)
        steady = bool((np.abs(sigma - previous) <= _STEADY * previous).all())
        if factor.reach() <= STILL * r**0.5 and steady:
            outcome = Outcome.CONVERGED
            break
        if done == iterations:
            break
        taken = _descend(problem, factor, z, b, w, previous, damping)
        if taken is None:
            outcome = Outcome.CONVERGED if factor.reach() <= 100 * STILL * r**0.5 else Outcome.STALLED
            break
        z, damping = taken
        e, J = problem.linear(z)
    return _finished(problem, z, (e, J), sigma, freedom, done, outcome)


def _descend(
    problem: Problem, factor: _Factor, z: FloatArray, b: FloatArray, w: FloatArray, sigma: FloatArray, damping: float
) -> tuple[FloatArray, float] | None:
    """The first of ever more damped steps that lowers the cost, and the damping to begin with next time."""
    cost = float(b @ b)
    for _ in range(_TRIALS):
        step = factor.step(damping)
        if problem.is_long(step):
            damping = max(10.0 * damping, _FIRST)
            continue
        trial = z + step
        e = problem.residuals(trial)
        new = float((w * (_white(problem, e, sigma) ** 2).sum(axis=1)).sum())
        if np.isfinite(new) and new <= cost * (1.0 + 1e-12):
            return trial, 0.0 if damping <= _FIRST else 0.1 * damping
        damping = max(10.0 * damping, _FIRST)
    return None


class _Factor:
    """The singular value decomposition of a tall J by way of its R; steps in it cost nothing."""

    def __init__(self, J: FloatArray, b: FloatArray) -> None:
        r = J.shape[1]
        R = tall_r(np.column_stack([J, b]))
        U, self.s, self.Vt = np.linalg.svd(R[:r, :r], full_matrices=False)
        self.g = U.T @ R[:r, r]
        self.kept = self.s > 1e-12 * self.s[0]

    def step(self, damping: float) -> FloatArray:
        """``V diag(s / (s^2 + lambda)) g``, lambda = damping s_1^2."""
        s = np.where(self.kept, self.s, 1.0)
        gain = np.where(self.kept, s / (s * s + damping * self.s[0] ** 2), 0.0)
        return np.asarray(self.Vt.T @ (gain * self.g))

    def reach(self) -> float:
        """|J step| without damping, in standard errors."""
        return float(np.linalg.norm(self.g[self.kept]))

    def leverage(self, J: FloatArray) -> FloatArray:
        """Diagonal of ``J (J^T J)^-1 J^T``."""
        columns = self.Vt[self.kept].T / self.s[self.kept]
        return np.asarray(((J @ columns) ** 2).sum(axis=1))


def _finished(
    problem: Problem,
    z: FloatArray,
    linear: tuple[FloatArray, FloatArray],
    sigma: FloatArray,
    freedom: float,
    done: int,
    outcome: Outcome,
) -> Fit:
    e, J = linear
    norms = np.linalg.norm(_white(problem, e, sigma), axis=1)
    A, _ = _whitened(problem, J, e, sigma, np.ones(len(e)))
    R = tall_r(A)
    w = robust.weights(problem.loss, norms, problem.data.rows)
    inflation = robust.inflation(problem.loss, norms, problem.data.rows, len(z))
    return Fit(z, e, sigma, w, R, inflation, norms, freedom, done, outcome)


def _weights(problem: Problem, e: FloatArray, sigma: FloatArray) -> FloatArray:
    """Judged by what the residuals spread so far: the model may still be far worse than the noise."""
    if problem.loss == "linear":
        return np.ones(len(e))
    scale = np.maximum(sigma, noise.start(problem.data, e))
    return robust.weights(problem.loss, np.linalg.norm(_white(problem, e, scale), axis=1), problem.data.rows)


def _white(problem: Problem, e: FloatArray, sigma: FloatArray) -> FloatArray:
    return np.asarray(e / noise.per_row(problem.data, sigma))


def _whitened(
    problem: Problem, J: FloatArray, e: FloatArray, sigma: FloatArray, w: FloatArray
) -> tuple[FloatArray, FloatArray]:
    trust = (np.sqrt(w)[:, None] / noise.per_row(problem.data, sigma)).ravel()
    return J.reshape(len(trust), -1) * trust[:, None], e.ravel() * trust
