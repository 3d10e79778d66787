"""What a constraint is, and how to add one.

A constraint turns a state into rows ``lower <= C u <= upper`` on the command of one step, u = v at the velocity level
and u = a at the acceleration level, for ``cc.Problem(..., constraints=rows)``. It knows no task and no solver.

Subclass :class:`Constraint`: give ``check``, ``velocity_rows``, ``acceleration_rows`` and ``excess``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray
from cartctl.constraints.intervals import Box
from cartctl.model.robot import Robot
from cartctl.model.state import State


class Rows(NamedTuple):
    """``lower <= C u <= upper``: C (r, nv), lower (r,), upper (r,); never crossed, +-inf where a side is open."""

    C: FloatArray
    lower: FloatArray
    upper: FloatArray


class Constraint(ABC):
    """Something a motion must not do, as rows on the command of one step.

    In all methods dt is the step in s, and box says in which interval each u will lie, ``(lower, upper)``, each (nv,):
    the better it is known, the less room is given away. None, or +-inf in it, stands for the robot's own limits. Rows
    always come, whatever the state: one that is outside already is led back, at a bounded rate.
    """

    name: str = ""

    @abstractmethod
    def check(self, robot: Robot) -> None:
        """Refuse what does not fit the robot, once, when a controller is made."""

    @abstractmethod
    def velocity_rows(self, state: State, dt: float, box: Box | None = None) -> Rows:
        """Rows on the velocity v (nv,) of a step ``q <- q (+) v dt``."""

    @abstractmethod
    def acceleration_rows(self, state: State, dt: float, box: Box | None = None) -> Rows:
        """Rows on the acceleration a (nv,) of a step ``q <- q (+) (v dt + a dt^2/2)``, ``v <- v + a dt``."""

    @abstractmethod
    def excess(self, state: State) -> float:
        """How far the state is beyond what is allowed, in the unit of the bound; negative or zero inside."""


def stacked(rows: Sequence[Rows]) -> Rows | None:
    """The rows of several constraints as one set; None where there is none."""
    rows = [block for block in rows if len(block.lower)]
    if not rows:
        return None
    return Rows(*(np.concatenate([block[k] for block in rows]) for k in range(3)))
