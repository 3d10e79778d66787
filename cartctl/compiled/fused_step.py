"""A controller's step at the velocity level at one stroke: the kernels of the rollouts, on a store that lasts.

The general way makes a Problem of Python objects and has it answered; here a step is one compiled call, and
Problem, references and Solution are put together when somebody asks a command for them, from a copy of that step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import LARGEST, FloatArray
from cartctl.compiled import store_kernel as at
from cartctl.compiled.answer_kernel import DLS, FAILED, SNS, told_size
from cartctl.compiled.curve import curve_of
from cartctl.compiled.lasting import Lasting
from cartctl.compiled.look_kernel import REFUSED
from cartctl.compiled.step_kernel import BITS, LEFT, OUTCOME, step_dls, step_ranks, step_sns
from cartctl.compiled.told import FusedCommand, Told
from cartctl.compiled.workspace import Workspace
from cartctl.errors import UnsupportedProblem
from cartctl.levels.patience import asked_of
from cartctl.tasks import FrameTask, Task

_FLOAT = np.dtype(np.float64)
_REFUSED = BITS * REFUSED


class FusedStep:
    """For one controller, on a store of its own."""

    def __init__(self, store: Workspace) -> None:
        robot, tasks = store.robot, store.tasks
        self.tasks, self.solver = tasks, store.solver
        self._robot, self._store = robot, store
        self.lasting = Lasting(store)
        code = self._store.ints[at.SOLVER]
        kernel = step_sns if code == SNS else step_dls if code == DLS else step_ranks
        self._kernel: Callable[..., int] = kernel.compiled
        self._arrays = (self._store.ints, self._store.floats)
        self._shape, self._rates = (robot.nq,), (robot.nv,)
        self._still = np.zeros(robot.nv)
        self._nv, self._size = robot.nv, told_size(robot.nv, len(tasks), self._store.rows)
        self._seen, self._latest = [-1] * len(tasks), -1
        self._expressed = self._take_over()
        self._asked = asked_of(tasks, robot)

    def step(self, q: Any, v: Any, t: Any) -> FusedCommand | None:
        """The command, or None where the general way is to be taken: nothing is kept of such a step.

        Raises ShapeError, NonFiniteError, ParameterError, ConfigurationError for what is no state.
        """
        if not (type(q) is np.ndarray and q.dtype is _FLOAT and q.shape == self._shape):
            q = self._robot.check_configuration(q)
        if v is None:
            v = self._still
        elif not (type(v) is np.ndarray and v.dtype is _FLOAT and v.shape == self._rates):
            v = checks.vector("v", v, self._nv, largest=LARGEST)
        if type(t) is not float:
            t = checks.number("t", t)
        latest = Task.latest
        if latest != self._latest:  # of any task
            if [task.changes for task in self.tasks] != self._seen:
                self._expressed = self._take_over()
                before, self._asked = self._asked, asked_of(self.tasks, self._robot)
                if self._asked != before:
                    self._store.begin_anew()
            self._latest = latest
        if self._gains:
            for task, row in self._gains:
                if (row != task.gain).any():
                    row[:] = task.gain
                    self._store.begin_anew()
        if not self._expressed or (self._paths and not self._sample(t)):
            return None
        ints, floats = self._arrays
        u, out = np.empty(self._nv), np.empty(self._size)
        found = self._kernel(ints, floats, q, v, t, u, out)
        if found & LEFT:
            if found & _REFUSED:
                self._refuse(q, v, t)
            return None
        if found & 15 == FAILED:
            return None
        return FusedCommand(u, (self._told, out, found & OUTCOME, found >= BITS))

    def _refuse(self, q: FloatArray, v: FloatArray, t: float) -> None:
        """Say what is wrong with a state; one that is at the margin may pass."""
        self._robot.check_configuration(q)
        checks.vector("v", v, self._nv, largest=LARGEST)
        checks.number("t", t)

    def _take_over(self) -> bool:
        """What the tasks ask now; whether this way can express it."""
        store = self._store
        # gains that may be changed in place
        self._gains = [
            (task, store.high[at.GAIN, a:b])
            for task, a, b in zip(self.tasks, store.first[:-1], store.first[1:], strict=True)
            if isinstance(task.gain, np.ndarray) and task.gain.flags.writeable
        ]
        self._paths: list[tuple[int, Callable[[float], Any], FloatArray]] = []
        try:
            for k, task in enumerate(self.tasks):
                if task.changes != self._seen[k]:
                    self._seen[k] = -1
                    store.fill(k)
                path = task.path if isinstance(task, FrameTask) else None
                if path is not None:
                    curve = curve_of(path)
                    store.each[at.CURVED, k] = curve is not None
                    if curve is None:
                        self._paths.append((k, path, store.store.samples[at.SAMPLE * k : at.SAMPLE * (k + 1)]))
                    else:
                        store.store.curves[at.CURVE * k : at.CURVE * (k + 1)] = curve[1:]
                        store.each[at.OPEN_ROTATION, k] = curve[0]
                self._seen[k] = task.changes
            store.rank()
        except UnsupportedProblem:
            self._seen, self._gains = [-1] * len(self.tasks), []
            return False
        parts = list(zip(store.first[:-1].tolist(), store.first[1:].tolist(), strict=True))
        named = [(task.fit, task.weight, task.name) for task in self.tasks]
        moving = [isinstance(task, FrameTask) and task.path is not None for task in self.tasks]
        scaled = store.ints[at.SOLVER] == SNS
        self._told = Told(self._nv, parts, named, moving, store.bounded, scaled, self.solver)
        return True

    def _sample(self, t: float) -> bool:
        """Ask every path for its target at the task's own time; False where what it says is to be refused in words."""
        each, times = self._store.each, self.lasting.times(t)
        for k, path, row in self._paths:
            own = times[k]
            try:
                s = path(own)
                rotation = s.rotation
                each[at.OPEN_ROTATION, k] = rotation is None
                if rotation is not None:
                    row[1:10].reshape(3, 3)[:] = rotation
                row[10:13], row[13:19], row[19:25] = s.position, s.twist, s.acceleration
            except Exception:  # asked again by the general way, which is the one to speak
                return False
        return True
