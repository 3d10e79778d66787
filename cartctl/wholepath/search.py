"""From many starts to one path: a coarse search of each, a fine one of the best; never worse than a start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray
from cartctl.wholepath.costs.base import PathCost
from cartctl.wholepath.grid_search import LAYERS, carried, searched
from cartctl.wholepath.local import LocalMethod
from cartctl.wholepath.report import Start
from cartctl.wholepath.resampled import joined, resampled
from cartctl.wholepath.rows import Rows
from cartctl.wholepath.selfmotion import random_postures
from cartctl.wholepath.setting import Setting
from cartctl.wholepath.sqp import MARGIN, Iterate, Optimised, excess_of, optimise, same
from cartctl.wholepath.trace import Trace

COARSE = 51  # samples of the first search
_COARSE_ROUNDS = 15
_FINE = 2  # starts that are refined
_ALIKE = 0.25  # rad or m at every sample: starts of which one is enough
_RANDOM = 8  # random postures carried along where more than one degree is left

Tell = Callable[[str], None]


class Seed(NamedTuple):
    """A start by name: a joint path Q at the instants ``times``."""

    name: str
    Q: FloatArray
    times: FloatArray


@dataclass(eq=False)
class Outcome:
    """The best path, what became of every start, and the work of all searches."""

    best: Optimised
    history: list[Iterate] = field(default_factory=list)
    starts: list[Start] = field(default_factory=list)
    iterations: int = 0
    qps: int = 0
    osqp_iterations: int = 0

    def count(self, done: Optimised) -> Optimised:
        """Add up its work."""
        self.iterations += max(len(done.history) - 1, 0)
        self.qps += done.qps
        self.osqp_iterations += done.inner
        return done


def search(
    setting: Setting,
    cost: PathCost,
    local: list[tuple[LocalMethod, FloatArray | None]],
    given: list[Seed],
    iterations: int,
    rng: np.random.Generator,
    tell: Tell,
) -> Outcome:
    """The best path that any start leads to."""
    rows = None if setting.limits is None else Rows(setting.limits, MARGIN)
    coarse = setting if setting.size <= COARSE else setting.coarser(COARSE)
    own = [Seed(m.name, Q, setting.times) for m, Q in local if Q is not None]
    seeds = [*given, *own]
    tell("searching the grid of postures")
    seeds += _found(setting, cost, seeds, rng)
    outcome = Outcome(_anything(setting, cost, rows, seeds))
    first: list[tuple[Seed, Optimised]] = []
    begun: list[Trace] = []
    for seed in seeds:
        tell(f"coarse search from {seed.name}")
        trace = _through(coarse, seed)
        if not trace.met.all():
            outcome.starts.append(Start(seed.name, "off the task"))
        elif any(same(trace, other, _ALIKE) for other in begun):
            outcome.starts.append(Start(seed.name, "like another"))
        else:
            begun.append(trace)
            ends = [done for _, done in first if done.kept]
            done = outcome.count(optimise(trace, cost, rows, _COARSE_ROUNDS, 1e-4, ends))
            if done.merged:
                outcome.starts.append(Start(seed.name, "same path"))
            else:
                first.append((seed, done))
    first.sort(key=lambda pair: _rank(pair[1]))
    chosen: list[tuple[Seed, Optimised]] = []
    for pair in first:
        if len(chosen) < _FINE and not any(same(pair[1].trace, other[1].trace) for other in chosen):
            chosen.append(pair)
    final: dict[str, float] = {}
    for seed, done in chosen:
        tell(f"fine search from {seed.name}")
        finer = done
        if coarse is not setting:
            trace = _through(setting, Seed(seed.name, done.trace.Q, coarse.times))
            if not trace.met.all():
                continue
            finer = optimise(trace, cost, rows, iterations)
        elif not done.converged:
            finer = optimise(done.trace, cost, rows, iterations)
        outcome.count(finer)
        final[seed.name] = finer.cost
        if _rank(finer) <= _rank(outcome.best):
            outcome.best, outcome.history = finer, ([] if finer is done else done.history) + finer.history
    for seed in [*given, *own]:  # never worse than a start that keeps everything
        trace = _through(setting, seed)
        if not trace.met.all() or excess_of(rows, trace) > 0.0:
            continue
        if not outcome.best.kept or cost.value(trace) < outcome.best.cost:
            tell(f"fine search from {seed.name}")
            finer = outcome.count(optimise(trace, cost, rows, iterations))
            final[seed.name] = finer.cost
            if _rank(finer) < _rank(outcome.best):
                outcome.best, outcome.history = finer, finer.history
    for seed, done in first:
        value = final.pop(seed.name, None)
        end = "not refined" if value is None else "refined"
        outcome.starts.append(Start(seed.name, end, done.cost, done.kept, value))
    outcome.starts += [Start(name, "refined", cost=value) for name, value in final.items()]
    return outcome


def _rank(done: Optimised) -> tuple[bool, bool, float]:
    """What is met first, then what keeps the limits, then what costs least."""
    kept = done.kept
    return (not bool(done.trace.met.all()), not kept, done.cost if kept else done.excess)


def _through(setting: Setting, seed: Seed) -> Trace:
    """A seed's path on the tasks, its ends as they must be."""
    Q = np.array(resampled(setting.robot, seed.Q, seed.times, setting.times))
    if setting.start is not None:
        Q[0] = setting.start
    if setting.closed:
        Q = joined(setting.robot, Q)
    return Trace.through(setting, Q)


def _anything(setting: Setting, cost: PathCost, rows: Rows | None, seeds: list[Seed]) -> Optimised:
    """A path to fall back on: the one that meets its tasks at most samples."""
    traces = [_through(setting, seed) for seed in seeds[:3]]
    trace = max(traces, key=lambda t: int(t.met.sum()))
    with np.errstate(all="ignore"):
        value, over = cost.value(trace), excess_of(rows, trace)
    return Optimised(trace, value if np.isfinite(value) else np.finfo(float).max, over, False)


def _found(setting: Setting, cost: PathCost, seeds: list[Seed], rng: np.random.Generator) -> list[Seed]:
    """Starts in other postures: from the grid where one degree is left, else from random ones."""
    grid = setting.coarser(min(LAYERS, setting.size))
    known = []
    for seed in seeds:
        trace = _through(grid, seed)
        if trace.met.all():
            known.append(trace)
    if known and known[0].Z.shape[2] == 1:
        found = searched(grid, cost, [t.Q for t in known], rng)
        return [Seed(f"grid {i + 1}", f.Q, grid.times) for i, f in enumerate(found)]
    if setting.start is not None or (known and known[0].Z.shape[2] == 0):
        return []
    starts = random_postures(grid, 0, 4 * _RANDOM, rng)[:_RANDOM]
    paths = []
    for q in starts:
        way = carried(grid, 0, q[None])
        if len(way) == grid.size and all(len(Q) for Q in way.values()):
            paths.append(np.array([way[k][0] for k in range(grid.size)]))
    return [Seed(f"random {i + 1}", Q, grid.times) for i, Q in enumerate(paths)]
