"""Hierarchical least squares: each level misses by as little as the levels above allow, inequalities included.

    level k:  min ||A_k u + d_k - b_k||^2,  or  min ||dist(A_k u, [lower_k, upper_k])||^2,
    over the optima of the levels above, under lower <= u <= upper and c_lower <= C u <= c_upper,
    then min 1/2 (u - u0)^T W (u - u0)

(Kanoun, Lamiraux & Wieber 2011; Escande, Mansard & Wieber 2014.) Levels are solved one after the other by a primal
active-set method on one working set, see :mod:`cartctl.solvers.exact`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cartctl.errors import ParameterError
from cartctl.solvers.exact.solver import ExactSolver


@dataclass(frozen=True)
class HQP(ExactSolver):
    """Strict priorities with inequalities at any level; tasks that cannot be met are missed by least squares.

    scaled: slow down equations with ``fit="scale"`` as ``sns`` does instead of missing them. Raises ParameterError.
    """

    name: ClassVar[str] = "hqp"
    sources: ClassVar[tuple[str, ...]] = ("kanoun2011", "escande2014")
    honours: ClassVar[frozenset[str]] = frozenset({"bounds", "constraints", "reference", "inequalities"})
    scaled: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.scaled, bool):
            raise ParameterError(f"scaled is {self.scaled!r}; expected True or False")

    @property
    def fits_all(self) -> bool:
        """Unless told to scale."""
        return not self.scaled
