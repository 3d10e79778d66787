"""Energies of a robot at a state, what they change by, and the torques of gravity and of velocity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.state import State


@dataclass(frozen=True)
class Energy:
    """kinetic: T = 1/2 v^T M v, J. potential: U = -sum_i m_i g0^T r_ci, J, zero where the world's origin is."""

    kinetic: float
    potential: float

    @property
    def total(self) -> float:
        """``E = T + U``, J."""
        return self.kinetic + self.potential


def energy(state: State, gravity: Any = None) -> Energy:
    """The energies of ``state``; ``gravity`` (3,), m/s^2, in the world, the robot's own if None.

    Links that are fixed to the world count for nothing, as their energy cannot change. Reflected rotor inertias
    (the model's armature) are part of M, so of T. Raises ShapeError, NonFiniteError, ParameterError.
    """
    M, v = require_state(state).mass_matrix, state.v
    return Energy(
        kinetic=0.5 * float(v @ M @ v),
        potential=-_mass(state) * float(_field(state, gravity) @ state.com),
    )


def energy_rate(state: State, torque: Any) -> float:
    """``E_dot = v^T u``, W: u (nv,) all generalised forces but gravity's (motors, friction, contacts).

    ``d/dt (1/2 v^T M v + U) = v^T u + 1/2 v^T (M_dot - 2 S) v``, and the last term is zero for every S with S v = c.
    Raises ShapeError, NonFiniteError, ParameterError.
    """
    return float(require_state(state).v @ checks.vector("torque", torque, state.robot.nv))


def gravity_torques(state: State, gravity: Any = None) -> FloatArray:
    """``g(q) = (dU/dq)^T = -sum_i m_i J_ci^T g0``, (nv,), N m or N, for any direction of gravity.

    gravity: g0 (3,), m/s^2, in the world, the robot's own if None. Raises ShapeError, NonFiniteError, ParameterError.
    """
    return -_mass(require_state(state)) * (state.com_jacobian.T @ _field(state, gravity))  # type: ignore[no-any-return]


def velocity_torques(state: State) -> FloatArray:
    """``c(q, v)``, (nv,), N m or N: Coriolis and centrifugal torques, the nonlinear effects without gravity.

    Raises ParameterError for what is no State.
    """
    return require_state(state).nonlinear_effects - state.gravity


def require_state(state: Any) -> State:
    """``state`` if it is one; raises ParameterError."""
    if not isinstance(state, State):
        raise ParameterError(f"state is a {type(state).__name__}; expected a State, such as robot.state(q, v)")
    return state


def _mass(state: State) -> float:
    return float(sum(body.mass for body in list(state.robot.model.inertias)[1:]))


def _field(state: State, gravity: Any) -> FloatArray:
    return state.robot.gravity if gravity is None else checks.vector("gravity", gravity, 3)
