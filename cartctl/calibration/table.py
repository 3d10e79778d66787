"""Measurements from a CSV file: one row a measurement, every complaint with its row and column.

The header names the robot's joints and what was measured, in any order, each with its unit in brackets if that is not
rad or m: ``panda_joint1 [deg]``, ``x [mm]``.

    position   x y z              pose   x y z qx qy qz qw, the quaternion without unit
    distance   distance, and ax ay az for the anchor if it is not the origin
"""

from __future__ import annotations

import csv
import math
import os
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from cartctl.calibration.conversion import joints_to
from cartctl.calibration.written import FAR, WIDE
from cartctl.checks import FloatArray
from cartctl.errors import CartctlWarning, MeasurementError
from cartctl.model.robot import Robot

POSITION, QUATERNION, ANCHOR = ("x", "y", "z"), ("qx", "qy", "qz", "qw"), ("ax", "ay", "az")
_UNITS = {"rad": (1.0, "rad"), "deg": (math.pi / 180.0, "rad"), "m": (1.0, "m"), "mm": (1e-3, "m"), "cm": (1e-2, "m")}
_HEAD = re.compile(r"^\s*(.*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*$")
_MOST = 200_000  # rows


@dataclass(frozen=True, eq=False)
class MeasurementTable:
    """q: (N, nq) configurations of the robot. kind, values, anchor: as :func:`cartctl.calibrate` takes them."""

    kind: str
    q: FloatArray
    values: FloatArray
    anchor: FloatArray | None

    def __len__(self) -> int:
        return len(self.q)


