"""What each backend of ``qp`` costs: small dense tracking problems, large sparse ones.

    python benchmarks/qp_backends.py            # print the table
    python benchmarks/qp_backends.py --save     # and write benchmarks/results/qp_backends.csv

Medians over many problems, interleaved; the ratio is to ``auto`` on the same problems in the same run. Where auto is
DAQP the two run the same code but for the choice, so the larger sets show the noise. One BLAS thread unless
OPENBLAS_NUM_THREADS says otherwise: on a busy machine several stall each other. The tracking problems are those of a
Panda at random postures whose hand shall move at up to 1 m/s and rad/s, as fast as its joint speeds allow; ``chain``
limits the differences of neighbours, ``random`` has five entries a row.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from time import perf_counter_ns

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is imported

import numpy as np
import qpsolvers
from harness import save_rows, setting, show

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "qp_backends.csv"
BACKENDS = ["auto", *(b for b in ("daqp", "osqp", "proxqp") if b in qpsolvers.available_solvers)]


def tracking(count: int) -> list[cc.Problem]:
    """Panda, n = 7, 6 rows, box."""
    rng, robot = np.random.default_rng(0), cc.load("panda")
    limits = robot.limits
    problems = []
    for _ in range(count):
        q = rng.uniform(limits.position_lower, limits.position_upper)
        J = robot.state(q).jacobian(robot.tool)
        lower, upper = limits.velocity_lower, limits.velocity_upper
        problems.append(cc.Problem([(J, rng.uniform(-1.0, 1.0, 6))], lower=lower, upper=upper))
    return problems


def chain(n: int) -> list[cc.Problem]:
    """Every fourth unknown has a goal, neighbours may differ by 0.3."""
    rng, limit = np.random.default_rng(n), np.full(n - 1, 0.3)
    A, C = np.eye(n)[::4], np.diff(np.eye(n), axis=0)
    goals = [2.0 * rng.normal(size=len(A)) for _ in range(2)]
    return [cc.Problem([(A, g)], -np.ones(n), np.ones(n), (C, -limit, limit)) for g in goals]


def scattered(n: int) -> list[cc.Problem]:
    """n/4 task rows and n/2 limited rows of about five entries each."""
    rng, limit = np.random.default_rng(n), np.full(n // 2, 0.6)

    def rows(m: int) -> np.ndarray:
        return rng.normal(size=(m, n)) * (rng.random((m, n)) < 5.0 / n)

    data = [(rows(n // 4), 3.0 * rng.normal(size=n // 4), rows(n // 2)) for _ in range(2)]
    return [cc.Problem([(A, b)], -0.5 * np.ones(n), 0.5 * np.ones(n), (C, -limit, limit)) for A, b, C in data]


def measure(problems: list[cc.Problem], rounds: int) -> dict[str, tuple[float, cc.Solution]]:
    """Median us of each backend, and its last answer; all take their turn on every problem, in shuffled order."""
    solvers = {name: cc.QP(backend=name) for name in BACKENDS}
    times: dict[str, list[float]] = {name: [] for name in solvers}
    answers: dict[str, cc.Solution] = {}
    for solver in solvers.values():
        solver.solve(problems[0])
    order, rng = list(solvers), np.random.default_rng(0)
    for _ in range(rounds):
        for problem in problems:
            rng.shuffle(order)  # whoever comes after OSQP finds cold caches: 25 us at n = 7
            for name in order:
                start = perf_counter_ns()
                answers[name] = solvers[name].solve(problem)
                times[name].append((perf_counter_ns() - start) / 1e3)
    return {name: (float(np.median(times[name])), answers[name]) for name in solvers}


SETS: dict[str, tuple[Callable[[], list[cc.Problem]], int]] = {
    "tracking, n = 7": (lambda: tracking(200), 3),
    "chain, n = 200": (lambda: chain(200), 3),
    "chain, n = 500": (lambda: chain(500), 2),
    "chain, n = 1000": (lambda: chain(1000), 1),
    "random, n = 200": (lambda: scattered(200), 3),
    "random, n = 500": (lambda: scattered(500), 1),
    "chain, n = 1500": (lambda: chain(1500), 1),
}


def main() -> None:
    """Measure, print and, if asked, save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help=f"write {RESULTS.name}")
    save = parser.parse_args().save
    rows = []
    for label, (make, rounds) in SETS.items():
        found = measure(make(), rounds)
        for name, (median, answer) in found.items():
            rows.append(
                {
                    "problems": label,
                    "backend": name,
                    "answered_by": str(getattr(answer, "backend", "")),
                    "median_us": f"{median:.0f}",
                    "ratio": f"{median / found['auto'][0]:.2f}",
                    "violation": f"{answer.bound_violation():.1e}",
                }
            )
    show("Backends of qp", rows)
    if save:
        save_rows(
            RESULTS,
            rows,
            setting()
            | {"blas_threads": os.environ["OPENBLAS_NUM_THREADS"]}
            | {name: version(name) for name in ("qpsolvers", "daqp", "osqp")},
        )


if __name__ == "__main__":
    main()
