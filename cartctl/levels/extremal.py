"""The rows that keep a configuration on the extremal set Z^T grad H = 0 of an objective along the self-motion.

``A_e = Z^T (Hess H - d(J^T lambda)/dq)`` with ``lambda = J^{T#} grad H`` held and Z an orthonormal basis of ker J is
the rate of ``Z^T grad H`` where that is zero (Baillieul 1985). Another basis turns A_e and b_e alike and leaves the
answer. The derivative of J^T lambda is a central difference of Jacobians, so that it serves every task.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cartctl.algebra.svd import numerical_rank, round_off, svd
from cartctl.checks import FloatArray
from cartctl.model.state import State
from cartctl.objectives.base import Objective
from cartctl.tasks.base import Task

_STEP = 1e-5


class ExtremalRows(NamedTuple):
    """The rows A_e (k, nv), what they keep at zero, Z^T grad H (k,), and the basis Z (nv, k)."""

    A: FloatArray
    slope: FloatArray
    basis: FloatArray


def extremal_rows(state: State, tasks: Sequence[Task], objective: Objective, scratch: State) -> ExtremalRows:
    """The n - rank(J) rows at ``state``; ``scratch`` is a State that may be moved about."""
    J = np.asfortranarray(np.concatenate([task.jacobian(state) for task in tasks]))
    decomposition = svd(J)
    rank = numerical_rank(decomposition.s, round_off(J))
    Z = decomposition.Vt[rank:].T
    gradient = objective.gradient(state)
    multipliers = decomposition.U[:, :rank] @ ((decomposition.Vt[:rank] @ gradient) / decomposition.s[:rank])
    bend = _pullback_derivative(state, tasks, multipliers, scratch)
    return ExtremalRows(Z.T @ (objective.hessian(state) - bend), Z.T @ gradient, Z)


def _pullback_derivative(state: State, tasks: Sequence[Task], multipliers: FloatArray, scratch: State) -> FloatArray:
    """``d(J(q)^T lambda)/dq`` for constant lambda, (nv, nv)."""
    robot = state.robot
    columns = []
    for step in _STEP * np.eye(robot.nv):
        ends = []
        for sign in (1.0, -1.0):
            scratch.set(robot.integrate(state.q, sign * step), state.v, state.time)
            ends.append(np.concatenate([task.jacobian(scratch) for task in tasks]).T @ multipliers)
        columns.append((ends[0] - ends[1]) / (2.0 * _STEP))
    return np.array(columns).T  # type: ignore[no-any-return]
