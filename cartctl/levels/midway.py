"""What held torques come to over a step: bounds on accelerations by M and h of the middle of it.

Torques are held from one step of the controller to the next, while M and h change under them: of a joint that brakes as
hard as it may, ``M^-1 (tau - h)`` is the deceleration at the beginning of the step and not that of all of it, and what
is missing adds up over a brake. By the midpoint rule, the velocity changes by dt times

    a = M_m^-1 (tau - h_m),   q_m = q (+) (v dt/2 + a dt^2/8),   v_m = v + a dt/2

up to dt^3. Where an answer is near a bound it is looked at there; if its a leaves a bound, the problem is to be solved
again with ``lower <= M_m^-1 (tau - h_m) <= upper`` for rows.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from cartctl.algebra.problem import Problem
from cartctl.checks import FloatArray
from cartctl.kernels import kernel
from cartctl.levels.base import Confines, Level
from cartctl.levels.inertia import singular
from cartctl.levels.torque_bounds import Blocks, through_inertia_rows
from cartctl.levels.torque_kernel import factor, solve
from cartctl.model.state import State

NEAR = 0.05  # of the room between two bounds: from here on an answer is looked at
KEPT = 1e-4  # of the room between two bounds: what may be left of it
SINGULAR, KEEPS, LEAVES = 0, 1, 2
ROUNDS = 4  # of solving again; each leaves some hundredths of what the one before left


@kernel("bool(matrix, vector, vector, vector, int, float)")
def near(C: FloatArray, lower: FloatArray, upper: FloatArray, u: FloatArray, rows: int, share: float) -> bool:
    """Whether one of the first rows of ``lower <= C u <= upper`` is within a share of its room of an end, or beyond.

    With a share below zero: whether it is beyond by so much.
    """
    for i in range(rows):
        at = 0.0
        for j in range(u.shape[0]):
            at += C[i, j] * u[j]
        room = upper[i] - lower[i]
        least = share * room if room < np.inf else 0.0
        if not (at - lower[i] >= least and upper[i] - at >= least):
            return True
    return False


@kernel("int(matrix, vector, vector, vector, vector, out_matrix, out_matrix)", fast=True)
def accelerations(
    M: FloatArray,
    h: FloatArray,
    u: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    rows: FloatArray,
    sides: FloatArray,
) -> int:
    """Fill rows with ``M^-1`` and sides (3, n) with the ends of ``lower <= M^-1 (u - h) <= upper`` on u, and with it.

    SINGULAR, KEEPS or LEAVES, by more than KEPT.
    """
    n = h.shape[0]
    L = np.empty((n, n))
    if not factor(M, L):
        return SINGULAR
    for i in range(n):
        for j in range(n):
            rows[i, j] = 1.0 if i == j else 0.0
        solve(L, rows, i, i)
        known, at = 0.0, 0.0
        for j in range(n):
            known += rows[i, j] * h[j]
            at += rows[i, j] * u[j]
        sides[0, i], sides[1, i], sides[2, i] = lower[i] + known, upper[i] + known, at - known
    return LEAVES if near(rows, sides[0], sides[1], u, n, -KEPT) else KEEPS


class Midway:
    """For one robot and level, in steps of dt seconds; raises UnderactuatedRobot where M is singular.

    state: the middle of the step, by the answer looked at last.
    """

    def __init__(self, level: Level, dt: float, state: State) -> None:
        assert level.loads is not None
        self.state, self._level, self._loads, self._dt = state, level, level.loads, dt
        self._near, self._accelerations = near.compiled, accelerations.compiled

    def concerns(self, problem: Problem, u: FloatArray) -> bool:
        """Whether u is near a bound on an acceleration."""
        rows = problem.constraints
        return rows is not None and rows[0].shape[0] >= u.shape[0] and self._near(*rows, u, u.shape[0], NEAR)

    def better(self, u: FloatArray, state: State, confines: Confines, again: bool) -> Blocks | None:
        """Rows, and their ends, that bound what u comes to over the step; None where u keeps them.

        again: whether u answers to such rows, so that the middle of the step is known as far as that.
        """
        lower, upper, outside, _, _ = confines
        assert lower is not None and upper is not None
        n, dt, v, own = u.shape[0], self._dt, state.v, self.state
        rows, sides = np.empty((n, n)), np.empty((3, n))
        self._look(own if again else state, u, lower, upper, rows, sides)
        a = sides[2]
        q = pin.integrate(state.robot.model, state.q, dt * (0.5 * v + (0.125 * dt) * a))
        own.set(q, v + (0.5 * dt) * a, state.time + 0.5 * dt)
        if self._look(own, u, lower, upper, rows, sides) == KEEPS:
            return None
        blocks = (rows, sides[0], sides[1])
        if outside is not None:
            blocks = through_inertia_rows(own, self._loads.effects(own), blocks, outside)
        return blocks

    def _look(
        self, at: State, u: FloatArray, lower: FloatArray, upper: FloatArray, rows: FloatArray, sides: FloatArray
    ) -> int:
        M = at.mass_matrix
        found: int = self._accelerations(M, self._loads.effects(at), u, lower, upper, rows, sides)
        if found == SINGULAR:
            raise singular(at)
        return found
