"""What becomes of a task for which no scale is feasible: it is slowed towards standing still, not towards nothing.

Where 0 is outside the box (a joint still brakes, or is brought back), a task at s = 0 may be as infeasible as at s = 1.
With u_b the stopping command clipped into the box, the task is asked for ``A u = A u_b + s (b - d - A u_b)``, which has
an answer at s = 0; a task below the first, whose s = 0 the ones above may rule out, is asked to stand as best it can.
"""

from __future__ import annotations

from cartctl.algebra.problem import Equation, Problem
from cartctl.checks import FloatArray


def towards_rest(problem: Problem, skipped: FloatArray, stopping: FloatArray) -> Problem:
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
    return Problem.trusted(
        tuple(equations), problem.metric, problem.reference, problem.lower, problem.upper, problem.constraints
    )
