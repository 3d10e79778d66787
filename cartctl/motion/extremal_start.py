"""Bringing a start configuration onto the extremal set that an extended Jacobian then keeps.

Newton's method on ``[r(q) - r(q0); Z^T grad H] = 0``: the tasks stay where q0 has them, the self-motion runs to where
the objective is least (or greatest). Where the reduced Hessian points the other way, a gradient step of bounded length
is made instead, so that a saddle is not taken for an optimum.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from copy import copy

import numpy as np

from cartctl.algebra.inverses import Truncated
from cartctl.algebra.svd import norm, scale, svd
from cartctl.checks import FloatArray
from cartctl.errors import CartctlWarning
from cartctl.levels.extremal import ExtremalRows, extremal_rows
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective
from cartctl.tasks.base import Task

_STEPS, _LONGEST, _DONE = 200, 0.2, 1e-11  # rad or m a step; relative to the gradient


def onto_extremal_set(robot: Robot, tasks: Sequence[Task], objective: Objective, q0: FloatArray) -> FloatArray:
    """The extremal configuration (nq,) reached from q0 with the tasks held; a CartctlWarning if it is not reached."""
    held = [copy(task) for task in tasks]
    for task in held:
        task.target = None
    state, scratch = State(robot), State(robot)
    state.set(q0, np.zeros(robot.nv))
    anchors = [task.anchor(state) for task in held]
    q = q0
    for _ in range(_STEPS):
        rows = extremal_rows(state, held, objective, scratch)
        error = np.concatenate([t.reference(state, 0.0, a).error for t, a in zip(held, anchors, strict=True)])
        if norm(rows.slope) <= _DONE * (scale(rows.A) + norm(objective.gradient(state))) and norm(error) <= 1e-10:
            return q
        step = _step(rows, np.concatenate([task.jacobian(state) for task in held]), error, objective.maximise)
        length = norm(step)
        q = robot.integrate(q, step if length <= _LONGEST else step * (_LONGEST / length))
        state.set(q, state.v)
    warnings.warn(
        f"the start is off the extremal set by |Z^T grad H| = {norm(rows.slope):.2g}; the first cycle will not close",
        CartctlWarning,
        stacklevel=3,
    )
    return q


def _step(rows: ExtremalRows, J: FloatArray, error: FloatArray, maximise: bool) -> FloatArray:
    """A Newton step where the reduced Hessian has the right sign, else one along the slope."""
    curvature = rows.A @ rows.basis
    sign = -1.0 if maximise else 1.0
    good = curvature.size == 0 or float(np.linalg.eigvalsh(sign * 0.5 * (curvature + curvature.T))[0]) > 0.0
    added = (rows.A, -rows.slope) if good else (rows.basis.T, -sign * 0.5 * _LONGEST * rows.slope / norm(rows.slope))
    size = scale(added[0])
    unit = scale(J) / size if size > 0.0 else 1.0  # H has its own unit
    A = np.asfortranarray(np.concatenate([J, unit * added[0]]))
    return Truncated().solve(svd(A), np.concatenate([error, unit * added[1]]), scale(A))
