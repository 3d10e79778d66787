"""One over the manipulability: 1/w, w = sqrt(det(A A^T)) with A = R J D; what a path near a singularity costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cartctl.checks import FloatArray
from cartctl.objectives.frame_measure import FrameMeasure, Spread

_LEAST = 1e-9  # of the product of norms: below it w counts as this, so that 1/w stays finite


@dataclass(frozen=True, eq=False)
class InverseManipulability(FrameMeasure):
    """``1/w = 1/prod sigma_i`` of ``A = R J D`` (minimised): grows without bound towards a singularity.

    ``d(1/w)/dq = -(1/w^2) dw/dq``; frame, axes, length, scale and gain as in :class:`cartctl.Manipulability` (Yoshikawa
    1985). As an integral along a path it weighs a close pass at a singularity far more than the mean of w does. At a
    singularity itself, w counts as 1e-9 of the largest singular value's power.

    Raises ParameterError, NonFiniteError; FrameNotFound and ShapeError when a controller or a plan is made.
    """

    def measure(self, spread: Spread) -> float:
        """``1/w``, in one over the product of the units of the rows."""
        return 1.0 / max(float(np.prod(spread.s)), _floor(spread.s))

    def slope(self, spread: Spread) -> FloatArray:
        """``-1/w^2`` times the matrix of cofactors."""
        s = spread.s
        before, after = np.cumprod(np.append(1.0, s[:-1])), np.cumprod(np.append(1.0, s[:0:-1]))[::-1]
        return (spread.U * (-before * after * self.measure(spread) ** 2)) @ spread.V.T  # type: ignore[no-any-return]


def _floor(s: FloatArray) -> float:
    return max(_LEAST * float(s[0]) ** len(s), 1e-150)
