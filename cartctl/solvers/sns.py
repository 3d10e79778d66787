"""Saturation in the null space, exact: s_1 as large as possible, then s_2 given s_1, ..., then the least norm.

    A_k u + d_k = s_k b_k,   k = 1..p,     lower <= u <= upper,     c_lower <= C u <= c_upper,
    lexicographically largest (s_1, ..., s_p), then min 1/2 (u - u0)^T W (u - u0)

(Flacco, De Luca & Khatib 2012, 2015 state the optimum and approach it by saturating joint after joint; here an
active-set method on the multipliers reaches it, see :mod:`cartctl.solvers.exact`.) An equation with
``fit="least_squares"`` is not scaled: at its place in the order it is missed by as little as possible.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cartctl.solvers.exact.solver import ExactSolver


@dataclass(frozen=True)
class SNS(ExactSolver):
    """Strict priorities under hard limits: each command slowed as little as possible, never bent.

    A task with no feasible s (its drift alone leaves the bounds) is skipped: scale nan, status SKIPPED; those below it
    still run. Where rows of C contradict the box they yield, by least squares: status INFEASIBLE.

    >>> import cartctl as cc
    >>> problem = cc.Problem([([[1.0, 1.0, 1.0]], [2.4])], lower=[-1, -1, -0.2], upper=[1, 1, 0.2])
    >>> solution = cc.solve(problem, "sns")
    >>> print(solution.u.round(6), solution.scales.round(6))
    [1.  1.  0.2] [0.916667]
    """

    scales: ClassVar[bool] = True
    name: ClassVar[str] = "sns"
    sources: ClassVar[tuple[str, ...]] = ("flacco2012", "flacco2015")
