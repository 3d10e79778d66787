"""What a plan says about itself: cost and gap, constraints, iterations, and how the local methods did."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

from cartctl.wholepath.between import Bound
from cartctl.wholepath.local import LocalMethod
from cartctl.wholepath.sqp import Iterate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class PlanStatus(Enum):
    """How a plan went; the value is a sentence for the user."""

    OPTIMAL = "no joint path nearby is better: the gradient along the tasks and limits is zero"
    NOT_CONVERGED = "the joint path is sound, but better ones are nearby: more samples or iterations= may find them"
    LIMITS = "no joint path was found within the limits: a longer duration, wider limits or another start may help"
    OUT_OF_REACH = "the tasks are not met at every sample: the path leaves what the robot reaches from here"


@dataclass(frozen=True)
class Start:
    """One start of the search.

    name: where it came from. end: what became of it: "refined", "not refined", "same path" (it ran into another one),
    "like another" (it began near another one), "off the task". coarse: its cost after the coarse search, kept: whether
    that kept the limits, cost: after the fine one; None where there was none.
    """

    name: str
    end: str
    coarse: float | None = None
    kept: bool | None = None
    cost: float | None = None


@dataclass(frozen=True, eq=False)
class PlanReport:
    """The report of a plan.

    status, message: how it went, and what stands in its way, in words. objective: the cost's name; cost: its value.
    local: every LocalMethod. best: the cheapest that does its task within the limits, None if none does. gap:
    ``(best - cost)/best``, what planning saves; None without best. residual: the largest task error at a sample, in m
    and rad; between: its bound between samples. excess: the worst limit, in half-ranges, < 0 inside. closure:
    ``||q(T) (-) q(0)||``, rad or m; drift: the largest joint distance over a lap, None for an open path. starts: every
    Start; history: an Iterate each of the search that won, the coarse one first; iterations: of all searches; qps,
    osqp_iterations: programmes that OSQP solved, and its own iterations. seconds: of planning, local methods included.
    """

    status: PlanStatus
    message: str
    objective: str
    cost: float
    local: tuple[LocalMethod, ...]
    residual: Bound
    between: Bound
    excess: float
    closure: float
    drift: float | None
    starts: tuple[Start, ...]
    history: tuple[Iterate, ...]
    iterations: int
    qps: int
    osqp_iterations: int
    seconds: float

    @property
    def feasible(self) -> bool:
        """Whether tasks and limits are met at every sample."""
        return self.status in (PlanStatus.OPTIMAL, PlanStatus.NOT_CONVERGED)

    @property
    def best(self) -> LocalMethod | None:
        """The cheapest local method that does its task within the limits."""
        return min((m for m in self.local if m.keeps), key=lambda m: m.cost, default=None)

    @property
    def gap(self) -> float | None:
        """``(best - cost)/|best|``."""
        best = self.best
        if best is None or not self.feasible or best.cost == 0.0:
            return None
        return (best.cost - self.cost) / abs(best.cost)

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """A figure of the convergence, the costs and the drifts; written to ``path`` if given."""
        from cartctl.report import plot_plan, save_figure

        figure = plot_plan(self)
        if path is not None:
            save_figure(figure, path)
        return figure

    def summary(self) -> dict[str, Any]:
        """The report as plain numbers and words, as a saved run keeps it in ``meta["plan"]``."""
        best = self.best
        return {
            "status": self.status.name,
            "message": self.message,
            "objective": self.objective,
            "cost": self.cost,
            "best_local": None if best is None else best.name,
            "gap": self.gap,
            "residual": _plain(self.residual),
            "between": _plain(self.between),
            "excess": _finite(self.excess),
            "closure": self.closure,
            "drift": self.drift,
            "local": [
                {
                    "name": m.name,
                    "cost": _finite(m.cost),
                    "residual": _finite(m.residual),
                    "excess": _finite(m.excess),
                    "drift": m.drift,
                    "keeps": m.keeps,
                }
                for m in self.local
            ],
            "starts": [asdict(start) for start in self.starts],
            "iterations": self.iterations,
            "qps": self.qps,
            "osqp_iterations": self.osqp_iterations,
            "seconds": self.seconds,
        }

    def __str__(self) -> str:
        return "\n".join([*_head(self), *_table(self.local, self.cost)])


def _head(report: PlanReport) -> list[str]:
    lines = [f"{report.status.name}: {report.message}", f"{report.objective} {report.cost:.6g}"]
    if report.gap is not None and report.best is not None:
        word = "below" if report.gap >= 0.0 else "above"
        lines[-1] += f", {abs(100.0 * report.gap):.3g} % {word} {report.best.name}, the best local method in the limits"
    words = ", ".join(
        f"{size:.1e} {unit} at samples, at most {wide:.1e} between"
        for unit, size, wide in zip(("m", "rad"), report.residual, report.between, strict=True)
        if size is not None and wide is not None
    )
    lines.append(f"task error {words}; closure {report.closure:.1e}; {report.iterations} iterations")
    return lines


def _table(local: Sequence[LocalMethod], cost: float) -> list[str]:
    lines = []
    for m in local:
        ratio = f"{m.cost / cost:.4g} x" if cost > 0.0 else f"{m.cost:.5g}"
        drift = "" if m.drift is None else f", drift {m.drift:.2g} a lap"
        lines.append(f"  {m.name}: {ratio}{drift}{trouble(m)}")
    return lines


def trouble(method: LocalMethod) -> str:
    """What a local method did wrong, in words that follow others."""
    if not method.on_task:
        return f", misses its task by {method.residual:.2g}"
    return "" if method.keeps else ", beyond the limits"


def _plain(bound: Bound) -> dict[str, float | None]:
    return {"m": bound.m, "rad": bound.rad}


def _finite(x: float) -> float | None:
    return float(x) if abs(x) < float("inf") else None
