"""Null-space projectors, checked by what they have to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra.metric import as_metric
from cartctl.algebra.svd import numerical_rank, round_off, scale, singular_values
from cartctl.analysis.spectrum import spectrum
from cartctl.checks import FloatArray

LEAK = 1e-12  # what the null spaces of cartctl promise


@dataclass(frozen=True)
class ProjectorCheck:
    """What P (n, n) does as a projector; made by :func:`check_projector`.

    idempotency: ``||P P - P|| / max(||P||, ||P||^2)``. asymmetry: ``||(W P)^T - W P|| / ||W P||``. leak: ``||A P|| /
    (||A|| ||P||)``, None without A. rank: of P. nullity: n - rank A, None without A. tolerance: what passes.
    """

    idempotency: float
    asymmetry: float
    leak: float | None
    rank: int
    nullity: int | None
    tolerance: float

    def __bool__(self) -> bool:
        """It passed."""
        return self.passed

    @property
    def idempotent(self) -> bool:
        """``P P = P``: a projector at all."""
        return self.idempotency <= self.tolerance

    @property
    def symmetric(self) -> bool:
        """``(W P)^T = W P``: an orthogonal one, in the metric W."""
        return self.asymmetry <= self.tolerance

    @property
    def annihilates(self) -> bool:
        """``A P = 0``: nothing that P lets through moves the task; true without A."""
        return self.leak is None or self.leak <= self.tolerance

    @property
    def complete(self) -> bool:
        """``rank P = nullity A``: P lets through all that does not move the task; true without A."""
        return self.nullity is None or self.rank == self.nullity

    @property
    def passed(self) -> bool:
        """All four."""
        return self.idempotent and self.symmetric and self.annihilates and self.complete


def check_projector(P: Any, A: Any = None, metric: Any = None, tolerance: float = LEAK) -> ProjectorCheck:
    """Check ``P = I - A#_W A`` by its properties: idempotent, W-symmetric, ``A P = 0``, rank P = nullity A.

    P: (n, n). A: (m, n), the task, or None. metric: W, (n,) or (n, n); identity. tolerance: the largest relative
    residual that passes. Raises ShapeError, NonFiniteError, MetricError, ParameterError.
    """
    limit = checks.number("tolerance", tolerance, low=0.0)
    P = checks.matrix("P", P)
    n = P.shape[0]
    P = checks.matrix("P", P, n, n)
    size = scale(P)
    idempotency = _ratio(P @ P - P, max(size, size * size))
    WP = _weighed(P, metric)
    leak = kernel = None
    if A is not None:
        task = checks.matrix("A", A, columns=n)
        leak, kernel = _ratio(task @ P, scale(task) * size), spectrum(task).nullity
    rank = numerical_rank(singular_values(P), 0.5 if idempotency <= limit else round_off(P))
    return ProjectorCheck(idempotency, _ratio(WP.T - WP, scale(WP)), leak, rank, kernel, limit)


def _weighed(P: FloatArray, metric: Any) -> FloatArray:
    if metric is None:
        return P
    W = as_metric(metric, P.shape[0])
    return W[:, None] * P if W.ndim == 1 else W @ P


def _ratio(difference: FloatArray, size: float) -> float:
    return float(np.linalg.norm(difference)) / size if size > 0.0 else 0.0
