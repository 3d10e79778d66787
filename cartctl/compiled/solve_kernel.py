"""``dls`` and ``task-priority`` on arrays: the formulas of their solvers, without a Problem around them."""

from __future__ import annotations

from math import sqrt

import numpy as np

from cartctl.algebra.svd import ROUND_OFF
from cartctl.checks import FloatArray, IntArray
from cartctl.kernels import lean_part, part
from cartctl.solvers.dls import damped_kernel

_EPS = 2.0**-52
_ROUND_OFF = ROUND_OFF


@part
def damped(A: FloatArray, b: FloatArray, squared: float, u: FloatArray) -> None:
    """``argmin ||A u - b||^2 + squared ||u||^2``."""
    if A.shape[0] == 0:
        for j in range(u.shape[0]):
            u[j] = 0.0
        return
    if damped_kernel(A, b, squared, u):
        return
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    for j in range(u.shape[0]):
        u[j] = 0.0
    for k in range(s.shape[0]):
        t = 0.0
        for i in range(b.shape[0]):
            t += U[i, k] * b[i]
        t *= s[k] / (s[k] * s[k] + squared)
        for j in range(u.shape[0]):
            u[j] += Vt[k, j] * t


@part
def least_above(A: FloatArray, least: float) -> bool:
    """Whether all singular values of A are above ``least``: the smaller Gram matrix, less its square, is definite."""
    m, n = A.shape
    k = min(m, n)
    G = np.empty((k, k))
    for i in range(k):
        for j in range(i + 1):
            total = -least * least if i == j else 0.0
            for a in range(max(m, n)):
                total += A[i, a] * A[j, a] if m <= n else A[a, i] * A[a, j]
            for a in range(j):
                total -= G[i, a] * G[j, a]
            if i == j:
                if not total > 0.0:
                    return False
                G[i, i] = sqrt(total)
            else:
                G[i, j] = total / G[j, j]
    return True


@part
def ranked(A: FloatArray, b: FloatArray, sizes: IntArray, natural: FloatArray, cutoff: float, u: FloatArray) -> bool:
    """Task priority with truncated inverses: whether a task lost rank."""
    n, row, lost = u.shape[0], 0, False
    Z = np.eye(n)
    for j in range(n):
        u[j] = 0.0
    for p in range(sizes.shape[0]):
        m, free = sizes[p], Z.shape[1]
        if free == 0:
            break
        own = A[row : row + m]
        restricted, rest, size = np.zeros((m, free)), np.empty(m), 0.0
        for i in range(m):
            rest[i] = b[row + i]
            for j in range(n):
                x = own[i, j]
                size += x * x
                rest[i] -= x * u[j]
                for k in range(free):
                    restricted[i, k] += x * Z[j, k]
        row += m
        size = sqrt(size)
        round_off = _ROUND_OFF * max(m, n) * max(size, natural[p])
        floor = cutoff * max(size, natural[p])
        if m == 0:
            continue
        U, s, Vt = np.linalg.svd(restricted, full_matrices=True)
        rank, narrowed = 0, 0
        for k in range(s.shape[0]):
            if s[k] > round_off:
                narrowed += 1
            if s[k] > floor:
                rank += 1
                t = 0.0
                for i in range(m):
                    t += U[i, k] * rest[i]
                t /= s[k]
                for j in range(n):
                    for c in range(free):
                        u[j] += Z[j, c] * Vt[k, c] * t
        lost = lost or rank < min(m, free)
        left = np.zeros((n, free - narrowed))
        for j in range(n):
            for k in range(free - narrowed):
                for c in range(free):
                    left[j, k] += Z[j, c] * Vt[narrowed + k, c]
        Z = left
    return lost


@lean_part
def met(A: FloatArray, b: FloatArray, d: FloatArray, first: int, last: int, s: float, u: FloatArray) -> bool:
    """Whether ``A u + d = s b`` holds in rows first..last, up to what round-off may leave; d may be empty."""
    size, norm = 0.0, 0.0
    for j in range(u.shape[0]):
        norm += u[j] * u[j]
        for i in range(first, last):
            size += A[i, j] * A[i, j]
    stable = 64.0 * _EPS * sqrt(size) * sqrt(norm)
    for i in range(first, last):
        at, most, wanted = 0.0, 0.0, s * b[i]
        if d.shape[0] > 0:
            wanted -= d[i]
        for j in range(u.shape[0]):
            x = A[i, j] * u[j]
            at += x
            most += abs(x)
        if not abs(at - wanted) <= 1e-9 * (most + abs(wanted)) + stable:
            return False
    return True
