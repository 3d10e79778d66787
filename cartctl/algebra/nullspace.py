"""Null spaces as orthonormal bases, ranks, and projectors made of them.

A basis Z with Z^T Z = I keeps ``A Z = 0`` to round-off however often it is narrowed; the recursion
``P_k = P_{k-1} - (A_k P_{k-1})# A_k P_{k-1}`` on matrices does not.
"""

from __future__ import annotations

import numpy as np

from cartctl.algebra.svd import SVD, numerical_rank, round_off, svd
from cartctl.checks import FloatArray


def null_part(decomposition: SVD, floor: float, u0: FloatArray) -> FloatArray:
    """``(I - A# A) u0``, (n,): what of u0 does not move the task."""
    rank = numerical_rank(decomposition.s, floor)
    n = decomposition.Vt.shape[1]
    if 2 * rank > n:  # the smaller of the two bases is the cheaper and the cleaner one
        Z = decomposition.Vt[rank:]
        return Z.T @ (Z @ u0)  # type: ignore[no-any-return]
    R = decomposition.Vt[:rank]
    part = u0 - R.T @ (R @ u0)
    return part - R.T @ (R @ part)  # type: ignore[no-any-return]


class NullSpace:
    """The common null space of the tasks met so far, narrowed task by task; all of R^n to begin with."""

    __slots__ = ("_basis", "dimension")

    def __init__(self, n: int) -> None:
        self.dimension = n
        self._basis: FloatArray | None = None  # (n, dimension), None for the identity

    def restrict(self, A: FloatArray) -> FloatArray:
        """``A Z``, (m, dimension): what a task can still do."""
        return A if self._basis is None else np.asfortranarray(A @ self._basis)

    def lift(self, restricted: SVD) -> SVD:
        """The SVD of ``A Z Z^T`` from that of ``A Z``: right singular vectors in joint space, (k, n) of them."""
        if self._basis is None:
            return restricted
        k = restricted.s.shape[0]
        return SVD(restricted.U, restricted.s, restricted.Vt[:k] @ self._basis.T)

    def project(self, u: FloatArray) -> FloatArray:
        """``Z Z^T u``, (n,)."""
        return u if self._basis is None else self._basis @ (self._basis.T @ u)

    def narrow(self, restricted: SVD, floor: float) -> None:
        """Take away the directions of a task, given the SVD of its restriction."""
        rest = restricted.Vt[numerical_rank(restricted.s, floor) :].T
        self._basis = rest if self._basis is None else self._basis @ rest
        self.dimension = rest.shape[1]


def basis(A: FloatArray) -> FloatArray:
    """An orthonormal basis (n, n - rank) of the null space of A (m, n)."""
    decomposition = svd(np.asfortranarray(A, dtype=np.float64))
    return decomposition.Vt[numerical_rank(decomposition.s, round_off(A)) :].T  # type: ignore[no-any-return]


def projector(A: FloatArray) -> FloatArray:
    """``I - A# A``, (n, n): the orthogonal projector onto the null space of A (m, n)."""
    Z = basis(A)
    return Z @ Z.T  # type: ignore[no-any-return]
