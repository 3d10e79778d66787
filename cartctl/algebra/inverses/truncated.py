"""Truncated: directions below a cutoff are left out, the others inverted exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from cartctl import checks
from cartctl.algebra.inverses.base import InversePolicy
from cartctl.algebra.svd import numerical_rank
from cartctl.checks import FloatArray


@dataclass(frozen=True, slots=True)
class Truncated(InversePolicy):
    """``phi = 1/sigma`` where sigma > cutoff * scale, else 0 (Penrose 1955).

    cutoff: relative to the Frobenius norm of the task's own matrix, in [1e-13, 1).

    >>> import cartctl as cc
    >>> nearly_singular = cc.Problem([([[1.0, 0.0], [0.0, 1e-12]], [1.0, 1.0])])
    >>> print(cc.solve(nearly_singular, cc.Pinv(cc.Truncated(1e-10))).u)
    [1. 0.]
    """

    sources: ClassVar[tuple[str, ...]] = ("penrose1955",)
    damps: ClassVar[bool] = False
    cutoff: float = 1e-10

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "cutoff", checks.number("cutoff", self.cutoff, low=1e-13, high=math.nextafter(1.0, 0.0))
        )

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
