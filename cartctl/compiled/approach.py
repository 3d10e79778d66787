"""The approach of a controller whose robot is a compiled tree: curvatures of frame tasks in one call, without a State.

The same as :class:`cartctl.levels.approach.Approach`, which asks Pinocchio for the drift of the task at a unit motion
along each singular direction.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray, IntArray
from cartctl.compiled.motion_kernel import chain_of, forward, frame_drift, place_frame
from cartctl.compiled.tree import Tree
from cartctl.kernels import kernel
from cartctl.levels.approach import Approach
from cartctl.levels.approach_kernel import ASKED, BEND, PULL
from cartctl.model.limits import Limits
from cartctl.model.state import State
from cartctl.solvers import Solver
from cartctl.tasks import FrameTask
from cartctl.tasks.base import Task


class _Rows(NamedTuple):
    """The frame of a task, and which of its six rows, times what."""

    frame: FloatArray
    row: IntArray
    unit: FloatArray


class TreeApproach(Approach):
    """For robots that :mod:`cartctl.compiled.tree` can hold; tasks that are no plain FrameTask go the usual way."""

    def __init__(self, limits: Limits, dt: float, solver: Solver, waiting: Iterable[Task], tree: Tree) -> None:
        super().__init__(limits, dt, solver, waiting)
        self._tree = tree
        self._known: dict[int, tuple[Task, _Rows | None]] = {}

    def prepare(self) -> None:
        """Compile ahead what the first step would otherwise wait for."""
        super().prepare()
        _ = curvatures.compiled, drift_of.compiled

    def _curvatures(
        self, task: Task, state: State, U: FloatArray, Vt: FloatArray, D: FloatArray, error: FloatArray
    ) -> None:
        rows = self._rows(task)
        if rows is None:
            super()._curvatures(task, state, U, Vt, D, error)
        else:
            curvatures.compiled(self._tree.joints, *rows, state.q, U, Vt, error, D)

    def _drift(self, task: Task, state: State, v: FloatArray) -> FloatArray:
        rows = self._rows(task)
        if rows is None:
            return super()._drift(task, state, v)
        out = np.empty(rows.row.shape[0])
        drift_of.compiled(self._tree.joints, *rows, state.q, v, out)
        return out

    def _rows(self, task: Task) -> _Rows | None:
        known = self._known.get(id(task))
        if known is None:
            known = self._known[id(task)] = (task, self._rows_of(task))
        return known[1]

    def _rows_of(self, task: Task) -> _Rows | None:
        if type(task) is not FrameTask or task.orientation != "angle-axis" or task.expressed_in != "world":
            return None
        index = np.array(task.rows, dtype=np.int64)
        return _Rows(self._tree.frame(task.frame), index, np.where(index < 3, 1.0, task.length))


@kernel("void(matrix, vector, ints, vector, vector, matrix, matrix, vector, out_matrix)")
def curvatures(
    joints: FloatArray,
    frame: FloatArray,
    row: IntArray,
    unit: FloatArray,
    q: FloatArray,
    U: FloatArray,
    Vt: FloatArray,
    error: FloatArray,
    D: FloatArray,
) -> None:
    """Fill D[BEND] = u . h and D[PULL] = max(0, -e . h), ``h = J_dot(v) v``, for the directions that are asked for."""
    if not D[ASKED].any():
        return
    n, chain = joints.shape[0], chain_of(joints)
    world, pose, v, six = np.empty((n, 12)), np.empty(12), np.empty(n), np.empty(6)
    order = np.empty(n, np.int64)
    forward(chain, np.ascontiguousarray(q), world)
    place_frame(world, int(frame[0]), np.ascontiguousarray(frame[1:]), pose)
    for i in range(D.shape[1]):
        if D[ASKED, i] == 0.0:
            continue
        for j in range(n):
            v[j] = Vt[i, j]
        frame_drift(chain, world, int(frame[0]), pose, v, order, six)
        along, pulled = 0.0, 0.0
        for a in range(row.shape[0]):
            h = six[row[a]] * unit[a]
            along += U[a, i] * h
            pulled += error[a] * h
        D[BEND, i], D[PULL, i] = along, max(0.0, -pulled)


@kernel("void(matrix, vector, ints, vector, vector, vector, out_vector)")
def drift_of(
    joints: FloatArray,
    frame: FloatArray,
    row: IntArray,
    unit: FloatArray,
    q: FloatArray,
    v: FloatArray,
    out: FloatArray,
) -> None:
    """Fill out (m,) with ``J_dot v`` of a task's rows."""
    n, chain = joints.shape[0], chain_of(joints)
    world, pose, six = np.empty((n, 12)), np.empty(12), np.empty(6)
    forward(chain, np.ascontiguousarray(q), world)
    place_frame(world, int(frame[0]), np.ascontiguousarray(frame[1:]), pose)
    frame_drift(chain, world, int(frame[0]), pose, np.ascontiguousarray(v), np.empty(n, np.int64), six)
    for a in range(row.shape[0]):
        out[a] = six[row[a]] * unit[a]
