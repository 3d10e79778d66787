"""Circles and ellipses with the laws of time this package has, worked out in the kernels.

A path of anybody else's is asked itself; asked from Python, a circle takes as long as all the rest of a step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cartctl.checks import FloatArray
from cartctl.compiled.curve_kernel import LENGTH, START_ANGLE
from cartctl.paths.base import Path
from cartctl.paths.loop import Loop, PlaneLoop
from cartctl.paths.timing import Quintic, SmoothTrapezoid


def curve_of(path: Any) -> FloatArray | None:
    """Whether it leaves the orientation open, then its figures (24,); None for a path that is to be asked itself."""
    if not isinstance(path, PlaneLoop) or type(path._law) not in (Quintic, SmoothTrapezoid):
        return None
    kind = type(path)
    if (kind.__call__, kind._sample, kind._progress) != (Loop.__call__, PlaneLoop._sample, Path._progress):
        return None
    held, law = path._rotation, path._law
    figures = np.zeros(25)
    figures[0] = held is None
    figures[1:10] = path._curve
    figures[10:19] = np.eye(3).ravel() if held is None else held.ravel()
    ramp = law.ramp if isinstance(law, SmoothTrapezoid) else 0.0
    figures[1 + START_ANGLE : 1 + LENGTH] = path.start_angle, path._phase, path.duration, ramp
    return figures
