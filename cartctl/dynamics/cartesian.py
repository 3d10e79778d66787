"""The inertia of a robot as felt at its hand: Lambda = (J M^-1 J^T)^-1 (Khatib 1987), at singularities too.

With M = L L^T and ``J L^-T = U diag(sigma) V^T`` (SVD) ``J M^-1 J^T = U diag(sigma^2) U^T``: no inverse is formed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra.metric import Whitening, as_metric
from cartctl.algebra.svd import ROUND_OFF, numerical_rank, scale, svd
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError

_SMALL = 1e-150  # of singular values, whose squares and their inverses are numbers still


@dataclass(frozen=True, eq=False)
class CartesianInertia:
    """Lambda (m, m) and what it is made of; made by :func:`cartesian_inertia`.

    matrix: ``sum_i u_i u_i^T / sigma_i^2`` over the directions that are not lost: the inverse of the mobility, or its
    pseudo-inverse. mobility: ``J M^-1 J^T``, the acceleration a unit force makes at rest. axes: (m, m), unit columns
    u_i, orthogonal. inertias: (m,), ``1 / sigma_i^2``, smallest first; inf where the hand cannot be moved at all.
    consistent_inverse: ``J_bar = M^-1 J^T Lambda`` (n, m), the dynamically consistent inverse of J.
    """

    matrix: FloatArray
    mobility: FloatArray
    axes: FloatArray
    inertias: FloatArray
    consistent_inverse: FloatArray

    @property
    def rank(self) -> int:
        """How many directions the hand can be accelerated in."""
        return int(np.isfinite(self.inertias).sum())

    @property
    def lost(self) -> FloatArray:
        """(m, m - rank): the directions in which no joint acceleration moves the hand."""
        return self.axes[:, self.rank :]

    def along(self, direction: Any) -> float:
        """Effective mass ``1 / (d^T J M^-1 J^T d)`` for the unit vector d along ``direction`` (m,); inf if immovable.

        The force along d over the acceleration along d that it makes at rest (Khatib 1995), not ``d^T Lambda d``.
        Raises ShapeError, NonFiniteError, ParameterError for the zero direction.
        """
        d = checks.vector("direction", direction, self.matrix.shape[0])
        size = float(np.linalg.norm(d))
        if size == 0.0:
            raise ParameterError(f"direction is {d}; expected a vector that is not zero")
        part = (self.axes.T @ (d / size))[: self.rank]
        mobility = float(np.sum(part * part / self.inertias[: self.rank]))
        # what is left of a direction within the lost ones is the round-off of the axes
        floor = 64.0 * ROUND_OFF**2 / self.inertias[0] if self.rank else 0.0
        return 1.0 / mobility if mobility > floor else np.inf


def cartesian_inertia(J: Any, M: Any, cutoff: float | None = None) -> CartesianInertia:
    """``Lambda = (J M^-1 J^T)^-1`` for J (m, n) and the mass matrix M (n, n), kg, kg m and kg m^2 as the rows of J are.

    For a square regular J it is ``J^-T M J^-1``. cutoff: directions with sigma at most this, relative to the Frobenius
    norm of ``J L^-T``, count as lost (immovable); by default round-off. Just above it, Lambda is finite and huge: give
    a cutoff such as 1e-2 before turning accelerations into forces with it.

    Raises ShapeError, NonFiniteError, MetricError for an M that is not symmetric positive definite, ParameterError,
    where ``1/sigma^2`` overflows, too.
    """
    A = checks.matrix("J", J)
    m, n = A.shape
    whitening = Whitening(as_metric(M, n, "M"))
    B = np.asfortranarray(whitening.matrix(A))
    relative = ROUND_OFF * max(m, n) if cutoff is None else checks.number("cutoff", cutoff, low=0.0, high=1.0)
    axes, sigma = _left(B)
    rank = numerical_rank(sigma, relative * scale(B))
    kept, s = axes[:, :rank], sigma[:rank]
    inertias = np.full(m, np.inf)
    if rank and not (_SMALL < float(s[-1]) and float(s[0]) < 1.0 / _SMALL):
        raise ParameterError(f"J L^-T has singular values from {s[-1]:g} to {s[0]:g}; expected J and M in SI units")
    inertias[:rank] = 1.0 / s**2
    half = kept / s  # Lambda = half half^T
    bar = np.zeros((n, m))
    if rank:
        bar = np.column_stack([whitening.back(y) for y in (B.T @ half).T]) @ half.T
    return CartesianInertia(half @ half.T, B @ B.T, axes, inertias, bar)


def _left(B: FloatArray) -> tuple[FloatArray, FloatArray]:
    """All m left singular vectors of B (m, n), and its singular values."""
    transposed = svd(np.asfortranarray(B.T))  # its complete right basis is B's left one
    return np.ascontiguousarray(transposed.Vt.T), transposed.s
