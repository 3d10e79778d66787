"""The smallest singular value: how near the frame is to losing a direction."""

from __future__ import annotations

from dataclasses import dataclass

from cartctl.checks import FloatArray
from cartctl.objectives.frame_measure import FrameMeasure, Spread

_EQUAL = 1e-9  # of the largest: singular values this near to each other coincide


@dataclass(frozen=True, eq=False)
class SmallestSingularValue(FrameMeasure):
    """The speed of the frame, in its worst direction, at joint rates of norm 1 (maximised; Klein & Blaho 1987).

    ``H = sigma_min(A)``, ``dH/dq_i = u^T dA_i v`` with its singular vectors. Where several singular values coincide, H
    has a kink, and the gradient is the mean of theirs: a member of the generalised gradient (Clarke 1983) that does not
    depend on the choice of vectors. frame, axes, length, scale, gain as in :class:`cartctl.Manipulability`.
    """

    maximise = True

    def measure(self, spread: Spread) -> float:
        """``sigma_min`` of the min(m, n) singular values, m/s per rad/s (per unit of D)."""
        return float(spread.s[-1])

    def slope(self, spread: Spread) -> FloatArray:
        """``u v^T``, the mean of those that coincide."""
        return mean_of(spread, spread.s[-1])


def mean_of(spread: Spread, sigma: float) -> FloatArray:
    """The mean of ``u_k v_k^T`` over the singular values that are ``sigma`` up to round-off."""
    equal = abs(spread.s - sigma) <= _EQUAL * spread.s[0]
    return spread.U[:, equal] @ spread.V[:, equal].T / equal.sum()  # type: ignore[no-any-return]
