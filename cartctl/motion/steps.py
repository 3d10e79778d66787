"""How many steps a duration takes."""

from __future__ import annotations

from typing import Any

import numpy as np

from cartctl.errors import ParameterError, TimeStepError

_MOST = 10_000_000  # steps a rollout records
_MOST_PARTS = 10_000  # of one step


def whole_steps(duration: float, dt: float) -> int:
    """Whole steps that cover the duration, forgiving the round-off of duration / dt; raises TimeStepError."""
    wanted = np.ceil(duration / dt - 1e-9)
    if not wanted <= _MOST:
        raise TimeStepError(
            f"duration {duration:g} s in steps of dt = {dt:g} s is {wanted:.3g} steps; expected at most {_MOST:.0e}: "
            "a larger dt, or several rollouts"
        )
    steps = int(wanted)
    if steps < 1:
        raise TimeStepError(f"duration is {duration:g} s; expected at least one step of {dt:g} s")
    return steps


def parts(substeps: Any) -> int:
    """``substeps`` as a whole number; raises ParameterError."""
    if isinstance(substeps, bool) or not isinstance(substeps, (int, np.integer)) or not 1 <= substeps <= _MOST_PARTS:
        raise ParameterError(f"substeps is {substeps!r}; expected a whole number from 1 to {_MOST_PARTS}")
    return int(substeps)
