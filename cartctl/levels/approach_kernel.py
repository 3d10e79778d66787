"""The arithmetic of :mod:`cartctl.levels.approach`, compiled: singular directions first, then what each may carry."""

from __future__ import annotations

import numpy as np

from cartctl.braking import clamp, fastest
from cartctl.checks import FloatArray, IntArray
from cartctl.kernels import kernel, lean_part, part
from cartctl.levels.left_out import leave_out

# Rows of the joints' array.
SLOWING, TOP_SPEED, STILL, WHOLE = 0, 1, 2, 3

# Rows of the directions' array, one column a singular direction.
SIGMA, FORWARD, FEEDBACK, ERROR, AVAILABLE, SPEED, BEND, PULL, ASKED, NEXT = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
ROWS = 10

ETA = 0.5  # of the way to a singular configuration in one step
TURNS = 0.7  # of the deceleration a direction has: what it counts on towards an edge to stand at, for it turns
_NOTHING = 1e-12  # of the Jacobian's size: no direction at all
_WORTH = 1e-4  # of the Jacobian's size: below this singular value there is nothing left to win further outwards
_CURVED = 4.0  # of the Jacobian's size: what the curvature along a unit motion stays below
_NOTICED = 0.1  # of what a direction may carry: from here on, what ranks below is kept calm
_PULLED = 10.0  # of sigma^2: a target this far beyond the edge keeps what ranks below calm, too
_STIFF = 0.25  # of sigma^2: a target this far beyond the edge would make a critically damped loop ring


@kernel(
    "void(matrix, vector, vector, vector, vector, matrix, vector, vector, matrix, vector, vector, float, float, bool, "
    "bool, out_matrix, out_matrix, out_matrix, out_vector)"
)
def directions(
    J: FloatArray,
    b: FloatArray,
    y: FloatArray,
    rate: FloatArray,
    error: FloatArray,
    joints: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    C: FloatArray,
    c_lower: FloatArray,
    c_upper: FloatArray,
    dt: float,
    size: float,
    bounded: bool,
    fenced: bool,
    U: FloatArray,
    Vt: FloatArray,
    D: FloatArray,
    stood: FloatArray,
) -> None:
    """Fill U (m, k), Vt (k, n) and D (10, k): what each singular direction of J is asked and has to do it with.

    D[ASKED] says whether the direction's curvature matters. y, the next velocity where that is another than b, and
    rate may be empty. Joints and rows of C whose bounds keep them from doing their part are left out of J. stood (n,):
    the way each joint that was left out is wanted, 0 for others. fenced: whether there may be rows, if not now.
    """
    m, n = J.shape
    A = np.empty((m, n))
    for i in range(m):
        for j in range(n):
            A[i, j] = J[i, j]
    left, s, right = np.linalg.svd(A, full_matrices=False)
    stood[:] = 0.0
    if bounded:
        walls = (lower, upper, C, c_lower, c_upper)
        if leave_out(A, left, s, right, b, joints, *walls, size, rate.shape[0] > 0, fenced, stood):
            left, s, right = np.linalg.svd(A, full_matrices=False)
    far = 0.0
    for i in range(m):
        far += error[i] * error[i]
    far = np.sqrt(far)
    for k in range(s.shape[0]):
        forward, total, following, e = 0.0, 0.0, 0.0, 0.0
        for i in range(m):
            U[i, k] = left[i, k]
            forward += left[i, k] * rate[i] if rate.shape[0] > 0 else 0.0
            following += left[i, k] * y[i] if y.shape[0] > 0 else 0.0
            total += left[i, k] * b[i]
            e += left[i, k] * error[i]
        available, speed = np.inf, np.inf
        for j in range(n):
            Vt[k, j] = right[k, j]
            share = abs(right[k, j])
            if share > 0.0:
                available = min(available, joints[SLOWING, j] / share)
                speed = min(speed, joints[TOP_SPEED, j] / share if joints[TOP_SPEED, j] > 0.0 else np.inf)
        D[SIGMA, k], D[FORWARD, k], D[FEEDBACK, k], D[ERROR, k] = s[k], forward, total - forward, abs(e)
        D[AVAILABLE, k], D[SPEED, k], D[BEND, k], D[PULL, k], D[NEXT, k] = available, speed, 0.0, 0.0, following
        asked = matters(D[:, k], total - forward, far, size, dt)
        if y.shape[0] > 0:
            asked = asked or matters(D[:, k], following - forward, far, size, dt)
        D[ASKED, k] = 1.0 if asked and s[k] > _NOTHING * size else 0.0


