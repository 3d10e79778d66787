"""A direction of the task space that a measure looks along."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.objectives.frame_measure import FrameMeasure


@dataclass(frozen=True, eq=False)
class DirectionalMeasure(FrameMeasure):
    """A measure along ``along`` (m,), one number a row of ``axes``, any length but 0, angular ones times length."""

    along: Any = None
    _unit: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        rows = len(self._rows)
        if self.along is None:
            raise ParameterError(f"along is None; expected ({rows},) numbers, one a row of axes {self.axes!r}")
        d = checks.vector("along", self.along, rows)
        size = float(np.linalg.norm(d))
        if size == 0.0:
            raise ParameterError(f"along is {d}; expected a vector that is not zero")
        object.__setattr__(self, "along", d)
        object.__setattr__(self, "_unit", d / size)
