"""Runs as .npz files: arrays plus one JSON text, no pickles."""

from __future__ import annotations

import json
import zipfile
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from cartctl.errors import ParameterError, RunFileError
from cartctl.files import whole_file
from cartctl.motion.energy import EnergyBooks
from cartctl.motion.run import Run, TaskRecord
from cartctl.motion.surroundings import ObstacleRecord

_FORMAT = 1
_ARRAYS = ("time", "q", "v", "command", "solve_time")
_OBSTACLE_ARRAYS = ("points", "sizes", "radii", "pose")
_TASK_ARRAYS = ("error", "scale", "singular_values", "pose", "target")


def save(run: Run, path: Path) -> Path:
    """Write ``run``; the file appears whole or not at all."""
    if path.suffix not in ("", ".npz"):
        raise ParameterError(
            f"path ends in {path.suffix!r}; expected .npz (run.to_csv and run.to_parquet write tables)"
        )
    if path.is_dir():
        raise ParameterError(f"path is the folder {str(path)!r}; expected the name of a .npz file")
    path = path.with_suffix(".npz")
    arrays: dict[str, Any] = {name: getattr(run, name) for name in _ARRAYS}
    names = sorted(set(run.status))
    header: dict[str, Any] = {"format": _FORMAT, "meta": run.meta, "status": names, "tasks": []}
    codes = {name: i for i, name in enumerate(names)}
    arrays["status"] = np.array([codes[s] for s in run.status], dtype=np.int8)
    for i, task in enumerate(run.tasks):
        header["tasks"].append({"name": task.name, "kind": task.kind, "frame": task.frame, "units": task.units})
        header["tasks"][-1]["rows"] = task.rows
        arrays.update({f"task{i}_{n}": getattr(task, n) for n in _TASK_ARRAYS if getattr(task, n) is not None})
    if run.torque is not None:
        arrays["torque"] = run.torque
    if run.energy is not None:
        arrays.update({f"energy_{f.name}": getattr(run.energy, f.name) for f in fields(EnergyBooks)})
    header["obstacles"] = [{"name": record.name, "plane": record.plane} for record in run.obstacles]
    for i, record in enumerate(run.obstacles):
        arrays.update({f"obstacle{i}_{n}": getattr(record, n) for n in _OBSTACLE_ARRAYS})
    arrays["header"] = np.array(json.dumps(header))
    with whole_file(path) as part, part.open("wb") as file:
        np.savez_compressed(file, **arrays)
    return path


def load(path: Path) -> Run:
    """Read a run; raises RunFileError for anything else."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        header = json.loads(str(arrays["header"]))
        if header["format"] != _FORMAT:
            raise RunFileError(f"{path} has format {header['format']}; expected {_FORMAT}, as this version writes")
        tasks = [_task(i, entry, arrays) for i, entry in enumerate(header["tasks"])]
        status = [header["status"][code] for code in arrays["status"]]
        books = [arrays[f"energy_{f.name}"] for f in fields(EnergyBooks) if f"energy_{f.name}" in arrays]
        around = [_obstacle(i, entry, arrays) for i, entry in enumerate(header.get("obstacles", []))]
        _check(arrays, tasks, path, books, around)
        return Run(
            meta=header["meta"],
            status=status,
            tasks=tasks,
            torque=arrays.get("torque"),
            energy=EnergyBooks(*books) if books else None,
            obstacles=around,
            **{n: arrays[n] for n in _ARRAYS},
        )
    except FileNotFoundError:
        raise RunFileError(f"{path}: no such file; expected a .npz written by Run.save") from None
    except (KeyError, IndexError, TypeError, ValueError, EOFError, OSError, zipfile.BadZipFile) as error:
        if isinstance(error, RunFileError):
            raise
        raise RunFileError(
            f"{path} is not a saved run ({type(error).__name__}); expected a .npz written by Run.save"
        ) from None


def _task(i: int, entry: dict[str, Any], arrays: dict[str, Any]) -> TaskRecord:
    values: dict[str, Any] = {n: arrays.get(f"task{i}_{n}") for n in _TASK_ARRAYS}
    rows = entry.get("rows")
    if rows is not None and not all(type(row) is int and 0 <= row < 6 for row in rows):
        raise ValueError("rows of no pose")
    return TaskRecord(**entry, **values)


def _obstacle(i: int, entry: dict[str, Any], arrays: dict[str, Any]) -> ObstacleRecord:
    return ObstacleRecord(**entry, **{n: arrays[f"obstacle{i}_{n}"] for n in _OBSTACLE_ARRAYS})


def _check(
    arrays: dict[str, Any], tasks: list[TaskRecord], path: Path, books: list[Any], around: list[ObstacleRecord]
) -> None:
    """One length throughout and nothing but finite numbers; raises RunFileError."""
    samples, steps = len(arrays["time"]), len(arrays["command"])
    per_sample = [arrays[n] for n in ("time", "q", "v")]
    per_sample += books
    per_sample += [o.pose for o in around if len(o.pose) != 1]
    per_sample += [a for t in tasks for a in (t.error, t.singular_values, t.pose, t.target) if a is not None]
    per_step = [arrays["command"], arrays["solve_time"], arrays["status"], *(t.scale for t in tasks)]
    torques = [arrays["torque"]] if "torque" in arrays else []
    per_step += torques
    lengths = {len(a) for a in per_sample} == {samples} and {len(a) for a in per_step} == {steps}
    if not lengths or samples not in (steps + 1, 0):
        raise RunFileError(f"{path} holds arrays that do not belong together; expected N + 1 samples of N steps")
    placed = [x for o in around for x in (o.pose, o.points, o.radii)]
    scales = [np.nan_to_num(t.scale, nan=0.0) for t in tasks]  # nan where a task was skipped
    if not all(
        np.isfinite(a).all() for a in [*per_sample, arrays["command"], arrays["solve_time"], *torques, *scales, *placed]
    ):
        raise RunFileError(f"{path} holds nan or inf; expected the finite numbers that Run.save writes")
