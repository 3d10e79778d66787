"""``tau = J^T w`` and back: the torques that go with a wrench, the wrench that goes with torques."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra.metric import Whitening, as_metric
from cartctl.algebra.svd import floor, numerical_rank, svd
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError


def exerting_torques(J: Any, wrench: Any) -> FloatArray:
    """``tau = J^T w``, (n,): the joint torques with which the hand pushes its surroundings with the wrench w (m,).

    J: (m, n). At rest, without gravity: add ``state.gravity`` to carry the arm's own weight. Prismatic joints have
    forces. Raises ShapeError, NonFiniteError, ParameterError where the torques overflow.

    >>> from cartctl import statics
    >>> print(statics.exerting_torques([[0.0, 0.0], [1.0, 0.5]], [3.0, 2.0]))
    [2. 1.]
    """
    J = checks.matrix("J", J)
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        torque: FloatArray = J.T @ checks.vector("wrench", wrench, J.shape[0])
    if not np.isfinite(torque).all():
        raise ParameterError("J^T w is beyond the largest number; expected J and wrench in SI units")
    return torque


def holding_torques(J: Any, wrench: Any) -> FloatArray:
    """``tau = -J^T w``, (n,): the joint torques that keep the arm at rest while w (m,) acts *on* the hand.

    The opposite sign of :func:`exerting_torques`, by action and reaction. Arguments and errors as there.
    """
    return -exerting_torques(J, wrench)


@dataclass(frozen=True, eq=False)
class Balance:
    """What joint torques do at the hand of an arm at rest; made by :func:`balanced_wrench`.

    wrench: (m,), with which the hand pushes; surroundings that push back with as much keep the arm at rest.
    internal: (m, m - rank J), columns span the wrenches the structure bears without any torque, ``J^T internal = 0``:
    any of them may be added. Empty where J has full row rank.
    unbalanced: (n,), the part of tau that no wrench balances, ``tau - J^T w``; ``J unbalanced = 0``: it sets the joints
    moving while the hand rests. Zero where J has full column rank.
    """

    wrench: FloatArray
    internal: FloatArray
    unbalanced: FloatArray


def balanced_wrench(J: Any, torque: Any, metric: Any = None, tolerance: float | None = None) -> Balance:
    """``argmin ||tau - J^T w||`` over w, of these the one of least ``w^T W w``: the dual of resolving ``J v = xi``.

    J: (m, n), any shape and rank. torque: (n,), without those that carry the arm's own weight. metric: W, (m,) positive
    or (m, m) symmetric positive definite, decides where J lacks full row rank; identity. With moments in w, (1, 1, 1,
    1/l^2, 1/l^2, 1/l^2) weighs them by a length l, m. tolerance: singular values of J, in that metric, of at most
    tolerance times its Frobenius norm count as zero; None is round-off.

    Raises ShapeError, NonFiniteError, MetricError, ParameterError.
    """
    J = checks.matrix("J", J)
    torque = checks.vector("torque", torque, J.shape[1])
    A = np.asfortranarray(J.T)
    whitening = None if metric is None else Whitening(as_metric(metric, J.shape[0]))
    if whitening is not None:
        A = np.asfortranarray(whitening.matrix(A))
    U, s, Vt = svd(A)
    rank = numerical_rank(s, floor(A, tolerance))
    range_ = U[:, :rank]
    parts = range_.T @ torque
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        y = Vt[:rank].T @ (parts / s[:rank])
    rest = torque - range_ @ parts
    rest -= range_ @ (range_.T @ rest)  # once more: the first difference leaves round-off of the size of tau
    null = Vt[rank:]
    if whitening is not None:
        y = whitening.back(y)
        null = np.array([whitening.back(np.ascontiguousarray(z)) for z in null]).reshape(null.shape)
    if not (np.isfinite(y).all() and np.isfinite(rest).all()):
        raise ParameterError("the wrench is beyond the largest number; expected J and torque in SI units")
    return Balance(y, null.T, rest)
