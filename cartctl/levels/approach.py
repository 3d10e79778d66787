"""Commands such that the robot can still stop: for the target, and for the edge of the workspace.

A feedback K e that ignores how fast joints can slow down overshoots its target, and at the edge of the workspace, where
a singular value vanishes, a command outwards is followed by reversals for good. Along each singular direction of the
task's Jacobian, ``J v_i = sigma_i u_i``, with the curvature ``h_i = J_dot(v_i) v_i``:

- a target beyond reach pulls by ``p_i = -e . h_i > 0``, which adds to the stiffness: the target is
  ``d_i = |u_i . e| sigma_i / (sigma_i^2 + p_i)`` away (without p_i where the solver slows commands down as a whole),
  and f of it is the largest speed that stops there at the deceleration a_i that the joints have along v_i
  (:mod:`cartctl.braking`): ``|u_i . K e| <= sigma_i f(d_i)``;
- one step may not go further than Newton's, ``|u_i . K e| dt <= |u_i . e| sigma_i^2 / (sigma_i^2 + p_i / eta)``;
- the singular configuration is ``theta_i = sigma_i / |u_i . h_i|`` away: towards it
  ``|u_i . b| <= w_i sigma_i min(f(theta_i), eta theta_i / dt)``. ``w_i = 1 - (1e-4 ||J|| / sigma_i)^2`` ends the way
  some 1e-8 of the arm's length before the edge: what is left to win there is not worth the joints' motion, which
  never ends where several of them stretch the arm, some much more than others. Before a target at rest f counts on
  0.7 a_i: v_i turns on the way, and who relied on all of a_i would swing about the edge;
- near the edge the directions together are slowed to what the joints' speeds allow of their sum, for solvers that do
  not scale: what the box cuts off would otherwise be cut off the direction of the smallest sigma_i, the one that
  leads to the target.

What ranks below a task at the edge moves no faster than the last of these, for in the null space, too, the task curves
(:mod:`cartctl.levels.calming`); it stands where the edge was reached. On the way back from the edge, an arm bends the
way it was bent before. Joints that a limit, and directions that a row of a constraint keeps from doing their part are
left out of J (:mod:`cartctl.levels.left_out`); before a target at rest and out of reach (for solvers that do not scale:
too far away for the joints' speeds), and without constraints, joints that the highest task presses against their bounds
are kept there: the solver's box is made so narrow. A task below others is held back before the edge of what those leave
to it, too (:mod:`cartctl.levels.beneath`). Far from edge and target, nothing is changed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from cartctl.algebra.svd import scale
from cartctl.checks import FloatArray
from cartctl.levels.approach_kernel import (
    ASKED,
    BEND,
    FORWARD,
    ROWS,
    SIGMA,
    SLOWING,
    bend,
    directions,
    hold,
    is_beyond,
)
from cartctl.levels.beneath import Beneath, Means, hold_beneath
from cartctl.levels.beneath_kernel import held_beneath, narrowed
from cartctl.levels.calming import Above
from cartctl.levels.calming_kernel import calmed
from cartctl.levels.left_out import keep
from cartctl.model.limits import Limits
from cartctl.model.state import State
from cartctl.solvers import Solver
from cartctl.tasks.base import Reference, Task

_SHARE = 0.5  # of the acceleration limits: what one direction may count on
_AT_REST = 1e-5  # of the velocity limit: a bound this close to zero blocks
_BENT = 1e-3  # of the Jacobian's size: above this singular value it is clear how an arm is bent
_THROUGH = 0.1  # rad: an edge as near can be gone through, what its curvature says of one farther away is not so
_BENDS = 0.5  # of what one direction may count on: what a path's bends may take, so that it can also slow down
_RISES = 0.2  # of it: what a path's return to full speed may take, for where it bends less now it may soon bend again
_CLEAR = 1e-2  # of the Jacobian's size: damping, for near a singularity a path's bends would ask for it to stand
_NOTHING = np.zeros(0)


class Approached(NamedTuple):
    """b (m,); the calm left to what ranks below; the share of its rate at which a path that can wait is followed.

    given: (m,) what of b is not its own but the motion's above it, None where that need not be told apart.
    """

    b: FloatArray
    calm: float
    pace: float
    given: FloatArray | None = None


class Walls(NamedTuple):
    """What bounds the next velocity: a box, each (nv,), and rows ``c_lower <= C y <= c_upper``."""

    lower: FloatArray
    upper: FloatArray
    C: FloatArray
    c_lower: FloatArray
    c_upper: FloatArray

    def box(self) -> Walls:
        """Without the rows."""
        return self if not self.C.shape[0] else Walls(self.lower, self.upper, self.C[:0], _NOTHING, _NOTHING)


class Directions(NamedTuple):
    """The singular directions of a task: U (m, k), Vt (k, nv), their rows of figures D, and the size of J."""

    U: FloatArray
    Vt: FloatArray
    D: FloatArray
    size: float
    stood: FloatArray  # (nv,) the way each joint that was left out is wanted, 0 for others


class Approach:
    """For one robot, its limits and a step of dt seconds.

    solver: one that slows commands down as a whole; for others they are kept below the joints' speeds.
    waiting: the tasks whose paths wait for the hand.
    """

    def __init__(
        self,
        limits: Limits,
        dt: float,
        solver: Solver,
        waiting: Iterable[Task] = (),
    ) -> None:
        self._waiting = {id(task) for task in waiting}
        slowing = _SHARE * np.minimum(limits.acceleration_upper, -limits.acceleration_lower)
        speed = np.minimum(limits.velocity_upper, -limits.velocity_lower)
        still = _AT_REST * np.where(np.isfinite(speed), speed, 1.0)
        whole = dt * (limits.acceleration_upper - limits.acceleration_lower)
        self._joints = np.array([slowing, speed, still, whole])
        self._dt, self._scales = dt, solver.scales
        self._bent: dict[int, FloatArray] = {}  # by task: the motion inwards, when it was last clear
        self._paces: dict[int, float] = {}  # by task that waits: of the step before
        self._above = Above(ranked=not solver.stacks)
        self._walls = Walls(_NOTHING, _NOTHING, np.zeros((0, 0)), _NOTHING, _NOTHING)
        self._box: tuple[FloatArray, FloatArray] | None = None  # the solver's, on u
        self._fenced = False  # whether there are constraints, with rows in this step or without

    def prepare(self) -> None:
        """Compile ahead what the first step would otherwise wait for."""
        _ = directions.compiled, bend.compiled, hold.compiled, calmed.compiled
        _ = narrowed.compiled, held_beneath.compiled

    @property
    def joints(self) -> FloatArray:
        """(4, nv) what each joint can slow down by, its top speed, the bound that stands still, a step's widest box."""
        return self._joints

    def begin(
        self,
        state: State,
        lower: FloatArray | None,
        upper: FloatArray | None,
        rows: tuple[FloatArray, FloatArray, FloatArray] | None,
    ) -> None:
        """Begin a step at ``state`` under a box and rows on u; the tasks follow, highest priority first.

        The box is narrowed where a task wants joints kept at their bounds.
        """
        self._above.clear()
        self._fenced = rows is not None
        self._box = None if lower is None or upper is None or self._fenced else (lower, upper)
        C, c_lower, c_upper = (np.zeros((0, state.v.shape[0])), _NOTHING, _NOTHING) if rows is None else rows
        low, high = (_NOTHING, _NOTHING) if lower is None or upper is None else (lower, upper)
        self._walls = Walls(low, high, C, c_lower, c_upper)

    def command(self, task: Task, state: State, J: FloatArray, reference: Reference, b: FloatArray) -> Approached:
        """``b`` (m,) held back along directions in which the robot could not stop in time."""
        edge, pace, given = math.inf, 1.0, None
        if J.shape[0] and task.fit == "scale":
            b, edge, pace, _ = self._held(task, state, J, reference, b)
            b, beneath, given = self._beneath(state, task, J, reference, b)
            edge = min(edge, beneath)
        b = self._above.calmed(J, b, self._box)
        self._above.add(J, b, edge, task)
        return Approached(b, self._above.calm, pace, given)

    def _beneath(self, state: State, task: Task, J: FloatArray, reference: Reference, b: FloatArray) -> Beneath:
        """``b`` held back before the edge of what the tasks above leave to it."""
        above = self._above
        if reference.rate is not None or not above.ranked or above.is_empty:
            return Beneath(b, math.inf, None)
        walls = self._walls.box()
        means = Means(self._joints, walls.lower, walls.upper, self._dt, self._scales, self._fenced)
        return hold_beneath(above, task, state, J, b, reference.error, scale(J), means, self._box)

    def _held(self, task: Task, state: State, J: FloatArray, reference: Reference, b: FloatArray) -> Approached:
        found = self._along(task, state, J, reference, b, _NOTHING)
        U, Vt, D, size, _ = found
        out, pace = np.empty(J.shape[0]), 1.0
        rate = reference.rate
        waits = id(task) in self._waiting and reference.acceleration is not None and size > 0.0
        if waits and rate is not None:
            pace = self._pace(task, state, found, reference)
            b = b - (1.0 - pace) * rate
            D[FORWARD] *= pace
        rests = self._rests(reference)
        edge = hold.compiled(b, U, Vt, D, self._joints, self._dt, size, self._scales, rests, out)
        if D.shape[1] and D[BEND, -1] != 0.0:
            self._bend_as_before(task, U[:, -1], Vt[-1], D[:, -1], size, out)
        self._keep(reference, found, edge, b, out)
        return Approached(out, edge, pace)

    def _rests(self, reference: Reference) -> bool:
        """Whether a target is at rest, with no constraint before it."""
        return reference.rate is None and not self._fenced

    def _keep(self, reference: Reference, found: Directions, edge: float, asked: FloatArray, held: FloatArray) -> None:
        """Keep joints at the bounds that the highest task presses them against before a resting target.

        Out of reach, or so far away that the command was held back for the joints' speeds.
        """
        if self._box is None or reference.rate is not None or not self._above.is_empty:
            return
        slowed = not self._scales and bool((held != asked).any())
        if slowed or is_beyond(edge, found.D, found.D.shape[1], found.size):
            keep(found.stood, *self._box)

    def _along(
        self, task: Task, state: State, J: FloatArray, reference: Reference, b: FloatArray, y: FloatArray
    ) -> Directions:
        """The singular directions, their curvatures where these matter."""
        (m, n), size = J.shape, scale(J)
        k = min(m, n)
        U, Vt, D, stood = np.empty((m, k)), np.empty((k, n)), np.empty((ROWS, k)), np.empty(n)
        rate, error = _NOTHING if reference.rate is None else reference.rate, reference.error
        walls = self._walls if reference.rate is None else self._walls.box()  # before a wall one stops, or slides on
        bounded = walls.lower.shape[0] > 0
        directions.compiled(
            J, b, y, rate, error, self._joints, *walls, self._dt, size, bounded, self._fenced, U, Vt, D, stood
        )
        self._curvatures(task, state, U, Vt, D, error)
        return Directions(U, Vt, D, size, stood)

    def _curvatures(
        self, task: Task, state: State, U: FloatArray, Vt: FloatArray, D: FloatArray, error: FloatArray
    ) -> None:
        """D[BEND] and D[PULL] of the directions whose curvature matters."""
        asked = np.flatnonzero(D[ASKED])
        if asked.shape[0]:
            along = Vt if asked.shape[0] == D.shape[1] else Vt[asked]
            bend.compiled(error, U, asked, task.curvatures(state, along), D)

    def _drift(self, task: Task, state: State, v: FloatArray) -> FloatArray:
        """``J_dot(v) v`` (m,) of a task at another velocity."""
        return task.curvatures(state, v[None])[:, 0]

    def _pace(self, task: Task, state: State, found: Directions, reference: Reference) -> float:
        """The share of its speed at which the joints' accelerations can follow the path's bends.

        At the share p they are p^2 times those at full speed, ``J a = r_ddot - J_dot(v) v`` with ``J v = r_dot``, and
        p_dot v where it rises.
        """
        rate, acceleration = reference.rate, reference.acceleration
        assert rate is not None and acceleration is not None
        s = found.D[SIGMA]
        solve = (found.Vt.T * (s / (s * s + (_CLEAR * found.size) ** 2))) @ found.U.T
        v = solve @ rate
        bends, rises = self._joints_for(solve @ (acceleration - self._drift(task, state, v))), self._joints_for(v)
        return min(1.0, math.sqrt(_BENDS * bends), self._paces.get(id(task), 1.0) + _RISES * rises * self._dt)

    def _joints_for(self, a: FloatArray) -> float:
        """How many times the acceleration a (nv,) the joints can bring about."""
        used = a != 0.0
        return float(np.min(self._joints[SLOWING][used] / np.abs(a[used]), initial=math.inf))

    def _bend_as_before(
        self, task: Task, u: FloatArray, v: FloatArray, d: FloatArray, size: float, out: FloatArray
    ) -> None:
        """Send an arm that is asked back from the edge through the singular configuration, if it has come out wrong."""
        inwards = v if d[BEND] > 0.0 else -v
        if d[SIGMA] > _BENT * size:
            self._bent[id(task)] = inwards
            return
        before = self._bent.get(id(task))
        asked = float(u @ out)
        near = d[SIGMA] <= _THROUGH * abs(d[BEND])
        if near and before is not None and asked * d[BEND] > 0.0 and float(before @ inwards) < 0.0:
            through = 2.0 * d[SIGMA] * d[SIGMA] / (abs(d[BEND]) * self._dt)
            out -= u * (asked + np.copysign(through, asked))

    def slowed(self, u: FloatArray) -> FloatArray:
        """What is wanted of the null space, no faster than the tasks leave to it."""
        return self._above.slowed(u)

    def go_on(self, tasks: Iterable[Task], paces: Iterable[float]) -> None:
        """Go on from the paces of the step before, by task."""
        self._paces = {id(task): pace for task, pace in zip(tasks, paces, strict=True) if id(task) in self._waiting}

    def bends(self, tasks: Iterable[Task]) -> list[FloatArray | None]:
        """How the arm was bent when it was last clear, by task: the motion inwards (nv,), None where it never was."""
        return [self._bent.get(id(task)) for task in tasks]

    def resume(self, tasks: Iterable[Task], bends: Iterable[FloatArray | None]) -> None:
        """Go on from what another one's :meth:`bends` said."""
        pairs = zip(tasks, bends, strict=True)
        self._bent = {id(task): motion for task, motion in pairs if motion is not None}

    def reset(self) -> None:
        """Forget how the arm was bent."""
        self._bent.clear()
        self._above.clear()
