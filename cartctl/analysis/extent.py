"""How far a task's singularities extend: everywhere, somewhere, or nowhere that a search could find."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cartctl.analysis.box import Box
from cartctl.analysis.generic import GenericRank, generic_rank
from cartctl.analysis.search import Search, find_kinematic_singularities

if TYPE_CHECKING:
    from cartctl.model.robot import Robot


@dataclass(frozen=True, eq=False)
class Extent:
    """Where ``rank J < m``; made by :func:`where_singular`.

    generic: the rank almost everywhere. search: for the other places, None where there is nothing else.
    """

    generic: GenericRank
    search: Search | None

    @property
    def where(self) -> str:
        """``"everywhere"``, ``"somewhere"`` or ``"nowhere found"``."""
        if self.search is None:
            return "everywhere" if self.generic.singular_everywhere else "nowhere found"
        return "somewhere" if self.search.found else "nowhere found"


def where_singular(
    place: Robot | Box, task: Any, *, starts: int = 20, seed: int = 0, tolerance: float = 1e-6
) -> Extent:
    """The generic rank of a task, and, where that is full, a search for singular configurations inside the limits.

    Arguments and errors as :func:`find_kinematic_singularities`, but for tasks that are singular everywhere.
    """
    generic = generic_rank(place, task, seed=seed, tolerance=tolerance)
    if generic.singular_everywhere or generic.rows == 0:
        return Extent(generic, None)
    return Extent(generic, find_kinematic_singularities(place, task, starts=starts, seed=seed, tolerance=tolerance))
