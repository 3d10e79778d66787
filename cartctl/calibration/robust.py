"""Losses that outliers do not carry away: weights for iterated least squares (Huber 1981; Holland & Welsch 1977).

With u = |e_i| / s, the whitened norm of measurement i over its scale,

    linear  w = 1        huber  w = min(1, k / u)        cauchy  w = 1 / (1 + (u/k)^2)
    tukey   w = (1 - (u/k)^2)^2 inside k, 0 outside

A measurement counts or does not count as a whole. k is in units of the norm that 95 % of sound measurements stay below.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import gammaincinv

from cartctl.checks import FloatArray

LOSSES = ("linear", "huber", "cauchy", "tukey")
_TUNING = {"huber": 0.7, "cauchy": 1.2, "tukey": 2.0}  # of the 95 % norm: a sound measurement keeps most of its weight
OUTSIDE = 0.9999  # share of sound measurements that are not called outliers


def weights(loss: str, norms: FloatArray, rows: int) -> FloatArray:
    """The w (N,) of whitened norms (N,), of measurements of ``rows`` numbers each."""
    if loss == "linear":
        return np.ones(len(norms))
    u = norms / (_TUNING[loss] * quantile(0.95, rows) ** 0.5)
    if loss == "huber":
        return np.asarray(1.0 / np.maximum(1.0, u))
    if loss == "cauchy":
        return np.asarray(1.0 / (1.0 + u * u))
    return np.asarray(np.where(u < 1.0, (1.0 - u * u) ** 2, 0.0))


def inflation(loss: str, norms: FloatArray, rows: int, rank: int) -> float:
    """By how much the covariance exceeds ``(H^T H)^-1``: ``K^2 mean(psi^2) / mean(psi')^2 / (1 - h)``, 1 if linear.

    psi = w(|e|) e has the mean derivative w + w' |e| / rows, w' by a central difference; h = rank / numbers, by which a
    fit shrinks its residuals; K = 1 + h var(psi') / mean(psi')^2 (Huber 1981, ch. 7.6).
    """
    if loss == "linear":
        return 1.0
    w = weights(loss, norms, rows)
    step = 1e-5 * np.maximum(norms, 1e-3)
    slope = (weights(loss, norms + step, rows) - weights(loss, norms - step, rows)) / (2.0 * step)
    bends = w + slope * norms / rows
    bend, h = float(bends.mean()), rank / (rows * len(norms))
    if bend < 1e-6 or h >= 1.0:
        return math.inf
    K = 1.0 + h * float(bends.var()) / (bend * bend)
    return max(1.0, K * K * float(np.mean((w * norms) ** 2)) / rows / (bend * bend * (1.0 - h)))


def robust_scale(squares: FloatArray, rows: int) -> float:
    """The sigma of rows with squared norms (N,), from their median: half of all measurements may be wild."""
    return math.sqrt(float(np.median(squares)) / quantile(0.5, rows))


def quantile(share: float, rows: int) -> float:
    """Of the chi-squared distribution with ``rows`` degrees of freedom."""
    return 2.0 * float(gammaincinv(0.5 * rows, share))
