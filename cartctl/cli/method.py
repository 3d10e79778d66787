"""From options to a solver, an objective and limits, each with what to say about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, NamedTuple

from cartctl import checks
from cartctl.cli.choices import OBJECTIVES, choice
from cartctl.errors import ParameterError, UnsupportedProblem
from cartctl.levels import get_level
from cartctl.objectives import Objective
from cartctl.objectives.named import KNOWN, in_words
from cartctl.solvers import Solver, solver_class, solvers

TORQUE_METRIC = "inverse-inertia"


class Purpose(NamedTuple):
    """What the redundancy is spent on, and that in words."""

    objective: Objective | None
    words: str


def make_solver(name: str, damping: float | None) -> Solver:
    """The solver of that name.

    Raises SolverNotFound, UnsupportedProblem where it needs more than the command line can say, and ParameterError
    where it has no damping to be set.
    """
    kind: Any = solver_class(name)
    if damping is not None and not has_damping(name):
        able = ", ".join(n for n in solvers() if has_damping(n))
        raise ParameterError(f"--damping is {damping:g}, but solver {name!r} has none; drop it, or use --solver {able}")
    needed = [f.name for f in fields(kind) if f.init and f.default is MISSING and f.default_factory is MISSING]
    if needed:
        raise UnsupportedProblem(
            f"solver {name!r} needs {', '.join(needed)}; give an instance of it to cc.Controller in Python"
        )
    return kind() if damping is None else kind(damping=damping)  # type: ignore[no-any-return]


def solver_list(given: Sequence[str], damping: float | None) -> dict[str, float | None]:
    """Names, each once and in the order given, with commas or apart, all if none is; with the damping of each.

    Raises SolverNotFound, and ParameterError for a damping that none of them has.
    """
    names = [name.strip() for text in given for name in text.split(",")]
    chosen = dict.fromkeys(names if given else solvers())
    if not any(chosen):
        raise ParameterError(f"--solvers is {','.join(given)!r}; expected names such as pinv,dls")
    able = [name for name in chosen if name and has_damping(name)]
    if damping is not None and not able:
        make_solver(next(iter(chosen)), damping)  # says so
    return {name: damping if name in able else None for name in chosen if name}


def make_objective(name: str | None, gain: float | None) -> Objective | None:
    """The objective of that name, joint-range by default; raises UnknownChoice, ParameterError."""
    if name is not None:
        choice("objective", name, OBJECTIVES)
    if name == "none":
        if gain is not None:
            raise ParameterError(f"--objective-gain is {gain:g}, but there is no objective; drop it")
        return None
    if gain is not None:
        checks.number("--objective-gain", gain, low=0.0, strict=True)
    known = KNOWN[name or "joint-range"]
    return known.make(known.gain if gain is None else gain)


def make_purpose(solver: Solver, name: str | None, gain: float | None) -> Purpose:
    """The objective asked for, or joint-range where the solver can; raises UnknownChoice, ParameterError.

    One asked for by name goes to every solver: the controller refuses it where it cannot be honoured.
    """
    able = spends_redundancy(solver)
    wanted = make_objective("none" if name is None and not able else name, gain)
    if wanted is not None:
        return Purpose(wanted, in_words(wanted))
    others = ", ".join(n for n in solvers() if spends_redundancy(solver_class(n)))
    return Purpose(None, "none" if able else f"none: {solver.name} has no null-space term ({others} have)")


def spends_redundancy(solver: Solver | type[Solver]) -> bool:
    """Whether it takes an objective: in its null space, or as rows that keep it extremal."""
    return "reference" in solver.honours or solver.extends


def limit_options(solver: Solver, level: str) -> dict[str, Any]:
    """What to tell the controller: off where solver or level honours none, which the header then says."""
    return {} if "bounds" in solver.honours and get_level(level).bounds is not None else {"limits": None}


def metric_of(solver: Solver, level: str, asked: str | None) -> str | None:
    """The one asked for; of torques, the dynamically consistent one where the solver takes any."""
    if asked is not None or level != "torque":
        return asked
    return TORQUE_METRIC if solver.takes_metric else None


def has_damping(name: str) -> bool:
    """Whether ``--damping`` means anything to the solver of that name."""
    kind = solver_class(name)
    return is_dataclass(kind) and any(f.name == "damping" for f in fields(kind))
