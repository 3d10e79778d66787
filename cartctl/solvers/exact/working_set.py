"""The working set: equalities and active inequalities as ``n_j . u = c0_j + s c1_j`` with unit normals n_j.

The normals are kept as ``n_j = sum_i R[j, i] Q[i]`` with orthonormal rows Q and R lower triangular (Gram-Schmidt with a
second pass where digits cancel, Givens rotations on removal). Then ``R g = c0 + s c1`` gives the point of least norm,
``u = Q^T g``, and ``R^T lam = g`` its multipliers: ``u = sum_j lam_j n_j``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.kernels import part

FIXED, FREE, TIED = 0, 1, 2  # an equality; an inequality that may leave; one that the present scale depends on

_CANCELLED = 0.3  # of a norm left after one pass: below, a second pass restores orthogonality


class WorkingSet(NamedTuple):
    """Up to n members and scratch space; ``num[0]`` is how many members there are."""

    Q: FloatArray  # (n + 1, n)
    R: FloatArray  # (n + 1, n + 1)
    g: FloatArray  # (n + 1,)
    c0: FloatArray  # (n + 1,) right-hand sides c0 + s c1
    c1: FloatArray  # (n + 1,)
    y: FloatArray  # (n + 1,) the members' share in the proof that s cannot be larger
    lam: FloatArray  # (n + 1,) multipliers
    h: FloatArray  # (n + 1,) scratch: the components of a normal along Q
    r: FloatArray  # (n + 1,) scratch: a normal as a combination of members
    z: FloatArray  # (n,) scratch: a normal, then what of it is orthogonal to the members
    who: NDArray[np.int64]  # (n + 1,) an inequality's code, or -1 - row of an equation
    kind: NDArray[np.int64]  # (n + 1,)
    num: NDArray[np.int64]  # (1,)


@part
def new_working_set(n: int) -> WorkingSet:
    """An empty one in R^n."""
    square = np.empty((2 * n + 2, n + 1))
    lines = np.zeros((8, n + 1))
    marks = np.zeros((3, n + 1), np.int64)
    return WorkingSet(
        np.empty((n + 1, n)),
        square[: n + 1],
        lines[0],
        lines[1],
        lines[2],
        lines[3],
        lines[4],
        lines[5],
        lines[6],
        lines[7, :n],
        marks[0],
        marks[1],
        marks[2],
    )


@part
def orthogonalise(w: WorkingSet, norm: float) -> float:
    """Take the members' directions out of z (of the given norm), their components into h; the norm that is left."""
    q, n = w.num[0], w.Q.shape[1]
    z = w.z
    for i in range(q):
        t = 0.0
        for k in range(n):
            t += w.Q[i, k] * z[k]
        for k in range(n):
            z[k] -= t * w.Q[i, k]
        w.h[i] = t
    left = 0.0
    for k in range(n):
        left += z[k] * z[k]
    left = math.sqrt(left)
    if left >= _CANCELLED * norm:
        return left
    for i in range(q):
        t = 0.0
        for k in range(n):
            t += w.Q[i, k] * z[k]
        for k in range(n):
            z[k] -= t * w.Q[i, k]
        w.h[i] += t
    left = 0.0
    for k in range(n):
        left += z[k] * z[k]
    return math.sqrt(left)


@part
def append(w: WorkingSet, who: int, kind: int, left: float, c0: float, c1: float, s: float) -> None:
    """Add the normal whose orthogonal part is z (of norm left) and whose components are h."""
    q, n = w.num[0], w.Q.shape[1]
    t = c0 + s * c1
    for i in range(q):
        w.R[q, i] = w.h[i]
        t -= w.h[i] * w.g[i]
    w.R[q, q] = left
    w.g[q] = t / left
    for k in range(n):
        w.Q[q, k] = w.z[k] / left
    w.who[q], w.kind[q], w.c0[q], w.c1[q], w.y[q], w.lam[q] = who, kind, c0, c1, 0.0, 0.0
    w.num[0] = q + 1


@part
def remove(w: WorkingSet, k: int) -> None:
    """Take out member k; the later ones move up."""
    q, n = w.num[0], w.Q.shape[1]
    R, Q, g = w.R, w.Q, w.g
    for j in range(k + 1, q):
        for i in range(j + 1):
            R[j - 1, i] = R[j, i]
        w.who[j - 1], w.kind[j - 1], w.c0[j - 1], w.c1[j - 1] = w.who[j], w.kind[j], w.c0[j], w.c1[j]
        w.y[j - 1], w.lam[j - 1] = w.y[j], w.lam[j]
    for i in range(k, q - 1):  # column i reaches one row too far: turn it into column i + 1
        a, b = R[i, i], R[i, i + 1]
        length = math.sqrt(a * a + b * b)
        cos, sin = a / length, b / length
        R[i, i] = length
        for j in range(i + 1, q - 1):
            a, b = R[j, i], R[j, i + 1]
            R[j, i], R[j, i + 1] = cos * a + sin * b, cos * b - sin * a
        for j in range(n):
            a, b = Q[i, j], Q[i + 1, j]
            Q[i, j], Q[i + 1, j] = cos * a + sin * b, cos * b - sin * a
        a, b = g[i], g[i + 1]
        g[i], g[i + 1] = cos * a + sin * b, cos * b - sin * a
    w.num[0] = q - 1


@part
def combine(w: WorkingSet, components: FloatArray, out: FloatArray) -> None:
    """``R^T out = components``: a vector with the given components along Q, as a combination of the members."""
    q = w.num[0]
    for j in range(q):
        out[j] = components[j]
    for j in range(q - 1, -1, -1):
        out[j] /= w.R[j, j]
        for i in range(j):
            out[i] -= w.R[j, i] * out[j]


@part
def refill(w: WorkingSet, s: float) -> None:
    """``R g = c0 + s c1`` anew, at another scale."""
    for j in range(w.num[0]):
        t = w.c0[j] + s * w.c1[j]
        for i in range(j):
            t -= w.R[j, i] * w.g[i]
        w.g[j] = t / w.R[j, j]


@part
def place(w: WorkingSet, u: FloatArray) -> None:
    """``u = Q^T g``: the point of least norm on the members."""
    n = w.Q.shape[1]
    for k in range(n):
        u[k] = 0.0
    for i in range(w.num[0]):
        t = w.g[i]
        for k in range(n):
            u[k] += t * w.Q[i, k]


@part
def copy_members(source: WorkingSet, target: WorkingSet) -> None:
    """Make ``target`` equal to ``source``."""
    q, n = source.num[0], source.Q.shape[1]
    for j in range(q):
        for k in range(n):
            target.Q[j, k] = source.Q[j, k]
        for i in range(j + 1):
            target.R[j, i] = source.R[j, i]
        target.g[j], target.c0[j], target.c1[j] = source.g[j], source.c0[j], source.c1[j]
        target.y[j], target.lam[j] = source.y[j], source.lam[j]
        target.who[j], target.kind[j] = source.who[j], source.kind[j]
    target.num[0] = q
