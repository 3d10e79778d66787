"""A controller's step at the velocity level at one stroke: the kernels of the rollouts, on a store that lasts.

The general way makes a Problem of Python objects and has it answered; here a step is one compiled call, and
Problem, references and Solution are put together when somebody asks a command for them, from a copy of that step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.checks import LARGEST, FloatArray
from cartctl.compiled import store_kernel as at
from cartctl.compiled.answer_kernel import DLS, FAILED, SNS, told_size
from cartctl.compiled.curve import curve_of
from cartctl.compiled.look_kernel import REFUSED
from cartctl.compiled.step_kernel import BITS, LEFT, OUTCOME, step_dls, step_ranks, step_sns
from cartctl.compiled.told import FusedCommand, Told
from cartctl.compiled.workspace import Workspace
from cartctl.errors import UnsupportedProblem
from cartctl.model.robot import Robot
from cartctl.solvers import Solver
from cartctl.tasks import FrameTask, Task

_FLOAT = np.dtype(np.float64)
_REFUSED = BITS * REFUSED


class Memory(NamedTuple):
    """What lasts from step to step, task by task, as the general way holds it.

    anchors: what each task holds on to, None before the first step. started: when that was. times: each task's own at
    the last step. delays, shares: of the clocks. last: when the last step was. bent: how the arm was bent, (nv,) or
    None.
    """

    anchors: list[Any] | None
    started: float | None
    times: list[float]
    delays: list[float]
    shares: list[float]
    last: float | None
    bent: list[FloatArray | None]


class FusedStep:
    """For one controller; arguments as of :class:`Workspace`, which raises what cannot be done this way."""

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
        self.tasks, self.solver = tasks, solver
        self._robot, self._store = robot, Workspace(robot, tasks, solver, packed, joints, waits, dt)
        code = self._store.ints[at.SOLVER]
        kernel = step_sns if code == SNS else step_dls if code == DLS else step_ranks
        self._kernel: Callable[..., int] = kernel.compiled
        self._arrays = (self._store.ints, self._store.floats)
        self._shape, self._rates = (robot.nq,), (robot.nv,)
        self._still = np.zeros(robot.nv)
        self._nv, self._size = robot.nv, told_size(robot.nv, len(tasks), self._store.rows)
        self._waits = any(waits)
        self._bounded = packed is not None
        self._anchors: list[Any] | None = None
        self._seen, self._latest = [-1] * len(tasks), -1
        self._expressed = self._take_over()

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
            self._latest = latest
        if self._gains:
            for task, row in self._gains:
                row[:] = task.gain
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
        self._told = Told(self._nv, parts, named, moving, self._bounded, scaled, self.solver)
        return True

    def _sample(self, t: float) -> bool:
        """Ask every path for its target at the task's own time; False where what it says is to be refused in words."""
        store, floats, each = self._store, self._store.floats, self._store.each
        passed = 0.0 if store.ints[at.BEGINS] else max(t - floats.item(at.BEFORE), 0.0)
        for k, path, row in self._paths:
            own = t
            if self._waits:
                own = t - each.item(at.DELAY, k) - (1.0 - each.item(at.SHARE, k)) * passed
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

    def times(self, t: float) -> list[float]:
        """Each task's own time at time t."""
        kept, store = self._store.each, self._store
        passed = 0.0 if store.ints[at.BEGINS] else max(t - store.floats.item(at.BEFORE), 0.0)
        pairs = zip(kept[at.DELAY].tolist(), kept[at.SHARE].tolist(), strict=True)
        return [t - delay - (1.0 - share) * passed for delay, share in pairs]

    @property
    def step_times(self) -> list[float] | None:
        """Each task's own time at the last step, None before the first one."""
        return None if self._store.ints[at.BEGINS] else self._store.each[at.MADE].tolist()

    @property
    def anchors(self) -> list[Any] | None:
        """What each task holds on to since the first step, None before it."""
        store, nv, p = self._store, self._nv, len(self.tasks)
        if store.ints[at.BEGINS]:
            return None
        if self._anchors is None:
            poses = store.store.twelve[2 * nv + p : 2 * nv + 2 * p].copy()
            found = store.high[at.FOUND].copy()
            self._anchors = [
                task.holding(pose[9:], pose[:9].reshape(3, 3)) if isinstance(task, FrameTask) else found[a:b]
                for task, pose, a, b in zip(self.tasks, poses, store.first[:-1], store.first[1:], strict=True)
            ]
        return self._anchors

    @property
    def memory(self) -> Memory:
        """What lasts, for the general way to go on from."""
        store, each, nv = self._store, self._store.each, self._nv
        s, p, begun = store.store, len(self.tasks), not store.ints[at.BEGINS]
        last = store.floats.item(at.BEFORE) if begun and self._waits else None
        kept = s.bent[p * (nv + 1) :].reshape(p, nv + 1)
        bent = [row[:nv].copy() if row[nv] else None for row in kept]
        started = store.floats.item(at.BEGAN) if begun else None
        delays, shares = each[at.DELAY].tolist(), each[at.SHARE].tolist()
        return Memory(self.anchors, started, self.step_times or [], delays, shares, last, bent)

    def resume(self, memory: Memory) -> None:
        """Go on from where the general way has come to."""
        store, each, nv = self._store, self._store.each, self._nv
        s, p = store.store, len(self.tasks)
        at.forgotten(s)
        self._anchors = None
        each[at.DELAY], each[at.SHARE] = memory.delays, memory.shares
        store.floats[at.BEFORE] = 0.0 if memory.last is None else memory.last
        if memory.anchors is not None:
            store.ints[at.BEGINS] = 0
            store.floats[at.BEGAN] = memory.started
            each[at.MADE] = memory.times
            for k, anchor in enumerate(memory.anchors):
                if isinstance(self.tasks[k], FrameTask):
                    row = s.twelve[2 * nv + p + k]
                    row[9:], row[:9] = anchor.position, anchor.rotation.ravel()
                else:
                    store.high[at.FOUND, store.first[k] : store.first[k + 1]] = anchor
        both = s.bent.reshape(2, p, nv + 1)
        for k, motion in enumerate(memory.bent):
            if motion is not None:
                both[:, k, :nv], both[:, k, nv] = motion, 1.0
