"""What lasts from step to step in a store, taken from there and put back, for the general way to take turns with it."""

from __future__ import annotations

from typing import Any, NamedTuple

from cartctl.checks import FloatArray
from cartctl.compiled import store_kernel as at
from cartctl.compiled.workspace import Workspace
from cartctl.tasks import FrameTask


class Memory(NamedTuple):
    """What lasts from step to step, task by task, as the general way holds it.

    anchors: what each task holds on to, None before the first step. started: when that was. times: each task's own at
    the last step. delays, shares, paces: of the clocks. last: when the last step was. bent: how the arm was bent,
    (nv,) or None. patience: the state of :class:`cartctl.levels.patience.Patience`, None where nobody looks on.
    """

    anchors: list[Any] | None
    started: float | None
    times: list[float]
    delays: list[float]
    shares: list[float]
    paces: list[float]
    last: float | None
    bent: list[FloatArray | None]
    patience: FloatArray | None


class Lasting:
    """Of one controller's workspace."""

    def __init__(self, workspace: Workspace) -> None:
        self._store = workspace
        self._anchors: list[Any] | None = None

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
        store, nv, p = self._store, self._store.robot.nv, len(self._store.tasks)
        if store.ints[at.BEGINS]:
            return None
        if self._anchors is None:
            poses = store.store.twelve[2 * nv + p : 2 * nv + 2 * p].copy()
            found = store.high[at.FOUND].copy()
            self._anchors = [
                task.holding(pose[9:], pose[:9].reshape(3, 3)) if isinstance(task, FrameTask) else found[a:b]
                for task, pose, a, b in zip(store.tasks, poses, store.first[:-1], store.first[1:], strict=True)
            ]
        return self._anchors

    @property
    def memory(self) -> Memory:
        """What lasts, for the general way to go on from."""
        store, each, nv = self._store, self._store.each, self._store.robot.nv
        s, p, begun = store.store, len(store.tasks), not store.ints[at.BEGINS]
        last = store.floats.item(at.BEFORE) if begun and each[at.WAITS].any() else None
        kept = s.bent[p * (nv + 1) :].reshape(p, nv + 1)
        bent = [row[:nv].copy() if row[nv] else None for row in kept]
        started = store.floats.item(at.BEGAN) if begun else None
        delays, shares, paces = (each[row].tolist() for row in (at.DELAY, at.SHARE, at.PACED))
        return Memory(
            self.anchors, started, self.step_times or [], delays, shares, paces, last, bent, s.patience.copy()
        )

    def resume(self, memory: Memory) -> None:
        """Go on from where the general way has come to."""
        store, each, nv = self._store, self._store.each, self._store.robot.nv
        s, p = store.store, len(store.tasks)
        at.forgotten(s)
        self._anchors = None
        each[at.DELAY], each[at.SHARE], each[at.PACED] = memory.delays, memory.shares, memory.paces
        store.floats[at.BEFORE] = 0.0 if memory.last is None else memory.last
        if memory.anchors is not None:
            store.ints[at.BEGINS] = 0
            store.floats[at.BEGAN] = memory.started
            each[at.MADE] = memory.times
            for k, anchor in enumerate(memory.anchors):
                if isinstance(store.tasks[k], FrameTask):
                    row = s.twelve[2 * nv + p + k]
                    row[9:], row[:9] = anchor.position, anchor.rotation.ravel()
                else:
                    store.high[at.FOUND, store.first[k] : store.first[k + 1]] = anchor
        if memory.patience is not None:
            s.patience[:] = memory.patience
        both = s.bent.reshape(2, p, nv + 1)
        for k, motion in enumerate(memory.bent):
            if motion is not None:
                both[:, k, :nv], both[:, k, nv] = motion, 1.0
