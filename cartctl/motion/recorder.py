"""Writing down every step of a rollout, so that nothing is lost when it ends early."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, is_dataclass
from datetime import datetime, timezone
from importlib import metadata
from typing import Any

import numpy as np

from cartctl.algebra.svd import singular_values
from cartctl.checks import FloatArray
from cartctl.levels import Command
from cartctl.model.state import State
from cartctl.motion.controller import Controller
from cartctl.motion.mover import Driven, Mover
from cartctl.motion.run import Run, TaskRecord
from cartctl.motion.surroundings import Surroundings
from cartctl.tasks import FrameTask


class Recorder:
    """Arrays for ``steps`` steps of one controller, filled as it goes."""

    def __init__(self, controller: Controller, steps: int, t0: float, moves: Mover) -> None:
        robot = controller.robot
        self._moves = moves
        self.steps = steps
        self._controller, self._t0 = controller, t0
        self._made = 0
        self._closed = False
        self._q, self._v = np.zeros((steps + 1, robot.nq)), np.zeros((steps + 1, robot.nv))
        self._command, self._spent = np.zeros((steps, robot.nv)), np.zeros(steps)
        self._status: list[str] = []
        self._around = Surroundings(controller)
        self._tasks = [_TaskRows(task.units(robot), robot.nv, steps) for task in controller.tasks]

    def time_of(self, k: int) -> float:
        """The time of step k in s; a product, so that it does not drift as a sum would."""
        return self._t0 + k * self._controller.dt

    def record(self, k: int, q: FloatArray, v: FloatArray, command: Command, spent: int) -> None:
        """Step k: the state before it, the command, and the time it took in ns."""
        self._q[k], self._v[k] = q, v
        self._command[k], self._spent[k] = command.told, spent * 1e-9
        self._status.append(command.solution.status.name)
        solution, controller = command.solution, self._controller
        state = controller.observe(q, v, self.time_of(k))
        self._around.see(state)
        times = controller.step_times
        for i, (rows, task) in enumerate(zip(self._tasks, controller.tasks, strict=True)):
            rows.error[k] = command.references[i].error
            rows.scale[k] = solution.scales[i]
            rows.singular[k] = singular_values(np.asfortranarray(task.jacobian(state)))
            rows.see(k, task.observe(state, times[i], controller.anchors[i]))
        self._made = k + 1

    def close(self, q: FloatArray, v: FloatArray) -> None:
        """The state after the last step."""
        k, controller = self._made, self._controller
        self._q[k], self._v[k] = q, v
        t = self.time_of(k)
        state = controller.observe(q, v, t)
        self._around.see(state)
        times = controller.times(t)
        for rows, task, anchor, own in zip(self._tasks, controller.tasks, controller.anchors, times, strict=True):
            rows.error[k] = task.reference(state, own, anchor).error
            rows.singular[k] = singular_values(np.asfortranarray(task.jacobian(state)))
            rows.see(k, task.observe(state, own, anchor))
        self._closed = True

    def finish(self, *, interrupted: bool) -> Run:
        """The Run of what was made."""
        n = self._made if self._closed else max(self._made - 1, 0)
        samples = n + 1 if self._made else 0
        controller = self._controller
        records = [rows.record(task, n, samples) for rows, task in zip(self._tasks, controller.tasks, strict=True)]
        driven = self._moves if isinstance(self._moves, Driven) else None
        return Run(
            meta=_meta(controller, interrupted),
            time=self._t0 + controller.dt * np.arange(samples, dtype=np.float64),
            q=self._q[:samples].copy(),
            v=self._v[:samples].copy(),
            command=self._command[:n].copy(),
            status=self._status[:n],
            solve_time=self._spent[:n].copy(),
            tasks=records,
            torque=None if driven is None else driven.torque[:n].copy(),
            energy=None if driven is None else driven.books.first(samples),
            obstacles=self._around.records(samples),
            robot=controller.robot,
        )


def run_of_states(
    controller: Controller,
    time: FloatArray,
    q: FloatArray,
    v: FloatArray,
    scales: FloatArray,
    status: list[str],
    own: FloatArray,
    step_time: float,
) -> Run:
    """A Run of N steps made elsewhere at the velocity level: states (N+1, ...), scales (N, p), own times (N+1, p)."""
    robot, tasks = controller.robot, controller.tasks
    n, state = len(status), State(robot)
    rows = [_TaskRows(task.units(robot), robot.nv, n) for task in tasks]
    anchors: list[Any] = []
    for k in range(n + 1):
        state.set(q[k], v[k], float(time[k]))
        anchors = anchors or [task.anchor(state) for task in tasks]
        for i, (row, task) in enumerate(zip(rows, tasks, strict=True)):
            t = float(own[k, i])
            row.error[k] = task.reference(state, t, anchors[i]).error
            row.singular[k] = singular_values(np.asfortranarray(task.jacobian(state)))
            row.see(k, task.observe(state, t, anchors[i]))
    for i, row in enumerate(rows):
        row.scale[:] = scales[:, i]
    return Run(
        meta=_meta(controller, False),
        time=time.copy(),
        q=q.copy(),
        v=v.copy(),
        command=v[1:].copy(),
        status=status,
        solve_time=np.full(n, step_time),
        tasks=[row.record(task, n, n + 1) for row, task in zip(rows, tasks, strict=True)],
        robot=robot,
    )


class _TaskRows:
    """One task's arrays."""

    def __init__(self, units: list[str], nv: int, steps: int) -> None:
        self.units, m = units, len(units)
        self.error = np.zeros((steps + 1, m))
        self.scale = np.ones(steps)
        self.singular = np.zeros((steps + 1, min(m, nv)))
        self.value: FloatArray | None = None
        self.target: FloatArray | None = None

    def see(self, k: int, observation: Any) -> None:
        if observation is None:
            return
        if self.value is None or self.target is None:
            self.value = np.zeros((self.error.shape[0], len(observation.value)))
            self.target = np.zeros_like(self.value)
        self.value[k], self.target[k] = observation.value, observation.target

    def record(self, task: Any, n: int, samples: int) -> TaskRecord:
        return TaskRecord(
            name=task.name,
            kind=task.kind,
            frame=task.frame,
            units=self.units,
            error=self.error[:samples].copy(),
            scale=self.scale[:n].copy(),
            singular_values=self.singular[:samples].copy(),
            pose=None if self.value is None else self.value[:samples].copy(),
            target=None if self.target is None else self.target[:samples].copy(),
            rows=world_rows(task),
        )


