"""A robot that gets no nearer to targets at rest slows down until it does, or stands.

A target out of reach is approached as far as that goes, and then stood before: that is what
:mod:`cartctl.levels.approach` and :mod:`cartctl.levels.beneath` are for, direction by direction. Where several joints
take turns at their limits, or a task is asked by those above to give up what it has won, the linear model of one step
promises what a tour of many steps never holds, and robots swing to and fro for ever. So somebody looks on.

A task comes nearer when its miss ``||e||`` falls below the least before by 1e-3 of ``||J||`` times the way the joints
went since, ``integral ||v|| dt``; what ranks below it then begins anew. If none does for 2.5 s, and half the time in
which the joints can stop, while they move, their speed limits are narrowed to a share that falls to 1/e in 0.1 s, from
what they move at; it rises again, e times in 3 s, while that brings a task nearer. What counts is joint motion and not
time, so that to be slow is not to be idle; and the way of a robot is bounded: ``||e|| / (1e-3 ||J||)`` for each time a
task begins. Steps get shorter until they lead downhill, as those of a trust region do (Conn, Gould & Toint 2000,
"Trust-region methods"); the merit is the tasks' misses in their order.

It is for tasks of frames and joints at rest, without an objective and without constraints, for those may have reasons of
their own to move. A task that is changed, limits that are assigned, a reset, or a miss that changes by 1e-2 of ``||J||``
more than the robot itself can have moved it, begin anew.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cartctl.algebra.problem import Equation
from cartctl.algebra.svd import norm, scale
from cartctl.checks import FloatArray
from cartctl.levels.approach_kernel import SLOWING, TOP_SPEED
from cartctl.levels.patience_kernel import HEAD, SHARE, forget, look_on, slow_down
from cartctl.tasks import FrameTask, JointTask, PostureTask
from cartctl.tasks.base import Reference, Task

PATIENCE = 2.5  # s


def patience_of(joints: FloatArray) -> float:
    """How long a robot may get no nearer, s: joints (4, nv) as :attr:`cartctl.levels.approach.Approach.joints`."""
    brakes = np.isfinite(joints[SLOWING]) & np.isfinite(joints[TOP_SPEED]) & (joints[SLOWING] > 0.0)
    return PATIENCE + float(np.max(0.5 * joints[TOP_SPEED, brakes] / joints[SLOWING, brakes], initial=0.0))


class Patience:
    """For one robot with p tasks, its joints' figures (4, nv) and a step of dt seconds."""

    def __init__(self, joints: FloatArray, count: int, dt: float, at_acceleration: bool) -> None:
        self._joints, self._dt, self._at_acceleration = joints, dt, at_acceleration
        self._patience = patience_of(joints)
        self._changes: list[int] = []
        self.state = np.empty(HEAD + 3 * count)
        self.forget()

    def forget(self) -> None:
        """As before the first step."""
        forget.compiled(self.state, self._patience)

    def _unchanged(self, tasks: Sequence[Task]) -> bool:
        """Whether the tasks are those of the step before; begins anew if not."""
        changes = [task.changes for task in tasks]
        if changes != self._changes:
            self._changes = changes
            self.forget()
            return False
        return True

    def slow_down(self, tasks: Sequence[Task], v: FloatArray, lower: FloatArray, upper: FloatArray) -> None:
        """Narrow the box on u, each (nv,), where no task came nearer; v (nv,): the velocity."""
        if self.state[SHARE] < 1.0 and self._unchanged(tasks):
            share = float(self.state[SHARE])
            slow_down.compiled(v, self._joints, share, self._dt, self._at_acceleration, lower, upper)

    def look_on(
        self, tasks: Sequence[Task], references: Sequence[Reference], equations: Sequence[Equation], v: FloatArray
    ) -> None:
        """Take note of a step that was made at velocity v (nv,)."""
        self._unchanged(tasks)
        if not all(type(task) in (FrameTask, JointTask, PostureTask) and task.rests for task in tasks):
            self.forget()
            return
        missed = np.array([norm(reference.error) for reference in references])
        sizes = np.array([max(e.size, scale(e.A)) for e in equations[: len(tasks)]])
        look_on.compiled(missed, sizes, v, self._joints, self._dt, self.state)

    def resume(self, tasks: Sequence[Task], state: FloatArray) -> None:
        """Go on from another one's :attr:`state`."""
        self._changes = [task.changes for task in tasks]
        self.state[:] = state
