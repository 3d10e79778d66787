"""What confines a controller's robot in each step: joint limits, disabled joints, Cartesian constraints."""

from __future__ import annotations

from collections.abc import Sequence

from cartctl.constraints import Box, Constraint, stacked
from cartctl.errors import ParameterError, UnsupportedProblem
from cartctl.levels import Level
from cartctl.levels.approach import Approach
from cartctl.levels.base import UNCONFINED, Confines
from cartctl.model.limits import Limits
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.solvers import Solver, solvers_that_honour
from cartctl.tasks.base import Task


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
    ) -> None:
        self._robot, self._level, self._dt = robot, level, dt
        self._constraints = _checked(constraints, robot, solver)
        joints = _joints(disabled, robot)
        self._bounds = None
        self._approach: Approach | None = None
        if limits is not None:
            assert level.bounds is not None
            self._bounds = level.bounds(limits, dt, joints, jerk, robot.dof_names)
            if approach and level.approaching is not None:
                self._approach = level.approaching(limits, dt, State(robot), solver, waiting)
        elif joints or jerk:
            what = "disabled" if joints else "jerk"
            raise ParameterError(f"{what} is given without limits; expected limits= for it to be a part of")
        self.recovering = False

    def reset(self) -> None:
        """Forget the previous step."""
        if self._bounds is not None:
            self._bounds.reset()
        if self._approach is not None:
            self._approach.reset()

    def at(self, state: State) -> Confines:
        """What confines u at a state."""
        if self._bounds is None:
            self.recovering = False
            box = None
        else:
            lower, upper, self.recovering = self._bounds(self._robot.coordinates(state.q), state.v)
            box = Box(lower, upper)
        if not self._constraints:
            return UNCONFINED if box is None else Confines(box.lower, box.upper, None, self._approach)
        blocks = stacked([self._level.rows(c, state, self._dt, box) for c in self._constraints])
        rows = None if blocks is None else (blocks.C, blocks.lower, blocks.upper)
        if box is None:
            return Confines(None, None, rows, None)
        return Confines(box.lower, box.upper, rows, self._approach)


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
