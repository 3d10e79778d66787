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

_EPS = 2.0**-52
EXACT, NEAR = 1e-13, 1e-4  # of a norm: what is left between these is nearly dependent
_CANCELLED = 0.3  # of a norm left after one pass: below, a second pass restores orthogonality


# Rows of V. Few arrays in one tuple: passing many of them from part to part costs more than the arithmetic.
G = 0  # the point of least norm along Q
C0, C1 = 1, 2  # right-hand sides c0 + s c1
Y = 3  # the members' share in the proof that s cannot be larger
LAM = 4  # multipliers
H, SUM, Z = 5, 6, 7  # scratch: a normal's components along Q; as a sum of members; what of it is orthogonal to them
ERR = 8  # by how much round-off may have turned a row of Q
SURELY = 9  # its first entry: how many times what round-off may leave of a normal is still nothing

# Rows of K.
WHO, KIND = 0, 1  # an inequality's code or -1 - row of an equation; FIXED, FREE or TIED
NUM = 2  # its first entry: how many members there are
NEARLY = 3  # its first entry: whether anything was nearly dependent on the members


class WorkingSet(NamedTuple):
    """Up to n members and scratch space."""

    Q: FloatArray  # (n + 1, n)
    R: FloatArray  # (n + 1, n + 1)
    V: FloatArray  # (10, n + 1)
    K: NDArray[np.int64]  # (4, n + 1)


@part
def new_working_set(n: int, surely: float) -> WorkingSet:
    """An empty one in R^n."""
    V = np.zeros((10, n + 1))
    V[SURELY, 0] = surely
    return WorkingSet(np.empty((n + 1, n)), np.empty((n + 1, n + 1)), V, np.zeros((4, n + 1), np.int64))


@part
def orthogonalise(w: WorkingSet, norm: float) -> float:
    """Take the members' directions out of z (of the given norm), their components into h; the norm that is left."""
    Q, h, z, q = w.Q, w.V[H], w.V[Z], w.K[NUM, 0]
    n = Q.shape[1]
    left = 0.0
    for i in range(q):
        h[i] = 0.0
    for _ in range(2):
        for i in range(q):
            t = 0.0
            for k in range(n):
                t += Q[i, k] * z[k]
            for k in range(n):
                z[k] -= t * Q[i, k]
            h[i] += t
        left = length(z, n)
        if left >= _CANCELLED * norm:
            break
    if EXACT * norm < left < NEAR * norm:
        w.K[NEARLY, 0] = 1
    return left


@part
def length(z: FloatArray, n: int) -> float:
    """``||z[:n]||``."""
    total = 0.0
    for k in range(n):
        total += z[k] * z[k]
    return math.sqrt(total)


@part
def largest_entry(u: FloatArray) -> float:
    """``max |u_k|``."""
    largest = 0.0
    for k in range(u.shape[0]):
        largest = max(largest, abs(u[k]))
    return largest


@part
def append(w: WorkingSet, who: int, left: float, c0: float, c1: float, s: float) -> None:
    """Add the equality whose normal has the orthogonal part z, of norm left, and the components h."""
    Q, R, g, h, z, q = w.Q, w.R, w.V[G], w.V[H], w.V[Z], w.K[NUM, 0]
    t = c0 + s * c1
    for i in range(q):
        R[q, i] = h[i]
        t -= h[i] * g[i]
    R[q, q] = left
    g[q] = t / left
    for k in range(Q.shape[1]):
        Q[q, k] = z[k] / left
    w.K[WHO, q], w.K[KIND, q], w.V[C0, q], w.V[C1, q], w.V[Y, q], w.V[LAM, q] = who, FIXED, c0, c1, 0.0, 0.0
    w.V[ERR, q] = noise(w) / left
    w.K[NUM, 0] = q + 1


