"""A peer put to a scenario: what it is asked, where it runs, and its answer as a Run measured as all others."""

from __future__ import annotations

import importlib.util
import json
import subprocess
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from cartctl.algebra.svd import singular_values
from cartctl.bench.building import Stage
from cartctl.bench.peers import Peer, PeerUnavailable
from cartctl.checks import FloatArray
from cartctl.model import library
from cartctl.model.state import State
from cartctl.motion.run import Run, TaskRecord
from cartctl.motion.steps import whole_steps
from cartctl.tasks import FrameTask

FORMAT = 1
PATIENCE = 600.0  # s for a process of its own


def roll(peer: Peer, stage: Stage, level: str) -> Run:
    """The peer's rollout; raises PeerUnavailable where it is not there or the scenario is none for it."""
    missing = peer.missing() or _unfit(stage, level)
    if missing:
        raise PeerUnavailable(missing)
    request = ask(stage)
    answer = _elsewhere(peer, request) if peer.python else _here(peer, request)
    return _as_run(peer, stage, answer, request)


def _unfit(stage: Stage, level: str) -> str:
    """Why a scenario is none for a peer."""
    task = stage.tasks[0]
    wrong = {
        f"peers are asked for velocities only, this is level {level}": level != "velocity",
        "peers are asked for one frame's task, this has none of that kind first": not isinstance(task, FrameTask),
        "peers are asked for fixed bases, this has a moving one": stage.scenario.root_joint != "fixed",
        "peers are told no obstacles and rows": bool(stage.constraints),
        "peers are asked for a single task (a posture below it may be there)": any(
            spec["kind"] != "posture" for spec in stage.scenario.tasks[1:]
        ),
        "peers are asked for a whole pose or a position": stage.scenario.tasks[0].get("axes")
        not in ("pose", "position"),
        "peers are asked for joints with one number each": stage.robot.nq != stage.robot.nv,
    }
    return next((reason for reason, holds in wrong.items() if holds), "")


def ask(stage: Stage) -> dict[str, Any]:
    """The request, plain data: the robot as URDF, start, limits, and where the frame is to be after every step."""
    robot, scenario, task = stage.robot, stage.scenario, stage.tasks[0]
    entry = library.find(scenario.robot) if not scenario.robot.endswith(".urdf") else None
    steps = whole_steps(scenario.duration, scenario.dt)
    state = State(robot)
    state.set(stage.start, np.zeros(robot.nv))
    anchor = task.anchor(state)
    targets = [task.observe(state, (k + 1) * scenario.dt, anchor) for k in range(steps)]
    limits = stage.limits
    return {
        "format": FORMAT,
        "urdf": entry.urdf_text() if entry else Path(scenario.robot).read_text(encoding="utf-8"),
        "package_dirs": [str(p) for p in entry.package_dirs()] if entry else list(scenario.package_dirs),
        "joints": list(robot.dof_names),
        "frame": task.frame,
        "position_only": scenario.tasks[0]["axes"] == "position",
        "posture": len(stage.tasks) > 1,
        "dt": scenario.dt,
        "gain": scenario.tasks[0]["gain"],
        "q0": stage.start.tolist(),
        "home": robot.home.tolist(),
        "locked": {} if entry is None else dict(entry.home),
        "lower": _plain(None if limits is None else limits.position_lower),
        "upper": _plain(None if limits is None else limits.position_upper),
        "speed": _plain(None if limits is None else limits.velocity_upper),
        "acceleration": _plain(None if limits is None else limits.acceleration_upper),
        "targets": [target.target.tolist() for target in targets if target is not None],
    }


def _plain(values: FloatArray | None) -> list[float] | None:
    """JSON without infinities: 1e9 stands for none."""
    return None if values is None else [float(x) for x in np.nan_to_num(values, posinf=1e9, neginf=-1e9)]