@part
def matters(d: FloatArray, feedback: float, far: float, size: float, dt: float) -> bool:
    """Whether the largest possible curvature would hold back this direction, or what ranks below it."""
    s, total, curved = d[SIGMA], abs(d[FORWARD] + feedback), _CURVED * size
    squared = s * s
    if curved * far > _PULLED * squared:
        return True
    if abs(feedback) * dt * (squared + curved * far / ETA) > d[ERROR] * squared:
        return True
    if abs(feedback) > s * fastest(d[ERROR] * s / (squared + curved * far), d[AVAILABLE], dt):
        return True
    theta = s / curved
    most = s * min(ETA * theta / dt, fastest(theta, TURNS * d[AVAILABLE], dt))
    return bool(total > _NOTICED * most)


@kernel("void(vector, matrix, ints, matrix, out_matrix)")
def bend(error: FloatArray, U: FloatArray, asked: IntArray, H: FloatArray, D: FloatArray) -> None:
    """Note the curvatures of the directions asked (k,), columns of H (m, k), and the pull of the error along them."""
    for j in range(asked.shape[0]):
        k, along, pull = asked[j], 0.0, 0.0
        for i in range(error.shape[0]):
            along += U[i, k] * H[i, j]
            pull -= error[i] * H[i, j]
        D[BEND, k], D[PULL, k] = along, max(0.0, pull)


@kernel("float(vector, matrix, matrix, matrix, matrix, float, float, bool, bool, out_vector)")
def hold(
    b: FloatArray,
    U: FloatArray,
    Vt: FloatArray,
    D: FloatArray,
    joints: FloatArray,
    dt: float,
    size: float,
    scales: bool,
    rests: bool,
    out: FloatArray,
) -> float:
    """Fill out (m,) with what of b the robot can still stop; the speed of joints left to what ranks below.

    rests: whether the target is at rest, with no constraint before it.
    """
    calm, allowed = np.inf, np.zeros(D.shape[1])
    asked = D[FORWARD] + D[FEEDBACK]
    for k in range(D.shape[1]):
        d = D[:, k]
        if d[SIGMA] > _NOTHING * size:
            # a method that scales would slow all directions down for the nearness of one
            pull = 0.0 if scales else d[PULL]
            most = min(_stoppable(d, pull, dt), _newton(d, dt))
            total = clamp(d[FEEDBACK], -most, most) + d[FORWARD]
            allowed[k], quiet = _before_the_edge(d, total, dt, size, scales, rests)
            calm = min(calm, quiet)
    if rests and not scales and calm < np.inf:
        _fit_together(Vt, D, joints, allowed)
    held = False
    for k in range(D.shape[1]):
        held = held or allowed[k] != asked[k]
    _put_together(b, U, asked, allowed, held, out)
    return calm


@kernel("float(vector, vector, matrix, matrix, float, float, bool, bool, out_vector)")
def steer(
    y: FloatArray,
    gain: FloatArray,
    U: FloatArray,
    D: FloatArray,
    dt: float,
    size: float,
    scales: bool,
    rests: bool,
    out: FloatArray,
) -> float:
    """Fill out (m,) with what of the next velocity y, reached by acceleration, can still be stopped; the calm left.

    D[FEEDBACK] is the velocity wanted, which y follows at the rate ``2 gain``, (m,) or (1,): held back where the way is
    too short, and y itself at the edge, and where the pull of a target out of reach would make the loop ring.
    """
    calm, held, allowed = np.inf, False, np.zeros(D.shape[1])
    asked = D[NEXT].copy()
    for k in range(D.shape[1]):
        d = D[:, k]
        if d[SIGMA] > _NOTHING * size:
            most, following, k_d = _stoppable(d, d[PULL], dt), asked[k], 0.0
            for i in range(y.shape[0]):
                k_d += 2.0 * (gain[i] if gain.shape[0] > 1 else gain[0]) * U[i, k] * U[i, k]
            following += dt * k_d * (clamp(d[FEEDBACK], -most, most) - d[FEEDBACK])
            if d[PULL] > _STIFF * d[SIGMA] * d[SIGMA]:
                most = min(most, _newton(d, dt))
                following = clamp(following - d[FORWARD], -most, most) + d[FORWARD]
            allowed[k], quiet = _before_the_edge(d, following, dt, size, scales, rests)
            calm = min(calm, quiet)
        held = held or allowed[k] != asked[k]
    _put_together(y, U, asked, allowed, held, out)
    return calm


