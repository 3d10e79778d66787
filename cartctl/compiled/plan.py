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

from cartctl.algebra.inverses import Truncated
from cartctl.algebra.solution import Status
from cartctl.checks import FloatArray, IntArray
from cartctl.compiled import plan_kernel as at
from cartctl.compiled.path_table import POSE, ROW, TWIST, path_table, samples
from cartctl.compiled.rollout_kernel import DLS, SNS, STATUSES, TASK_PRIORITY, roll
from cartctl.compiled.tree import tree_of
from cartctl.errors import UnsupportedProblem
from cartctl.model.robot import Robot
from cartctl.solvers import Solver, dls, sns
from cartctl.solvers.task_priority import TaskPriority
from cartctl.tasks import FrameTask, JointTask, PostureTask, Task

NAMES = (
    Status.OPTIMAL,
    Status.SCALED,
    Status.SKIPPED,
    Status.SINGULAR,
    Status.INEXACT,
    Status.FAILED,
    Status.RECOVERING,
    Status.DAMPED,
    Status.OVERDETERMINED,
)  # in the kernel's order
assert len(NAMES) == STATUSES


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the loop found for B starts over N steps, M rows of p tasks; the history's arrays are empty if not kept.

    q (B, nq), v (B, nv), error (B, M): at the end. least (B, p): the smallest scale. counts (B, 9): of each status.
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
    """The arrays of one controller's loop over ``steps`` steps from ``t0``.

    packed, joints: the limits as :class:`VelocityBounds` and :class:`Approach` hold them, None without. waits: (p,)
    whose paths wait for the hand. Raises UnsupportedProblem, UnsupportedJoint with the reason.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Sequence[Task],
        solver: Solver,
        packed: FloatArray | None,
        joints: FloatArray | None,
        waits: Sequence[bool],
        dt: float,
        t0: float,
        steps: int,
    ) -> None:
        tree = tree_of(robot)
        code, parameter = _solver(solver)
        self.steps, self.sizes = steps, (robot.nq, robot.nv, 0, len(tasks))
        times: FloatArray = t0 + dt * np.arange(steps + 1, dtype=np.float64)
        frames, table = np.zeros((len(tasks), 13)), np.zeros((len(tasks), at.TASK_WIDTH))
        goals, rows = np.zeros((len(tasks), 12)), []
        tables: list[FloatArray] = []
        for k, task in enumerate(tasks):
            table[k, [at.FITTED, at.WEIGHT, at.WAITS]] = task.fit == "least_squares", task.weight, waits[k]
            if type(task) is FrameTask:
                frames[k] = tree.frame(task.frame)
                rows.append(_of_frame(task, table[k], goals[k], tables, times))
            elif type(task) in (JointTask, PostureTask):
                rows.append(_of_joints(task, robot, table[k]))
            else:
                raise UnsupportedProblem(f"task {task.name!r} is a {type(task).__name__}")
            table[k, at.COUNT] = len(rows[-1])
        every = np.concatenate(rows)
        self.sizes = (robot.nq, robot.nv, len(every), len(tasks))
        none = np.zeros((0, robot.nv))
        self._fixed = (
            tree.joints,
            frames,
            table,
            every,
            goals,
            none if packed is None else packed,
            none if joints is None else joints,
            np.concatenate(tables) if tables else np.zeros((0, ROW)),
            np.cumsum([0, *(len(nodes) for nodes in tables)]).astype(np.int64),
            np.array([t0, dt, parameter]),
            np.array([code, steps, _is_reference(code, table, every, robot.nv)], dtype=np.int64),
        )

    def run(self, q0: FloatArray, v0: FloatArray, arrays: Sequence[FloatArray]) -> None:
        """Roll out q0 (B, nq), v0 (B, nv) into the arrays of an Outcome."""
        roll.compiled(*self._fixed, q0, v0, *arrays)


def prepared() -> Any:
    """Compile the loop, or fetch it from its cache."""
    return roll.compiled


def _solver(solver: Solver) -> tuple[int, float]:
    if type(solver) is sns.SNS:
        return SNS, 0.0
    if type(solver) is dls.DLS:
        return DLS, solver.damping
    if type(solver) is TaskPriority:
        if type(solver.policy) is Truncated:
            return TASK_PRIORITY, solver.policy.cutoff
        raise UnsupportedProblem(f"solver 'task-priority' has the policy {solver.policy!r}")
    raise UnsupportedProblem(f"solver {solver.name!r} is not compiled ('sns', 'dls' and 'task-priority' are)")


def _of_frame(
    task: FrameTask, own: FloatArray, goal: FloatArray, tables: list[FloatArray], times: FloatArray
) -> FloatArray:
    """The rows of a frame task; fills its line of the table and its goal, adds its path."""
    if task.orientation != "angle-axis":
        raise UnsupportedProblem(f"task {task.name!r} has its orientation as Euler angles {task.orientation}")
    if task.expressed_in != "world":
        raise UnsupportedProblem(f"task {task.name!r} is expressed in the axes of {task.expressed_in!r}")
    own[at.KIND], own[at.PATH], own[at.WHOLE] = at.FRAME, -1.0, len(task.rows) == 6
    given = task.goal(float(times[0]))
    path = task.path
    if path is None:
        position, rotation = given.position, given.rotation
        goal[9:] = 0.0 if position is None else position
        goal[:9] = np.eye(3).ravel() if rotation is None else np.asarray(rotation).ravel()
        own[[at.OPEN_POSITION, at.OPEN_ROTATION]] = position is None, rotation is None
    else:
        name = f"task {task.name!r}"
        own[at.PATH], own[at.OPEN_ROTATION] = len(tables), given.rotation is None
        tables.append(path_table(path, times, name) if own[at.WAITS] else samples(path, times, name))
        goal[:] = tables[-1][0, POSE:TWIST]
    rows = np.zeros((len(task.rows), at.ROW_WIDTH))
    rows[:, at.INDEX] = task.rows
    rows[:, at.ROW_GAIN] = task.gain
    rows[:, at.UNIT] = np.where(rows[:, at.INDEX] < 3, 1.0, task.length)
    return rows


def _of_joints(task: Any, robot: Robot, own: FloatArray) -> FloatArray:
    """The rows of a task on joints."""
    index, points = task.fixed_target(robot)
    own[at.KIND], own[at.PATH], own[at.OPEN_POSITION] = at.JOINTS, -1.0, points is None
    own[at.WHOLE] = sorted(index.tolist()) == list(range(robot.nv))
    rows = np.zeros((len(index), at.ROW_WIDTH))
    rows[:, at.INDEX], rows[:, at.ROW_GAIN], rows[:, at.UNIT] = index, task.gain, 1.0
    rows[:, at.TURNING] = robot.continuous[index]
    if points is not None:
        rows[:, at.POINT] = points
    return rows


def _is_reference(code: int, table: FloatArray, rows: FloatArray, n: int) -> bool:
    """Whether the lowest of several tasks is a posture of all joints: fitting it is to stay near it, as near u0."""
    low = table[-1]
    whole = low[at.KIND] == at.JOINTS and low[at.WHOLE] != 0.0 and low[at.FITTED] != 0.0
    in_order = np.array_equal(rows[-n:, at.INDEX], np.arange(n))
    return bool(code == SNS and len(table) > 1 and whole and in_order)


def widths(tasks: Sequence[Task], robot: Robot) -> IntArray:
    """(p + 1,) where each task's rows begin among all of them."""
    return np.cumsum([0, *(len(task.units(robot)) for task in tasks)])
