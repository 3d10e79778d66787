"""Damped: every direction gives way a little, the small ones most."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cartctl import checks
from cartctl.algebra.inverses.base import NOISE, InversePolicy, damped_factors
from cartctl.algebra.svd import numerical_rank
from cartctl.checks import FloatArray


@dataclass(frozen=True, slots=True)
class Damped(InversePolicy):
    """``phi = sigma / (sigma^2 + lambda^2)`` (Nakamura & Hanafusa 1986; Wampler 1986).

    damping: lambda > 0, in the units of the task's singular values (m/rad for positions); ||u|| (in
    the norm of the metric) stays below ||b|| / (2 lambda).

    >>> import cartctl as cc
    >>> print(cc.solve(cc.Problem([([[1.0, 0.0], [0.0, 0.1]], [1.0, 1.0])]), cc.Pinv(cc.Damped(0.1))).u.round(4))
    [0.9901 5.    ]
    """

    sources: ClassVar[tuple[str, ...]] = ("nakamura1986", "wampler1986")
    damping: float = 1e-2

    def __post_init__(self) -> None:
        object.__setattr__(self, "damping", checks.number("damping", self.damping, low=0.0, strict=True))

    def factors(self, s: FloatArray, scale: float) -> FloatArray:
        """phi(s); see the class."""
        return damped_factors(s, self.damping**2, scale)

    def rank(self, s: FloatArray, scale: float) -> int:
        """How many singular values lie above lambda, where damping takes less than half."""
        return numerical_rank(s, max(self.damping, NOISE * scale))
