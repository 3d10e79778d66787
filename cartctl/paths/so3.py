"""Rotations along a path: the geodesic between two, and the exact rates of a moving rotation vector."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from cartctl.paths.arguments import Array, frozen

_TERMS = range(9)
# b = (1 - cos x)/x^2, c = (x - sin x)/x^3, (db/dx)/x and (dc/dx)/x as series in x^2, highest power first
_B = [(-1) ** k / math.factorial(2 * k + 2) for k in reversed(_TERMS)]
_C = [(-1) ** k / math.factorial(2 * k + 3) for k in reversed(_TERMS)]
_DB = [2 * k * b for k, b in zip(reversed(_TERMS), _B, strict=True)][:-1]
_DC = [2 * k * c for k, c in zip(reversed(_TERMS), _C, strict=True)][:-1]


class Turn:
    """The geodesic R(s) = R0 exp(s phi), phi = log(R0^T R1), s in [0, 1]: one axis, fixed in the world.

    ``vector`` (3,) rad is that axis times the angle in world axes, R0 phi: the angular velocity is
    ``vector`` ds/dt.
    """

    def __init__(self, first: Array, last: Array) -> None:
        phi = pin.log3(first.T @ last)
        if np.linalg.norm(phi) < 1e-14:  # the round-off of R^T R: nothing turns, exactly
            phi = np.zeros(3)
        self.angle = float(np.linalg.norm(phi))
        self.vector: tuple[float, float, float] = tuple((first @ phi).tolist())
        # Rodrigues: R0 (I + sin K + (1 - cos) K^2), K the unit axis' cross matrix
        K = pin.skew(phi / self.angle) if self.angle > 0.0 else np.zeros((3, 3))
        self._first, self._sine, self._versine = frozen(first), first @ K, first @ K @ K

    def __call__(self, s: float) -> Array:
        """Return R(s), (3, 3); read-only where nothing turns."""
        if self.angle == 0.0:
            return self._first
        angle = s * self.angle
        half = math.sin(0.5 * angle)
        rotation: Array = self._sine * math.sin(angle)
        rotation += self._versine * (2.0 * half * half)
        rotation += self._first
        return rotation


def left_rates(theta: Array, rate: Array, rate_dot: Array) -> tuple[Array, Array]:
    """Angular velocity and acceleration of exp(theta(t)) in the fixed axes, each (3,).

    omega = J rate, alpha = J rate_dot + J_dot rate, with J = I + b [theta] + c [theta]^2 the left Jacobian of
    SO(3), b = (1 - cos x)/x^2, c = (x - sin x)/x^3, x = |theta| (Sola, Deray & Atchuthan 2018, appendix B).
    """
    x, y, z = theta.tolist()
    v, w = rate.tolist(), rate_dot.tolist()
    b, c, db, dc = _series(x * x + y * y + z * z)
    along = x * v[0] + y * v[1] + z * v[2]
    n, m = _cross((x, y, z), v), _cross((x, y, z), w)
    nn, mm, vn = _cross((x, y, z), n), _cross((x, y, z), m), _cross(v, n)
    db, dc = db * along, dc * along
    omega = [v[i] + b * n[i] + c * nn[i] for i in range(3)]
    alpha = [w[i] + b * m[i] + c * (mm[i] + vn[i]) + db * n[i] + dc * nn[i] for i in range(3)]
    return np.array(omega), np.array(alpha)


def right_rates(theta: Array, rate: Array, rate_dot: Array) -> tuple[Array, Array]:
    """Angular velocity and acceleration of exp(theta(t)) in the moving axes, each (3,)."""
    omega, alpha = left_rates(-theta, -rate, -rate_dot)
    return -omega, -alpha


def vector_rates(theta: Array, omega: Array, alpha: Array) -> tuple[Array, Array]:
    """Invert :func:`right_rates`: d theta/dt and its derivative; |theta| < 2 pi."""
    J = pin.Jexp3(theta)
    rate = np.linalg.solve(J, omega)
    _, bias = right_rates(theta, rate, np.zeros(3))
    return rate, np.linalg.solve(J, alpha - bias)


def _cross(a: tuple[float, ...] | list[float], b: tuple[float, ...] | list[float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _series(square: float) -> tuple[float, float, float, float]:
    """b, c, (db/dx)/x, (dc/dx)/x at x^2; the closed forms cancel below x = 1, the series is exact there."""
    if square < 1.0:
        return _horner(_B, square), _horner(_C, square), _horner(_DB, square), _horner(_DC, square)
    x = math.sqrt(square)
    a, b, c = math.sin(x) / x, (1.0 - math.cos(x)) / square, (x - math.sin(x)) / (square * x)
    return b, c, (a - 2.0 * b) / square, (b - 3.0 * c) / square


def _horner(coefficients: list[float], x: float) -> float:
    value = 0.0
    for coefficient in coefficients:
        value = value * x + coefficient
    return value
