"""Selectively damped least squares: u = clamp(sum_i clamp(v_i (u_i^T (b - d)) / sigma_i, gamma_i), limit).

Each singular direction is clamped by how far it would move the joints (Buss & Kim 2005): directions that the command
does not ask for cost nothing; the null space is exact throughout.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cartctl.algebra.inverses import InversePolicy, SelectivelyDamped
from cartctl.solvers.filtered import FilteredSolver


@dataclass(frozen=True)
class SDLS(FilteredSolver):
    """Each singular direction clamped by how far it would move the joints.

    limit: gamma_max > 0, the largest entry of the task's part of u, in its units.
    """

    name: ClassVar[str] = "sdls"
    sources: ClassVar[tuple[str, ...]] = ("buss2005",)
    limit: float = 3.141592653589793

    def __post_init__(self) -> None:
        self.filter()  # validates

    def filter(self) -> InversePolicy:
        """The policy that the parameters stand for."""
        return SelectivelyDamped(self.limit)
