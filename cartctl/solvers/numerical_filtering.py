"""Numerical filtering: phi_i = sigma_i / (sigma_i^2 + beta^2 + lambda_i^2), lambda_i only where sigma_i < eps.

lambda_i^2 = lambda_max^2 (1 - (sigma_i/eps)^2) (Maciejewski & Klein 1988; Chiaverini 1997): the directions that are
well conditioned keep their accuracy; the null space is exact throughout.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cartctl.algebra.inverses import InversePolicy, NumericalFiltering
from cartctl.solvers.filtered import FilteredSolver


@dataclass(frozen=True)
class NumericalFilteringSolver(FilteredSolver):
    """Damping for the singular directions alone, and a trace of it for all.

    damping: lambda_max > 0; threshold: eps > 0; beta >= 0; all in the units of the singular values.
    """

    name: ClassVar[str] = "numerical-filtering"
    sources: ClassVar[tuple[str, ...]] = ("maciejewski1988", "chiaverini1997")
    damping: float = 0.04
    threshold: float = 0.04
    beta: float = 1e-4

    def __post_init__(self) -> None:
        self.filter()  # validates

    def filter(self) -> InversePolicy:
        """The policy that the parameters stand for."""
        return NumericalFiltering(self.damping, self.threshold, self.beta)
