"""Inverse policies: what an SVD-based method does with small singular values.

A policy maps an SVD ``A = U diag(s) V^T`` and a right-hand side b to ``y = V diag(phi(s)) U^T b``; it is a
choice of the filter factors phi. Null-space projectors never use it: they are truncated at round-off
(:mod:`cartctl.algebra.nullspace`), for a damped projector leaks into the task.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from cartctl import checks
from cartctl.algebra.svd import SVD, numerical_rank
from cartctl.checks import FloatArray


class InversePolicy(ABC):
    """A choice of filter factors phi(sigma), applied to one right-hand side."""

    @abstractmethod
    def factors(self, s: FloatArray, scale: float) -> FloatArray:
        """phi(s), (k,), for singular values s (k,) descending.

        scale: the Frobenius norm of the task's own matrix, before any projection; relative cutoffs refer to it,
        so that a projected matrix that is zero up to round-off is never inverted.
        """

    @abstractmethod
    def rank(self, s: FloatArray, scale: float) -> int:
        """How many of the singular values s the policy inverts in earnest."""

    def solve(self, svd: SVD, b: FloatArray, scale: float) -> FloatArray:
        """``V diag(phi) U^T b``, (n,)."""
        k = svd.s.shape[0]
        return svd.Vt[:k].T @ (self.factors(svd.s, scale) * (svd.U.T @ b))  # type: ignore[no-any-return]


@dataclass(frozen=True, slots=True)
class Truncated(InversePolicy):
    """``phi = 1/sigma`` where sigma > cutoff * scale, else 0 (Penrose 1955).

    cutoff: relative to the Frobenius norm of the task's own matrix, in [1e-13, 1).
    """

    cutoff: float = 1e-10

    def __post_init__(self) -> None:
        checks.number("cutoff", self.cutoff, low=1e-13, high=1.0)

    def factors(self, s: FloatArray, scale: float) -> FloatArray:
        """phi(s); see the class."""
        floor = self.cutoff * scale
        if s.shape[0] and s[-1] > floor:
            return 1.0 / s
        phi = s.copy()
        kept = s > floor
        phi[kept] = 1.0 / s[kept]
        phi[~kept] = 0.0
        return phi  # type: ignore[no-any-return]

    def rank(self, s: FloatArray, scale: float) -> int:
        """How many singular values lie above the cutoff."""
        return numerical_rank(s, self.cutoff * scale)


@dataclass(frozen=True, slots=True)
class Damped(InversePolicy):
    """``phi = sigma / (sigma^2 + lambda^2)`` (Nakamura & Hanafusa 1986; Wampler 1986).

    damping: lambda > 0, in the units of the task's singular values (m/rad for positions); ||u|| stays below
    ||b|| / (2 lambda).
    """

    damping: float = 1e-2

    def __post_init__(self) -> None:
        checks.number("damping", self.damping, low=0.0, strict=True)

    def factors(self, s: FloatArray, scale: float) -> FloatArray:
        """phi(s); see the class."""
        return s / (s * s + self.damping**2)

    def rank(self, s: FloatArray, scale: float) -> int:
        """How many singular values lie above lambda, where damping takes less than half."""
        return numerical_rank(s, self.damping)
