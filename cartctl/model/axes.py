"""Which rows of a pose are meant: "pose", "position", "orientation", "xy", "z rx ry", or a mask."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from cartctl.errors import ParameterError

_NAMES = ("x", "y", "z", "rx", "ry", "rz")
_NAMED = {"pose": (0, 1, 2, 3, 4, 5), "position": (0, 1, 2), "orientation": (3, 4, 5)}


def pose_rows(axes: Any, size: int = 6) -> tuple[int, ...]:
    """Row numbers (0-2 linear x y z, 3-5 angular) of ``axes``; size 3 allows positions only.

    Raises ParameterError.
    """
    rows = _named(axes) if isinstance(axes, str) else _masked(axes, size)
    if not rows or any(r >= size for r in rows):
        allowed = "'pose', 'position', 'orientation', 'z rx ry', " if size == 6 else "'position', "
        raise ParameterError(
            f"axes is {axes!r}; expected {allowed}letters such as 'xy', "
            f"or a mask of {size} booleans with at least one True"
        )
    return rows


def _named(axes: str) -> tuple[int, ...]:
    if axes in _NAMED:
        return _NAMED[axes]
    text = re.sub(r"[\s,]+", "", axes.lower())
    tokens = re.findall(r"r?[xyz]", text)
    if "".join(tokens) != text or len(set(tokens)) != len(tokens):
        return ()
    return tuple(sorted(_NAMES.index(token) for token in tokens))


def _masked(axes: Any, size: int) -> tuple[int, ...]:
    try:
        mask = np.asarray(axes)
        if mask.shape != (size,) or mask.dtype.kind not in "biuf" or not np.isin(mask, (0, 1)).all():
            return ()
    except (TypeError, ValueError):
        return ()
    return tuple(int(i) for i in np.flatnonzero(mask))
