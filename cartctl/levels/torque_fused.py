"""The torque level and ``sns`` at one stroke, where nothing is out of the ordinary; else the general way is taken.

The answer is that of the general way, by the same kernels (:mod:`cartctl.levels.torque_fused_kernel`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra.problem import Equation, Problem
from cartctl.algebra.solution import Solution
from cartctl.checks import FloatArray
from cartctl.constraints import Box
from cartctl.levels.base import Confines, Level, Secondary, direction
from cartctl.levels.metrics import Metric
from cartctl.levels.torque import TorqueLevel
from cartctl.levels.torque_fused_kernel import CLOSE, LEFT, torque_sns
from cartctl.model.state import State
from cartctl.solvers import Solver
from cartctl.solvers.exact.kinds import FITTED, LOST_RANK, SCALED
from cartctl.solvers.sns import SNS
from cartctl.tasks.base import Reference, Task

_NONE = np.zeros(0)
_EMPTY = np.zeros((1, 0))
_NO_BOX = np.zeros((2, 0))
_NO_GUESS = np.zeros(1, dtype=np.int64)
_KINDS = {"scale": SCALED, "least_squares": FITTED}


def fuses(level: Level, solver: Solver, metric: Metric) -> bool:
    """Whether a controller may take this way: the torque level and ``sns`` as they are, in the identity metric."""
    return type(level) is TorqueLevel and type(solver) is SNS and metric is None


class FusedTorque:
    """For one controller that :func:`fuses` said yes to."""

    def __init__(self, level: TorqueLevel, solver: Solver, tasks: Sequence[Task], nv: int) -> None:
        self._level, self._solver, self._tasks, self._nv = level, solver, tasks, nv
        self._kernel: Any = torque_sns.compiled
        self._sizes: Sequence[int] = ()
        self._natural = np.zeros(len(tasks))
        # arrays of what seldom changes, made anew when it does
        self._gain, self._gains = 0.0, np.zeros(1)
        self._damping: float | FloatArray | None = None
        self._damps, self._amounts = True, _NONE
        self._box: Box | None = None
        self._packed = _NO_BOX

    def answer(
        self,
        state: State,
        times: Sequence[float],
        anchors: Sequence[Any],
        secondary: Secondary,
        confines: Confines,
        start: Solution | None,
    ) -> tuple[Solution, list[Reference], bool] | None:
        """The solution, the references it was made from, and whether it is near a bound on an acceleration.

        None where the general way is to be taken.
        """
        lower, upper, constraints, _, torque = confines
        if constraints is not None:
            return None
        tasks, n = self._tasks, self._nv
        M = state.mass_matrix  # before the Jacobians, which come along
        J, (*asked, gain, gains), sizes, references = self._level.asked(state, tasks, times, anchors)
        if sizes != self._sizes:
            self._sizes = sizes
            self._levels = np.array([*sizes, *(_KINDS[task.fit] for task in tasks)], dtype=np.int64)
        h = self._level.loads.effects(state)
        drawn, pull = self._drawn(state, secondary)
        for k, task in enumerate(tasks):
            self._natural[k] = task.size(state)
        low, high = (_NONE, _NONE) if lower is None or upper is None else (lower, upper)
        m, r = J.shape[0], low.shape[0]
        rows, sides = np.empty((m + r + 2, n)), np.empty((4, max(m + r, len(tasks))))
        active = np.empty(n + 2, dtype=np.int64)
        flags = self._kernel(
            M,
            h,
            state.v,
            J,
            *asked,
            gains if gains.shape[0] else self._alike(gain),
            self._levels,
            self._natural,
            low,
            high,
            _NO_BOX if torque is None else self._bounds(torque),
            drawn,
            self._amounts,
            pull,
            _EMPTY,
            _NO_GUESS if start is None or start.warm is None else start.warm,
            rows,
            sides,
            active,
        )
        if flags & LEFT:
            return None
        lost = bool(flags & LOST_RANK)
        if lost and tasks and tasks[0].fit == "scale" and not sides[2, 0] > 0.0:
            return None  # it is to be asked for what of it can be done
        u0 = rows[-2] if drawn else None
        put_together = partial(_problem, tasks, sizes, rows, sides, u0, torque)
        solver = self._solver
        solution = Solution(put_together, rows[-1], solver.name, solver, None, lost, sides[2, : len(tasks)])
        solution.warm = active
        return solution, references, bool(flags & CLOSE)

    def _drawn(self, state: State, secondary: Secondary) -> tuple[bool, FloatArray]:
        """Whether there is a u0, and what an objective adds to it, (nv,) or empty."""
        damping = self._level.damping
        if damping is not self._damping:
            checks.fits("damping", 0.0 if damping is None else damping, self._nv)
            self._amounts = _NONE if damping is None else np.zeros(self._nv) + damping
            self._damping, self._damps = damping, damping is None or bool(np.any(damping))
        if secondary.objective is None:
            return self._damps, _NONE
        return True, secondary.share * direction(secondary.objective, state)

    def _alike(self, gain: float) -> FloatArray:
        if gain != self._gain:
            self._gain, self._gains = gain, np.array([gain])
        return self._gains

    def _bounds(self, torque: Box) -> FloatArray:
        if torque is not self._box:
            self._box, self._packed = torque, np.array(torque)
        return self._packed


def _problem(
    tasks: Sequence[Task], sizes: Sequence[int], rows: FloatArray, sides: FloatArray, u0: FloatArray | None, box: Any
) -> Problem:
    """The problem that the kernel answered, from what it has written."""
    asked, known, _, natural = sides
    equations, first = [], 0
    for k, task in enumerate(tasks):
        own = slice(first, first + sizes[k])
        given = (task.fit, task.weight, task.name, natural.item(k))
        equations.append(Equation.trusted(rows[own], asked[own], known[own], *given))
        first = own.stop
    m, end = first, rows.shape[0] - 2
    blocks = (rows[m:end], asked[m:end], known[m:end]) if end > m else None
    least, most = (None, None) if box is None else box
    return Problem.trusted(tuple(equations), None, u0, least, most, blocks)
