"""The singular value decomposition, straight from LAPACK.

``np.linalg.svd`` costs 9 us on a 6 x 7 matrix and ``np.linalg.pinv`` 17; ``dgesdd`` itself takes 6.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import blas, lapack

from cartctl import checks
from cartctl.checks import FloatArray

_nrm2 = blas.dnrm2

# Rank and null-space decisions: singular values below this many units of round-off, relative to the scale of the
# task's own matrix, are noise of forming and projecting that matrix.
ROUND_OFF = 8.0 * float(np.finfo(np.float64).eps)


class SVD(NamedTuple):
    """``A = U diag(s) Vt[:k]``, k = min(m, n); ``Vt`` is (n, n), so its last rows span the null space."""

    U: FloatArray  # (m, k)
    s: FloatArray  # (k,), descending
    Vt: FloatArray  # (n, n)


def svd(A: FloatArray) -> SVD:
    """The SVD of A (m, n) with the complete right basis; m = 0 and n = 0 are fine."""
    m, n = A.shape
    if m == 0 or n == 0:
        return SVD(np.zeros((m, 0)), np.zeros(0), np.eye(n))
    U, s, Vt, info = lapack.dgesdd(A, compute_uv=1, full_matrices=1)
    if info != 0:  # the divide-and-conquer iteration may stall where plain QR converges
        U, s, Vt, info = lapack.dgesvd(A, compute_uv=1, full_matrices=1)
        if info != 0:
            raise FloatingPointError(f"LAPACK dgesvd did not converge (info {info})")
    return SVD(U[:, : s.shape[0]], s, Vt)


def singular_values(A: FloatArray) -> FloatArray:
    """The min(m, n) singular values of A, descending."""
    if 0 in A.shape:
        return np.zeros(0)
    _, s, _, info = lapack.dgesdd(A, compute_uv=0)
    return s if info == 0 else svd(A).s


def round_off(A: FloatArray) -> float:
    """The size below which singular values of A, or of a projection of A, are round-off."""
    return ROUND_OFF * max(A.shape) * scale(A)  # type: ignore[no-any-return]


def floor(A: FloatArray, tolerance: float | None) -> float:
    """The size up to which a singular value of A counts as zero: tolerance times its Frobenius norm, or round-off."""
    if tolerance is None:
        return round_off(A)
    return checks.number("tolerance", tolerance, low=0.0) * scale(A)


def scale(A: FloatArray) -> float:
    """The Frobenius norm of A: the scale its cutoffs are relative to, the same before and after projection."""
    return norm(A.ravel(order="K"))


def norm(x: FloatArray) -> float:
    """The Euclidean norm of a vector, by BLAS: it neither over- nor underflows where the squares do."""
    return float(_nrm2(x)) if x.shape[0] else 0.0


def numerical_rank(s: FloatArray, floor: float) -> int:
    """How many of the descending singular values s lie above ``floor``."""
    k = s.shape[0]
    if k == 0 or s[-1] > floor:
        return k  # type: ignore[no-any-return]
    return int((s > floor).sum())
