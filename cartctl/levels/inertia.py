"""Products with ``M^-1`` outside the hot loop, by LAPACK's Cholesky factor."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from cartctl.checks import FloatArray
from cartctl.errors import UnderactuatedRobot
from cartctl.model.state import State


def by_inertia(state: State, rows: FloatArray) -> FloatArray:
    """``rows M^-1``, (m, nv), for rows (m, nv); raises UnderactuatedRobot where M is singular."""
    if rows.shape[0] == 0:
        return np.zeros(rows.shape)
    factor, info = lapack.dpotrf(state.mass_matrix, lower=1)
    if info != 0:
        raise singular(state)
    return lapack.dpotrs(factor, rows.T, lower=1)[0].T  # type: ignore[no-any-return]


def singular(state: State) -> UnderactuatedRobot:
    """The error for a state at which M is not positive definite."""
    return UnderactuatedRobot(
        f"the inertia matrix of robot {state.robot.name!r} is singular at q = {state.q}; expected links with mass"
    )


def inverse_inertia(state: State) -> FloatArray:
    """``W = M^-1``: of all torques that do the task, the one of least ``tau^T M^-1 tau`` (Khatib 1987)."""
    W = by_inertia(state, np.eye(state.robot.nv))
    return np.asarray(0.5 * (W + W.T))


def inverse_inertia_squared(state: State) -> FloatArray:
    """``W = M^-2``: of all torques that do the task, the one of least ``||M^-1 tau||``, ``tau = M J# c``."""
    W = by_inertia(state, np.eye(state.robot.nv))
    return np.asarray(W @ W.T)
