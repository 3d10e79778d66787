"""Damping that sets in where the manipulability falls below a threshold."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from cartctl import checks
from cartctl.algebra.inverses.base import NOISE, InversePolicy, damped_factors
from cartctl.algebra.svd import numerical_rank
from cartctl.checks import FloatArray


@dataclass(frozen=True, slots=True)
class ManipulabilityDamped(InversePolicy):
    """``lambda^2 = lambda_max^2 (1 - w/w0)^2`` where w < w0, else 0; ``w = prod sigma_i`` (Nakamura & Hanafusa 1986).

    damping: lambda_max > 0, in the units of the singular values. threshold: w0 > 0, in the units of the manipulability
    w = sqrt(det(A A^T)), which depend on the number of rows.
    """

    sources: ClassVar[tuple[str, ...]] = ("nakamura1986",)
    damping: float = 0.04
    threshold: float = 0.03

    def __post_init__(self) -> None:
        object.__setattr__(self, "damping", checks.number("damping", self.damping, low=0.0, strict=True))
        object.__setattr__(self, "threshold", checks.number("threshold", self.threshold, low=0.0, strict=True))

    def factors(self, s: FloatArray, scale: float) -> FloatArray:
        """phi(s); see the class."""
        return damped_factors(s, self._damping(s) ** 2, scale)

    def rank(self, s: FloatArray, scale: float) -> int:
        """How many singular values outweigh the damping."""
        return numerical_rank(s, max(self._damping(s), NOISE * scale))

    def _damping(self, s: FloatArray) -> float:
        return self.damping * max(0.0, 1.0 - math.prod(s.tolist()) / self.threshold)  # type: ignore[no-any-return]
