"""Numerical filtering: damping only for the directions that need it, and a trace of it for all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cartctl import checks
from cartctl.algebra.inverses.base import NOISE, InversePolicy, damped_factors
from cartctl.checks import FloatArray


@dataclass(frozen=True, slots=True)
class NumericalFiltering(InversePolicy):
    """``phi_i = sigma_i / (sigma_i^2 + beta^2 + lambda_i^2)`` (Maciejewski & Klein 1988; Chiaverini 1997).

    ``lambda_i^2 = lambda_max^2 (1 - (sigma_i/eps)^2)`` where sigma_i < eps, else 0.

    damping: lambda_max > 0; threshold: eps > 0; beta >= 0, a small damping of all directions; all in the units of the
    singular values.
    """

    sources: ClassVar[tuple[str, ...]] = ("maciejewski1988", "chiaverini1997")
    damping: float = 0.04
    threshold: float = 0.04
    beta: float = 1e-4

    def __post_init__(self) -> None:
        object.__setattr__(self, "damping", checks.number("damping", self.damping, low=0.0, strict=True))
        object.__setattr__(self, "threshold", checks.number("threshold", self.threshold, low=0.0, strict=True))
        object.__setattr__(self, "beta", checks.number("beta", self.beta, low=0.0))

    def factors(self, s: FloatArray, scale: float) -> FloatArray:
        """phi(s); see the class."""
        return damped_factors(s, self._squared(s), scale)

    def rank(self, s: FloatArray, scale: float) -> int:
        """How many singular values outweigh their damping."""
        if s.shape[0] and s[-1] > max(self.threshold, self.beta, NOISE * scale):
            return s.shape[0]  # type: ignore[no-any-return]
        return int((s > np.maximum(np.sqrt(self._squared(s)), NOISE * scale)).sum())

    def _squared(self, s: FloatArray) -> FloatArray | float:
        if s.shape[0] and s[-1] >= self.threshold:
            return self.beta**2
        shortfall = np.maximum(0.0, 1.0 - (s / self.threshold) ** 2)
        return self.beta**2 + self.damping**2 * shortfall
