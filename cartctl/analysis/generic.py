"""Singular everywhere, somewhere, or nowhere: ranks at random, and a search between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cartctl import checks
from cartctl.algebra.svd import floor, numerical_rank, scale, singular_values
from cartctl.analysis.box import Box, Space, space_of
from cartctl.checks import FloatArray

if TYPE_CHECKING:
    from cartctl.model.robot import Robot


@dataclass(frozen=True)
class GenericRank:
    """The rank of a task at random configurations; made by :func:`generic_rank`.

    rank: the largest met, which is the rank almost everywhere. lowest: the smallest met. rows, columns: m and n.
    """

    rank: int
    lowest: int
    rows: int
    columns: int
    samples: int

    @property
    def singular_everywhere(self) -> bool:
        """Rank < m wherever it was tried: some direction is one that the robot never has."""
        return self.rank < self.rows

    @property
    def redundancy(self) -> int:
        """``n - rank``: the degree of redundancy almost everywhere."""
        return self.columns - self.rank


def generic_rank(
    place: Robot | Box, *tasks: Any, samples: int = 10, seed: int = 0, tolerance: float | None = None
) -> GenericRank:
    """The rank of the tasks' Jacobians, stacked, at ``samples`` random configurations inside the limits.

    place: a Robot, or an :class:`analysis.Box` for functions of q. tasks: one or more; a Task, a function
    State -> (m, nv), or with a Box a function q -> (m, n). tolerance: as in :func:`spectrum`.

    Raises ParameterError, ShapeError, NonFiniteError, and what a task raises that does not fit the robot.
    """
    return ranks(space_of(place, tasks), samples, seed, tolerance)


def ranks(space: Space, samples: int, seed: int, tolerance: float | None) -> GenericRank:
    """The same of a space."""
    count = int(checks.number("samples", samples, low=1.0))
    rng = np.random.default_rng(seed)
    stacks = [stacked(space.jacobians(space.sample(rng))) for _ in range(count)]
    found = [numerical_rank(singular_values(A), floor(A, tolerance)) for A in stacks]
    return GenericRank(max(found), min(found), stacks[0].shape[0], space.n, count)


def stacked(jacobians: list[FloatArray]) -> FloatArray:
    """All rows, each task divided by its Frobenius norm: the rank of a stack must not depend on units."""
    sizes = [scale(J) for J in jacobians]
    return np.asfortranarray(np.vstack([J / s if s > 0.0 else J for J, s in zip(jacobians, sizes, strict=True)]))
