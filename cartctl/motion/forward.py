"""Forward dynamics, step by step: semi-implicit Euler and Runge-Kutta of fourth order, with the books of energy.

Over a step the torque is held. The books are integrated beside the motion: the work of the motors ``int tau . v dt``,
the friction losses ``int f(v) . v dt`` and the work of wrenches ``int (J^T w) . v dt``. They must balance,

    (T + U) - (T + U)(0) = motors - friction + wrenches,

and what is left over, the residual, is the error of the integrator.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray
from cartctl.motion.plant import Body


class Work(NamedTuple):
    """Energies since the beginning, J: from the motors, lost in friction, from wrenches."""

    motors: float = 0.0
    friction: float = 0.0
    wrenches: float = 0.0


class Advanced(NamedTuple):
    """Where a step leads: configuration (nq,), velocity (nv,), and the work done so far."""

    q: FloatArray
    v: FloatArray
    work: Work


Integrator = Callable[[Body, FloatArray, FloatArray, FloatArray, float, float, Work], Advanced]


class _Slope(NamedTuple):
    """What changes at an instant: the acceleration (nv,), and the powers of motors, friction and wrenches, W."""

    a: FloatArray
    powers: FloatArray


def _slope(body: Body, q: FloatArray, v: FloatArray, torque: FloatArray, t: float) -> _Slope:
    lost, pushed = body.friction(v), body.pushed(q, v, t)
    a = body.acceleration(q, v, torque - lost + pushed)
    return _Slope(a, np.array([torque @ v, lost @ v, pushed @ v]))


def semi_implicit(
    body: Body, q: FloatArray, v: FloatArray, torque: FloatArray, t: float, dt: float, work: Work
) -> Advanced:
    """``v+ = v + a dt``, ``q+ = q (+) v+ dt``: of first order, and symplectic. Powers at the mean of v and v+."""
    lost, pushed = body.friction(v), body.pushed(q, v, t)
    a = body.acceleration(q, v, torque - lost + pushed)
    after = v + a * dt
    mean = (0.5 * dt) * (v + after)
    done = Work(*(np.array(work) + [torque @ mean, lost @ mean, pushed @ mean]).tolist())
    return Advanced(body.move(q, after * dt), after, done)


def rk4(body: Body, q: FloatArray, v: FloatArray, torque: FloatArray, t: float, dt: float, work: Work) -> Advanced:
    """The classical method of Runge and Kutta on (q, v) and the work, of fourth order."""
    move, half = body.move, 0.5 * dt
    k1 = _slope(body, q, v, torque, t)
    v2 = v + half * k1.a
    k2 = _slope(body, move(q, half * v), v2, torque, t + half)
    v3 = v + half * k2.a
    k3 = _slope(body, move(q, half * v2), v3, torque, t + half)
    v4 = v + dt * k3.a
    k4 = _slope(body, move(q, dt * v3), v4, torque, t + dt)
    sixth = dt / 6.0
    done = np.array(work) + sixth * (k1.powers + 2.0 * (k2.powers + k3.powers) + k4.powers)
    q_after = move(q, sixth * (v + 2.0 * (v2 + v3) + v4))
    return Advanced(q_after, v + sixth * (k1.a + 2.0 * (k2.a + k3.a) + k4.a), Work(*done.tolist()))


INTEGRATORS: dict[str, Integrator] = {"semi-implicit": semi_implicit, "rk4": rk4}
