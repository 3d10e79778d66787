"""Sequential quadratic programming on the set where the tasks are met.

Each step solves the quadratic programme in the free directions, moves along it, and comes back onto the tasks by
Newton's method; so every path on the way does its task, and the merit ``J/J_0 + nu max(excess, 0)`` weighs cost against
limits only. Paths beyond their limits are first brought inside (:func:`restore`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from cartctl.checks import FloatArray
from cartctl.wholepath.blocks import Layout
from cartctl.wholepath.costs.base import PathCost
from cartctl.wholepath.curvature import local_model
from cartctl.wholepath.qp import Programmes, nearest
from cartctl.wholepath.rows import Rows
from cartctl.wholepath.trace import Trace

MARGIN = 2e-4  # half-ranges: what the programme keeps away from the limits, for its own accuracy
_LONGEST = 0.5  # rad or m: a step of any joint at any sample
_PENALTY = 10.0
_HALVINGS = 12


class Iterate(NamedTuple):
    """One iteration of a search over a number of samples.

    cost; excess: the worst one over a limit, half-ranges; residual: the worst task error, m or rad; step: the longest
    of any joint, rad or m, before it was shortened; slope: what the linear model hoped to gain, as a share of the first
    cost.
    """

    samples: int

    cost: float
    excess: float
    residual: float
    step: float
    slope: float


@dataclass(eq=False)
class Optimised:
    """Where the iterations ended, and how they went there."""

    trace: Trace
    cost: float
    excess: float
    converged: bool
    history: list[Iterate] = field(default_factory=list)
    inner: int = 0
    qps: int = 0
    merged: bool = False

    @property
    def kept(self) -> bool:
        """Whether the path does its tasks within the limits."""
        return bool(self.trace.met.all()) and self.excess <= 0.0


def optimise(
    trace: Trace,
    cost: PathCost,
    rows: Rows | None,
    rounds: int,
    tolerance: float = 1e-7,
    known: Sequence[Optimised] = (),
) -> Optimised:
    """From a path that does its tasks to one of least cost nearby; given up where it runs into a ``known`` one."""
    programmes = Programmes()
    layout = layout_of(trace)
    if rows is not None and excess_of(rows, trace) > -MARGIN and layout.size:
        trace = restore(trace, cost, rows, layout)
    value, over = cost.value(trace), excess_of(rows, trace)
    reference = max(abs(value), 1e-12)
    done = Optimised(trace, value, over, False)
    small = 0
    for _ in range(rounds):
        if not layout.size:
            done.converged = True
            break
        model = local_model(trace, cost.quadratic(trace), layout)
        rows_now = _no_rows(layout) if rows is None else rows.linear(trace, layout)
        step = programmes.solve(model.P, model.factor, model.g, *rows_now)
        y = step.y if step.how != "none" else nearest(model.P, *rows_now, 1e-6)  # no room: back inside first
        delta = layout.expand(trace.Z, y)
        longest = float(np.abs(delta).max(initial=0.0))
        share = min(1.0, _LONGEST / max(longest, 1e-300))
        slope = float(model.g @ y)
        moved = _search(trace, cost, rows, value, over, delta, share, slope, reference)
        done.history.append(Iterate(trace.setting.size, value, over, _residual(trace), longest, abs(slope) / reference))
        if moved is None:
            done.converged = abs(slope) <= 1e-6 * reference
            break
        gain = value - moved.cost
        trace, value, over = moved.trace, moved.cost, moved.excess
        if any(same(trace, other.trace) and other.cost <= value for other in known):
            done.merged = True
            break
        small = small + 1 if gain <= tolerance * reference and over <= 0.0 else 0
        if small >= 2 or (longest < 1e-7 and over <= 0.0):
            done.converged = True
            break
    if rows is not None and over > 0.0 and layout.size:
        trace = restore(trace, cost, rows, layout)
        value, over = cost.value(trace), excess_of(rows, trace)
    done.trace, done.cost, done.excess = trace, value, over
    done.inner, done.qps = programmes.iterations, programmes.calls
    done.history.append(
        Iterate(trace.setting.size, value, over, _residual(trace), 0.0, done.history[-1].slope if done.history else 0.0)
    )
    return done


class _Moved(NamedTuple):
    trace: Trace
    cost: float
    excess: float


def _search(
    trace: Trace,
    cost: PathCost,
    rows: Rows | None,
    value: float,
    over: float,
    delta: FloatArray,
    share: float,
    slope: float,
    reference: float,
) -> _Moved | None:
    """The first of shares 1, 1/2, 1/4, ... of the step at which the merit falls."""
    before = value / reference + _PENALTY * max(over, 0.0)
    for _ in range(_HALVINGS):
        found = trace.moved(share * delta)
        if found.met.all():
            now = cost.value(found)
            excess = excess_of(rows, found)
            merit = now / reference + _PENALTY * max(excess, 0.0)
            drop = max(-slope, 0.0) / reference + _PENALTY * max(over, 0.0)
            if np.isfinite(merit) and merit < before - 1e-4 * share * drop:
                return _Moved(found, now, excess)
        share *= 0.5
    return None


def restore(trace: Trace, cost: PathCost, rows: Rows, layout: Layout, rounds: int = 25) -> Trace:
    """The path brought within its limits, or as near as the least squares of the violations lead."""
    over = _violation(rows, trace)
    for _ in range(rounds):
        if excess_of(rows, trace) <= -0.5 * MARGIN:
            break
        P = layout.hessian(cost.quadratic(trace), trace.Z)
        delta = layout.expand(trace.Z, nearest(P, *rows.linear(trace, layout), 1e-9))
        share = min(1.0, _LONGEST / max(float(np.abs(delta).max(initial=0.0)), 1e-300))
        for _ in range(_HALVINGS):
            found = trace.moved(share * delta)
            now = _violation(rows, found)
            if found.met.all() and now < (1.0 - 0.05 * share) * over:
                break
            share *= 0.5
        else:
            break
        trace, over = found, now
    return trace


def _no_rows(layout: Layout) -> tuple[sp.csr_matrix, FloatArray, FloatArray]:
    return sp.csr_matrix((0, layout.size)), np.zeros(0), np.zeros(0)


def same(a: Trace, b: Trace, within: float = 0.05) -> bool:
    """Whether two paths of the same samples are nowhere farther apart than ``within``, rad or m."""
    setting = a.setting
    if setting.robot.has_plain_coordinates:
        return float(np.linalg.norm(a.Q - b.Q, axis=1).max()) < within
    return all(np.linalg.norm(setting.robot.difference(p, q)) < within for p, q in zip(a.Q, b.Q, strict=True))


def layout_of(trace: Trace) -> Layout:
    """The unknowns of a path."""
    setting = trace.setting
    return Layout(setting.size, trace.Z.shape[2], setting.closed, setting.start is not None)


def excess_of(rows: Rows | None, trace: Trace) -> float:
    """The worst violation, half-ranges; -inf without limits."""
    return -np.inf if rows is None else float(rows.excess(trace).max(initial=-np.inf))


def _violation(rows: Rows, trace: Trace) -> float:
    return float(np.sum(np.maximum(rows.excess(trace) + MARGIN, 0.0) ** 2))


def _residual(trace: Trace) -> float:
    return float(np.linalg.norm(trace.E, axis=1).max(initial=0.0))
