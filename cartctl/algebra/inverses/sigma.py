"""Damping that sets in where the smallest singular value falls below a threshold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cartctl import checks
from cartctl.algebra.inverses.base import NOISE, InversePolicy, damped_factors
from cartctl.algebra.svd import numerical_rank
from cartctl.checks import FloatArray


@dataclass(frozen=True, slots=True)
class SigmaDamped(InversePolicy):
    """``lambda^2 = lambda_max^2 (1 - (sigma_min/eps)^2)`` where sigma_min < eps, else 0 (Chiaverini et al. 1994).

    damping: lambda_max > 0; threshold: eps > 0; both in the units of the singular values.
    """

    sources: ClassVar[tuple[str, ...]] = ("chiaverini1994",)
    damping: float = 0.04
    threshold: float = 0.04

    def __post_init__(self) -> None:
        object.__setattr__(self, "damping", checks.number("damping", self.damping, low=0.0, strict=True))
        object.__setattr__(self, "threshold", checks.number("threshold", self.threshold, low=0.0, strict=True))

    def factors(self, s: FloatArray, scale: float) -> FloatArray:
        """phi(s); see the class."""
        return damped_factors(s, self._squared(s), scale)

    def rank(self, s: FloatArray, scale: float) -> int:
        """How many singular values outweigh the damping."""
        return numerical_rank(s, max(float(np.sqrt(self._squared(s))), NOISE * scale))

    def _squared(self, s: FloatArray) -> float:
        ratio = float(s[-1]) / self.threshold if s.shape[0] else 1.0
        return self.damping**2 * max(0.0, 1.0 - ratio * ratio)
