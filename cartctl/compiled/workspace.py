"""A controller's tasks, limits and solver put into a store, or a refusal that says why they cannot be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cartctl.algebra.inverses import Truncated
from cartctl.algebra.solution import Status
from cartctl.checks import FloatArray, IntArray
from cartctl.compiled import store_kernel as at
from cartctl.compiled.answer_kernel import DLS, SNS, STATUSES, TASK_PRIORITY
from cartctl.compiled.plan_kernel import FRAME, JOINTS
from cartctl.compiled.tree import AT, KIND, PARENT, PLACE, tree_of
from cartctl.errors import UnsupportedProblem
from cartctl.levels.patience import patience_of
from cartctl.levels.patience_kernel import PATIENCE, forget
from cartctl.model.robot import Robot
from cartctl.solvers import Solver, dls, sns
from cartctl.solvers.exact.kinds import FITTED, SCALED
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
    Status.UNPROVEN,
)  # in the kernels' order
assert len(NAMES) == STATUSES


class Workspace:
    """The store of one controller, as :mod:`cartctl.compiled.store_kernel` lays it out, as before the first step.

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
    ) -> None:
        tree, (code, parameter) = tree_of(robot), _solver(solver)
        self.robot, self.tasks, self.solver, self.waits, self.bounded = (
            robot,
            tuple(tasks),
            solver,
            waits,
            packed is not None,
        )
        index = [_rows_of(task, robot) for task in tasks]
        counts = [len(rows) for rows in index]
        n, p, m, r = robot.nv, len(tasks), sum(counts), max(6, *counts)
        ints, floats = at.sizes(n, p, m, r)
        self.rows = m
        self.ints: IntArray = np.zeros(ints, dtype=np.int64)
        self.floats: FloatArray = np.zeros(floats)
        self.ints[:9] = robot.nq, n, p, m, r, 0 if packed is None else n, joints is not None, 0, 1
        self.ints[at.SOLVER] = code
        self.floats[[at.DT, at.PARAMETER]] = dt, parameter
        self.store = s = at.opened(self.ints, self.floats)
        self.each, self.high = s.each, s.high
        self.index = index_ = at.index_in(s)
        chain = at.chain_in(s)
        for numbers, column in zip(chain[:3], (PARENT, KIND, AT), strict=True):
            numbers[:] = tree.joints[:, column]
        chain.place[:] = tree.joints[:, PLACE:]
        if packed is not None:
            s.wide[at.LIMITS : at.LIMITS + 11] = packed
        if joints is not None:
            s.wide[at.JOINTS : at.JOINTS + 4] = joints
            s.patience[PATIENCE] = patience_of(joints)
        self.first = np.cumsum([0, *counts])
        index_.first[:] = self.first
        index_.counts[:] = counts
        index_.dof[:] = np.concatenate(index)
        self.each[at.COUNTED], self.each[at.WAITS] = counts, waits
        for k, task in enumerate(tasks):
            own = slice(self.first[k], self.first[k + 1])
            if isinstance(task, FrameTask):
                frame = tree.frame(task.frame)
                index_.joint[k] = frame[0]
                s.twelve[2 * n + 3 * p + k] = frame[1:]
                self.each[[at.KIND, at.WHOLE], k] = FRAME, len(index[k]) == 6
                self.high[at.UNIT, own] = np.where(index[k] < 3, 1.0, task.length)
            else:
                self.each[[at.KIND, at.WHOLE], k] = JOINTS, sorted(index[k].tolist()) == list(range(n))
                self.high[at.UNIT, own] = 1.0
                self.high[at.TURNING, own] = robot.continuous[index[k]]
                s.wide[at.A + own.start : at.A + own.stop] = np.eye(n)[index[k]]
            self.fill(k)
        self.rank()
        at.forgotten(s)

    def fill(self, k: int) -> None:
        """Take over gain, weight, fit and target of task k; raises UnsupportedProblem."""
        task, each, s = self.tasks[k], self.each, self.store
        own = slice(self.first[k], self.first[k + 1])
        try:
            self.high[at.GAIN, own] = task.gain
        except ValueError:
            raise UnsupportedProblem(f"task {task.name!r} has a gain that does not fit its rows") from None
        fitted = task.fit == "least_squares"
        each[at.FITTED, k], each[at.WEIGHT, k], each[at.PATH, k], each[at.CURVED, k] = fitted, task.weight, -1.0, 0.0
        self.index.fits[k] = FITTED if fitted else SCALED
        if isinstance(task, FrameTask):
            each[at.OPEN_POSITION, k] = each[at.OPEN_ROTATION, k] = 0.0
            if task.path is None:
                given = task.goal(0.0)
                goal = s.twelve[2 * self.robot.nv + 2 * len(self.tasks) + k]
                each[at.OPEN_POSITION, k], each[at.OPEN_ROTATION, k] = given.position is None, given.rotation is None
                goal[9:] = 0.0 if given.position is None else given.position
                goal[:9] = np.eye(3).ravel() if given.rotation is None else given.rotation.ravel()
            else:
                each[at.PATH, k] = 0.0
        elif isinstance(task, JointTask):
            _, points = task.fixed_target(self.robot)
            each[at.OPEN_POSITION, k] = points is None
            self.high[at.POINT, own] = 0.0 if points is None else points

    def begin_anew(self) -> None:
        """Look anew whether the tasks come nearer, for they are others."""
        forget.compiled(self.store.patience, len(self.tasks), self.store.patience[PATIENCE])

    def rank(self) -> None:
        """Whether the lowest of several tasks is a posture of all joints: fitting it is to stay near it, as near u0.

        Not below another that is fitted: whether that has lost rank is judged from where its search begins.
        """
        each, n = self.each, self.robot.nv
        whole = each[at.KIND, -1] == JOINTS and each[at.WHOLE, -1] != 0.0 and each[at.FITTED, -1] != 0.0
        in_order = np.array_equal(self.index.dof[-n:], np.arange(n))
        below = self.ints[at.SOLVER] == SNS and len(self.tasks) > 1 and not each[at.FITTED, :-1].any()
        self.ints[at.LAST] = below and whole and in_order


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


def _rows_of(task: Any, robot: Robot) -> IntArray:
    """Which rows of its frame's six, or which tangent coordinates, a task has; raises UnsupportedProblem."""
    if type(task) is FrameTask:
        if task.orientation != "angle-axis":
            raise UnsupportedProblem(f"task {task.name!r} has its orientation as Euler angles {task.orientation}")
        if task.expressed_in != "world":
            raise UnsupportedProblem(f"task {task.name!r} is expressed in the axes of {task.expressed_in!r}")
        return np.array(task.rows, dtype=np.int64)
    if type(task) in (JointTask, PostureTask):
        return np.array(task.fixed_target(robot)[0], dtype=np.int64)
    raise UnsupportedProblem(f"task {task.name!r} is a {type(task).__name__}")
