"""A robot that gets no nearer to targets at rest slows down until it does, or stands.

A target out of reach is approached as far as that goes, and then stood before: that is what
:mod:`cartctl.levels.approach` and :mod:`cartctl.levels.beneath` are for, direction by direction. Where several joints
take turns at their limits, or a task is asked by those above to give up what it has won, the linear model of one step
promises what a tour of many steps never holds, and robots swing to and fro for ever. So somebody looks on.

A task comes nearer when its miss ``||e||`` falls below the least before by 1e-3 of ``||J||`` times the way the joints
went since; what ranks below it then begins anew. If none does for as long as patience lasts, while the joints move,
their speed limits are narrowed to a share that falls to 1/e in 0.1 s, from what they move at; what counts as nearer is
measured from there, and anew for each 0.4 of a share. It rises again, e times in 0.5 s to 3 s, while that brings a task
nearer. Patience lasts for 2.5 s, or 4 rad at full speed, and the time in which the joints can stop. Steps get shorter
until they lead downhill, as those of a trust region do (Conn, Gould & Toint 2000, "Trust-region methods"); the merit is
the tasks' misses in their order.

It is for tasks of frames and joints at rest, without an objective and without constraints, for those may have reasons
of their own to move, and while the robot does what it is told, to 30 % of each step. A task that is changed, limits
that are assigned, a reset, or a miss that changes by 1e-3 of ``||J||`` more than the robot itself can have moved it,
begin anew. Within 1e-4 of ``||J||`` of all targets nobody is slowed down.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cartctl.algebra.problem import Problem
from cartctl.algebra.svd import norm, scale
from cartctl.checks import FloatArray
from cartctl.levels.approach_kernel import SLOWING, TOP_SPEED
from cartctl.levels.patience_kernel import HEAD, SHARE, forget, look_on, slow_down
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.tasks import FrameTask, JointTask, PostureTask
from cartctl.tasks.base import Reference, Task

PATIENCE, WAY = 2.5, 4.0  # s; rad at full speed


def patience_of(joints: FloatArray) -> float:
    """How long a robot may get no nearer, s: joints (4, nv) as :attr:`cartctl.levels.approach.Approach.joints`."""
    slowing, top = joints[SLOWING], joints[TOP_SPEED]
    fastest = float(np.max(top[np.isfinite(top)], initial=0.0))
    brakes = np.isfinite(slowing) & np.isfinite(top) & (slowing > 0.0)
    stops = float(np.max(0.5 * top[brakes] / slowing[brakes], initial=0.0))
    return max(PATIENCE, WAY / fastest if fastest > 0.0 else 0.0) + stops


def size_of(count: int, nv: int) -> int:
    """How many numbers last, for that many tasks."""
    return HEAD + 3 * count + nv


class Patience:
    """For one robot with p tasks, its joints' figures (4, nv) and a step of dt seconds."""

    def __init__(self, joints: FloatArray, count: int, dt: float, at_acceleration: bool) -> None:
        self._joints, self._dt, self._at_acceleration = joints, dt, at_acceleration
        self._patience, self._count = patience_of(joints), count
        self._changes: list[int] = []
        self._asked: list[bytes] = []
        self.state = np.zeros(size_of(count, joints.shape[1]))
        self.forget()

    def prepare(self) -> None:
        """Compile ahead what the first steps would otherwise wait for."""
        _ = look_on.compiled, slow_down.compiled

    def forget(self) -> None:
        """As before the first step."""
        forget.compiled(self.state, self._count, self._patience)

    def slow_down(self, tasks: Sequence[Task], state: State, problem: Problem) -> None:
        """Narrow the box of the problem at a state where no task came nearer, in place."""
        if self.state[SHARE] < 1.0 and not self._others(tasks, state):
            assert problem.lower is not None and problem.upper is not None
            box = (problem.lower, problem.upper)
            slow_down.compiled(state.v, self._joints, float(self.state[SHARE]), self._dt, self._at_acceleration, *box)

    def look_on(
        self, tasks: Sequence[Task], references: Sequence[Reference], problem: Problem, state: State, u: FloatArray
    ) -> None:
        """Take note of a step that was made at a state, u (nv,)."""
        self._others(tasks, state)
        if not all(type(task) in (FrameTask, JointTask, PostureTask) and task.rests for task in tasks):
            self.forget()
            return
        missed = np.array([norm(reference.error) for reference in references])
        sizes = np.array([max(e.size, scale(e.A)) for e in problem.equations[: len(tasks)]])
        step = self._dt * ((state.v + 0.5 * self._dt * u) if self._at_acceleration else u)
        x = state.robot.coordinates(state.q)
        look_on.compiled(missed, sizes, x, step, self._joints, self._dt, self.state)

    def _others(self, tasks: Sequence[Task], state: State) -> bool:
        """Whether the tasks ask for something else than in the step before; begins anew then."""
        changes = [task.changes for task in tasks]
        if changes == self._changes:
            return False
        self._changes, before = changes, self._asked
        self._asked = asked_of(tasks, state.robot)
        if self._asked == before:
            return False
        self.forget()
        return True

    def resume(self, tasks: Sequence[Task], state: FloatArray) -> None:
        """Go on from another one's :attr:`state`."""
        self._changes, self._asked = [task.changes for task in tasks], []
        self.state[:] = state


def asked_of(tasks: Sequence[Task], robot: Robot) -> list[bytes]:
    """What each task asks for, to be compared; changes of a path, and of tasks of others, always count."""
    return [_asked(task, robot) for task in tasks]


def _asked(task: Task, robot: Robot) -> bytes:
    parts: list[FloatArray | None] = [np.array([task.weight, task.fit == "scale"]), np.atleast_1d(task.gain)]
    if type(task) is FrameTask and task.path is None:
        goal = task.goal(0.0)
        parts += [goal.position, goal.rotation]
    elif type(task) in (JointTask, PostureTask) and task.rests:
        parts.append(task.fixed_target(robot)[1])  # type: ignore[attr-defined]
    else:
        parts.append(np.array([float(task.changes)]))
    return b"|".join(b"open" if part is None else np.asarray(part).tobytes() for part in parts)
