"""Which limits a controller works under: the caller's, the robot's where the solver honours them, or none."""

from __future__ import annotations

import warnings
from enum import Enum

from cartctl.errors import CartctlWarning, ParameterError, ShapeError, UnsupportedProblem
from cartctl.levels import Level
from cartctl.model.limits import Limits
from cartctl.model.robot import Robot
from cartctl.solvers import Solver, solvers_that_honour


class RobotLimits(Enum):
    """The default of ``limits=``: the robot's own, where the solver honours bounds."""

    ROBOT = "robot.limits"


ROBOT_LIMITS = RobotLimits.ROBOT


def usable_limits(limits: Limits | RobotLimits | None, robot: Robot, solver: Solver, level: Level) -> Limits | None:
    """The limits to work under; raises UnsupportedProblem, ParameterError, ShapeError."""
    if limits is None:
        return None
    able = "bounds" in solver.honours and level.bounds is not None
    if limits is ROBOT_LIMITS:
        if able:
            return robot.limits
        warnings.warn(
            f"{_who(solver, level)} honours no limits; it runs without them "
            "(limits=None says so; run.metrics() counts violations)",
            CartctlWarning,
            stacklevel=3,
        )
        return None
    if not isinstance(limits, Limits):
        raise ParameterError(f"limits is a {type(limits).__name__}; expected Limits such as robot.limits, or None")
    if len(limits.position_lower) != robot.nv:
        raise ShapeError(f"limits have {len(limits.position_lower)} joints; expected {robot.nv} as {robot.name!r}")
    if not able:
        others = ", ".join(repr(s) for s in solvers_that_honour("bounds")) or "none so far"
        raise UnsupportedProblem(
            f"{_who(solver, level)} honours no limits; use one that does ({others}), or limits=None"
        )
    return limits


def _who(solver: Solver, level: Level) -> str:
    return f"solver {solver.name!r}" if "bounds" not in solver.honours else f"level {level.name!r}"
