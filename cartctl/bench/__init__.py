"""Benches: every method on every robot, in one honest table.

``cc.bench.run`` puts methods to scenarios and writes Parquet, ``cc.bench.results`` reads it, ``cc.bench.report``
writes it up, ``cc.bench.compare`` finds what became worse. The command line has the same as ``cartctl bench``.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cartctl.bench.regressions import compare as compare
    from cartctl.bench.replays import replay as replay
    from cartctl.bench.reporting import report as report
    from cartctl.bench.runner import Outcome as Outcome
    from cartctl.bench.runner import run as run
    from cartctl.bench.sets import SHIPPED as SHIPPED
    from cartctl.bench.sets import ScenarioSet as ScenarioSet
    from cartctl.bench.sets import load_set as load_set
    from cartctl.bench.sets import select as select
    from cartctl.bench.sets import shipped as shipped
    from cartctl.bench.table import results as results

_HOMES = {
    "Outcome": "runner", "SHIPPED": "sets", "ScenarioSet": "sets", "compare": "regressions", "load_set": "sets",
    "replay": "replays", "report": "reporting", "results": "table", "run": "runner", "select": "sets",
    "shipped": "sets",
}  # fmt: skip
__all__ = sorted(_HOMES)  # noqa: PLE0605 - names, from the table above


def __getattr__(name: str) -> Any:
    """Import a name when it is first asked for (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"cartctl.bench.{_HOMES[name]}"), name)
