"""What one task is to the loops: a named tuple of views into a store."""

from __future__ import annotations

from typing import NamedTuple

from cartctl.checks import FloatArray, IntArray

FRAME, JOINTS = 0, 1  # kinds of tasks


class Task(NamedTuple):
    """A frame task, or joints: how its rows are taken from the six of its frame, or from the coordinates."""

    kind: int
    joint: int
    waits: bool
    pose: FloatArray  # (12,) of its frame
    row: IntArray  # (m,) of the six, or tangent coordinates
    unit: FloatArray  # (m,) what a row is multiplied by
