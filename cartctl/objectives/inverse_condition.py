"""One over the condition number: how evenly the frame moves in all directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cartctl.checks import FloatArray
from cartctl.objectives.frame_measure import FrameMeasure, Spread
from cartctl.objectives.smallest_singular_value import mean_of


@dataclass(frozen=True, eq=False)
class InverseCondition(FrameMeasure):
    """How near the frame is to moving alike in all directions (maximised; Salisbury & Craig 1982).

    ``H = 1/kappa = sigma_min / sigma_max`` of ``A = R J D``, in [0, 1]: 1 where A is isotropic, 0 where it is singular
    and the condition number kappa is infinite. ``dH/dq_i = (u_min^T dA_i v_min - H u_max^T dA_i v_max) / sigma_max``,
    so that ``grad kappa = -kappa^2 grad H``; where singular values coincide, as in
    :class:`cartctl.SmallestSingularValue`. frame, axes, length, scale, gain as in :class:`cartctl.Manipulability`.
    """

    maximise = True

    def measure(self, spread: Spread) -> float:
        """``1/kappa``, no unit."""
        largest = float(spread.s[0])
        return float(spread.s[-1]) / largest if largest > 0.0 else 0.0

    def slope(self, spread: Spread) -> FloatArray:
        """The quotient rule; 0 where A is 0."""
        largest = float(spread.s[0])
        if largest == 0.0:
            return np.zeros((spread.U.shape[0], spread.V.shape[0]))
        return (mean_of(spread, spread.s[-1]) - self.measure(spread) * mean_of(spread, spread.s[0])) / largest
