"""Damped least squares with damping by the smallest singular value: lambda^2 = lambda_max^2 (1 - (sigma_min/eps)^2).

Damping sets in where sigma_min < eps (Chiaverini, Siciliano & Egeland 1994). Away from singularities the answer is the
pseudo-inverse's; the null space is exact throughout.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cartctl.algebra.inverses import InversePolicy, SigmaDamped
from cartctl.solvers.filtered import FilteredSolver


@dataclass(frozen=True)
class DLSSigma(FilteredSolver):
    """Damped least squares whose damping grows as the smallest singular value falls below a threshold.

    damping: lambda_max > 0; threshold: eps > 0, both in the units of the singular values.
    """

    name: ClassVar[str] = "dls-sigma"
    sources: ClassVar[tuple[str, ...]] = ("chiaverini1994",)
    damping: float = 0.04
    threshold: float = 0.04

    def __post_init__(self) -> None:
        self.filter()  # validates

    def filter(self) -> InversePolicy:
        """The policy that the parameters stand for."""
        return SigmaDamped(self.damping, self.threshold)
