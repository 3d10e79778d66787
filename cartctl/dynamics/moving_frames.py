"""The moving-frames recursion: velocities of each link in its own frame, then kinetic energy and mass matrix.

With sigma_i = 0 for a revolute, 1 for a prismatic joint, z = (0, 0, 1) and everything of link i in frame i

    omega_i = R_i^T (omega_{i-1} + (1 - sigma_i) dq_i z)
    v_i     = R_i^T (v_{i-1} + sigma_i dq_i z) + omega_i x r_i        r_i from the origin of frame i-1 to frame i
    v_ci    = v_i + omega_i x r_ci
    T_i     = 1/2 m_i v_ci^T v_ci + 1/2 omega_i^T I_ci omega_i        (Koenig)

(De Luca, Robotics 2). A prismatic link behind a revolute joint turns with it: omega_i is then R_i^T omega_{i-1}, not 0.
The recursion runs on the columns that multiply dq, (3, n) matrices, so that M = sum_i m_i V_ci^T V_ci + W_i^T I_ci W_i.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.dynamics.dh import DHArm
from cartctl.errors import ParameterError


class Algebra(NamedTuple):
    """What the recursion needs of its entries, floats or sums of sines and cosines."""

    read: Callable[[float | str], Any]  # an entry of the table
    cos_sin: Callable[[float | str, Any], tuple[Any, Any]]  # of an entry of the table plus a coordinate (or None)
    coordinate: Callable[[int], Any]  # q_i
    lump: Callable[[Any], Any]  # a length to be kept as it is


class Columns(NamedTuple):
    """One link in its own frame: omega = angular @ dq, v = linear @ dq, v_c = com @ dq; (3, n) each."""

    angular: Any
    linear: Any
    com: Any
    mass: Any
    inertia: Any  # (3, 3)
    rotor: Any

    def mass_matrix(self) -> Any:
        """``m V_c^T V_c + W^T I_c W`` (n, n), without the rotor's."""
        return self.com.T @ (self.mass * self.com) + self.angular.T @ (self.inertia @ self.angular)


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """One link in its own frame. angular, linear, com: (3,), rad/s and m/s. kinetic: T_i with its rotor's, J."""

    angular: FloatArray
    linear: FloatArray
    com: FloatArray
    kinetic: float


@dataclass(frozen=True, eq=False)
class MovingFrames:
    """links: a LinkMotion each. kinetic: T = sum T_i, J. mass_matrix: (n, n), T = 1/2 dq^T M dq."""

    links: tuple[LinkMotion, ...]
    kinetic: float
    mass_matrix: FloatArray


def moving_frames(arm: DHArm, q: Any, dq: Any) -> MovingFrames:
    """The recursion in numbers at q (n,), dq (n,), for a table of numbers.

    Raises ParameterError where the table holds names, ShapeError, NonFiniteError.
    """
    DHArm.check(arm)
    if arm.names:
        raise ParameterError(f"the table holds the names {sorted(arm.names)}; give them values by arm.with_values(...)")
    angles = checks.vector("q", q, arm.n, largest=checks.LARGEST)
    rates = checks.vector("dq", dq, arm.n, largest=checks.LARGEST)
    arm, links, M = arm.with_values(), [], np.zeros((arm.n, arm.n))
    for i, columns in enumerate(recursion(arm, _numbers(angles))):
        own = columns.mass_matrix()
        own[i, i] += columns.rotor
        M += own
        angular, linear, com = (np.array(part @ rates) for part in (columns.angular, columns.linear, columns.com))
        links.append(LinkMotion(angular, linear, com, kinetic=0.5 * float(rates @ own @ rates)))
    return MovingFrames(tuple(links), sum(link.kinetic for link in links), M)


def recursion(arm: DHArm, algebra: Algebra) -> Iterator[Columns]:
    """Each link's columns, from the base up, in whatever numbers ``algebra`` has."""
    read, n = algebra.read, arm.n
    zero, one = read(0.0), read(1.0)
    W = V = np.full((3, n), zero)
    for i, link in enumerate(arm.links):
        turning = link.joint == "R"
        q = algebra.coordinate(i)
        c, s = algebra.cos_sin(link.theta, q if turning else None)
        ca, sa = algebra.cos_sin(link.alpha, None)
        R = np.array([[c, -s * ca, s * sa], [s, c * ca, -c * sa], [zero, sa, ca]])
        a, d = read(link.a), read(link.d) if turning else read(link.d) + q
        z = np.full((3, n), zero)
        z[2, i] = one
        W = R.T @ (W + z) if turning else R.T @ W
        carried = R.T @ V if turning else R.T @ (V + z)
        r = np.array([a, d * sa, d * ca])  # from frame i-1 to frame i, in frame i: without q_i if the joint turns
        arm_ = np.array([algebra.lump(x + read(y)) for x, y in zip(r, link.com, strict=True)])
        V = carried + _turned(W, r, zero)
        inertia = np.array([[read(x) for x in row] for row in link.inertia_matrix])
        yield Columns(W, V, carried + _turned(W, arm_, zero), read(link.mass), inertia, read(link.rotor))


def centres(arm: DHArm, algebra: Algebra) -> Iterator[tuple[Any, Any]]:
    """``(m_i, r_ci)``: each mass and its centre, (3,) in frame 0."""
    zero, one = algebra.read(0.0), algebra.read(1.0)
    R, p = np.array([[one if i == j else zero for j in range(3)] for i in range(3)]), np.array([zero] * 3)
    for i, link in enumerate(arm.links):
        turning = link.joint == "R"
        q = algebra.coordinate(i)
        c, s = algebra.cos_sin(link.theta, q if turning else None)
        ca, sa = algebra.cos_sin(link.alpha, None)
        a, d = algebra.read(link.a), algebra.read(link.d) if turning else algebra.read(link.d) + q
        R = R @ np.array([[c, -s * ca, s * sa], [s, c * ca, -c * sa], [zero, sa, ca]])
        r = (a, d * sa, d * ca)
        com = np.array([algebra.lump(x + algebra.read(y)) for x, y in zip(r, link.com, strict=True)])
        yield algebra.read(link.mass), p + R @ com
        p = p + R @ np.array(r)


def _turned(W: Any, r: Any, zero: Any) -> Any:
    """``omega x r`` for each column: ``-S(r) W``."""
    x, y, z = r
    return np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]]) @ W


def _numbers(q: FloatArray) -> Algebra:
    def cos_sin(angle: float | str, more: Any) -> tuple[Any, Any]:
        total = float(angle) + (0.0 if more is None else more)
        return np.cos(total), np.sin(total)

    return Algebra(float, cos_sin, lambda i: float(q[i]), float)
