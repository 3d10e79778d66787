"""What each solver adds to its arithmetic: one 6 x 7 equation, against the same arithmetic in raw LAPACK calls.

    python benchmarks/solver_time.py            # print the table
    python benchmarks/solver_time.py --save     # and write benchmarks/results/solver_time.csv

The aim is at most 3 x the raw time plus 4 us. Rounds are interleaved; medians are over rounds.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from harness import interleaved, save_rows, setting, show
from scipy.linalg import lapack

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "solver_time.csv"
M, N = 6, 7


def raw_arithmetic() -> dict[str, Callable[[], object]]:
    """What a method cannot do without, by LAPACK and numpy's matrix product alone."""
    rng = np.random.default_rng(0)
    A = np.asfortranarray(rng.normal(size=(M, N)))
    square = np.asfortranarray(rng.normal(size=(N, N)))
    b, b_square, u0 = rng.normal(size=M), rng.normal(size=N), rng.normal(size=N)
    minors = [np.asfortranarray(np.delete(A, j, axis=1)) for j in range(N)]
    small = np.asfortranarray(A @ A.T)

    def svd_solve(matrix: np.ndarray = A, rhs: np.ndarray = b) -> np.ndarray:
        U, s, Vt, _ = lapack.dgesdd(matrix, compute_uv=1, full_matrices=1)
        return Vt[: s.shape[0]].T @ ((U.T @ rhs) / s)

    def damped() -> np.ndarray:
        G = A @ A.T
        G.ravel()[:: M + 1] += 1e-4
        return A.T @ lapack.dposv(G, b)[1]

    def transpose() -> np.ndarray:
        slope = A.T @ b
        moved = A @ slope
        return (slope @ slope) / (moved @ moved) * slope

    def main_variables() -> np.ndarray:
        lapack.dgeqp3(A.T)
        return svd_solve()

    def reduced_gradient() -> np.ndarray:
        lapack.dgeqp3(A)
        for minor in minors:
            lapack.dgetrf(minor)
        factor, pivots, _ = lapack.dgetrf(minors[0])
        slope = lapack.dgetrs(factor, pivots, A[:, :1])[0]
        return lapack.dgetrs(factor, pivots, b)[0] - slope @ (u0[:1] - slope.T @ u0[1:])

    def projected() -> np.ndarray:
        _, _, Vt, _ = lapack.dgesdd(A, compute_uv=1, full_matrices=1)
        return svd_null(Vt) + Vt[:M].T @ b

    def svd_null(Vt: np.ndarray) -> np.ndarray:
        return Vt[M:].T @ (Vt[M:] @ u0)

    def robust() -> np.ndarray:
        lapack.dgesdd(A, compute_uv=1, full_matrices=1)
        return svd_solve()

    def reverse() -> np.ndarray:
        lapack.dgesdd(A, compute_uv=0)
        lapack.dgesdd(small, compute_uv=1, full_matrices=1)
        return svd_solve()

    def scaled() -> np.ndarray:
        return svd_solve() - svd_solve()

    return {
        "pinv": svd_solve,
        "dls": damped,
        "dls-manipulability": svd_solve,
        "dls-sigma": svd_solve,
        "numerical-filtering": svd_solve,
        "sdls": svd_solve,
        "transpose": transpose,
        "main-variables": main_variables,
        "projected-gradient": projected,
        "reduced-gradient": reduced_gradient,
        "extended-jacobian": lambda: svd_solve(square, b_square),
        "task-priority": projected,
        "singularity-robust-priority": robust,
        "reverse-priority": reverse,
        "task-scaling": scaled,
    }


def solvers() -> dict[str, Callable[[], object]]:
    """Every registered solver on a prepared problem, with a reference where it honours one."""
    rng = np.random.default_rng(0)
    A, b, u0 = rng.normal(size=(M, N)), rng.normal(size=M), rng.normal(size=N)
    plain, guided = cc.Problem([(A, b)]), cc.Problem([(A, b)], reference=u0)
    square = cc.Problem([(A, b), (rng.normal(size=(1, N)), [0.3])])
    found: dict[str, Callable[[], object]] = {}
    for name in cc.solvers():
        solver = cc.solvers.get_solver(name)
        null = name in ("projected-gradient", "reduced-gradient", "task-priority")
        problem = square if solver.extends else guided if null else plain
        found[name] = lambda s=solver, p=problem: s.solve(p)
    return found


def main() -> None:
    """Measure, print and, if asked, save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help=f"write {RESULTS.name}")
    save = parser.parse_args().save
    raw = raw_arithmetic()
    ours = {name: solve for name, solve in solvers().items() if name in raw}  # under bounds there is none: sns_time.py
    times = interleaved({f"{kind} {name}": f for kind, fs in (("ours", ours), ("raw", raw)) for name, f in fs.items()})
    rows = []
    for name in ours:
        mine, arithmetic = (float(np.median(times[f"{kind} {name}"])) for kind in ("ours", "raw"))
        allowed = 3.0 * arithmetic + 4.0
        rows.append(
            {
                "solver": name,
                "median_us": f"{mine:.2f}",
                "raw_us": f"{arithmetic:.2f}",
                "allowed_us": f"{allowed:.2f}",
                "within": "yes" if mine <= allowed else "no",
            }
        )
    show("One 6 x 7 equation, us", rows)
    if save:
        save_rows(RESULTS, rows, setting())


if __name__ == "__main__":
    main()