def world_rows(task: Any) -> list[int] | None:
    """The rows of a frame's pose in the world's axes that a task moves, None where it moves something else."""
    if not isinstance(task, FrameTask) or task.expressed_in != "world":
        return None
    return list(task.rows)


def _meta(controller: Controller, interrupted: bool) -> dict[str, Any]:
    solver, robot = controller.solver, controller.robot
    return {
        "robot": robot.spec,
        "robot_name": robot.name,
        "joints": list(robot.dof_names),
        "solver": solver.name,
        "solver_parameters": _parameters(solver),
        "level": controller.level.name,
        "objective": None if controller.objective is None else repr(controller.objective),
        "singularity": None if controller.singularity is None else repr(controller.singularity),
        "metric": controller.metric if isinstance(controller.metric, str) else type(controller.metric).__name__,
        "dt": controller.dt,
        "cycles": cycles_of([getattr(task, "target", None) for task in controller.tasks]),
        "interrupted": interrupted,
        **provenance(),
    }


def cycles_of(targets: Sequence[Any]) -> list[float]:
    """When the laps of the first closed path among the targets begin and end, s; nothing without one."""
    for target in targets:
        if hasattr(target, "cycle_times") and getattr(target, "closed", False):
            return [float(t) for t in target.cycle_times()]
    return []


def provenance() -> dict[str, Any]:
    """When a run was made, and by which versions."""
    return {
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "versions": {name: _version(name) for name in ("cartctl", "pin", "numpy", "scipy")}
        | {"python": ".".join(map(str, sys.version_info[:3]))},
    }


def _parameters(solver: Any) -> dict[str, str]:
    return (
        {k: str(v) for k, v in asdict(solver).items()} if is_dataclass(solver) and not isinstance(solver, type) else {}
    )


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
