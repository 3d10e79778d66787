"""Manipulability: w = sqrt(det(A A^T)), the product of the singular values of A = R J D."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cartctl.checks import FloatArray
from cartctl.objectives.frame_measure import FrameMeasure, Spread


@dataclass(frozen=True, eq=False)
class Manipulability(FrameMeasure):
    """How well the frame can move in all directions at once (maximised; Yoshikawa 1985).

    ``w = sqrt(det(A A^T)) = prod sigma_i`` with ``A = R J D``, proportional to the volume of the velocity ellipsoid
    (``sqrt(det(A^T A))`` where A has more rows than columns). ``dw/dq_i = w tr((A A^T)^-1 A dA_i^T)``, worked out as
    ``sum_k (prod_{l != k} sigma_l) u_k^T dA_i v_k``, in which nothing is divided by a singular value: at a singularity,
    where w has a kink, it is finite and one of the directions in which w grows; zero where two directions are lost.

    frame: the robot's tool if None. axes: which rows, as in :class:`cartctl.FrameTask`, in world axes. length: m per
    rad, makes angular rows comparable with linear ones. scale: diag D (nv,), >= 0, the joint rates that count as 1;
    None is 1 each, ``"limits"`` the velocity limits. gain: k > 0, (rad/s) per unit of the gradient.

    Raises ParameterError, NonFiniteError; FrameNotFound and ShapeError when a controller is made.
    """

    maximise = True

    def measure(self, spread: Spread) -> float:
        """``w``, in the product of the units of the rows: m^a (R of angular rows included) for joints in rad."""
        return float(np.prod(spread.s))

    def slope(self, spread: Spread) -> FloatArray:
        """``U diag(prod_{l != k} sigma_l) V^T``, the matrix of cofactors in these bases."""
        s = spread.s
        before, after = np.cumprod(np.append(1.0, s[:-1])), np.cumprod(np.append(1.0, s[:0:-1]))[::-1]
        return (spread.U * (before * after)) @ spread.V.T  # type: ignore[no-any-return]
