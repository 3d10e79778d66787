"""What a solver is, and how to add one.

A solver is a frozen dataclass: its fields are its parameters, validated once. It sees a Problem and never a robot.
To add a method, write one file with the formula at its top and a subclass below, and add one line to the registry in
``cartctl/solvers/__init__.py``; or hand an instance of your own class to ``cc.solve`` or ``cc.Controller``.

Subclass :class:`EquationSolver` where the method knows equations, a metric and perhaps a reference, but no bounds;
its ``_impl`` works on unweighted, identity-metric arrays. Subclass :class:`Solver` otherwise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np

from cartctl.algebra.metric import Whitening
from cartctl.algebra.problem import Equation, Problem
from cartctl.algebra.solution import Solution, Status
from cartctl.checks import FloatArray, is_finite
from cartctl.errors import UnsupportedProblem


class Solver(ABC):
    """Answers a Problem with a Solution, or refuses what it cannot honour (UnsupportedProblem)."""

    name: ClassVar[str]
    honours: ClassVar[frozenset[str]] = frozenset()  # of "reference", "bounds", "constraints"

    def solve(self, problem: Problem) -> Solution:
        """The answer to ``problem``; raises UnsupportedProblem, never returns NaN."""
        self.check(problem)
        return self._solve_impl(problem)

    def prepare(self) -> None:
        """Do ahead what the first solve would otherwise wait for; nothing, unless a method has kernels to compile."""
        return

    def check(self, problem: Problem) -> None:
        """Refuse what this method would have to ignore."""
        honours = self.honours
        if problem.bounded and "bounds" not in honours:
            self._refuse("bounds on u", "bounds", "problem.without_bounds()")
        if problem.constraints is not None and "constraints" not in honours:
            self._refuse("constraint rows", "constraints", "problem.without_bounds()")
        if problem.reference is not None and "reference" not in honours:
            self._refuse("a reference u0 for the null space", "reference", "problem.without_reference()")

    def _refuse(self, what: str, feature: str, remedy: str) -> None:
        from cartctl.solvers import solvers_that_honour

        others = ", ".join(repr(s) for s in solvers_that_honour(feature)) or "none so far"
        raise UnsupportedProblem(
            f"solver {self.name!r} cannot honour {what}; use one that does ({others}) or pass {remedy}"
        )

    @property
    def damps(self) -> bool:
        """Whether the method holds back part of a command that it could deliver."""
        return False

    def grade(self, solution: Solution) -> Status:
        """How an answer of this method went, decided when somebody asks."""
        if solution.lost_rank:
            return Status.SINGULAR
        if solution.met:
            return Status.OPTIMAL
        return Status.DAMPED if self.damps else Status.INEXACT

    @abstractmethod
    def _solve_impl(self, problem: Problem) -> Solution:
        """The method itself, on a problem that was checked."""


class Answer(NamedTuple):
    """What an equation method found: u, and whether a task lost rank on the way."""

    u: FloatArray
    lost_rank: bool


class EquationSolver(Solver):
    """A method without bounds, written for W = I and ``A_k u = c_k`` with ``c_k = b_k - d_k``."""

    def _solve_impl(self, problem: Problem) -> Solution:
        try:
            answer = self._whitened(problem)
        except FloatingPointError:  # LAPACK met infinities
            answer = None
        if answer is None or not is_finite(answer.u):
            return Solution(problem, np.zeros(problem.n), self.name, status=Status.FAILED)
        return Solution(problem, answer.u, self.name, self, None, answer.lost_rank)

    def _whitened(self, problem: Problem) -> Answer:
        """The answer in the metric of the problem."""
        systems = [(e.A, e.rhs) for e in problem.equations]
        u0 = problem.reference
        if problem.metric is None:
            return self._impl(systems, problem, u0)
        white = Whitening(problem.metric)
        systems = [(white.matrix(A), c) for A, c in systems]
        answer = self._impl(systems, problem, None if u0 is None else white.forward(u0))
        return Answer(white.back(answer.u), answer.lost_rank)

    @abstractmethod
    def _impl(self, systems: list[tuple[FloatArray, FloatArray]], problem: Problem, u0: FloatArray | None) -> Answer:
        """Minimise 1/2 ||u - u0||^2 over the answers to ``systems`` as this method sees them."""


def stack(
    systems: list[tuple[FloatArray, FloatArray]], equations: tuple[Equation, ...]
) -> tuple[FloatArray, FloatArray]:
    """All equations as one ``(A, c)``, rows weighed by the root of their weight; those of weight 0 left out."""
    if len(systems) == 1 and equations[0].weight == 1.0:
        return systems[0]
    kept = [(e.weight**0.5, A, c) for e, (A, c) in zip(equations, systems, strict=True) if e.weight > 0.0]
    if not kept:
        return np.zeros((0, systems[0][0].shape[1])), np.zeros(0)
    A = np.concatenate([root * A for root, A, _ in kept])
    c = np.concatenate([root * c for root, _, c in kept])
    return np.asfortranarray(A), c
