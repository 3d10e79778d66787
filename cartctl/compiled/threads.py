"""How many threads compiled loops run on."""

from __future__ import annotations

import os
from typing import Any

from cartctl import checks


def thread_count(threads: Any) -> int:
    """``threads``, or all cores this process may use; raises ParameterError."""
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return checks.whole("threads", threads, 1)
