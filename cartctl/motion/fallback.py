"""What becomes of a task for which no scale will do: it is not given up, but asked for what it can do.

**No scale is feasible** where 0 is outside the box (a joint still brakes, or is brought back). With u_b the stopping
command clipped into the box, the highest task is asked for ``A u = A u_b + s (b - d - A u_b)``, which has an answer at
s = 0; a task further down, whose s = 0 those above may rule out, is asked to stand as best it can.

**No scale but 0 is** where b has a part that no u can deliver, at an exact singularity or where a task has more rows
than the robot can do: an arm stretched out would stand still for ever. The highest task is then asked for the other
part, ``A u = s A u_b - A u_d``, with u_b and u_d of least squares.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cartctl.algebra.problem import Equation, Problem
from cartctl.algebra.solution import Solution
from cartctl.checks import FloatArray

_BEYOND = 1e-6  # of a command: a part as large that cannot be obeyed


def slowed(problem: Problem, skipped: FloatArray, stopping: FloatArray) -> Problem:
    """The problem with its skipped equations (p,) replaced; stopping: (n,)."""
    stopping = problem.clip(stopping)
    first = True
    equations = []
    for e, out in zip(problem.equations, skipped, strict=True):
        if not out:
            equations.append(e)
        elif first:
            rest = e.A @ stopping
            equations.append(Equation.trusted(e.A, e.rhs - rest, -rest, "scale", e.weight, e.name, e.size))
        else:
            rest = e.A @ stopping
            equations.append(Equation.trusted(e.A, rest, None, "least_squares", e.weight, e.name, e.size))
        first = False
    return _with(problem, equations)


def within_reach(problem: Problem, solve: Callable[[Problem], Solution]) -> Problem | None:
    """The problem with the part of its first command that can be obeyed; None where that is all of it."""
    e = problem.equations[0]

    def obeyed(side: FloatArray) -> FloatArray:
        alone = Equation.trusted(e.A, side, None, "least_squares", e.weight, e.name, e.size)
        return e.A @ solve(Problem.trusted((alone,), None, None, None, None)).u

    along = obeyed(e.b)
    given = np.zeros_like(e.b) if e.drift is None else e.drift
    drift = given if e.drift is None else obeyed(given)
    missed, asked = np.concatenate([e.b - along, given - drift]), np.concatenate([e.b, given])
    if not float(missed @ missed) > _BEYOND * _BEYOND * float(asked @ asked):
        return None
    part = Equation.trusted(e.A, along, drift, "scale", e.weight, e.name, e.size)
    return _with(problem, [part, *problem.equations[1:]])


def _with(problem: Problem, equations: list[Equation]) -> Problem:
    p = problem
    return Problem.trusted(tuple(equations), p.metric, p.reference, p.lower, p.upper, p.constraints)