@lean_part
def is_beyond(edge: float, D: FloatArray, k: int, size: float) -> bool:
    """Whether a task is near the edge, or a direction of the k it has is none: joints at their bounds were in it."""
    return edge < np.inf or (k > 0 and D[SIGMA, k - 1] <= _NOTHING * size)


@part
def _stoppable(d: FloatArray, pull: float, dt: float) -> float:
    """The largest speed that stops at the target; its pull brings a target beyond reach nearer."""
    s = d[SIGMA]
    return s * fastest(d[ERROR] * s / (s * s + pull), d[AVAILABLE], dt)  # type: ignore[no-any-return]


@part
def _newton(d: FloatArray, dt: float) -> float:
    """The speed of one Newton step."""
    squared = d[SIGMA] * d[SIGMA]
    return d[ERROR] / dt * squared / (squared + d[PULL] / ETA)  # type: ignore[no-any-return]


@part
def _before_the_edge(
    d: FloatArray, total: float, dt: float, size: float, scales: bool, rests: bool
) -> tuple[float, float]:
    """What a direction may carry of ``total``, and the speed of joints that does not spoil it."""
    s, a = d[SIGMA], d[AVAILABLE]
    if d[BEND] == 0.0:
        return total, np.inf
    theta = s / abs(d[BEND])
    most = s * ETA * theta / dt
    outwards = total * d[BEND] < 0.0
    if outwards:
        worth = max(0.0, 1.0 - (_WORTH * size) ** 2 / (s * s))
        most = worth * min(most, s * fastest(theta, TURNS * a if rests else a, dt))
    calm = np.inf
    if (outwards and abs(total) > _NOTICED * most) or d[PULL] > _PULLED * s * s:
        calm = most / s
    if rests and not scales and calm < np.inf:  # a method that scales slows all alike; others would bend the command
        most = min(most, s * d[SPEED])
    return clamp(total, -most, most), calm


@part
def _fit_together(Vt: FloatArray, D: FloatArray, joints: FloatArray, allowed: FloatArray) -> None:
    """Slow all directions so far that the joints have the speed for their sum.

    Each by itself is within it. What a box cuts off the sum would be cut off the direction of the smallest singular
    value, which is the one that leads to a target beyond the edge: turned round, it would lead away and back for ever.
    """
    share = 1.0
    for j in range(Vt.shape[1]):
        speed = 0.0
        for k in range(Vt.shape[0]):
            if D[SIGMA, k] > 0.0:
                speed += Vt[k, j] * (allowed[k] / D[SIGMA, k])
        if joints[TOP_SPEED, j] > 0.0:
            share = max(share, abs(speed) / joints[TOP_SPEED, j])
    for k in range(Vt.shape[0]):
        allowed[k] /= share


@part
def _put_together(
    b: FloatArray, U: FloatArray, asked: FloatArray, allowed: FloatArray, held: bool, out: FloatArray
) -> None:
    """Fill out (m,) with b, changed from asked to allowed along the directions.

    Put together, not taken away: the round-off of what is held back would be moved by joints, over sigma.
    """
    m, k = U.shape
    for i in range(m):
        carried, rest = 0.0, b[i]
        for j in range(k):
            carried += U[i, j] * allowed[j]
            rest -= U[i, j] * asked[j]
        out[i] = b[i] if not held else carried if k == m else carried + rest
