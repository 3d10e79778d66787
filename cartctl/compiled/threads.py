"""How many threads compiled loops run on."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from cartctl.errors import ParameterError


def thread_count(threads: Any) -> int:
    """``threads``, or all cores this process may use; raises ParameterError."""
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return whole("threads", threads, 1)


def whole(name: str, value: Any, least: int) -> int:
    """``value`` as a whole number of at least ``least``; raises ParameterError."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise ParameterError(f"{name} is {value!r}; expected a whole number of at least {least}")
    return int(value)
