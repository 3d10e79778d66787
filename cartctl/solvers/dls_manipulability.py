"""Damped least squares with damping by manipulability: lambda^2 = lambda_max^2 (1 - w/w0)^2 where w < w0.

w = sqrt(det(A A^T)) is the product of the singular values (Nakamura & Hanafusa 1986). Away from singularities the
answer is the pseudo-inverse's; the null space is exact throughout.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cartctl.algebra.inverses import InversePolicy, ManipulabilityDamped
from cartctl.solvers.filtered import FilteredSolver


@dataclass(frozen=True)
class DLSManipulability(FilteredSolver):
    """Damped least squares whose damping grows as the manipulability falls below a threshold.

    damping: lambda_max > 0; threshold: w0 > 0, see :class:`cartctl.ManipulabilityDamped`.
    """

    name: ClassVar[str] = "dls-manipulability"
    sources: ClassVar[tuple[str, ...]] = ("nakamura1986",)
    damping: float = 0.04
    threshold: float = 0.03

    def __post_init__(self) -> None:
        self.filter()  # validates

    def filter(self) -> InversePolicy:
        """The policy that the parameters stand for."""
        return ManipulabilityDamped(self.damping, self.threshold)
