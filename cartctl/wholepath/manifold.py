"""Where the tasks are met: Newton's way onto that set, and the directions that stay on it.

At sample k the tasks are ``r(q) = r_d(t_k)``, with error e and Jacobian J; Newton's step of least norm is
``delta = J# e``, truncated where J loses rank, and ``ker J`` is spanned by an orthonormal Z (nv, r).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.wholepath.setting import Setting

MET = 1e-9  # m or rad: what a Newton step squares away
STRIDE = 0.3  # rad or m, the longest step of Newton's method
_CUTOFF = 1e-7  # of the largest singular value: what is left out where J loses rank
_ROUNDS = 30


class Projected(NamedTuple):
    """Samples brought onto the task: Q (S, nq), errors E (S, m) and Jacobians J (S, m, nv) there, met (S,)."""

    Q: FloatArray
    E: FloatArray
    J: FloatArray
    met: NDArray[np.bool_]


def project(setting: Setting, Q: FloatArray, rounds: int = _ROUNDS) -> Projected:
    """Newton's method at every sample; a fixed start and the end of a closed path are not moved apart from it."""
    Q = np.array(Q)
    E, J = look(setting, Q)
    error = np.linalg.norm(E, axis=1)
    held = np.zeros(len(Q), dtype=bool)
    held[0] = setting.start is not None
    for _ in range(rounds):
        open_ = np.flatnonzero((error > MET) & ~held)
        if setting.closed:
            open_ = open_[open_ < len(Q) - 1]
        if not len(open_):
            break
        delta = _steps(J[open_], E[open_])
        for k, step in zip(open_.tolist(), delta, strict=True):
            Q[k] = setting.robot.integrate(Q[k], step)
            E[k] = setting.errors(k, Q[k])
            J[k] = setting.jacobian()
        now = np.linalg.norm(E[open_], axis=1)
        held[open_] = (now > 0.5 * error[open_]) & (error[open_] < 1e-7)  # round-off is all that is left
        error[open_] = now
    if setting.closed:
        Q[-1] = Q[0]
        E[-1] = setting.errors(len(Q) - 1, Q[-1])
        J[-1] = setting.jacobian()
        error[-1] = np.linalg.norm(E[-1])
    return Projected(Q, E, J, error <= 1e-7)


def newton(setting: Setting, k: int, Q: FloatArray, rounds: int = 20) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Configurations Q (G, nq) brought onto the tasks of one sample, and which of them got there."""
    Q = np.array(Q)
    met = np.zeros(len(Q), dtype=bool)
    best = np.full(len(Q), np.inf)
    active = np.arange(len(Q))
    for turn in range(rounds):
        errors, jacobians = [], []
        for i in active.tolist():
            errors.append(setting.errors(k, Q[i]))
            jacobians.append(setting.jacobian())
        E = np.array(errors)
        size = np.linalg.norm(E, axis=1)
        met[active] = size < 1e-7
        best[active] = np.minimum(best[active], size)
        going = (size >= 1e-7) & ((turn < 8) | (size <= 2.0 * best[active]))
        if not going.any():
            break
        delta = _steps(np.array(jacobians)[going], E[going])
        active = active[going]
        for i, step in zip(active.tolist(), delta, strict=True):
            Q[i] = setting.robot.integrate(Q[i], step)
    return Q, met


def look(setting: Setting, Q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Errors (S, m) and Jacobians (S, m, nv) at every sample."""
    errors, jacobians = [], []
    for k, q in enumerate(Q):
        errors.append(setting.errors(k, q))
        jacobians.append(setting.jacobian())
    return np.array(errors), np.array(jacobians)


def _steps(J: FloatArray, E: FloatArray) -> FloatArray:
    """``J# e``, no longer than STRIDE, (k, nv)."""
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    kept = s > _CUTOFF * s[:, :1]
    w = np.where(kept, np.einsum("kij,ki->kj", U, E) / np.where(kept, s, 1.0), 0.0)
    delta = np.einsum("kji,kj->ki", Vt, w)
    size = np.linalg.norm(delta, axis=1, keepdims=True)
    return np.asarray(delta * np.minimum(1.0, STRIDE / np.maximum(size, 1e-300)))


def kernels(J: FloatArray) -> FloatArray:
    """Orthonormal bases Z (S, nv, r) of what the tasks leave open; r is the same at every sample.

    At a sample where J loses rank, the directions that are lost only there stay with the task.
    """
    s, Vt = np.linalg.svd(J, full_matrices=True)[1:]
    rank = int((s > 1e-6 * s[:, :1]).sum(axis=1).max())
    return np.ascontiguousarray(Vt[:, rank:, :].transpose(0, 2, 1))
