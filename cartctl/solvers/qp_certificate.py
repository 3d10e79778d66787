"""The certificate of a weighted optimum: stationarity, signs and complementarity of its multipliers.

    sum_k w_k A_k^T (A_k u + d_k - b_k) + rho W (u - u0) = z_box + C^T z_rows,

z >= 0 at lower bounds, <= 0 at upper ones, 0 between: with these, no other u within the bounds costs less.
"""

from __future__ import annotations

import numpy as np

from cartctl.algebra.certificate import Certificate, LevelCertificate
from cartctl.algebra.metric import weighed
from cartctl.algebra.problem import Problem
from cartctl.checks import FloatArray


def weighted_certificate(
    problem: Problem, u: FloatArray, rho: float, upper_box: FloatArray, upper_rows: FloatArray
) -> Certificate:
    """Residuals of the statement for u (n,), from multipliers that are positive at *upper* bounds."""
    terms = [e.weight * (e.A.T @ e.miss(u, 1.0)) for e in problem.equations]
    step = u if problem.reference is None else u - problem.reference
    terms.append(rho * weighed(problem.metric, step))
    C, c_low, c_high = problem.constraints or (np.zeros((0, problem.n)), np.zeros(0), np.zeros(0))
    low = np.full(problem.n, -np.inf) if problem.lower is None else problem.lower
    high = np.full(problem.n, np.inf) if problem.upper is None else problem.upper
    z = np.concatenate([-upper_box, -upper_rows])
    terms += [-z[: problem.n], -(C.T @ z[problem.n :])]
    weights = [e.weight * np.linalg.norm(e.A) * np.linalg.norm(e.b) for e in problem.equations]
    size = max([float(np.abs(t).max(initial=0.0)) for t in terms] + [1e-6 * float(w) for w in weights])
    value, low, high = np.concatenate([u, C @ u]), np.concatenate([low, c_low]), np.concatenate([high, c_high])
    unit = np.maximum(1.0, np.abs(value))
    with np.errstate(invalid="ignore"):
        gaps = np.abs(z) * np.where(z > 0.0, np.abs(value - low), np.abs(high - value)) / unit
    gap = float(np.max(np.where(z == 0.0, 0.0, gaps), initial=0.0))
    primal = float(np.max(np.maximum(low - value, value - high) / unit, initial=0.0))
    dual = float(np.abs(np.sum(terms, axis=0)).max(initial=0.0))
    misses = np.concatenate([e.weight * e.miss(u, 1.0) for e in problem.equations])
    scale = size if size > 0.0 else 1.0
    level = LevelCertificate("", "weighted", primal, dual / scale, gap / scale, np.concatenate([-misses, z]))
    return Certificate((level,))
