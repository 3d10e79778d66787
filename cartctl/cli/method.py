"""From options to a solver, an objective and limits, each with what to say about it."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple

from cartctl import checks
from cartctl.cli.choices import OBJECTIVES, choice
from cartctl.errors import ParameterError
from cartctl.objectives import JointRange, Objective
from cartctl.solvers import Solver, solver_class, solvers, solvers_that_honour


class Purpose(NamedTuple):
    """What the redundancy is spent on, and that in words."""

    objective: Objective | None
    words: str


def make_solver(name: str, damping: float | None) -> Solver:
    """The solver of that name; raises SolverNotFound, and ParameterError where it has no damping to be set."""
    kind: Any = solver_class(name)
    if damping is None:
        return kind()  # type: ignore[no-any-return]
    if not _has_damping(kind):
        able = ", ".join(n for n in solvers() if _has_damping(solver_class(n)))
        raise ParameterError(f"--damping is {damping:g}, but solver {name!r} has none; drop it, or use --solver {able}")
    return kind(damping=damping)  # type: ignore[no-any-return]


def make_purpose(solver: Solver, name: str | None, gain: float | None) -> Purpose:
    """The objective asked for, or joint-range where the solver can; raises UnknownChoice, ParameterError.

    One asked for by name goes to every solver: the controller refuses it where it cannot be honoured.
    """
    if name is not None:
        choice("objective", name, OBJECTIVES)
    able = "reference" in solver.honours
    if name == "none" or (name is None and not able):
        if gain is not None:
            raise ParameterError(f"--objective-gain is {gain:g}, but there is no objective; drop it")
        others = ", ".join(solvers_that_honour("reference"))
        return Purpose(None, "none" if able else f"none: {solver.name} has no null-space term ({others} have)")
    if gain is not None:
        checks.number("--objective-gain", gain, low=0.0, strict=True)
    wanted = JointRange() if gain is None else JointRange(gain=gain)
    return Purpose(wanted, f"joint-range, gain {wanted.gain:g}, keeps the joints near mid-range")


def limit_options(solver: Solver) -> dict[str, Any]:
    """What to tell the controller: off where the solver honours none, which the header then says."""
    return {} if "bounds" in solver.honours else {"limits": None}


def _has_damping(kind: type[Solver]) -> bool:
    return is_dataclass(kind) and any(f.name == "damping" for f in fields(kind))