@part
def append_at(w: WorkingSet, who: int, left: float, u: FloatArray) -> None:
    """Add the equality that the same normal has at u, which is on the members.

    Straight from u: what little is left of a nearly dependent normal would magnify the round-off in ``n . u``.
    """
    h, z, q = w.V[H], w.V[Z], w.K[NUM, 0]
    along = 0.0
    for k in range(u.shape[0]):
        along += z[k] * u[k]
    c0 = along
    for i in range(q):
        c0 += h[i] * w.V[G, i]
    append(w, who, left, c0, 0.0, 0.0)
    w.V[G, q] = along / left


@part
def noise(w: WorkingSet) -> float:
    """What round-off may leave of the normal whose components are h, if it depends on the members.

    A row of Q that was left over from a nearly dependent normal points somewhere else by as much as that was near, and
    passes its error on to those taken apart by it.
    """
    h, err = w.V[H], w.V[ERR]
    total = _EPS * _EPS
    for i in range(w.K[NUM, 0]):
        total += (h[i] * err[i]) ** 2
    return math.sqrt(total)


@part
def unsure(w: WorkingSet, u: FloatArray) -> float:
    """By how much round-off in the members may have moved u, which is on them."""
    worst = 0.0
    for i in range(w.K[NUM, 0]):
        worst = max(worst, w.V[ERR, i])
    return worst * largest_entry(u)


@part
def remove(w: WorkingSet, k: int) -> None:
    """Take out member k; the later ones move up."""
    q, n = w.K[NUM, 0], w.Q.shape[1]
    R, Q, g = w.R, w.Q, w.V[G]
    for j in range(k + 1, q):
        for i in range(j + 1):
            R[j - 1, i] = R[j, i]
        w.K[WHO, j - 1], w.K[KIND, j - 1] = w.K[WHO, j], w.K[KIND, j]
        for i in (C0, C1, Y, LAM):
            w.V[i, j - 1] = w.V[i, j]
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
    err = w.V[ERR]
    for j in range(k, q - 1):
        total = _EPS * _EPS
        for i in range(j):
            total += (R[j, i] * err[i]) ** 2
        err[j] = math.sqrt(total) / R[j, j]
    w.K[NUM, 0] = q - 1


@part
def combine(w: WorkingSet, components: FloatArray, out: FloatArray) -> None:
    """``R^T out = components``: a vector with the given components along Q, as a combination of the members."""
    R, q = w.R, w.K[NUM, 0]
    for j in range(q):
        out[j] = components[j]
    for j in range(q - 1, -1, -1):
        t = out[j] / R[j, j]
        out[j] = t
        for i in range(j):
            out[i] -= R[j, i] * t


@part
def refill(w: WorkingSet, s: float) -> None:
    """``R g = c0 + s c1`` anew, at another scale."""
    R, g, c0, c1 = w.R, w.V[G], w.V[C0], w.V[C1]
    for j in range(w.K[NUM, 0]):
        t = c0[j] + s * c1[j]
        for i in range(j):
            t -= R[j, i] * g[i]
        g[j] = t / R[j, j]


@part
def place(w: WorkingSet, u: FloatArray) -> None:
    """``u = Q^T g``: the point of least norm on the members."""
    Q, g, n = w.Q, w.V[G], u.shape[0]
    for k in range(n):
        u[k] = 0.0
    for i in range(w.K[NUM, 0]):
        t = g[i]
        for k in range(n):
            u[k] += t * Q[i, k]


@part
def copy_members(source: WorkingSet, target: WorkingSet) -> None:
    """Make ``target`` equal to ``source``."""
    q, n = source.K[NUM, 0], source.Q.shape[1]
    for j in range(q):
        for k in range(n):
            target.Q[j, k] = source.Q[j, k]
        for i in range(j + 1):
            target.R[j, i] = source.R[j, i]
        target.K[WHO, j], target.K[KIND, j] = source.K[WHO, j], source.K[KIND, j]
        for i in (G, C0, C1, Y, LAM, ERR):
            target.V[i, j] = source.V[i, j]
    target.K[NUM, 0] = q
