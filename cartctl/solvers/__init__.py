"""The registry of methods: one file each, one line each. Works without Pinocchio."""

from __future__ import annotations

import sys
from functools import lru_cache
from importlib import import_module
from inspect import isabstract
from types import ModuleType

from cartctl.algebra.problem import Problem
from cartctl.algebra.solution import Solution
from cartctl.errors import ParameterError, SolverNotFound
from cartctl.solvers.base import EquationSolver, Solver

_REGISTRY = {
    "pinv": "pinv:Pinv",
    "dls": "dls:DLS",
    "dls-manipulability": "dls_manipulability:DLSManipulability",
    "dls-sigma": "dls_sigma:DLSSigma",
    "numerical-filtering": "numerical_filtering:NumericalFilteringSolver",
    "sdls": "sdls:SDLS",
    "transpose": "transpose:Transpose",
    "main-variables": "main_variables:MainVariables",
    "projected-gradient": "projected_gradient:ProjectedGradient",
    "reduced-gradient": "reduced_gradient:ReducedGradient",
    "extended-jacobian": "extended_jacobian:ExtendedJacobian",
    "task-priority": "task_priority:TaskPriority",
    "singularity-robust-priority": "singularity_robust_priority:SingularityRobustPriority",
    "reverse-priority": "reverse_priority:ReversePriority",
    "task-scaling": "task_scaling:TaskScaling",
    "sns": "sns:SNS",
    "sns-greedy": "sns_greedy:SNSGreedy",
    "qp": "qp:QP",
    "hqp": "hqp:HQP",
}

__all__ = [
    "EquationSolver",
    "Solver",
    "get_solver",
    "solve",
    "solver_class",
    "solvers",
    "solvers_that_honour",
]


def solver_class(name: str) -> type[Solver]:
    """The class registered under ``name``; raises SolverNotFound with the closest names."""
    if name not in _REGISTRY:
        raise SolverNotFound(name, _REGISTRY)
    module, _, cls = _REGISTRY[name].partition(":")
    return getattr(import_module(f"cartctl.solvers.{module}"), cls)  # type: ignore[no-any-return]


def solvers() -> dict[str, str]:
    """Every registered name with one line on what it does.

    >>> import cartctl as cc
    >>> cc.solvers()["dls"]
    'Damped least squares over all equations stacked.'
    """
    return {name: (solver_class(name).__doc__ or "").strip().splitlines()[0] for name in _REGISTRY}


def solvers_that_honour(feature: str) -> list[str]:
    """Names of the registered solvers that honour a feature: see :attr:`Solver.honours`."""
    return [name for name in _REGISTRY if feature in solver_class(name).honours]


@lru_cache
def _by_name(name: str) -> Solver:
    """The one instance with default parameters: solvers keep no state, so everybody may have the same."""
    return solver_class(name)()


def get_solver(solver: str | Solver | type[Solver]) -> Solver:
    """An instance: by name, from a class with its default parameters, or as given.

    Raises SolverNotFound, ParameterError.
    """
    if isinstance(solver, Solver):
        return solver
    if isinstance(solver, str):
        return _by_name(solver)
    if isinstance(solver, type) and issubclass(solver, Solver) and not isabstract(solver):
        return solver()
    raise ParameterError(f"solver is {solver!r}; expected a name from cc.solvers() or a Solver instance")


def solve(problem: Problem, solver: str | Solver | type[Solver] = "pinv", *, start: Solution | None = None) -> Solution:
    """The answer of ``solver`` to ``problem``.

    start: an earlier Solution, from which a method that can (``sns``, ``hqp``) reaches the same answer sooner.

    Raises SolverNotFound, UnsupportedProblem. Numerical trouble is in ``solution.status``.

    >>> import cartctl as cc
    >>> solution = cc.solve(cc.Problem([([[2.0, 0.0, 0.0], [0.0, 1.0, 1.0]], [1.0, 2.0])]), "pinv")
    >>> print(solution.u, solution.status)
    [0.5 1.  1. ] OPTIMAL
    """
    if not isinstance(problem, Problem):
        raise ParameterError(f"problem is a {type(problem).__name__}; expected a cc.Problem")
    if start is not None and not isinstance(start, Solution):
        raise ParameterError(f"start is a {type(start).__name__}; expected a Solution, or None")
    return get_solver(solver).solve(problem, start)


class _CallableModule(ModuleType):
    """Lets ``cartctl.solvers`` be the package and ``cartctl.solvers()`` the list, in whatever order they come."""

    def __call__(self) -> dict[str, str]:
        return solvers()


sys.modules[__name__].__class__ = _CallableModule
