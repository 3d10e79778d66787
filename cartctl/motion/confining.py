"""What confines a controller's robot in each step: joint limits, disabled joints, Cartesian constraints."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from contextlib import suppress

from cartctl.algebra.problem import Equation, Problem
from cartctl.checks import FloatArray
from cartctl.compiled.approach import TreeApproach
from cartctl.compiled.tree import tree_of
from cartctl.constraints import Box, Constraint, stacked
from cartctl.errors import CartctlWarning, ParameterError, UnsupportedJoint, UnsupportedProblem
from cartctl.levels import Level
from cartctl.levels.approach import Approach
from cartctl.levels.base import UNCONFINED, Confines
from cartctl.levels.bounds import JointBounds
from cartctl.levels.loads import actuated
from cartctl.levels.midway import Midway
from cartctl.levels.patience import Patience
from cartctl.levels.torque_bounds import torque_box
from cartctl.levels.yielding import Layer, Widened, intervals, widened
from cartctl.model.limits import Limits
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.solvers import Solver, solve, solvers_that_honour
from cartctl.tasks.base import Reference, Task


class Confining:
    """Limits and constraints of one robot at one level, as bounds and rows on u, step by step."""

    def __init__(
        self,
        robot: Robot,
        level: Level,
        solver: Solver,
        limits: Limits | None,
        constraints: Sequence[Constraint],
        disabled: Sequence[str],
        jerk: bool,
        approach: bool,
        dt: float,
        waiting: Sequence[Task],
        count: int,
    ) -> None:
        """waiting: the tasks whose paths wait for the hand. count: of all tasks."""
        self._level, self._dt = level, dt
        self._constraints = _checked(constraints, robot, solver)
        joints = _joints(disabled, robot)
        self._bounds: JointBounds | None = None
        self._approach: Approach | None = None
        self._patience: Patience | None = None
        self._torque: Box | None = None
        if limits is not None:
            assert level.bounds is not None
            takes_rows = "constraints" in solver.honours
            if level.loads is not None and actuated(robot) and (takes_rows or level.limits_are_rows):
                self._torque = torque_box(limits)
            if takes_rows or not level.limits_are_rows:
                self._bounds = level.bounds(limits, dt, joints, jerk, robot.dof_names)
            else:
                _warn_of_rows(solver, level)
            if approach and level.approaching is not None:
                self._approach = _approach(level.approaching, robot, limits, dt, solver, waiting)
                if not self._constraints:
                    accelerates = level.bounds.at_acceleration
                    self._patience = Patience(self._approach.joints, count, dt, accelerates)
        elif joints or jerk:
            what = "disabled" if joints else "jerk"
            raise ParameterError(f"{what} is given without limits; expected limits= for it to be a part of")
        self.yields = level.limits_are_rows or self._torque is not None
        self.recovering = False
        self.midway: Midway | None = None  # where bounds are on what u comes to
        if level.limits_are_rows and self._bounds is not None:
            self.midway = Midway(level, dt, State(robot))
        self._now = UNCONFINED
        self._coordinates = _itself if robot.has_plain_coordinates else robot.coordinates

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """The Cartesian constraints."""
        return self._constraints

    def reset(self) -> None:
        """Forget the previous step."""
        if self._bounds is not None:
            self._bounds.reset()
        if self._approach is not None:
            self._approach.reset()
        if self._patience is not None:
            self._patience.forget()

    def prepare(self) -> None:
        """Compile ahead what the first step would otherwise wait for."""
        if self._approach is not None:
            self._approach.prepare()
        if self._patience is not None:
            self._patience.prepare()

    def bends(self, tasks: Sequence[Task]) -> list[FloatArray | None]:
        """How the arm was bent before, by task."""
        return [None] * len(tasks) if self._approach is None else self._approach.bends(tasks)

    @property
    def patience(self) -> FloatArray | None:
        """What is known of whether the tasks come nearer, None where nobody looks on."""
        return None if self._patience is None else self._patience.state.copy()

    def resume(self, tasks: Sequence[Task], bends: Sequence[FloatArray | None], patience: FloatArray | None) -> None:
        """Go on from what another way has come to."""
        if self._approach is not None:
            self._approach.resume(tasks, bends)
        if self._patience is not None and patience is not None:
            self._patience.resume(tasks, patience)

    def look_on(
        self,
        tasks: Sequence[Task],
        references: Sequence[Reference],
        problem: Problem,
        state: State,
        u: FloatArray,
    ) -> None:
        """Take note of a step that was made, to see whether the tasks come nearer."""
        if self._patience is not None:
            self._patience.look_on(tasks, references, problem, state, u)

    def look_away(self) -> None:
        """Forget what was seen: an objective has reasons of its own to move."""
        if self._patience is not None:
            self._patience.forget()

    def slow_down(self, tasks: Sequence[Task], problem: Problem, state: State) -> None:
        """Narrow the problem's box, in place, where no task came nearer."""
        if self._patience is not None and not self.recovering:
            self._patience.slow_down(tasks, state, problem)

    def compiled(self) -> tuple[FloatArray | None, FloatArray | None]:
        """Limits (11, nv) and the approach's figures of the joints (3, nv), None without; raises UnsupportedProblem."""
        if self._constraints:
            raise UnsupportedProblem(f"a constraint is not compiled: {type(self._constraints[0]).__name__}")
        if self._bounds is None:
            return None, None
        if self._bounds.jerk:
            raise UnsupportedProblem("jerk limits are not compiled")
        return self._bounds.packed, None if self._approach is None else self._approach.joints

    def at(self, state: State, tasks: Sequence[Task] = (), paces: Sequence[float] = ()) -> Confines:
        """What confines u at a state; paces: the share of its speed at which each task's path was asked for last."""
        lower = upper = rows = approach = None
        self.recovering = False
        if self._bounds is not None:
            lower, upper, self.recovering = self._bounds(self._coordinates(state.q), state.v)
            approach = self._approach
            if approach is not None:
                approach.go_on(tasks, paces)
        if self._constraints:
            box = None if lower is None or upper is None else Box(lower, upper)
            blocks = stacked([self._level.rows(c, state, self._dt, box) for c in self._constraints])
            rows = None if blocks is None else (blocks.C, blocks.lower, blocks.upper)
        self._now = Confines(lower, upper, rows, approach, self._torque)
        return self._now

    def widened(self, problem: Problem, state: State, at: State | None = None) -> Widened:
        """The problem of the state :meth:`at` was last asked about, with limits that exclude each other widened.

        at: where M and h are taken from, if not from there.
        """
        lower, upper, rows, _, torque = self._now
        T, t, S, s = self._level.motion(at or state)
        layers = []
        if self._bounds is not None and lower is not None and upper is not None:
            q = self._coordinates(state.q)
            for name, box in intervals(self._bounds, q, state.v, Box(lower, upper)).items():
                layers.append(Layer(name, T, box.lower - t, box.upper - t))
        if rows is not None:
            shift = rows[0] @ t
            layers.append(Layer("constraints", rows[0] @ T, rows[1] - shift, rows[2] - shift))
        if torque is None or self._level.limits_are_rows:
            return widened(problem, layers, torque)
        return widened(problem, layers, Layer("torque", S, torque.lower - s, torque.upper - s))

    def stopping(self, problem: Problem, state: State, at: State | None = None) -> FloatArray:
        """The u that comes nearest to stopping within the step, inside all bounds of the problem, (n,)."""
        if not self.yields:
            return self._level.stopping(state, self._dt)
        T, t, _, _ = self._level.motion(at or state)
        # nearest in terms of accelerations, not of torques
        braking = Equation(T, -state.v / self._dt - t, fit="least_squares", name="stop")
        nearest = Problem((braking,), problem.lower, problem.upper, problem.constraints)
        for solver in ("hqp", "qp"):
            stopped = solve(nearest, solver)
            if not stopped.failed:
                break
        return stopped.u


