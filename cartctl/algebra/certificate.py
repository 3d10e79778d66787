"""Certificates: what a solver claims, level by level, and how far its own multipliers are from proving it."""

from __future__ import annotations

from typing import NamedTuple

from cartctl.checks import FloatArray


class LevelCertificate(NamedTuple):
    """One level of a claim.

    claim: ``"scale"`` (s cannot be larger), ``"skipped"`` (no s in [0, 1] will do), ``"least squares"`` (no other u
    misses less), ``"nearest"`` (no other u is nearer to the reference) or ``"weighted"`` (no other u costs less).
    primal: what u misses of the equations, bounds and rows it must keep, relative to their size. dual: what the
    multipliers leave of stationarity, relative to the terms in it, signs included. gap: between what u attains and what
    the multipliers prove: in s for a scale, else relative. multipliers: one for every equation row, joint and
    constraint row, > 0 at a lower bound and < 0 at an upper one.
    """

    name: str
    claim: str
    primal: float
    dual: float
    gap: float
    multipliers: FloatArray

    @property
    def worst(self) -> float:
        """The largest of the three."""
        return max(self.primal, self.dual, self.gap)


class Certificate(NamedTuple):
    """One LevelCertificate a level, the last one about the reference; checked without the solver that made them."""

    levels: tuple[LevelCertificate, ...]

    @property
    def worst(self) -> float:
        """The largest residual of all levels."""
        return max((level.worst for level in self.levels), default=0.0)

    def holds(self, tolerance: float = 1e-7) -> bool:
        """Whether every residual is at most ``tolerance``."""
        return self.worst <= tolerance
