"""What a rollout's loop is told: tasks, limits, paths and solver as arrays, or a refusal that says why not.

Compiled are the solvers ``sns``, ``dls`` and ``task-priority`` (truncated), with FrameTasks in world axes whose errors
are angle-axis vectors, and JointTasks and PostureTasks with fixed targets, on any tree of joints that
:mod:`cartctl.compiled.tree` can hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl.checks import FloatArray, IntArray
from cartctl.compiled import store_kernel as at
from cartctl.compiled.answer_kernel import STATUSES
from cartctl.compiled.curve import curve_of
from cartctl.compiled.path_table import ROW, path_table, samples
from cartctl.compiled.rollout_kernel import roll
from cartctl.compiled.workspace import Workspace
from cartctl.model.robot import Robot
from cartctl.tasks import FrameTask, Task


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the loop found for B starts over N steps, M rows of p tasks; the history's arrays are empty if not kept.

    q (B, nq), v (B, nv), error (B, M): at the end. least (B, p): the smallest scale. counts (B, 10): of each status.
    q_all, v_all, error_all (B, N + 1, ...), step_all (B, N + 1, 1 + 2 p): status, scales, own times.
    """

    q: FloatArray
    v: FloatArray
    error: FloatArray
    least: FloatArray
    counts: FloatArray
    q_all: FloatArray
    v_all: FloatArray
    error_all: FloatArray
    step_all: FloatArray

    @staticmethod
    def empty(b: int, steps: int, sizes: tuple[int, int, int, int], history: bool) -> Outcome:
        """Room for b starts; sizes: nq, nv, M, p."""
        nq, nv, m, p = sizes
        kept = b * (steps + 1) if history else 0
        ends = [(b, nq), (b, nv), (b, m), (b, p), (b, STATUSES)]
        every = [(kept, nq), (kept, nv), (kept, m), (kept, 1 + 2 * p)]
        return Outcome(*(np.zeros(shape) for shape in ends + every))

    def part(self, begin: int, end: int, steps: int) -> list[FloatArray]:
        """Views of the rows of starts begin to end, in the kernel's order."""
        own = slice(begin * (steps + 1), end * (steps + 1)) if len(self.q_all) else slice(0, 0)
        ends = (self.q, self.v, self.error, self.least, self.counts)
        every = (self.q_all, self.v_all, self.error_all, self.step_all)
        return [x[begin:end] for x in ends] + [x[own] for x in every]


class Loop:
    """The arrays of one controller's loop over ``steps`` steps from ``t0``, on a store of its own.

    Raises UnsupportedProblem for a path that cannot be sampled ahead.
    """

    def __init__(self, store: Workspace, t0: float, steps: int) -> None:
        robot, tasks, dt = store.robot, store.tasks, store.floats.item(at.DT)
        times: FloatArray = t0 + dt * np.arange(steps + 1, dtype=np.float64)
        tables: list[FloatArray] = []
        for k, task in enumerate(tasks):
            if isinstance(task, FrameTask) and task.path is not None:
                store.each[at.OPEN_ROTATION, k] = task.goal(float(times[0])).rotation is None
                store.each[at.PATH, k] = len(tables)
                tables.append(_table(task.path, times, store.waits[k], f"task {task.name!r}"))
        store.ints[at.STEPS], store.floats[at.START] = steps, t0
        self.steps, self.sizes = steps, (robot.nq, robot.nv, store.rows, len(tasks))
        self._fixed = (
            store.ints,
            store.floats,
            np.concatenate(tables) if tables else np.zeros((0, ROW)),
            np.cumsum([0, *(len(nodes) for nodes in tables)]).astype(np.int64),
        )

    def run(self, q0: FloatArray, v0: FloatArray, arrays: Sequence[FloatArray]) -> None:
        """Roll out q0 (B, nq), v0 (B, nv) into the arrays of an Outcome."""
        roll.compiled(*self._fixed, q0, v0, *arrays)


def _table(path: Any, times: FloatArray, waits: bool, name: str) -> FloatArray:
    """What the loop reads the path from: samples, or one row with the figures of a curve that it works out itself."""
    figures = curve_of(path)
    if figures is not None:
        return figures[None]
    return path_table(path, times, name) if waits else samples(path, times, name)


def prepared() -> Any:
    """Compile the loop, or fetch it from its cache."""
    return roll.compiled


def widths(tasks: Sequence[Task], robot: Robot) -> IntArray:
    """(p + 1,) where each task's rows begin among all of them."""
    return np.cumsum([0, *(len(task.units(robot)) for task in tasks)])
