"""Cholesky's factorisation of a matrix that couples neighbouring samples, and of one whose ends meet.

Where the path is closed the last samples are neighbours of the first. Folded, in the order 0, N-1, 1, N-2, ..., such a
matrix is banded again, with twice the width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

from cartctl.checks import FloatArray


@dataclass(frozen=True, eq=False)
class Factor:
    """``P = L L^T`` in a banded order."""

    L: FloatArray
    order: NDArray[np.int64] | None

    @classmethod
    def of(cls, P: sp.csc_matrix) -> Factor | None:
        """The factorisation; None where P is not positive definite."""
        n = P.shape[0]
        if not n:
            return cls(np.zeros((1, 0)), None)
        entries = P.tocoo()
        rows, columns = entries.row.astype(np.int64), entries.col.astype(np.int64)
        order = None
        width = int(np.abs(rows - columns).max(initial=0))
        if width > n // 2 and n > 8:
            order = _folded(n)
            place = np.empty(n, dtype=np.int64)
            place[order] = np.arange(n)
            rows, columns = place[rows], place[columns]
            width = int(np.abs(rows - columns).max())
        lower = rows >= columns
        band = np.zeros((width + 1, n))
        np.add.at(band, (rows[lower] - columns[lower], columns[lower]), entries.data[lower])
        try:
            L = cholesky_banded(band, lower=True, overwrite_ab=True, check_finite=False)
        except LinAlgError:
            return None
        return cls(L, order) if np.isfinite(L).all() else None

    def solve(self, b: FloatArray) -> FloatArray:
        """``P^-1 b``."""
        if not len(b):
            return np.zeros(0)
        if self.order is None:
            return np.asarray(cho_solve_banded((self.L, True), b, check_finite=False))
        x = np.empty_like(b)
        x[self.order] = cho_solve_banded((self.L, True), b[self.order], check_finite=False)
        return x


def _folded(n: int) -> NDArray[np.int64]:
    """0, n-1, 1, n-2, ..."""
    order = np.empty(n, dtype=np.int64)
    order[0::2] = np.arange((n + 1) // 2)
    order[1::2] = np.arange(n - 1, (n + 1) // 2 - 1, -1)
    return order
