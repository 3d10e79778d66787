"""The saddle-point system of a programme whose active rows C are equations, dense or sparse.

    [ W   A^T    C^T ]
    [ A  -root I  0  ] x = rhs
    [ C   0       0  ]

Rows of C that depend on each other make it singular. Then -delta I takes the place of the last zero, and iterative
refinement takes its effect away again: the multipliers of dependent rows share the load, those of rows that exclude
each other grow, with the signs that say which one to let go.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import lapack

from cartctl.checks import FloatArray

_SPARSE_FROM = 200  # unknowns in the system
_DELTA = 1e-7
_REFINEMENTS = 6
_RESIDUAL = 1e-12  # relative to the answer


def solve_saddle(W: FloatArray, A: FloatArray, C: FloatArray, root: float, rhs: FloatArray) -> FloatArray | None:
    """The answer x; None where the numbers leave none. W: (k,) or (k, k), A: (m, k), C: (r, k)."""
    size, last = rhs.shape[0], C.shape[0]
    if size == 0:
        return rhs
    build, factor = (_dense, _dense_factor) if size <= _SPARSE_FROM else (_sparse, _sparse_factor)
    K = build(W, A, C, root)
    x = _refined(K, factor(K, 0), rhs, 0)
    if x is None or _missed(K, x, rhs) > _RESIDUAL:
        x = _refined(K, factor(K, last), rhs, _REFINEMENTS)
    return x


Solve = Callable[[FloatArray], FloatArray]


def _refined(K: Any, solve: Solve | None, rhs: FloatArray, times: int) -> FloatArray | None:
    if solve is None:
        return None
    x = solve(rhs)
    for _ in range(times):
        x = x + solve(rhs - K @ x)
    return x if np.isfinite(x).all() else None


def _missed(K: Any, x: FloatArray, rhs: FloatArray) -> float:
    return float(np.abs(K @ x - rhs).max() / (np.abs(x).max() + np.abs(rhs).max() + 1e-300))


def _dense(W: FloatArray, A: FloatArray, C: FloatArray, root: float) -> FloatArray:
    k, m = A.shape[1], A.shape[0]
    K = np.zeros((k + m + C.shape[0],) * 2)
    K[:k, :k] = np.diag(W) if W.ndim == 1 else W
    K[k : k + m, :k], K[:k, k : k + m] = A, A.T
    K[k + m :, :k], K[:k, k + m :] = C, C.T
    _add_to_diagonal(K, -root, k, k + m)
    return K


def _add_to_diagonal(K: FloatArray, value: float, first: int, last: int) -> None:
    at = np.arange(first, last)
    K[at, at] += value


def _dense_factor(K: FloatArray, regular: int) -> Solve | None:
    """A solve with K, its last diagonal entries made regular."""
    if regular:
        K = K.copy()
        _add_to_diagonal(K, -_DELTA, K.shape[0] - regular, K.shape[0])
    factors, pivots, info = lapack.dgetrf(K)
    if info != 0:
        return None
    return lambda rhs: lapack.dgetrs(factors, pivots, rhs)[0]


def _sparse(W: FloatArray, A: FloatArray, C: FloatArray, root: float) -> Any:
    from scipy import sparse

    metric = sparse.diags(W) if W.ndim == 1 else sparse.csc_matrix(W)
    middle = -root * sparse.eye(A.shape[0])
    A, C = sparse.csc_matrix(A), sparse.csc_matrix(C)
    return sparse.bmat([[metric, A.T, C.T], [A, middle, None], [C, None, None]], format="csc")


def _sparse_factor(K: Any, regular: int) -> Solve | None:
    from scipy import sparse
    from scipy.sparse.linalg import splu

    diagonal = np.zeros(K.shape[0])
    diagonal[K.shape[0] - regular :] = _DELTA
    try:
        return splu((K - sparse.diags(diagonal)).tocsc() if regular else K).solve  # type: ignore[no-any-return]
    except RuntimeError:  # exactly singular
        return None
