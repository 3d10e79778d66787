"""Velocity and force ellipsoids: what a ball of joint velocities or joint torques becomes at the hand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra.metric import Whitening, as_metric
from cartctl.algebra.svd import floor, numerical_rank, svd
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """``{sum_i y_i lengths_i axes_i : |y| <= 1}`` in a task space of dimension m.

    axes: (m, m), unit columns, orthogonal. lengths: (m,), semi-axes, longest first; 0 where nothing is possible, inf
    where anything is.
    """

    axes: FloatArray
    lengths: FloatArray

    @property
    def isotropy(self) -> float:
        """Shortest over longest semi-axis, in [0, 1]; 1 is a ball."""
        if not self.lengths.size:
            return 1.0
        longest = self.lengths[0]
        return float(self.lengths[-1] / longest) if 0.0 < longest < np.inf else 0.0

    @property
    def volume(self) -> float:
        """``pi^(m/2) / Gamma(m/2 + 1)`` times the product of the semi-axes."""
        m = self.lengths.size
        with np.errstate(over="ignore", under="ignore"):
            return float(math.pi ** (m / 2.0) / math.gamma(m / 2.0 + 1.0) * np.prod(self.lengths))

    def along(self, direction: Any) -> float:
        """How far the ellipsoid reaches along ``direction`` (m,): the transmission ratio of Chiu 1988.

        Raises ShapeError, NonFiniteError, ParameterError for the zero direction.
        """
        d = checks.vector("direction", direction, self.lengths.size)
        size = float(np.linalg.norm(d))
        if size == 0.0:
            raise ParameterError(f"direction is {d}; expected a vector that is not zero")
        parts = np.abs(self.axes.T @ (d / size))
        parts[parts < 1e-12] = 0.0  # round-off along an axis of length 0 would stop everything
        asked = parts > 0.0
        if (self.lengths[asked] == 0.0).any():
            return 0.0
        with np.errstate(over="ignore"):
            steepness = float(np.linalg.norm(parts[asked] / self.lengths[asked]))
        return 1.0 / steepness if steepness > 0.0 else np.inf


def velocity_ellipsoid(J: Any, metric: Any = None, tolerance: float | None = None) -> Ellipsoid:
    """``{J v : v^T W v <= 1}``: what unit joint velocities reach at the hand (Yoshikawa 1985).

    J: (m, n), any shape. metric: W, (n,) positive or (n, n) symmetric positive definite; identity. For joints of
    unlike speed ``1 / limits.velocity_upper**2``. tolerance: as in :func:`spectrum`. Axes are the left singular vectors
    of ``J W^-1/2``, lengths its singular values.

    Raises ShapeError, NonFiniteError, MetricError, ParameterError.
    """
    return Ellipsoid(*_principal(J, metric, tolerance))


def force_ellipsoid(J: Any, metric: Any = None, tolerance: float | None = None) -> Ellipsoid:
    """``{f : tau^T W^-1 tau <= 1, tau = J^T f}``: the forces that unit joint torques balance (Yoshikawa 1985).

    Arguments and errors as :func:`velocity_ellipsoid`, to which it is reciprocal: the same axes, one over the
    lengths; inf along the directions that a singular J has lost, which the structure itself carries. For joints of
    unlike strength W = ``limits.torque_upper**2``.
    """
    axes, lengths = _principal(J, metric, tolerance)
    with np.errstate(divide="ignore"):
        return Ellipsoid(np.ascontiguousarray(axes[:, ::-1]), 1.0 / lengths[::-1])


def _principal(J: Any, metric: Any, tolerance: float | None) -> tuple[FloatArray, FloatArray]:
    """All m left singular vectors of the whitened J, and m lengths: zeros where there is no singular value left."""
    A = checks.matrix("J", J)
    if metric is not None:
        A = Whitening(as_metric(metric, A.shape[1])).matrix(A)
    m = A.shape[0]
    transposed = svd(np.asfortranarray(A.T))  # its complete right basis is A's left one
    kept = numerical_rank(transposed.s, floor(A, tolerance))
    lengths = np.zeros(m)
    lengths[:kept] = transposed.s[:kept]
    return np.ascontiguousarray(transposed.Vt.T), lengths
