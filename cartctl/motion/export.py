"""Runs as tables: one row a sample, for pandas, R, a spreadsheet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from cartctl.files import whole_file
from cartctl.motion.run import Run

_COMMANDS = {"acceleration": "acceleration command", "torque": "torque command"}  # velocities are the plain "command"


def table(run: Run) -> pa.Table:
    """A pyarrow Table; what belongs to a step is null in the row after the last one."""
    columns: dict[str, Any] = {"time [s]": run.time}
    columns |= {f"q{i}": run.q[:, i] for i in range(run.q.shape[1])}
    joints = run.meta.get("joints") or [f"dof{i}" for i in range(run.v.shape[1])]
    columns |= {f"v {name}": run.v[:, i] for i, name in enumerate(joints)}
    told = _COMMANDS.get(str(run.meta.get("level")), "command")
    columns |= {f"{told} {name}": _padded(run.command[:, i]) for i, name in enumerate(joints)}
    for task in run.tasks:
        for i, unit in enumerate(task.units):
            columns[f"{task.name} error{i}" + (f" [{unit}]" if unit else "")] = task.error[:, i]
        columns |= {f"{task.name} sigma{i}": task.singular_values[:, i] for i in range(task.singular_values.shape[1])}
        columns[f"{task.name} scale"] = _padded(task.scale)
        for label, poses in (("pose", task.pose), ("target", task.target)):
            if poses is not None:
                parts = ("x", "y", "z", "qx", "qy", "qz", "qw")[: poses.shape[1]]
                columns |= {f"{task.name} {label} {part}": poses[:, i] for i, part in enumerate(parts)}
    if run.torque is not None:
        columns |= {f"torque {name}": _padded(run.torque[:, i]) for i, name in enumerate(joints)}
    if run.energy is not None:
        books = {"kinetic energy": "kinetic", "potential energy": "potential", "work of motors": "motors"}
        books |= {"work lost in friction": "friction", "work of wrenches": "wrenches", "residual": "residual"}
        columns |= {f"{title} [J]": getattr(run.energy, name) for title, name in books.items()}
    columns["status"] = [*run.status, None] if len(run.time) else []
    columns["solve time [s]"] = _padded(run.solve_time)
    return pa.table(columns)


def to_csv(run: Run, path: Path) -> Path:
    """Write the table as CSV."""
    with whole_file(path) as part:
        pyarrow.csv.write_csv(table(run), str(part))
    return path


def to_parquet(run: Run, path: Path) -> Path:
    """Write the table as Parquet."""
    with whole_file(path) as part:
        pyarrow.parquet.write_table(table(run), str(part))
    return path


def _padded(values: Any) -> pa.Array:
    """One value a step, and a null for the state after the last."""
    return pa.concat_arrays([pa.array(np.asarray(values, dtype=np.float64)), pa.nulls(1, pa.float64())])
