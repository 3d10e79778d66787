"""What ranks below a task at the edge of the workspace, kept so calm that the edge stays where it is.

With N the null space of the tasks above and v_a the least motion that does what they ask, a task below takes
``J N w = b - J v_a``. At the edge J N may lose rank, and what little of a direction is left would be paid for with any
speed; so w is the motion of ``||w|| <= calm`` that comes nearest. Joints that are kept where they are have no part in
it. A solver that weighs tasks instead of ranking them has nothing above: there, b is slowed down as it is.
"""

from __future__ import annotations

import math

import numpy as np

from cartctl.algebra.svd import norm
from cartctl.checks import FloatArray
from cartctl.levels.calming_kernel import calmed
from cartctl.tasks.base import Task

_CLEAR = 1e-6  # of the largest: singular values below this are none
_NO_BOX = (np.zeros(0), np.zeros(0))


class Above:
    """The tasks above, in this step: their J and b, and the largest speed, in the norm of v, that they leave."""

    def __init__(self, ranked: bool) -> None:
        self.ranked = ranked  # or all are weighed against each other
        self.clear()

    def clear(self) -> None:
        """Begin with the highest priority."""
        self.tasks: list[Task] = []
        self._rows: list[FloatArray] = []
        self._asked: list[FloatArray] = []
        self.calm = math.inf

    @property
    def is_empty(self) -> bool:
        """Whether nothing has been asked for yet."""
        return not any(J.shape[0] for J in self._rows)

    @property
    def rows(self) -> FloatArray:
        """(M, nv) their J."""
        return np.concatenate(self._rows)

    @property
    def asked(self) -> FloatArray:
        """(M,) what they ask."""
        return np.concatenate(self._asked)

    def add(self, J: FloatArray, b: FloatArray, calm: float, task: Task | None = None) -> None:
        """One more task, which leaves ``calm``."""
        if task is not None:
            self.tasks.append(task)
        self._rows.append(J)
        self._asked.append(b)
        self.calm = min(self.calm, calm)

    def calmed(self, J: FloatArray, b: FloatArray, box: tuple[FloatArray, FloatArray] | None) -> FloatArray:
        """``b`` (m,) slowed down until the motion that the tasks above leave to it is no faster than calm."""
        if self.calm == math.inf or not J.shape[0]:
            return b
        if not self.ranked:
            fastest = float(np.linalg.norm(np.linalg.lstsq(J, b, rcond=_CLEAR)[0]))
            return b * (self.calm / fastest) if fastest > self.calm else b
        slowed: FloatArray = b.copy()
        lower, upper = _NO_BOX if box is None else box
        calmed.compiled(self.rows, self.asked, J, self.calm, lower, upper, slowed)
        return slowed

    def slowed(self, u: FloatArray) -> FloatArray:
        """A motion of the null space (nv,), no faster than calm."""
        fastest = norm(u)
        return u * (self.calm / fastest) if fastest > self.calm else u
