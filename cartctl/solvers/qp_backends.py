"""The solvers behind ``qp``: DAQP called directly, every other one through qpsolvers (Caron et al.).

Small dense programmes go as ``H = A^T A + rho W``; large ones, to a backend that knows sparse matrices, with the slack
e of the tasks as unknowns beside v: ``A v - e = c`` keeps the zeros that ``A^T A`` would fill.
"""

from __future__ import annotations

import sys
import warnings
from ctypes import c_int
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.solvers.qp_polish import Point
from cartctl.solvers.qp_program import Program

# Backend -> the package that brings it, where the two differ. quadprog is licensed under the GPL: never a default.
_PACKAGES = {
    "proxqp": "proxsuite",
    "highs": "highspy",
    "kvxopt": "kvxopt",
    "gurobi": "gurobipy",
    "hpipm": "hpipm_python",
    "jaxopt_osqp": "jaxopt",
}
# What each calls its tolerance; backends that are not listed keep their own.
_TOLERANCES = {
    "osqp": ("eps_abs", "eps_rel"),
    "proxqp": ("eps_abs", "eps_rel"),
    "piqp": ("eps_abs", "eps_rel"),
    "scs": ("eps_abs", "eps_rel"),
    "qpalm": ("eps_abs", "eps_rel"),
    "clarabel": ("tol_feas", "tol_gap_abs", "tol_gap_rel"),
    "cvxopt": ("feastol", "abstol", "reltol"),
}
_CONDENSED = 150  # unknowns up to which a backend that takes both is given H; beyond, the slack form
# Unknowns from which OSQP is tried. On banded rows (difference limits) it then takes 0.3 to 1.8 times as long as
# DAQP, by the data; where entries are scattered over the columns DAQP is still 3 to 5 times as fast at 1200: name it.
_LARGE = 1000
_SPARSE = 0.25  # share of entries that are not zero
_INFINITY = 1e30  # DAQP's


class Found(NamedTuple):
    """What a backend says: a point, exact or not, and whether it calls it solved."""

    point: Point
    solved: bool


def installed(package: str) -> bool:
    """Whether a package is there."""
    return package in sys.modules or find_spec(package) is not None


def check_backend(name: str) -> None:
    """Raises ParameterError, naming what to install, where the backend is missing."""
    if name in ("auto", "daqp", "osqp"):
        for needed in {"daqp": ["daqp"], "osqp": ["qpsolvers", "osqp"]}.get(name, []):
            if not installed(needed):
                raise ParameterError(f"backend {name!r} needs {needed}, which is missing: pip install {needed}")
        return
    import qpsolvers

    if name not in qpsolvers.available_solvers:
        listed = ", ".join(map(repr, ["auto", *qpsolvers.available_solvers]))
        package = _PACKAGES.get(name, name)
        raise ParameterError(
            f"backend is {name!r}; installed are {listed}; if it is one of qpsolvers' own: pip install {package}"
        )


def choose(p: Program) -> str:
    """DAQP where the programme is small or dense, OSQP where it is large and sparse."""
    entries = p.n * (p.A.shape[0] + p.C.shape[0])
    full = np.count_nonzero(p.A) + np.count_nonzero(p.C) if p.n > _LARGE else entries
    metric_is_sparse = p.W.ndim == 1 or np.count_nonzero(p.W) < _SPARSE * p.W.size
    wanted = "osqp" if p.n > _LARGE and full < _SPARSE * entries and metric_is_sparse else "daqp"
    if not installed(wanted):
        wanted = "daqp" if wanted == "osqp" else "osqp"
    check_backend(wanted)
    return wanted


def run(p: Program, backend: str, tolerance: float, max_iterations: int) -> Found:
    """The backend's own answer; not solved where it raises (some do where a programme has no room)."""
    try:
        if backend == "daqp":
            return _daqp(p, max_iterations)
        return _qpsolvers(p, backend, tolerance, max_iterations)
    except (ArithmeticError, ValueError, RuntimeError):
        return Found(Point(np.zeros(p.n), np.zeros(p.C.shape[0]), np.zeros(p.n)), False)


def _daqp(p: Program, max_iterations: int) -> Found:
    import daqp

    n, r = p.n, p.C.shape[0]
    low = np.maximum(np.concatenate([p.low, p.c_low]), -_INFINITY)
    high = np.minimum(np.concatenate([p.high, p.c_high]), _INFINITY)
    sense = np.zeros(n + r, dtype=c_int)
    x, _, flag, info = daqp.solve(
        p.hessian(), -(p.A.T @ p.c), np.ascontiguousarray(p.C), high, low, sense,
        primal_tol=1e-11, dual_tol=1e-14, iter_limit=max_iterations,
    )  # fmt: skip
    multipliers = np.asarray(info["lam"])
    return Found(Point(np.asarray(x), multipliers[n:], multipliers[:n]), flag > 0)


def _qpsolvers(p: Program, backend: str, tolerance: float, max_iterations: int) -> Found:
    import qpsolvers

    options: dict[str, Any] = {name: tolerance for name in _TOLERANCES.get(backend, ())}
    if backend == "osqp":
        options["max_iter"] = max_iterations
    below, above = np.isfinite(p.c_low), np.isfinite(p.c_high)
    G, h = np.concatenate([p.C[above], -p.C[below]]), np.concatenate([p.c_high[above], -p.c_low[below]])
    condensed = backend not in qpsolvers.sparse_solvers or (p.n <= _CONDENSED and backend in qpsolvers.dense_solvers)
    problem = _condensed(p, G, h) if condensed else _with_slack(p, G, h)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a status, which we look at ourselves
        answer = qpsolvers.solve_problem(problem, solver=backend, **options)
    x = np.zeros(p.n) if answer.x is None else np.asarray(answer.x)[: p.n]
    z, z_box = np.zeros(p.C.shape[0]), np.zeros(p.n)
    if answer.z is not None and answer.z.shape[0]:
        k = int(above.sum())
        z[above] += answer.z[:k]
        z[below] -= answer.z[k:]
    if answer.z_box is not None and answer.z_box.shape[0]:
        z_box = np.asarray(answer.z_box)[: p.n]
    finite = all(np.isfinite(a).all() for a in (x, z, z_box))
    return Found(Point(x, z, z_box), bool(answer.found) and finite)


def _condensed(p: Program, G: FloatArray, h: FloatArray) -> Any:
    import qpsolvers

    rows = {"G": G, "h": h} if h.shape[0] else {}
    return qpsolvers.Problem(P=p.hessian(), q=-(p.A.T @ p.c), lb=p.low, ub=p.high, **rows)


def _with_slack(p: Program, G: FloatArray, h: FloatArray) -> Any:
    import qpsolvers
    from scipy import sparse

    m = p.A.shape[0]
    metric = sparse.diags(p.W) if p.W.ndim == 1 else sparse.csc_matrix(p.W)
    P = sparse.block_diag([p.rho * metric, sparse.eye(m)], format="csc")
    A = sparse.hstack([sparse.csc_matrix(p.A), -sparse.eye(m)], format="csc")
    rows: dict[str, Any] = {"A": A, "b": p.c} if m else {}
    if h.shape[0]:
        G_sparse = sparse.hstack([sparse.csc_matrix(G), sparse.csc_matrix((h.shape[0], m))], format="csc")
        rows |= {"G": G_sparse, "h": h}
    wide = np.full(m, np.inf)
    low, high = np.concatenate([p.low, -wide]), np.concatenate([p.high, wide])
    return qpsolvers.Problem(P=P, q=np.zeros(p.n + m), lb=low, ub=high, **rows)