def _here(peer: Peer, request: dict[str, Any]) -> dict[str, Any]:
    spec = importlib.util.spec_from_file_location(f"cartctl_peer_{peer.name}", peer.file)
    assert spec is not None and spec.loader is not None  # a .py file has both
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.roll(request)  # type: ignore[no-any-return]


def _elsewhere(peer: Peer, request: dict[str, Any]) -> dict[str, Any]:
    done = subprocess.run(
        [str(peer.python), str(peer.file)], input=json.dumps(request), capture_output=True, text=True, check=False,
        timeout=PATIENCE,
    )  # fmt: skip
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no word"])[-1]
        raise PeerUnavailable(f"{peer.name} in {peer.python} ended with {done.returncode}: {last}")
    return json.loads(done.stdout.strip().splitlines()[-1])  # type: ignore[no-any-return]


def _as_run(peer: Peer, stage: Stage, answer: dict[str, Any], request: dict[str, Any]) -> Run:
    """The answer, q (N+1, n) and step times (N,), with the errors as cartctl's own tasks see them."""
    robot, dt = stage.robot, stage.scenario.dt
    q, spent = np.array(answer["q"], dtype=np.float64), np.array(answer["times"], dtype=np.float64)
    steps = len(request["targets"])
    if q.shape != (steps + 1, robot.nq) or spent.shape != (steps,) or not np.isfinite(q).all():
        raise PeerUnavailable(
            f"{peer.name} answered with q of shape {q.shape}; expected ({steps + 1}, {robot.nq}) finite"
        )
    v = np.vstack([np.zeros(robot.nv), np.diff(q, axis=0) / dt])
    time: FloatArray = dt * np.arange(steps + 1, dtype=np.float64)
    state = State(robot)
    state.set(q[0], v[0])
    anchors = [task.anchor(state) for task in stage.tasks]
    errors: list[list[FloatArray]] = [[] for _ in stage.tasks]
    sigmas: list[list[FloatArray]] = [[] for _ in stage.tasks]
    for k in range(steps + 1):
        state.set(q[k], v[k], float(time[k]))
        for i, task in enumerate(stage.tasks):
            errors[i].append(np.array(task.reference(state, float(time[k]), anchors[i]).error))
            sigmas[i].append(singular_values(np.asfortranarray(task.jacobian(state))))
    records = [
        TaskRecord(
            task.name, task.kind, task.frame, task.units(robot), np.array(errors[i]), np.ones(steps),
            np.array(sigmas[i]), *_seen(task, stage, q, time, anchors[i]),
        )
        for i, task in enumerate(stage.tasks)
    ]  # fmt: skip
    target = getattr(stage.tasks[0], "target", None)
    closed = bool(getattr(target, "closed", False))
    meta = {
        "robot": robot.spec, "robot_name": robot.name, "joints": list(robot.dof_names), "solver": peer.name,
        "solver_parameters": {}, "level": "velocity", "objective": None, "metric": None, "dt": dt,
        "cycles": [float(t) for t in target.cycle_times()] if closed and target is not None else [],
        "interrupted": False, "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "versions": {peer.name: str(answer.get("version", ""))},
    }  # fmt: skip
    return Run(
        meta=meta, time=time, q=q, v=v, command=v[1:], status=[str(s) for s in answer.get("status", ["DONE"] * steps)],
        solve_time=spent, tasks=records, robot=robot,
    )  # fmt: skip


def _seen(task: Any, stage: Stage, q: FloatArray, time: FloatArray, anchor: Any) -> tuple[Any, Any]:
    """Poses and targets for the picture."""
    state, still = State(stage.robot), np.zeros(stage.robot.nv)
    seen = []
    for sample, t in zip(q, time, strict=True):
        state.set(sample, still, float(t))
        seen.append(task.observe(state, float(t), anchor))
    if any(each is None for each in seen):
        return None, None
    return np.array([each.value for each in seen]), np.array([each.target for each in seen])
