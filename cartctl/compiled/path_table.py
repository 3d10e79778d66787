"""A path as a table of samples, so dense that what lies between them is known to 1e-12: for clocks that may wait.

Between two samples positions and rotation matrices are the polynomials of degree five that meet value, rate and
acceleration at both, rates the cubic ones that meet rate and acceleration, accelerations their derivatives. An interval
is halved until the path itself, asked in between, agrees to 1e-12 (m, rad, per s; 1e-10 of accelerations) of the
vector's size, or to what round-off leaves of a difference of rates over so short a time, or until it is 1e-9 s long, as
around a corner. At a sample the path's own numbers come back unchanged.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cartctl.checks import FloatArray
from cartctl.errors import UnsupportedProblem
from cartctl.kernels import kernel, lean_part

TIME, POSE, TWIST, ACCELERATION, ROW = 0, 1, 13, 19, 25  # columns; POSE: a rotation row by row, then a position
_EXACT, _BENT, _SHORTEST = 1e-12, 1e-10, 1e-9
_MOST, _MOST_A_STEP = 500_000, 5_000  # samples
_ROUNDED = 1e-15  # of rates: what differences of them are not sure of
_INSIDE = (0.25, 0.5, 0.8)  # of an interval: where the path is asked


def samples(path: Callable[[float], Any], times: FloatArray, name: str) -> FloatArray:
    """(K, 25) samples at ``times`` alone, for clocks that never wait; raises UnsupportedProblem."""
    return np.array([_sample(path, t, name) for t in times.tolist()])


def path_table(path: Callable[[float], Any], times: FloatArray, name: str) -> FloatArray:
    """(K, 25) samples of ``path`` at ``times`` and in between; raises UnsupportedProblem."""
    rows = [_sample(path, t, name) for t in times.tolist()]
    done = [rows[0]]
    for last in rows[1:]:
        waiting, begun = [last], len(done)
        while waiting:
            if _between(path, done[-1], waiting[-1], name):
                done.append(waiting.pop())
            else:
                middle = 0.5 * (done[-1][TIME] + waiting[-1][TIME])
                waiting.append(_sample(path, middle, name))
            if len(done) + len(waiting) - begun > _MOST_A_STEP or len(done) > _MOST:
                raise UnsupportedProblem(
                    f"{name}: its path is too rough at t = {done[-1][TIME]:g} s to be sampled ahead: are its twist and "
                    "acceleration the derivatives of its position? With path_clock=False one sample a step will do"
                )
    return np.array(done)


def _between(path: Callable[[float], Any], a: FloatArray, b: FloatArray, name: str) -> bool:
    """Whether the polynomial from a to b is the path."""
    length = b[TIME] - a[TIME]
    if length <= _SHORTEST:
        return True
    nodes, out = np.array([a, b]), np.empty(ROW)
    rates = np.abs(nodes[:, TWIST:ACCELERATION]).max(axis=0)
    for share in _INSIDE:
        t = float(a[TIME] + share * length)
        read_table(nodes, t, out)
        own = _sample(path, t, name)
        gap = np.abs(out - own)[POSE:]
        room = np.empty(ROW - POSE)
        room[: TWIST - POSE] = _EXACT * (1.0 + np.abs(own[POSE:TWIST]))
        for begin, part in ((TWIST, _EXACT), (ACCELERATION, _BENT)):
            for k in (begin, begin + 3):
                room[k - POSE : k + 3 - POSE] = part * (1.0 + np.abs(own[k : k + 3]).max())
        room[ACCELERATION - POSE :] += _ROUNDED * rates / length
        if (gap > room).any():
            return False
    return True


def _sample(path: Callable[[float], Any], t: float, name: str) -> FloatArray:
    s = path(t)
    row = np.zeros(ROW)
    try:
        row[TIME] = t
        row[POSE : POSE + 9] = np.eye(3).ravel() if s.rotation is None else np.asarray(s.rotation).ravel()
        row[POSE + 9 : TWIST] = s.position
        row[TWIST:ACCELERATION], row[ACCELERATION:] = s.twist, s.acceleration
    except (AttributeError, TypeError, ValueError):
        raise UnsupportedProblem(
            f"{name}: its path returns no position, twist and acceleration of sizes 3, 6, 6"
        ) from None
    if not np.isfinite(row).all():
        raise UnsupportedProblem(f"{name}: its path is not finite at t = {t:g} s")
    return row


@lean_part
def sample_between(table: FloatArray, i: int, t: float, out: FloatArray) -> None:
    """Fill out (25,) with the path at t, in the interval that begins at row i."""
    a, b = table[i], table[i + 1]
    h, x = b[0] - a[0], t - a[0]
    out[0] = t
    y, z = x / h, h * h
    # the quintic with p, p', p'' at both ends, in u = x / h
    for k in range(12):
        p0, p1 = a[1 + k], b[1 + k]
        v0, v1, a0, a1 = 0.0, 0.0, 0.0, 0.0
        if k >= 9:
            v0, v1, a0, a1 = a[4 + k], b[4 + k], a[10 + k], b[10 + k]
        else:
            v0, a0 = _turned(a, k)
            v1, a1 = _turned(b, k)
        d = p1 - p0
        c1, c2 = h * v0, 0.5 * z * a0
        r0, r1, r2 = d - c1 - c2, h * v1 - c1 - 2.0 * c2, z * a1 - 2.0 * c2
        c3 = 10.0 * r0 - 4.0 * r1 + 0.5 * r2
        c4 = -15.0 * r0 + 7.0 * r1 - r2
        c5 = 6.0 * r0 - 3.0 * r1 + 0.5 * r2
        out[1 + k] = p0 + y * (c1 + y * (c2 + y * (c3 + y * (c4 + y * c5))))
    for k in range(6):  # not the quintic's derivatives: they divide round-off by h
        w0, w1, a0, a1 = a[13 + k], b[13 + k], a[19 + k], b[19 + k]
        d, c1 = w1 - w0, h * a0
        c2, c3 = 3.0 * d - h * (2.0 * a0 + a1), -2.0 * d + h * (a0 + a1)
        out[13 + k] = w0 + y * (c1 + y * (c2 + y * c3))
        out[19 + k] = (c1 + y * (2.0 * c2 + y * 3.0 * c3)) / h


@lean_part
def _turned(row: FloatArray, k: int) -> tuple[float, float]:
    """Rate and acceleration of entry k of the rotation: ``w x r`` and ``a x r + w x (w x r)`` of its column r."""
    i, j = k // 3, k % 3
    y, z = (i + 1) % 3, (i + 2) % 3
    r0, r1, r2 = row[1 + j], row[4 + j], row[7 + j]
    wx, wy, wz = row[16], row[17], row[18]
    ux, uy, uz = wy * r2 - wz * r1, wz * r0 - wx * r2, wx * r1 - wy * r0
    u = ux if i == 0 else uy if i == 1 else uz
    uy_, uz_ = (uy, uz) if i == 0 else (uz, ux) if i == 1 else (ux, uy)
    ry, rz = row[1 + 3 * y + j], row[1 + 3 * z + j]
    return u, row[22 + y] * rz - row[22 + z] * ry + row[16 + y] * uz_ - row[16 + z] * uy_


@lean_part
def follow(table: FloatArray, i: int, t: float, out: FloatArray) -> int:
    """Fill out (25,) with the path at t, looked up from row i on: the row found. Beyond its ends it rests there."""
    last = table.shape[0] - 1
    while i < last and table[i + 1, 0] <= t:
        i += 1
    while i > 0 and table[i, 0] > t:
        i -= 1
    if t == table[i, 0] or i == last or t < table[i, 0]:
        for k in range(25):
            out[k] = table[i, k]
    else:
        sample_between(table, i, t, out)
    return i


@kernel("void(matrix, float, out_vector)")
def read_table(table: FloatArray, t: float, out: FloatArray) -> None:
    """Fill out (25,) with the path at t."""
    follow(table, 0, t, out)
