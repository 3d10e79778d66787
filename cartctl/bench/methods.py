"""What is put to the scenarios: the solvers of the registry, solvers of one's own, and peers."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from typing import Any

from cartctl import checks
from cartctl.bench.peers import peers
from cartctl.errors import LookupFailure, ParameterError
from cartctl.solvers import Solver, solver_class, solvers


class MethodNotFound(LookupFailure):
    """Neither a solver nor a peer of that name."""

    kind = "solver or peer"


@dataclass(frozen=True)
class Method:
    """A solver under a name, or a peer of that name (solver None)."""

    name: str
    solver: Solver | None = None

    @property
    def peer(self) -> bool:
        """Whether it is another project's."""
        return self.solver is None

    @property
    def parameters(self) -> str:
        """The solver's fields as JSON."""
        if self.solver is None or not is_dataclass(self.solver):
            return "{}"
        return json.dumps({f.name: str(getattr(self.solver, f.name)) for f in fields(self.solver)}, sort_keys=True)


def methods(chosen: Iterable[str] | Mapping[str, Solver | str] = ("all",)) -> list[Method]:
    """Methods by name, each once: solvers, peers, ``all`` solvers of the registry, ``peers`` for all of those.

    A mapping gives solvers of one's own a name: ``{"mine": MySolver(), "sns": "sns"}``. Raises MethodNotFound,
    ParameterError.
    """
    if isinstance(chosen, Mapping) and chosen:
        return [_named(name, solver) for name, solver in chosen.items()]
    if isinstance(chosen, str):
        chosen = [chosen]
    chosen = checks.listed("solvers", chosen)
    if not chosen:
        raise ParameterError("solvers is empty; expected names such as 'sns', or a mapping of names to solvers")
    names: list[str] = []
    for name in chosen:
        names += list(solvers()) if name == "all" else list(peers()) if name == "peers" else [name]
    return [_by_name(name) for name in dict.fromkeys(names)]


def _named(name: str, solver: Solver | str) -> Method:
    if isinstance(solver, str):
        return Method(name, _by_name(solver).solver)
    if not isinstance(solver, Solver):
        raise ParameterError(f"solvers[{name!r}] is a {type(solver).__name__}; expected a Solver, or the name of one")
    return Method(name, solver)


def _by_name(name: str) -> Method:
    if name in peers():
        return Method(name)
    if name not in solvers():
        raise MethodNotFound(name, [*solvers(), *peers(), "all", "peers"])
    kind = solver_class(name)
    parameters: tuple[Field[Any], ...] = fields(kind) if is_dataclass(kind) else ()
    needed = [f.name for f in parameters if f.init and f.default is MISSING and f.default_factory is MISSING]
    if needed:
        raise ParameterError(
            f"solver {name!r} needs {', '.join(needed)}; give an instance, as in cc.bench.run(..., solvers={{...}})"
        )
    return Method(name, kind())
