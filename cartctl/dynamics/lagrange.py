"""Equations of motion in symbols, by Euler-Lagrange, from a table or from a given inertia matrix.

    d/dt (dL/d dq) - dL/dq = u,   L = T - U,   T = 1/2 dq^T M dq
    M(q) ddq + c(q, dq) + g(q) = u

with ``c_i = dq^T C_i dq``, ``C_i = 1/2 (dM_i/dq + (dM_i/dq)^T - dM/dq_i)``, ``g = dU/dq`` (Siciliano et al. 2009).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cartctl.dynamics.dh import DHArm
from cartctl.dynamics.expressions import entry, expression, names, require_sympy
from cartctl.dynamics.moving_frames import Algebra, centres, recursion
from cartctl.errors import ParameterError, ShapeError

if TYPE_CHECKING:
    from cartctl.dynamics.equations import Equations


def euler_lagrange(arm: DHArm) -> Equations:
    """T, U, M, c and g of an arm in symbols, by moving frames, as compact as the textbooks print them.

    The coordinates are ``q1``, ..., their rates ``dq1``, ..., accelerations ``ddq1``, .... Numbers of the table become
    fractions, multiples of pi/2 (to 1e-12) exact. U is zero with every mass at the origin of frame 0.

    Raises MissingDependencyError without SymPy, ParameterError where ``arm`` is no DHArm.
    """
    sympy = require_sympy()
    DHArm.check(arm)
    from cartctl.dynamics.trigsum import Ground

    q, dq = _symbols(arm.n)
    entries = [expression("entry", x) for link in arm.links for x in link.entries()]
    gravity = [expression("gravity", x) for x in arm.gravity]
    ground = Ground([*entries, *gravity], [*q, *dq], lumps=3 * arm.n)
    algebra = Algebra(
        ground.read,
        ground.turned,
        lambda i: q[i] if arm.links[i].joint == "R" else ground.generator(q[i]),
        ground.lump,
    )
    parts = []
    for i, columns in enumerate(recursion(arm, algebra)):
        own = columns.mass_matrix()
        own[i, i] = own[i, i] + columns.rotor
        parts.append(own)
    field = np.array([ground.convert(g) for g in gravity])
    potentials = [-(field @ (mass * r)) for mass, r in centres(arm, algebra)]
    masses = [sympy.Symbol(n) for link in arm.links for n in sorted(names(link.mass))]
    order = [*masses, *(sympy.Symbol(n) for n in _in_order(arm))]
    return _equations(ground, parts, potentials, (q, dq), (masses, order))


def from_inertia_matrix(M: Sequence[Sequence[Any]], U: Any = 0.0) -> Equations:
    """c, g and the factorisations that belong to a given M(q), rows of formulas in q1, q2, ..., and potential U(q).

    Raises ShapeError where M is not square, ParameterError where it is not symmetric or holds a coordinate it has not
    or a rate, MissingDependencyError.
    """
    sympy = require_sympy()
    from cartctl.dynamics.trigsum import Ground

    rows = [[entry(f"M[{i}][{j}]", x) for j, x in enumerate(row)] for i, row in enumerate(M)]
    n = len(rows)
    if not n or any(len(row) != n for row in rows):
        raise ShapeError(f"M has rows of {[len(row) for row in rows]} entries; expected a square matrix")
    q, dq = _symbols(n)
    potential = entry("U", U)
    used = set().union(*(names(x) for row in rows for x in row), names(potential))
    beyond = sorted(name for name in used if re.fullmatch(r"d{0,2}q[0-9]+", name) and name not in map(str, q))
    if beyond:
        raise ParameterError(
            f"{beyond[0]!r} stands in M or U; expected coordinates q1 to q{n} and no rates, as M is {n} x {n}"
        )
    read = [[expression("M", x) for x in row] for row in rows]
    ground = Ground([*(x for row in read for x in row), expression("U", potential)], [*q, *dq])
    matrix = np.array([[ground.convert(x) for x in row] for row in read])
    for i, j in zip(*np.triu_indices(n, 1), strict=True):
        if matrix[i, j] != matrix[j, i]:
            raise ParameterError(f"M[{i}][{j}] is {rows[i][j]!r}, M[{j}][{i}] {rows[j][i]!r}; expected a symmetric M")
    known = sorted(set().union(*(names(x) for row in rows for x in row), names(potential)) - {str(x) for x in q})
    order = [sympy.Symbol(name) for name in known]
    return _equations(ground, [matrix], [ground.read(potential)], (q, dq), ([], order))


def _symbols(n: int) -> tuple[list[Any], list[Any]]:
    sympy = require_sympy()
    return [sympy.Symbol(f"q{i + 1}") for i in range(n)], [sympy.Symbol(f"dq{i + 1}") for i in range(n)]


def _in_order(arm: DHArm) -> Iterable[str]:
    """The names of the table in the order a textbook multiplies them: inertias, lengths, centres of mass, gravity."""
    kinds = (
        [x for link in arm.links for row in link.inertia_matrix for x in row],
        [link.rotor for link in arm.links],
        [x for link in arm.links for x in (link.a, link.d)],
        [x for link in arm.links for x in link.com],
        list(arm.gravity),
        [x for link in arm.links for x in (link.alpha, link.theta)],
    )
    return dict.fromkeys(name for kind in kinds for x in kind for name in sorted(names(x)))


def _equations(
    ground: Any, parts: list[Any], potentials: list[Any], coordinates: tuple[Any, Any], symbols: tuple[Any, Any]
) -> Equations:
    """Everything that follows from M = sum of ``parts`` and U = sum of ``potentials``."""
    from cartctl.dynamics.equations import Equations

    q, dq = coordinates
    n = len(q)
    rates = np.array([ground.generator(x) for x in dq])
    half = _half(ground)
    M = sum(parts[1:], parts[0])
    U = sum(potentials[1:], potentials[0])
    D = np.array([[[M[i, j].diff(x) for j in range(n)] for i in range(n)] for x in q])  # D[k] = dM/dq_k
    C = np.empty((n, n, n), dtype=object)
    plain = np.empty((n, n), dtype=object)
    for i in range(n):
        for j in range(n):
            for k in range(n):
                C[i, j, k] = half * (D[k, i, j] + D[j, i, k] - D[i, j, k])
            plain[i, j] = sum(
                (D[k, i, j] * rates[k] - half * (D[i, j, k] * rates[k]) for k in range(n)), ground.constant(0)
            )
    S = C @ rates
    return Equations(
        q=q,
        dq=dq,
        kinetic=[half * (rates @ (part @ rates)) for part in parts],
        potential=potentials,
        M=M,
        C=C,
        S=S,
        plain=plain,
        c=S @ rates,
        g=np.array([U.diff(x) for x in q]),
        M_dot=np.array(
            [[sum((D[k, i, j] * rates[k] for k in range(n)), ground.constant(0)) for j in range(n)] for i in range(n)]
        ),
        masses=symbols[0],
        order=symbols[1],
    )


def _half(ground: Any) -> Any:
    sympy = require_sympy()
    return ground.constant(sympy.QQ(1, 2))
