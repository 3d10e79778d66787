"""A pose spline: C2 in SE(3), through given poses at given times, at rest at both ends."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin
from scipy.interpolate import make_interp_spline

from cartctl.errors import PathError
from cartctl.paths.arguments import Array, Placement
from cartctl.paths.base import PathSample, linear
from cartctl.paths.so3 import left_rates, vector_rates


class PoseSegment:
    """Between two waypoints: p(x) and theta(x) quintics of the time x (s) since the first, R = R0 exp(theta).

    ``coefficients`` (6, 3) or (6, 6): row k goes with x^k, columns are p (m) and, where there is one, theta
    (rad).
    """

    def __init__(self, coefficients: Array, rotation: Array | None) -> None:
        self._coefficients, self._rotation = coefficients, rotation

    def __call__(self, x: float) -> PathSample:
        """Return the sample at x seconds after the segment's first waypoint."""
        x2 = x * x
        x3, x4 = x2 * x, x2 * x2
        powers = (1.0, x, x2, x3, x4, x4 * x)
        slopes = (0.0, 1.0, 2.0 * x, 3.0 * x2, 4.0 * x3, 5.0 * x4)
        bends = (0.0, 0.0, 2.0, 6.0 * x, 12.0 * x2, 20.0 * x3)
        value, rate, rate_dot = np.array((powers, slopes, bends)) @ self._coefficients
        if self._rotation is None:
            return PathSample(value, None, linear(rate), linear(rate_dot))
        rotation = self._rotation @ pin.exp3(value[3:])
        omega, alpha = left_rates(value[3:], rate[3:], rate_dot[3:])
        rate[3:], rate_dot[3:] = self._rotation @ omega, self._rotation @ alpha
        return PathSample(value[:3], rotation, rate, rate_dot)


def pose_spline(waypoints: list[Placement], times: Array) -> list[PoseSegment]:
    """Return the segments between waypoints, n - 1 of them.

    Positions: the minimum-jerk spline (quintic, C4, velocity and acceleration zero at both ends; Todorov &
    Jordan 1998). Rotations: the same spline through the rotations unrolled along the path, that is through
    the sums of phi_k = log(R_k^T R_k+1), gives angular velocity and acceleration (body axes) at every
    waypoint; each segment is the quintic in its own rotation vector that meets them exactly. Hence C2
    everywhere, and the minimum-jerk spline itself for turns about one axis.

    Raises PathError where times are too uneven for a spline.
    """
    positions = np.array([w.position for w in waypoints])
    states = np.stack((positions, *_knot_rates(positions, times)), axis=1)  # (n, 3 derivatives, 3)
    gaps = np.diff(times).tolist()
    spans = [_quintic(h, start, end) for h, (start, end) in zip(gaps, pairwise(states), strict=True)]
    rotations = [w.rotation for w in waypoints if w.rotation is not None]
    if not rotations:
        return [PoseSegment(span, None) for span in spans]
    steps = [pin.log3(first.T @ last) for first, last in pairwise(rotations)]
    omegas, alphas = _knot_rates(np.cumsum([np.zeros(3), *steps], axis=0), times)
    segments = []
    for k, (h, phi) in enumerate(zip(gaps, steps, strict=True)):
        start = np.array((np.zeros(3), omegas[k], alphas[k]))
        end = np.array((phi, *vector_rates(phi, omegas[k + 1], alphas[k + 1])))
        segments.append(PoseSegment(np.hstack((spans[k], _quintic(h, start, end))), rotations[k]))
    return segments


def _knot_rates(values: Array, times: Array) -> tuple[Array, Array]:
    """First and second time derivatives (n, d) of the minimum-jerk spline at its knots."""
    span = float(times[-1] - times[0])
    knots = (times - times[0]) / span  # normalised, for the condition of the collocation matrix
    rest = [(1, np.zeros(values.shape[1])), (2, np.zeros(values.shape[1]))]
    try:
        spline = make_interp_spline(knots, values, k=5, bc_type=(rest, rest))
        rates, rate_dots = spline(knots, 1) / span, spline(knots, 2) / span**2
    except (np.linalg.LinAlgError, ValueError):
        rates = rate_dots = np.full(values.shape, np.nan)
    if not (np.isfinite(rates).all() and np.isfinite(rate_dots).all()):
        gaps = np.diff(times)
        raise PathError(
            f"Waypoints times have gaps from {gaps.min():.3g} to {gaps.max():.3g} s: expected more even ones"
        )
    rates[[0, -1]] = rate_dots[[0, -1]] = 0.0  # rest to the last bit
    return rates, rate_dots


def _quintic(h: float, start: Array, end: Array) -> Array:
    """Coefficients (6, d), lowest power first, of the quintic with value, rate and rate_dot at 0 and at h."""
    p, v, a = start
    dp, dv, da = end[0] - p - v * h - a * (0.5 * h * h), end[1] - v - a * h, end[2] - a
    c3 = (10.0 * dp - 4.0 * dv * h + 0.5 * da * h**2) / h**3
    c4 = (-15.0 * dp + 7.0 * dv * h - da * h**2) / h**4
    c5 = (6.0 * dp - 3.0 * dv * h + 0.5 * da * h**2) / h**5
    return np.array((p, v, 0.5 * a, c3, c4, c5))
