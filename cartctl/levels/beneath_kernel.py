"""The arithmetic of :mod:`cartctl.levels.beneath`, compiled."""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.kernels import kernel, part
from cartctl.levels.approach_kernel import ASKED, bend, directions, hold

_NO_FREEDOM = 1e-9  # of the largest: singular values of the tasks above below this leave a motion free
_ROUNDS = 5  # of joints found at their bounds


@kernel(
    "void(matrix, vector, matrix, vector, vector, matrix, vector, vector, float, float, bool, out_matrix, out_matrix, "
    "out_matrix, out_matrix, out_vector, out_vector, out_vector)"
)
def narrowed(
    above: FloatArray,
    asked: FloatArray,
    J: FloatArray,
    b: FloatArray,
    error: FloatArray,
    joints: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    dt: float,
    size: float,
    fenced: bool,
    U: FloatArray,
    Vt: FloatArray,
    D: FloatArray,
    back: FloatArray,
    base: FloatArray,
    rest: FloatArray,
    stood: FloatArray,
) -> None:
    """Fill U (m, k), Vt (k, n), D (10, k) with the directions of J N, N the null space of the tasks above.

    above (M, n), asked (M,): their rows and commands; size: of J. Joints whose bounds keep them from doing their part
    are left out of both; stood (n,): which way they are wanted, 0 for others. back (m, M): ``J A#``. base, rest (m,):
    what the motion above does to the task, and b without it.
    """
    (m, n), M = J.shape, above.shape[0]
    rows, own, left = np.empty((M, n)), np.empty((m, n)), np.empty((m, n))
    moves, pressed, nothing = np.ones(n), np.empty(n), np.empty(0)
    none = np.empty((0, n))
    bounded = lower.shape[0] > 0
    stood[:] = 0.0
    for j in range(n):
        if bounded and lower[j] == upper[j]:
            moves[j] = 0.0
    for turn in range(_ROUNDS + 1):
        for j in range(n):
            for i in range(M):
                rows[i, j] = moves[j] * above[i, j]
            for i in range(m):
                own[i, j] = moves[j] * J[i, j]
        left_vectors, s, right = np.linalg.svd(rows, full_matrices=False)
        rank = 0
        while rank < s.shape[0] and s[rank] > _NO_FREEDOM * s[0]:
            rank += 1
        _project(own, left_vectors, s, right, rank, asked, left, back, base)
        for i in range(m):
            rest[i] = b[i] - base[i]
        if not bounded or turn == _ROUNDS:
            break
        walls = (lower, upper, none, nothing, nothing)
        directions(left, rest, nothing, nothing, error, joints, *walls, dt, size, True, fenced, U, Vt, D, pressed)
        found = False
        for j in range(n):
            if pressed[j] != 0.0 and moves[j] > 0.0:
                moves[j], stood[j], found = 0.0, pressed[j], True
        if not found:
            break
    walls = (nothing, nothing, none, nothing, nothing)
    directions(left, rest, nothing, nothing, error, joints, *walls, dt, size, False, fenced, U, Vt, D, pressed)


@part
def _project(
    own: FloatArray,
    U: FloatArray,
    s: FloatArray,
    right: FloatArray,
    rank: int,
    asked: FloatArray,
    left: FloatArray,
    back: FloatArray,
    base: FloatArray,
) -> None:
    """``left = J N``, ``back = J A#``, ``base = J A# asked``."""
    m, n = own.shape
    back[:, :] = 0.0
    for i in range(m):
        base[i] = 0.0
        for j in range(n):
            left[i, j] = own[i, j]
        for k in range(rank):
            along = 0.0
            for j in range(n):
                along += own[i, j] * right[k, j]
            for j in range(n):
                left[i, j] -= along * right[k, j]
            for a in range(asked.shape[0]):
                back[i, a] += along / s[k] * U[a, k]
        for a in range(asked.shape[0]):
            base[i] += back[i, a] * asked[a]


@kernel(
    "float(vector, vector, vector, matrix, matrix, out_matrix, matrix, matrix, matrix, matrix, float, float, bool, "
    "bool, out_vector)"
)
def held_beneath(
    error: FloatArray,
    base: FloatArray,
    rest: FloatArray,
    U: FloatArray,
    Vt: FloatArray,
    D: FloatArray,
    joints: FloatArray,
    back: FloatArray,
    own: FloatArray,
    others: FloatArray,
    dt: float,
    size: float,
    scales: bool,
    rests: bool,
    b: FloatArray,
) -> float:
    """Change b (m,) to base and what of rest can be stopped; the speed left to what ranks below.

    own (m, q), others (M, q): the curvatures of the task and of those above along the q directions that are asked for.
    A motion along one takes ``- A# h`` to stay where the tasks above are, and so bends the task by ``h_own - J A# h``.
    """
    (m, q), M = own.shape, others.shape[0]
    if q > 0:
        h, asked, at = np.empty((m, q)), np.empty(q, np.int64), 0
        for k in range(D.shape[1]):
            if D[ASKED, k] != 0.0:
                asked[at] = k
                at += 1
        for i in range(m):
            for c in range(q):
                t = own[i, c]
                for a in range(M):
                    t -= back[i, a] * others[a, c]
                h[i, c] = t
        bend(error, U, asked, h, D)
    out = np.empty(m)
    edge = hold(rest, U, Vt, D, joints, dt, size, scales, rests, out)
    for i in range(m):
        if out[i] != rest[i]:
            b[i] = base[i] + out[i]
    return edge