def _approach(
    kind: type[Approach], robot: Robot, limits: Limits, dt: float, solver: Solver, waiting: Sequence[Task]
) -> Approach:
    """The level's own, or where the robot is a compiled tree, the same without Pinocchio."""
    if kind is Approach:
        with suppress(UnsupportedJoint):
            return TreeApproach(limits, dt, solver, waiting, tree_of(robot))
    return kind(limits, dt, solver, waiting)


def _itself(q: FloatArray) -> FloatArray:
    return q


def _warn_of_rows(solver: Solver, level: Level) -> None:
    warnings.warn(
        f"solver {solver.name!r} honours no rows: at level {level.name!r} it keeps torque bounds, not those on "
        "position, velocity and acceleration (run.metrics() counts violations)",
        CartctlWarning,
        stacklevel=5,
    )


def _checked(constraints: Sequence[Constraint], robot: Robot, solver: Solver) -> tuple[Constraint, ...]:
    if isinstance(constraints, Constraint):
        constraints = (constraints,)
    for k, constraint in enumerate(constraints):
        if not isinstance(constraint, Constraint):
            raise ParameterError(f"constraints[{k}] is a {type(constraint).__name__}; expected a Constraint")
        constraint.check(robot)
    if constraints and "constraints" not in solver.honours:
        able = ", ".join(repr(s) for s in solvers_that_honour("constraints"))
        raise UnsupportedProblem(f"solver {solver.name!r} honours no constraint rows; use one that does ({able})")
    return tuple(constraints)


def _joints(disabled: Sequence[str], robot: Robot) -> list[int]:
    names = [disabled] if isinstance(disabled, str) else list(disabled)
    return [robot.dof(name) for name in names]
