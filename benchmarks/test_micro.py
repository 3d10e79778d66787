"""Kernels and calls one by one, by pytest-benchmark: ``make micro``. A round is a thousand calls: ms are us a call.

Every group has ``numpy.linalg.pinv`` of a 6 x 7 matrix in it; the ratios in brackets are to the quickest of the group.
The problems, motions and loops are those of the scripts beside this one, which write the tables of the documentation.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import cycle, islice

import numpy as np
import pytest
from compiled_time import controller, reachable, rollout
from pytest_benchmark.fixture import BenchmarkFixture
from sns_time import FREE, SATURATED, SCALED, cases, instances, prepared
from whole_steps import controllers, motion

import cartctl as cc
from cartctl.solvers.dls import damped_solve

CALLS = 1000
KINDS = (FREE, SATURATED, SCALED)
SIZES = [
    (n, sizes, kind) for group, n, sizes, kind, warm in cases() if group in ("one task", "three tasks") and not warm
]
KERNELS, SOLVES, STEPS, LOOPS = "kernels on prepared arrays", "cc.solve", "Controller.step", "compiled loops"


def thousand(benchmark: BenchmarkFixture, functions: list[Callable[[], object]]) -> None:
    """Measure them, in turns, a thousand calls a round."""
    calls = list(islice(cycle(functions), CALLS))

    def run() -> None:
        for call in calls:
            call()

    benchmark(run)


@pytest.mark.parametrize(
    "group", [pytest.param(g, marks=pytest.mark.benchmark(group=g)) for g in (KERNELS, SOLVES, STEPS, LOOPS)]
)
def test_numpy_pinv(benchmark: BenchmarkFixture, group: str) -> None:
    A = np.random.default_rng(0).normal(size=(6, 7))
    thousand(benchmark, [lambda: np.linalg.pinv(A)])


@pytest.mark.benchmark(group=KERNELS)
@pytest.mark.parametrize(("n", "sizes", "kind"), SIZES, ids=lambda v: "+".join(map(str, v)) if type(v) is tuple else v)
def test_sns_kernel(benchmark: BenchmarkFixture, n: int, sizes: tuple[int, ...], kind: str) -> None:
    thousand(benchmark, [prepared(problem)[0] for problem in instances(n, sizes, kind)])


@pytest.mark.benchmark(group=KERNELS)
def test_dls_kernel(benchmark: BenchmarkFixture) -> None:
    rng = np.random.default_rng(0)
    A, b = rng.normal(size=(6, 7)), rng.normal(size=6)
    thousand(benchmark, [lambda: damped_solve(A, b, 1e-4)])


@pytest.mark.benchmark(group=SOLVES)
@pytest.mark.parametrize("kind", KINDS)
def test_prepared(benchmark: BenchmarkFixture, kind: str) -> None:
    thousand(benchmark, [prepared(problem)[1] for problem in instances(7, (6,), kind)])


@pytest.mark.benchmark(group=SOLVES)
@pytest.mark.parametrize("kind", KINDS)
def test_solve_sns(benchmark: BenchmarkFixture, kind: str) -> None:
    thousand(benchmark, [lambda p=p: cc.solve(p, "sns") for p in instances(7, (6,), kind)])


@pytest.mark.benchmark(group=SOLVES)
@pytest.mark.parametrize("solver", ["dls", "pinv", "task-priority"])
def test_solve_without_bounds(benchmark: BenchmarkFixture, solver: str) -> None:
    free = [cc.Problem(p.equations) for p in instances(7, (6,), FREE)]
    thousand(benchmark, [lambda p=p: cc.solve(p, solver) for p in free])


@pytest.mark.benchmark(group=STEPS)
@pytest.mark.parametrize("name", controllers())
def test_step(benchmark: BenchmarkFixture, name: str) -> None:
    """The last thousand of a motion's steps; those before, untimed, bring the path's clock and the guesses there."""
    moving = controllers()[name]
    states = motion(moving)[0]

    def steps(part: list) -> None:
        for q, v, t in part:
            moving.step(q, v, t)

    def begin() -> None:
        moving.reset()
        steps(states[:-CALLS])

    benchmark.pedantic(lambda: steps(states[-CALLS:]), setup=begin, rounds=10)


@pytest.mark.benchmark(group=LOOPS)
@pytest.mark.parametrize("solver", ["sns", "dls", "task-priority"])
def test_rollout_step(benchmark: BenchmarkFixture, solver: str) -> None:
    limits = {} if solver == "sns" else {"limits": None}
    benchmark(rollout(controller(solver, **limits), copies=1, steps=CALLS))


@pytest.mark.benchmark(group=LOOPS)
def test_inverse_kinematics_pose(benchmark: BenchmarkFixture) -> None:
    robot, poses = cc.load("panda"), reachable(CALLS)
    benchmark(lambda: cc.inverse_kinematics(robot, poses, threads=1))
