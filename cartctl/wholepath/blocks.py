"""Block-banded matrices over samples, and their reduction to the free directions as sparse matrices.

A form of second order in the displacements ``delta_k`` (nv,) of S samples couples neighbours and, through
accelerations, their neighbours: diagonals ``H_0 (S, n, n)``, ``H_1 (S-1, n, n)``, ``H_2 (S-2, n, n)``, ``H_j[k]``
between samples k and k + j.
With ``delta_k = Z_k y_k`` they become ``Z_k^T H_j Z_{k+j}``. Of a closed path the last sample's y is the first one's;
a fixed start has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cartctl.checks import FloatArray, IntArray


@dataclass(eq=False)
class Quadratic:
    """``g . delta + 1/2 delta^T H delta``: g (S, n), and the three block diagonals of H; zeros to be added to.

    H is positive semidefinite; H + X is nearer to the second derivative, along the free directions, and need not be.
    """

    g: FloatArray
    H0: FloatArray
    H1: FloatArray
    H2: FloatArray
    X0: FloatArray
    X1: FloatArray

    @classmethod
    def zeros(cls, samples: int, n: int) -> Quadratic:
        """Nothing yet."""
        shape = (n, n)
        return cls(
            np.zeros((samples, n)),
            np.zeros((samples, *shape)),
            np.zeros((samples - 1, *shape)),
            np.zeros((max(samples - 2, 0), *shape)),
            np.zeros((samples, *shape)),
            np.zeros((samples - 1, *shape)),
        )

    def add(self, other: Quadratic, factor: float) -> None:
        """``+ factor`` times another one."""
        self.g += factor * other.g
        self.H0 += factor * other.H0
        self.H1 += factor * other.H1
        self.H2 += factor * other.H2
        self.X0 += factor * other.X0
        self.X1 += factor * other.X1


class Layout:
    """Which unknown of the reduced problem stands for which free direction of which sample."""

    def __init__(self, samples: int, free: int, closed: bool, fixed: bool) -> None:
        first = 1 if fixed else 0
        count = samples - first - (1 if closed else 0)
        index = np.full((samples, free), -1, dtype=np.int64)
        index[first : first + count] = np.arange(count * free).reshape(count, free)
        if closed:
            index[-1] = index[0]
        self.index = index
        self.size = count * free
        self._patterns: dict[str, Pattern] = {}

    def expand(self, Z: FloatArray, y: FloatArray) -> FloatArray:
        """``delta_k = Z_k y_k`` (S, nv)."""
        padded = np.append(y, 0.0)
        delta: FloatArray = np.einsum("kij,kj->ki", Z, padded[self.index])
        return delta

    def gather(self, g: FloatArray) -> FloatArray:
        """The sum (size,) of per-sample vectors (S, r) over the samples that share an unknown."""
        kept = self.index >= 0
        total: FloatArray = np.bincount(self.index[kept], weights=g[kept], minlength=self.size).astype(np.float64)
        return total

    def gradient(self, quadratic: Quadratic, Z: FloatArray) -> FloatArray:
        """``Z^T g``, (size,)."""
        return self.gather(np.einsum("kij,ki->kj", Z, quadratic.g))

    def hessian(self, quadratic: Quadratic, Z: FloatArray) -> sp.csc_matrix:
        """``Z^T H Z``, both triangles."""
        return self._reduced("hessian", (quadratic.H0, quadratic.H1, quadratic.H2), Z)

    def correction(self, quadratic: Quadratic, Z: FloatArray) -> sp.csc_matrix:
        """``Z^T X Z``, both triangles."""
        return self._reduced("correction", (quadratic.X0, quadratic.X1), Z)

    def _reduced(self, name: str, diagonals: Sequence[FloatArray], Z: FloatArray) -> sp.csc_matrix:
        rows: list[IntArray] = []
        columns: list[IntArray] = []
        values: list[FloatArray] = []
        for j, H in enumerate(diagonals):
            if not len(H):
                continue
            block = Z[: len(Z) - j].transpose(0, 2, 1) @ H @ Z[j:]
            a = np.broadcast_to(self.index[: len(Z) - j, :, None], block.shape)
            b = np.broadcast_to(self.index[j:, None, :], block.shape)
            rows.append(a.ravel())
            columns.append(b.ravel())
            values.append(block.ravel())
            if j:
                rows.append(b.ravel())
                columns.append(a.ravel())
                values.append(block.ravel())
        return self._sparse(name, rows, columns, values, self.size)

    def diagonal(self, blocks: FloatArray) -> sp.csc_matrix:
        """Blocks (S, r, r) on the diagonal."""
        a = np.broadcast_to(self.index[:, :, None], blocks.shape).ravel()
        b = np.broadcast_to(self.index[:, None, :], blocks.shape).ravel()
        return self._sparse("diagonal", [a], [b], [blocks.ravel()], self.size)

    def rows(self, blocks: list[tuple[FloatArray, IntArray, IntArray]], count: int) -> sp.csc_matrix:
        """Rows of an inequality: blocks (K, rows, r) with their row numbers (K, rows) and samples (K,)."""
        rows: list[IntArray] = []
        columns: list[IntArray] = []
        values: list[FloatArray] = []
        for block, numbers, samples in blocks:
            rows.append(np.broadcast_to(numbers[:, :, None], block.shape).ravel())
            columns.append(np.broadcast_to(self.index[samples][:, None, :], block.shape).ravel())
            values.append(block.ravel())
        return self._sparse("rows", rows, columns, values, count)

    def _sparse(
        self, name: str, rows: list[IntArray], columns: list[IntArray], values: list[FloatArray], height: int
    ) -> sp.csc_matrix:
        if name not in self._patterns:
            self._patterns[name] = Pattern(np.concatenate(rows), np.concatenate(columns), (height, self.size))
        return self._patterns[name].matrix(np.concatenate(values))


class Pattern:
    """Where the entries of a sparse matrix lie, worked out once; entries that meet add up."""

    def __init__(self, rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> None:
        self._kept = (rows >= 0) & (columns >= 0)
        key = columns[self._kept] * shape[0] + rows[self._kept]
        known, self._where = np.unique(key, return_inverse=True)
        self._indices = known % shape[0]
        self._indptr = np.searchsorted(known // shape[0], np.arange(shape[1] + 1))
        self._shape = shape

    def matrix(self, values: FloatArray) -> sp.csc_matrix:
        """The matrix with these entries, its structure always the same, zeros included."""
        data = np.bincount(self._where, weights=values[self._kept], minlength=len(self._indices))
        return sp.csc_matrix((data, self._indices, self._indptr), shape=self._shape)
