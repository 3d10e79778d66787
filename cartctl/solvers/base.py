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

from cartctl.algebra.certificate import Certificate
from cartctl.algebra.metric import Whitening
from cartctl.algebra.problem import Equation, Problem
from cartctl.algebra.solution import Solution, Status
from cartctl.algebra.svd import scale
from cartctl.checks import FloatArray, is_finite
from cartctl.errors import SolverOutputError, UnsupportedProblem


class Solver(ABC):
    """Answers a Problem with a Solution, or refuses what it cannot honour (UnsupportedProblem)."""

    name: ClassVar[str]
    sources: ClassVar[tuple[str, ...]] = ()  # what ``cc.cite`` prints: keys of references.bib, or BibTeX
    stacks: ClassVar[bool] = False  # whether several equations are solved as one
    extends: ClassVar[bool] = False  # whether the level shall add the rows that keep an objective extremal
    scales: ClassVar[bool] = False  # whether commands are slowed down, so that a path had better wait
    honours: ClassVar[frozenset[str]] = frozenset()  # of "reference", "bounds", "constraints", "inequalities"

    def solve(self, problem: Problem, start: Solution | None = None) -> Solution:
        """The answer to ``problem``; raises UnsupportedProblem, never returns NaN.

        start: an earlier Solution; a method that can begin there gives the same answer sooner.
        """
        self.check(problem)
        solution = self._solve_impl(problem) if start is None else self._solve_from(problem, start)
        u = solution.u
        return solution if u.shape == (problem.n,) and is_finite(u) else self._astray(problem, u)

    def _astray(self, problem: Problem, u: FloatArray) -> Solution:
        """What to make of an answer that is none: the fault of whoever wrote the solver."""
        raise SolverOutputError(
            f"solver {self.name!r} returned u of shape {np.shape(u)}: {u}; expected ({problem.n},) finite numbers"
        )

    @property
    def takes_metric(self) -> bool:
        """Whether the method means something in a metric other than the identity."""
        return True

    def prepare(self) -> None:
        """Do ahead what the first solve would otherwise wait for; nothing, unless a method has kernels to compile."""
        return

    def check(self, problem: Problem) -> None:
        """Refuse what this method would have to ignore."""
        honours = self.honours
        for e in problem.equations:
            if e.fit == "inequality" and "inequalities" not in honours:
                self._refuse("inequalities among the equations", "inequalities", "them as constraints")
        if problem.bounded and "bounds" not in honours:
            self._refuse("bounds on u", "bounds", "problem.without_bounds()")
        if problem.constraints is not None and "constraints" not in honours:
            self._refuse("constraint rows", "constraints", "problem.without_bounds()")
        if problem.reference is not None and "reference" not in honours:
            self._refuse("a reference u0 for the null space", "reference", "problem.without_reference()")
        if problem.metric is not None and not self.takes_metric:
            raise UnsupportedProblem(f"solver {self.name!r} takes no metric; use another solver or metric=None")

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
        problem = solution.problem
        if self.stacks and len(problem.equations) > 1 and sum(problem.sizes) > problem.n:
            return Status.OVERDETERMINED
        return Status.DAMPED if self.damps else Status.INEXACT

    def task_part(self, solution: Solution) -> FloatArray:
        """What of an answer the tasks ask for, (n,): the answer with u0 = 0."""
        return self.solve(solution.problem.without_reference()).u

    def certify(self, solution: Solution) -> Certificate:
        """The residuals of what the method claims; raises UnsupportedProblem where that is no optimum."""
        raise UnsupportedProblem(
            f"solver {self.name!r} claims no optimum that a certificate could show; 'sns', 'hqp' and 'qp' do"
        )

    @abstractmethod
    def _solve_impl(self, problem: Problem) -> Solution:
        """The method itself, on a problem that was checked."""

    def _solve_from(self, problem: Problem, start: Solution) -> Solution:
        """The same from an earlier answer; most methods have no use for one."""
        return self._solve_impl(problem)


class Answer(NamedTuple):
    """What an equation method found: u, and whether a task lost rank on the way."""

    u: FloatArray
    lost_rank: bool


class System(NamedTuple):
    """``A u = c`` in whitened coordinates; ratio: how much larger than ||A|| the equation is by nature, at least 1."""

    A: FloatArray
    c: FloatArray
    ratio: float


class EquationSolver(Solver):
    """A method without bounds, written for W = I and ``A_k u = c_k`` with ``c_k = b_k - d_k``."""

    def _solve_impl(self, problem: Problem) -> Solution:
        try:
            answer = self._whitened(problem)
        except FloatingPointError:  # LAPACK met infinities
            return _failed(problem, self.name)
        return Solution(problem, answer.u, self.name, self, None, answer.lost_rank)

    def _astray(self, problem: Problem, u: FloatArray) -> Solution:
        """FAILED where the numbers over- or underflowed."""
        return _failed(problem, self.name) if u.shape == (problem.n,) else super()._astray(problem, u)

    def _whitened(self, problem: Problem) -> Answer:
        """The answer in the metric of the problem."""
        u0 = problem.reference
        if problem.metric is None:
            return self._impl(systems_of(problem), problem, u0)
        white = Whitening(problem.metric)
        answer = self._impl(systems_of(problem, white), problem, None if u0 is None else white.forward(u0))
        return Answer(white.back(answer.u), answer.lost_rank)

    @abstractmethod
    def _impl(self, systems: list[System], problem: Problem, u0: FloatArray | None) -> Answer:
        """Minimise 1/2 ||u - u0||^2 over the answers to ``systems`` as this method sees them."""


def _failed(problem: Problem, name: str) -> Solution:
    return Solution(problem, np.zeros(problem.n), name, status=Status.FAILED)


def systems_of(problem: Problem, white: Whitening | None = None) -> list[System]:
    """Every equation of a problem, whitened if a whitening is given."""
    if white is None:
        return [System(e.A, e.rhs, e.ratio) for e in problem.equations]
    return [System(white.matrix(e.A), e.rhs, e.ratio) for e in problem.equations]


def stack(systems: list[System], equations: tuple[Equation, ...]) -> System:
    """All equations as one, rows weighed by the root of their weight; those of weight 0 left out.

    c may be (m,) or (m, k), for k right-hand sides.
    """
    if len(systems) == 1 and equations[0].weight == 1.0:
        return systems[0]
    kept = [(e.weight**0.5, system) for e, system in zip(equations, systems, strict=True) if e.weight > 0.0]
    if not kept:
        first = systems[0]
        return System(np.zeros((0, first.A.shape[1])), np.zeros((0, *first.c.shape[1:])), 1.0)
    A = np.asfortranarray(np.concatenate([root * system.A for root, system in kept]))
    c = np.concatenate([root * system.c for root, system in kept])
    if all(system.ratio == 1.0 for _, system in kept):
        return System(A, c, 1.0)
    by_nature = max(root * system.ratio * scale(system.A) for root, system in kept)
    norm = scale(A)
    return System(A, c, max(1.0, by_nature / norm) if norm > 0.0 else 1.0)
