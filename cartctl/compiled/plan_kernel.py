"""What one task is to the loops: a named tuple of views into the plan's arrays."""

from __future__ import annotations

from typing import NamedTuple

from cartctl.checks import FloatArray, IntArray

FRAME, JOINTS = 0, 1  # kinds of tasks

# columns of the table of tasks
KIND, COUNT, FITTED, WEIGHT, OPEN_POSITION, OPEN_ROTATION, PATH, WAITS, WHOLE = 0, 1, 2, 3, 4, 5, 6, 7, 8
TASK_WIDTH = 9

# columns of the table of rows
INDEX, ROW_GAIN, UNIT, TURNING, POINT = 0, 1, 2, 3, 4
ROW_WIDTH = 5


class Task(NamedTuple):
    """A frame task, or joints: how its rows are taken from the six of its frame, or from the coordinates."""

    kind: int
    joint: int
    waits: bool
    pose: FloatArray  # (12,) of its frame
    row: IntArray  # (m,) of the six, or tangent coordinates
    unit: FloatArray  # (m,) what a row is multiplied by
