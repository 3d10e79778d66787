"""The arithmetic of :mod:`cartctl.levels.approach`, compiled: singular directions first, then what each may carry."""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.kernels import kernel, part
from cartctl.levels.braking import clamp, fastest

# Rows of the joints' array.
SLOWING, TOP_SPEED, STILL = 0, 1, 2

# Rows of the directions' array, one column a singular direction.
SIGMA, FORWARD, FEEDBACK, ERROR, AVAILABLE, SPEED, BEND, PULL, ASKED = 0, 1, 2, 3, 4, 5, 6, 7, 8

ETA = 0.5  # of the way to a singular configuration in one step
_NOTHING = 1e-12  # of the Jacobian's size: no direction at all
_EDGE = 1e-7  # of the Jacobian's size: as near to the edge of the workspace as a command may lead
_CURVED = 4.0  # of the Jacobian's size: what the curvature along a unit motion stays below
_NOTICED = 0.1  # of what a direction may carry: from here on, what ranks below is kept calm
_PULLED = 10.0  # of sigma^2: a target this far beyond the edge keeps what ranks below calm, too
_WANTED = 1e-3  # of the Jacobian's size: damping of the motion that says which joints are wanted


@kernel(
    "void(matrix, vector, vector, vector, matrix, vector, vector, float, float, bool, out_matrix, out_matrix, "
    "out_matrix)"
)
def directions(
    J: FloatArray,
    b: FloatArray,
    rate: FloatArray,
    error: FloatArray,
    joints: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    dt: float,
    size: float,
    bounded: bool,
    U: FloatArray,
    Vt: FloatArray,
    D: FloatArray,
) -> None:
    """Fill U (m, k), Vt (k, n) and D (9, k): what each singular direction of J is asked and has to do it with.

    D[ASKED] says whether the direction's curvature matters. rate may be empty. Joints whose bounds keep them from
    doing their part are left out of J.
    """
    m, n = J.shape
    A = np.empty((m, n))
    for i in range(m):
        for j in range(n):
            A[i, j] = J[i, j]
    left, s, right = np.linalg.svd(A, full_matrices=False)
    if bounded and _leave_out(A, left, s, right, b, joints, lower, upper, size):
        left, s, right = np.linalg.svd(A, full_matrices=False)
    far = 0.0
    for i in range(m):
        far += error[i] * error[i]
    far = np.sqrt(far)
    for k in range(s.shape[0]):
        forward, total, e = 0.0, 0.0, 0.0
        for i in range(m):
            U[i, k] = left[i, k]
            forward += left[i, k] * rate[i] if rate.shape[0] > 0 else 0.0
            total += left[i, k] * b[i]
            e += left[i, k] * error[i]
        available, speed = np.inf, np.inf
        for j in range(n):
            Vt[k, j] = right[k, j]
            share = abs(right[k, j])
            if share > 0.0:
                available = min(available, joints[SLOWING, j] / share)
                speed = min(speed, joints[TOP_SPEED, j] / share)
        D[SIGMA, k], D[FORWARD, k], D[FEEDBACK, k], D[ERROR, k] = s[k], forward, total - forward, abs(e)
        D[AVAILABLE, k], D[SPEED, k], D[BEND, k], D[PULL, k] = available, speed, 0.0, 0.0
        D[ASKED, k] = 1.0 if s[k] > _NOTHING * size and _matters(D[:, k], far, size, dt) else 0.0


@part
def _leave_out(
    A: FloatArray,
    left: FloatArray,
    s: FloatArray,
    right: FloatArray,
    b: FloatArray,
    joints: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    size: float,
) -> bool:
    """Zero the columns of joints that are wanted beyond where their bounds let them go."""
    found = False
    for j in range(A.shape[1]):
        still = joints[STILL, j]
        if upper[j] > still and lower[j] < -still:
            continue
        wanted = 0.0
        for k in range(s.shape[0]):
            t = 0.0
            for i in range(A.shape[0]):
                t += left[i, k] * b[i]
            wanted += right[k, j] * t * s[k] / (s[k] * s[k] + (_WANTED * size) ** 2)
        if (wanted > 0.0 and upper[j] <= still) or (wanted < 0.0 and lower[j] >= -still):
            for i in range(A.shape[0]):
                A[i, j] = 0.0
            found = True
    return found


@part
def _matters(d: FloatArray, far: float, size: float, dt: float) -> bool:
    """Whether the largest possible curvature would hold back this direction, or what ranks below it."""
    s, total, curved = d[SIGMA], abs(d[FORWARD] + d[FEEDBACK]), _CURVED * size
    squared = s * s
    if curved * far > _PULLED * squared:
        return True
    if abs(d[FEEDBACK]) * dt * (squared + curved * far / ETA) > d[ERROR] * squared:
        return True
    theta = s / curved
    most = s * min(ETA * theta / dt, fastest(theta, d[AVAILABLE], dt))
    return bool(total > _NOTICED * most)


@kernel("float(vector, matrix, matrix, float, float, bool, out_vector)")
def hold(b: FloatArray, U: FloatArray, D: FloatArray, dt: float, size: float, scales: bool, out: FloatArray) -> float:
    """Fill out (m,) with what of b the robot can still stop; the speed of joints left to what ranks below."""
    m, calm = b.shape[0], np.inf
    for i in range(m):
        out[i] = b[i]
    for k in range(D.shape[1]):
        d = D[:, k]
        asked = d[FORWARD] + d[FEEDBACK]
        allowed = 0.0
        if d[SIGMA] > _NOTHING * size:
            allowed, quiet = _allowed(d, dt, size, scales)
            calm = min(calm, quiet)
        if allowed != asked:
            for i in range(m):
                out[i] += U[i, k] * (allowed - asked)
    return calm


@part
def _allowed(d: FloatArray, dt: float, size: float, scales: bool) -> tuple[float, float]:
    """What a direction may carry, and the speed of joints that does not spoil it."""
    s, e, a = d[SIGMA], d[ERROR], d[AVAILABLE]
    squared = s * s
    most = min(s * fastest(e / s, a, dt), e / dt * squared / (squared + d[PULL] / ETA))
    total = clamp(d[FEEDBACK], -most, most) + d[FORWARD]
    if not scales:  # a method that scales slows all directions alike; others would bend the command
        total = clamp(total, -s * d[SPEED], s * d[SPEED])
    if d[BEND] == 0.0:
        return total, np.inf
    theta = s / abs(d[BEND])
    most = s * ETA * theta / dt
    outwards = total * d[BEND] < 0.0
    if outwards:
        most = 0.0 if s < _EDGE * size else min(most, s * fastest(theta, a, dt))
    calm = np.inf
    if (outwards and abs(total) > _NOTICED * most) or d[PULL] > _PULLED * squared:
        calm = most / s
    return clamp(total, -most, most), calm
