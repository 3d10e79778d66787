"""The R of tall matrices, in blocks that fit into the cache: R of the stacked R's (Demmel et al. 2012, TSQR)."""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray

_BLOCK = 12  # rows of a block, times the columns


def tall_r(A: FloatArray) -> FloatArray:
    """R (min(m, n), n) with ``R^T R = A^T A``, of A (m, n), up to the signs of its rows; a few times faster than QR."""
    m, n = A.shape
    if not n:
        return np.zeros((0, 0))
    block = max(_BLOCK * n, 64)
    while m >= 3 * block:
        whole = m // block * block
        tops = np.asarray(np.linalg.qr(A[:whole].reshape(-1, block, n), mode="r")).reshape(-1, n)
        A = np.concatenate([tops, A[whole:]])
        m = len(A)
    return np.asarray(np.linalg.qr(A, mode="r"))
