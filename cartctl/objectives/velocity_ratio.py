"""How fast the frame moves along one direction: the radius of the velocity ellipsoid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cartctl.checks import FloatArray
from cartctl.objectives.directional import DirectionalMeasure
from cartctl.objectives.frame_measure import Spread

_ABSENT = 1e-12  # parts of the direction below this are round-off


@dataclass(frozen=True, eq=False)
class VelocityRatio(DirectionalMeasure):
    """The speed of the frame in one direction at joint rates of norm 1 (maximised; Chiu 1988).

    ``H = (d^T (A A^T)^-1 d)^-1/2``, d the unit direction: how far the velocity ellipsoid of ``A = R J D`` reaches.
    ``dH/dq_i = H^3 x^T dA_i A^T x`` with ``x = (A A^T)^-1 d``. With ``t_k = H d_k / sigma_k``, a unit vector, this is
    ``sum_kl (H/sigma_k) t_k t_l u_k^T dA_i v_l``, where H/sigma_k has a limit as sigma_k goes to 0: at a singularity
    that takes d away, H = 0 and the gradient is finite.

    along: (m,), the direction, one number a row of ``axes``, any length but 0. frame, axes, length, scale, gain as in
    :class:`cartctl.Manipulability`. Raises ParameterError, ShapeError, NonFiniteError.
    """

    maximise = True

    def measure(self, spread: Spread) -> float:
        """``H``, m/s per rad/s (per unit of D); 0 where d is out of reach."""
        parts, s, _ = self._along(spread)
        return _radius(parts, s)[0] if s.size else 0.0

    def slope(self, spread: Spread) -> FloatArray:
        """``H^3 x (A^T x)^T``; 0 where d is out of reach however the joints move."""
        parts, s, asked = self._along(spread)
        F = np.zeros((spread.U.shape[0], spread.V.shape[0]))
        if not s.size:
            return F
        shares = _radius(parts, s)[1]  # H / sigma_k
        t = shares * parts
        return (spread.U[:, asked] @ (shares * t))[:, None] * (spread.V[:, asked] @ t)

    def _along(self, spread: Spread) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The parts of d along the u_k, their sigma_k, and which of them; none where d leaves the range of U."""
        parts = spread.U.T @ self._unit
        asked = np.abs(parts) > _ABSENT
        if np.linalg.norm(self._unit - spread.U @ parts) > _ABSENT:
            asked[:] = False
        return parts[asked], spread.s[asked], asked


def _radius(parts: FloatArray, s: FloatArray) -> tuple[float, FloatArray]:
    """``H = |parts / s|^-1`` and ``H / s``, by the ratios of the s to the smallest: 0 may be among them."""
    smallest = s.min()
    ratios = smallest / s if smallest > 0.0 else (s == 0.0).astype(np.float64)
    size = float(np.linalg.norm(ratios * parts))
    return float(smallest) / size, ratios / size
