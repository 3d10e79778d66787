"""What the exact solver costs: the compiled engine on prepared arrays, `cc.Prepared` and `cc.solve` around it.

    python benchmarks/sns_time.py            # print the table
    python benchmarks/sns_time.py --save     # and write benchmarks/results/sns_time.csv

Every case is a dozen random instances; a figure is the median over them of the least of several interleaved rounds.
``warm`` starts from the instance's own answer. Beside them, in the same run: the engine called for nothing (an equation
without rows for one unknown), and ``numpy.linalg.pinv`` of a 6 x 7 matrix.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from harness import interleaved, save_rows, setting, show

import cartctl as cc
from cartctl.solvers.exact.prepared_kernel import solve_prepared

RESULTS = Path(__file__).parent / "results" / "sns_time.csv"
INSTANCES, ROUNDS = 12, 8
FREE, SATURATED, SCALED = "unsaturated", "saturated", "scaled"


def instance(rng: np.random.Generator, n: int, sizes: tuple[int, ...], kind: str) -> cc.Problem | None:
    """Tasks that u = A# b meets inside, or that must saturate or slow down; None where they happen not to."""
    equations = [(rng.normal(size=(m, n)), rng.normal(size=m)) for m in sizes]
    free = cc.Problem(equations)
    peak = float(np.abs(cc.solve(free, "task-priority").u).max())
    share = {FREE: 1.2, SATURATED: rng.uniform(0.75, 0.95), SCALED: rng.uniform(0.1, 0.4)}[kind]
    limit = np.full(n, share * peak)
    problem = cc.Problem(equations, lower=-limit, upper=limit)
    solution = cc.solve(problem, "sns")
    slowed = float(solution.scales.min()) < 1.0
    fits = (
        solution.scales.min() > 0.0 and slowed == (kind == SCALED) and (kind == FREE) != bool(solution.saturated.any())
    )
    return problem if fits else None


def instances(n: int, sizes: tuple[int, ...], kind: str) -> list[cc.Problem]:
    """A dozen of them."""
    rng = np.random.default_rng(1)
    found = (instance(rng, n, sizes, kind) for _ in range(2000))
    return [p for p, _ in zip(filter(None, found), range(INSTANCES), strict=False)]


def prepared(problem: cc.Problem, warm: bool = False) -> tuple[Callable[[], object], Callable[[], object]]:
    """The engine on prepared arrays, and :meth:`cartctl.Prepared.solve`; warm: from the instance's own answer."""
    made = cc.Prepared(problem.n, [len(e.b) for e in problem.equations], bounds=problem.lower is not None)
    for A, b, e in zip(made.A, made.b, problem.equations, strict=True):
        A[:], b[:] = e.A, e.b
    if problem.lower is not None:
        made.lower[:], made.upper[:] = problem.lower, problem.upper
    made.solve(warm)
    engine, arrays = solve_prepared.compiled, (made._ints, made._floats)
    return lambda: engine(*arrays), lambda: made.solve(warm)


def cases() -> Iterator[tuple[str, int, tuple[int, ...], str, bool]]:
    """(group, n, sizes, kind, warm)."""
    for kind in (FREE, SATURATED, SCALED):
        yield "one task", 7, (6,), kind, False
    for kind in (FREE, SCALED):
        yield "three tasks", 7, (3, 2, 1), kind, False
    for n in (20, 40):
        for kind in (FREE, SATURATED, SCALED):
            yield "one task", n, (6,), kind, False
            if kind != FREE:
                yield "one task", n, (6,), kind, True
    for n in (7, 10, 15, 30, 60):
        yield "growth with n", n, (6,), SCALED, False
    for p in range(1, 6):
        yield "growth with tasks", 20, (3,) * p, SCALED, False


def main() -> None:
    """Measure, print and, if asked, save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help=f"write {RESULTS.name}")
    save = parser.parse_args().save
    A = np.random.default_rng(0).normal(size=(6, 7))
    nothing = cc.Problem([(np.zeros((0, 1)), [])])
    references = {"called for nothing": prepared(nothing)[0], "numpy pinv 6 x 7": lambda: np.linalg.pinv(A)}
    least = {name: float(min(times)) for name, times in interleaved(references, ROUNDS, 300).items()}
    base = least["numpy pinv 6 x 7"]
    rows = [row(name, "", "", "", 1, t, [], base) for name, t in least.items()]
    sns = cc.solvers.get_solver("sns")
    for group, n, sizes, kind, warm in cases():
        problems = instances(n, sizes, kind)
        functions: dict[str, Callable[[], object]] = {}
        for k, problem in enumerate(problems):
            start = sns.solve(problem) if warm else None
            functions[f"engine {k}"], functions[f"prepared {k}"] = prepared(problem, warm)
            functions[f"solve {k}"] = lambda p=problem, s=start: sns.solve(p, s)
        times = interleaved(functions, ROUNDS, 2000 // n)
        engine, *calls = (
            float(np.median([min(times[f"{what} {k}"]) for k in range(len(problems))]))
            for what in ("engine", "prepared", "solve")
        )
        rows.append(row(group, n, "+".join(map(str, sizes)), kind + " warm" * warm, len(problems), engine, calls, base))
    show("Exact scaling, us", rows)
    if save:
        save_rows(RESULTS, rows, setting())


def row(
    group: str, n: object, sizes: str, kind: str, count: int, engine: float, calls: list[float], base: float
) -> dict[str, str]:
    """One line of the table."""
    told = [f"{t:.2f}" for t in calls] or ["", ""]
    return {
        "case": group,
        "n": str(n),
        "rows": sizes,
        "kind": kind,
        "instances": str(count),
        "engine_us": f"{engine:.2f}",
        "prepared_us": told[0],
        "solve_us": told[1],
        "of_pinv": f"{engine / base:.2f}",
    }


if __name__ == "__main__":
    main()
