"""Metrics W and the whitening that turns a W-weighted problem into an unweighted one.

With W = L L^T and y = L^T u, minimising u^T W u subject to A u = b is minimising y^T y subject to
(A L^-T) y = b. Every equation method is therefore written once, for W = I. No inverse is formed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import lapack

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import MetricError, ShapeError

_EPS = float(np.finfo(np.float64).eps)
_SYMMETRY = 1e-9  # relative to the largest entry: M(q) from a recursion is symmetric to 1e-15


def as_metric(value: Any, n: int, name: str = "metric") -> FloatArray:
    """``value`` as a read-only metric: (n,) positive, or (n, n) symmetric positive definite.

    Raises ShapeError, NonFiniteError, MetricError.
    """
    W = checks.floats(name, value)
    if W.ndim == 1:
        diagonal = checks.vector(name, W, n)
        if not (diagonal > 0.0).all():
            i = int(np.argmin(diagonal))
            raise MetricError(f"{name}[{i}] is {diagonal[i]:g}; expected positive weights")
        return diagonal
    if W.ndim != 2:
        raise ShapeError(f"{name} has shape {W.shape}; expected ({n},) or ({n}, {n})")
    full = checks.matrix(name, W, n, n)
    asymmetry = float(np.abs(full - full.T).max())
    if asymmetry > _SYMMETRY * float(np.abs(full).max()):
        raise MetricError(f"{name} differs from its transpose by {asymmetry:.3g}; expected a symmetric matrix")
    _factor(full, name)
    # round-off lifts the zero eigenvalue of a semidefinite matrix above zero half of the time; units shall not matter
    root = np.sqrt(np.diag(full))
    eigenvalues = np.linalg.eigvalsh(full / root / root[:, None])
    if eigenvalues[0] <= 8.0 * n * _EPS * eigenvalues[-1]:
        raise MetricError(
            f"{name} has the relative eigenvalue {eigenvalues[0]:.3g}; expected a positive definite matrix"
        )
    return full


def weighed(W: FloatArray | None, u: FloatArray) -> FloatArray:
    """``W u``, (n,), for a metric of any form; None is the identity."""
    return u if W is None else W * u if W.ndim == 1 else W @ u


def _factor(W: FloatArray, name: str) -> FloatArray:
    n = W.shape[0]
    L, info = lapack.dpotrf(W, lower=1, clean=1)
    # of a semidefinite matrix, round-off may leave a pivot above zero
    if info != 0 or (L.diagonal() ** 2 <= 8.0 * n * _EPS * W.diagonal()).any():
        smallest = float(np.linalg.eigvalsh(W)[0])
        raise MetricError(f"{name} has the eigenvalue {smallest:.3g}; expected a positive definite matrix")
    return L  # type: ignore[no-any-return]


class Whitening:
    """The change of variables y = L^T u for one metric W = L L^T (n,) or (n, n)."""

    __slots__ = ("_factor", "_root")

    def __init__(self, W: FloatArray) -> None:
        self._root = np.sqrt(W) if W.ndim == 1 else None
        self._factor = None if W.ndim == 1 else _factor(W, "metric")

    def matrix(self, A: FloatArray) -> FloatArray:
        """``A L^-T``, (m, n)."""
        if self._root is not None:
            return A / self._root
        if A.shape[0] == 0:
            return A
        X, _ = lapack.dtrtrs(self._factor, A.T, lower=1)  # L X = A^T
        return X.T  # type: ignore[no-any-return]

    def forward(self, u: FloatArray) -> FloatArray:
        """``y = L^T u``, (n,)."""
        if self._root is not None:
            return self._root * u
        assert self._factor is not None
        return self._factor.T @ u  # type: ignore[no-any-return]

    def back(self, y: FloatArray) -> FloatArray:
        """``u = L^-T y``, (n,)."""
        if self._root is not None:
            return y / self._root
        u, _ = lapack.dtrtrs(self._factor, y, lower=1, trans=1)
        return u  # type: ignore[no-any-return]
