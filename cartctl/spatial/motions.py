"""The matrices of twists, and the exponential and logarithm between twists and poses (Murray, Li & Sastry 1994)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.special import zeta

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError, ShapeError
from cartctl.spatial.frames import as_pose
from cartctl.spatial.rotations import log3, series, skew

_SKEW = 1e-6
# 1/x^2 - cot(x/2)/(2 x) = sum_k 2 zeta(2k)/(2 pi)^2k x^(2k - 2), highest power first
_D = [2.0 * float(zeta(2.0 * k)) / (2.0 * math.pi) ** (2 * k) for k in range(14, 0, -1)]


def hat(x: Any) -> FloatArray:
    """``S(phi)`` (3, 3) of a vector (3,), or ``[[S(omega), v], [0, 0]]`` (4, 4) of a twist (v, omega) (6,).

    Raises ShapeError, NonFiniteError.
    """
    x = checks.vector("x", x)
    if x.shape[0] == 3:
        return skew(x)
    if x.shape[0] != 6:
        raise ShapeError(f"x has shape {x.shape}; expected (3,) or (6,)")
    X = np.zeros((4, 4))
    X[:3, :3], X[:3, 3] = skew(x[3:]), x[:3]
    return X


def vee(X: Any) -> FloatArray:
    """The vector (3,) or twist (6,) of which X (3, 3) or (4, 4) is the :func:`hat`.

    X of finite differences may miss skew symmetry by 1e-6 of its size; its skew part counts. Raises ParameterError
    beyond that, ShapeError, NonFiniteError.
    """
    X = checks.matrix("X", X)
    if X.shape not in ((3, 3), (4, 4)):
        raise ShapeError(f"X has shape {X.shape}; expected (3, 3) or (4, 4)")
    S, size = X[:3, :3], float(np.abs(X).max())
    odd = max(float(np.abs(S + S.T).max()), float(np.abs(X[3:]).max(initial=0.0)))
    if odd > _SKEW * size:
        raise ParameterError(
            f"X misses S = -S^T, or a last row of zeros, by {odd:.2g}; expected the matrix of a vector or twist"
        )
    omega = 0.5 * np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]])
    return omega if X.shape[0] == 3 else np.concatenate([X[:3, 3], omega])


def ad(twist: Any) -> FloatArray:
    """``ad(xi)`` (6, 6), ``[[S(omega), S(v)], [0, S(omega)]]``: the Lie bracket, and how adjoints change.

    ``d/dt Ad(T) = Ad(T) ad(xi)`` where the frame moves with the twist xi (6,) in its own axes; ``-ad(xi)^T`` does the
    same for wrenches. Raises ShapeError, NonFiniteError.
    """
    twist = checks.vector("twist", twist, 6)
    X = np.zeros((6, 6))
    X[:3, :3] = X[3:, 3:] = skew(twist[3:])
    X[:3, 3:] = skew(twist[:3])
    return X


def exp6(twist: Any) -> FloatArray:
    """``T = e^hat(xi)`` (4, 4): the pose after one second of a constant twist xi = (v, phi) (6,), m and rad.

    ``[[e^S(phi), V v], [0, 1]]``, ``V = I + b S + c S^2``, b = (1 - cos x)/x^2, c = (x - sin x)/x^3, x = |phi|. Raises
    ShapeError, NonFiniteError, ParameterError for entries beyond 1e9.
    """
    twist = checks.vector("twist", twist, 6, largest=checks.LARGEST)
    v, phi = twist[:3], twist[3:]
    a, b, c = series(math.hypot(*phi.tolist()))
    S = skew(phi)
    square = S @ S
    T = np.eye(4)
    T[:3, :3] += a * S + b * square
    T[:3, 3] = v + b * (S @ v) + c * (square @ v)
    return T


def log6(T: Any) -> FloatArray:
    """The twist (v, phi) (6,) with ``e^hat(xi) = T``, |phi| <= pi: undoes :func:`exp6`; exact at 0 and at pi.

    T: (4, 4) or a pin.SE3. ``v = V^-1 p``, ``V^-1 = I - S/2 + d S^2``, d = (1 - (x/2) cot(x/2))/x^2. Raises
    ParameterError where T is no pose, ShapeError, NonFiniteError.
    """
    T = as_pose("T", T)
    p, phi = T[:3, 3], log3(T[:3, :3])
    x = math.hypot(*phi.tolist())
    if x < 1.0:
        d = 0.0
        for coefficient in _D:
            d = d * x * x + coefficient
    else:
        d = (1.0 - 0.5 * x * math.cos(0.5 * x) / math.sin(0.5 * x)) / (x * x)
    S = skew(phi)
    return np.concatenate([p - 0.5 * (S @ p) + d * (S @ (S @ p)), phi])