def read_table(path: str | os.PathLike[str], robot: Robot, frame: str | None = None) -> MeasurementTable:
    """The measurements in a CSV file, of the chain to ``frame`` (the robot's tool).

    Joints that have no column stay where the robot's home is, if they do not move the frame. What looks like degrees or
    millimetres without saying so is one CartctlWarning. Raises MeasurementError naming file, row and column.
    """
    rows = _rows(Path(path))
    columns, factors = _header(f"{path}: row {rows[0][0]}", rows[0][1], robot)
    needed = [joint.name for joint in joints_to(robot, robot.tool if frame is None else frame)]
    kind = _kind(f"{path}: row {rows[0][0]}", columns, needed)
    table = _numbers(str(path), rows[1:], rows[0][1]) * np.array(factors)
    at = {name: table[:, k] for k, name in enumerate(columns) if name}
    _suspect(str(path), at, needed, robot)
    joints = [name for name in at if name in robot.single_joints]
    q = np.array([robot.configuration({n: float(at[n][i]) for n in joints}, robot.home) for i in range(len(table))])
    anchor = None
    if kind == "distance":
        values = at["distance"]
        anchor = _stack(at, ANCHOR) if "ax" in at else None
    else:
        values = _stack(at, (*POSITION, *QUATERNION) if kind == "pose" else POSITION)
    if kind == "pose":
        norm = np.linalg.norm(values[:, 3:], axis=1)
        bad = np.flatnonzero(np.abs(norm - 1.0) > 1e-2)
        if len(bad):
            i = int(bad[0])
            raise MeasurementError(
                f"{path}: row {rows[1 + i][0]}, columns qx qy qz qw: the quaternion has norm {norm[i]:.4g}; expected 1"
            )
    return MeasurementTable(kind, q, values, anchor)


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line numbers and cells of the lines that are neither empty nor a comment (#); at least a header and one more."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else "is no text in UTF-8"
        raise MeasurementError(f"{path}: {why}; expected a CSV file of measurements") from None
    reader = csv.reader(text.splitlines(), strict=True)
    rows = []
    try:
        for cells in reader:
            if any(c.strip() for c in cells) and not cells[0].lstrip().startswith("#"):
                rows.append((reader.line_num, cells))
    except csv.Error as error:
        raise MeasurementError(f"{path}: row {reader.line_num}: {error}; expected comma-separated values") from None
    if len(rows) < 2:
        raise MeasurementError(f"{path} holds {len(rows)} rows; expected a header and at least one measurement")
    if len(rows) > _MOST:
        raise MeasurementError(f"{path} holds {len(rows)} rows; expected at most {_MOST}")
    return rows


def _header(top: str, cells: Sequence[str], robot: Robot) -> tuple[list[str], list[float]]:
    """The name and the factor to m or rad of each column."""
    if len(cells) == 1 and re.search(r"[;\t]", cells[0]):
        raise MeasurementError(f"{top} has one column, {cells[0][:60]!r}; expected commas between columns")
    names, factors = list[str](), list[float]()
    for k, cell in enumerate(cells, start=1):
        match = _HEAD.match(cell)
        name, unit = (match[1], match[2]) if match else ("", None)
        where = f"{top}, column {k}"
        wanted = _wanted(name, robot)
        if wanted is None:
            known = [*robot.single_joints, *POSITION, *QUATERNION, "distance", *ANCHOR]
            offer = get_close_matches(name, known, n=3, cutoff=0.6) or [*known[:6], "..."] * (len(known) > 20) or known
            raise MeasurementError(f"{where}: unknown name {name!r}; expected one of {', '.join(offer)}")
        if name in names:
            raise MeasurementError(f"{where}: {name!r} stands there twice; expected each column once")
        factor, dimension = _UNITS.get(wanted if unit is None else unit, (1.0, "")) if wanted else (1.0, "")
        if dimension != wanted or (not wanted and unit):
            units = ", ".join(u for u, (_, d) in _UNITS.items() if d == wanted) or "none"
            raise MeasurementError(f"{where}: {name!r} has the unit {unit!r}; expected {units}")
        names.append(name)
        factors.append(factor)
    return names, factors


def _wanted(name: str, robot: Robot) -> str | None:
    """The dimension of a column, "" for none, None for a name that is unknown."""
    if name in robot.single_joints:
        return "m" if robot.is_prismatic(name) else "rad"
    if name in (*POSITION, *ANCHOR, "distance"):
        return "m"
    return "" if name in QUATERNION else None


def _kind(top: str, names: Sequence[str], needed: Sequence[str]) -> str:
    """What the columns hold; every joint that moves the frame must be among them."""
    missing = [name for name in needed if name not in names]
    if missing:
        raise MeasurementError(f"{top} lacks the joints {', '.join(missing)}; expected a column for each")
    groups = {"x y z": POSITION, "qx qy qz qw": QUATERNION, "ax ay az": ANCHOR}
    there = {}
    for label, group in groups.items():
        some = [name for name in group if name in names]
        if some and len(some) < len(group):
            lost = [name for name in group if name not in names]
            raise MeasurementError(f"{top} has {' '.join(some)} but not {' '.join(lost)}; expected {label}")
        there[label] = bool(some)
    measured = there["x y z"], "distance" in names
    if measured == (True, True) or not any(measured):
        what = "both x y z and distance" if all(measured) else "neither x y z nor distance"
        raise MeasurementError(f"{top} has {what}; expected one of them")
    if (there["qx qy qz qw"] and not measured[0]) or (there["ax ay az"] and not measured[1]):
        raise MeasurementError(f"{top}: qx qy qz qw belong to x y z, and ax ay az to distance; expected these")
    return "distance" if measured[1] else "pose" if there["qx qy qz qw"] else "position"


def _numbers(path: str, rows: Sequence[tuple[int, list[str]]], header: Sequence[str]) -> FloatArray:
    table = np.empty((len(rows), len(header)))
    for i, (line, cells) in enumerate(rows):
        if len(cells) != len(header):
            raise MeasurementError(f"{path}: row {line} has {len(cells)} columns; expected {len(header)}")
        for k, cell in enumerate(cells):
            try:
                table[i, k] = float(cell)
            except ValueError:
                table[i, k] = math.nan
            if not math.isfinite(table[i, k]):
                raise MeasurementError(
                    f"{path}: row {line}, column {k + 1} ({header[k].strip()}): {cell.strip()[:40]!r}; "
                    "expected a finite number"
                )
    return table


def _suspect(path: str, at: dict[str, FloatArray], needed: Sequence[str], robot: Robot) -> None:
    """Warn of what looks like another unit."""
    for name in needed:
        if not robot.is_prismatic(name) and float(np.abs(at[name]).max()) > WIDE:
            words = f"{name} reaches {np.abs(at[name]).max():.4g} rad; if these are degrees, write '{name} [deg]'"
            break
    else:
        far = [n for n in (*POSITION, "distance") if n in at and float(np.abs(at[n]).max()) > FAR]
        if not far:
            return
        words = f"{far[0]} reaches {np.abs(at[far[0]]).max():.4g} m; if these are millimetres, write '{far[0]} [mm]'"
    warnings.warn(f"{path}: {words} in the header", CartctlWarning, stacklevel=3)


def _stack(at: dict[str, FloatArray], names: Sequence[str]) -> FloatArray:
    return np.column_stack([at[name] for name in names])
