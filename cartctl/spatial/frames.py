"""Twists and wrenches seen from another frame of the same rigid body.

A twist is (v, omega), m/s and rad/s, v the velocity of the frame's origin; a wrench (f, m), N and N m, m the moment
about the frame's origin: linear part first. The pose T always is that of the frame the thing is *given* in, seen from
the frame it is *wanted* in, as for points: ``p_A = T_AB p_B``.

    twist    xi_A = Ad(T_AB) xi_B        Ad = [[R, S(p) R], [0, R]]
    wrench   w_A = Ad(T_AB)^-T w_B       Ad^-T = [[R, 0], [S(p) R, R]]

so the power ``w^T xi`` is the same in both (virtual work), and ``w_B = Ad(T_AB)^T w_A`` goes back.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError, ShapeError
from cartctl.spatial.rotations import checked_rotation, skew

_ORDERS = ("linear-first", "angular-first")
_LAST = np.array([0.0, 0.0, 0.0, 1.0])
_LARGEST = 1e150  # m, and of a twist or wrench: products of two of them are numbers still


def velocity_conversion(R: Any, p: Any) -> FloatArray:
    """``V`` (6, 6): the twist of frame B in B's axes = V times the twist of frame A in A's axes, one rigid body.

    R (3, 3), p (3,): the pose of B in A, ``^A T_B``. ``V = [[R^T, -R^T S(p)], [0, R^T]]``, the inverse of
    :func:`adjoint`. Column j of a Jacobian in tool axes is the column of V from joint frame j that belongs to the
    joint's axis: 5 for a revolute joint about z, 2 for a prismatic one along z, 3 + i and i for the axes x, y.

    Raises ParameterError for an R that is no rotation, ShapeError, NonFiniteError.
    """
    R, p = checked_rotation("R", R), checks.vector("p", p, 3, largest=_LARGEST)
    V = np.zeros((6, 6))
    V[:3, :3] = V[3:, 3:] = R.T
    V[:3, 3:] = -R.T @ skew(p)
    return V


def pose(R: Any = None, p: Any = None) -> FloatArray:
    """``T = [[R, p], [0, 1]]``, (4, 4), of a rotation (3, 3), identity by default, and an origin (3,), zero by default.

    Raises ParameterError for an R that is no rotation, ShapeError, NonFiniteError.
    """
    T = np.eye(4)
    if R is not None:
        T[:3, :3] = checked_rotation("R", R)
    if p is not None:
        T[:3, 3] = checks.vector("p", p, 3, largest=_LARGEST)
    return T


def inverse_pose(T: Any) -> FloatArray:
    """``T^-1 = [[R^T, -R^T p], [0, 1]]``, (4, 4): A seen from B where T is B seen from A. Errors as :func:`adjoint`."""
    T = as_pose("T", T)
    inverse = np.eye(4)
    inverse[:3, :3] = T[:3, :3].T
    inverse[:3, 3] = -T[:3, :3].T @ T[:3, 3]
    return inverse


def adjoint(T: Any, order: str = "linear-first") -> FloatArray:
    """``Ad(T)`` (6, 6): the twist in frame A = Ad times the twist in frame B, T the pose of B in A.

    T: (4, 4) or a pin.SE3. ``[[R, S(p) R], [0, R]]``, or ``[[R, 0], [S(p) R, R]]`` for order="angular-first", twists
    (omega, v) as in Lynch & Park 2017. ``Ad(T1 T2) = Ad(T1) Ad(T2)``.

    Raises ParameterError where T is no pose or the order unknown, ShapeError, NonFiniteError.
    """
    T = as_pose("T", T)
    return _blocks(T, 0 if checks.choice("order", order, _ORDERS) == "linear-first" else 3)


def wrench_adjoint(T: Any, order: str = "linear-first") -> FloatArray:
    """``Ad(T)^-T`` (6, 6): the wrench in frame A = this times the wrench in frame B, T the pose of B in A.

    ``[[R, 0], [S(p) R, R]]``; wrenches (m, f) for order="angular-first". Arguments and errors as :func:`adjoint`.
    """
    T = as_pose("T", T)
    return _blocks(T, 3 if checks.choice("order", order, _ORDERS) == "linear-first" else 0)


def move_twist(T: Any, twist: Any) -> FloatArray:
    """``Ad(T) xi``: a twist (6,), or the columns of a Jacobian (6, n), from frame B to frame A, T the pose of B in A.

    With R = I only the origin moves, with p = 0 only the axes turn. Errors as :func:`adjoint`.

    >>> from cartctl import spatial
    >>> lever = spatial.pose(p=[1.0, 0.0, 0.0])  # a frame 1 m along x, given in mine
    >>> print(spatial.move_twist(lever, [0, 0, 0, 0, 0, 1.0]))  # its turning about z moves me
    [ 0. -1.  0.  0.  0.  1.]
    """
    return adjoint(T) @ _six("twist", twist)


def move_wrench(T: Any, wrench: Any) -> FloatArray:
    """``Ad(T)^-T w``: a wrench (6,), or columns (6, n), from frame B to frame A, T the pose of B in A.

    A load cell's reading at the tool: T is the pose of the cell in the tool frame. Errors as :func:`adjoint`.
    """
    return wrench_adjoint(T) @ _six("wrench", wrench)


def other_order(x: Any) -> FloatArray:
    """(v, omega) as (omega, v) and back, (f, m) as (m, f): a vector (6,), or the columns of a matrix (6, n).

    Raises ShapeError, NonFiniteError.
    """
    x = _six("x", x)
    return np.concatenate([x[3:], x[:3]])


def as_pose(name: str, value: Any) -> FloatArray:
    """``value``, a (4, 4) array or a pin.SE3, as a checked (4, 4) array."""
    T = checks.matrix(name, getattr(value, "homogeneous", value), 4, 4)
    if not np.array_equal(T[3], _LAST):
        raise ParameterError(f"{name} has the last row {T[3]}; expected a pose with the last row 0 0 0 1")
    checked_rotation(name, T[:3, :3])
    _moderate(f"{name}: its origin", T[:3, 3])
    return T


def _blocks(T: FloatArray, row: int) -> FloatArray:
    """R twice on the diagonal, S(p) R beside it in rows ``row`` to ``row + 3``."""
    X = np.zeros((6, 6))
    X[:3, :3] = X[3:, 3:] = R = T[:3, :3]
    X[row : row + 3, 3 - row : 6 - row] = skew(T[:3, 3]) @ R
    return X


def _six(name: str, value: Any) -> FloatArray:
    array = checks.floats(name, value)
    if array.ndim not in (1, 2) or array.shape[0] != 6:
        raise ShapeError(f"{name} has shape {array.shape}; expected (6,) or columns (6, n)")
    array = checks.vector(name, array, 6) if array.ndim == 1 else checks.matrix(name, array, 6)
    _moderate(name, array)
    return array


def _moderate(name: str, array: FloatArray) -> None:
    """Refuse what overflows where two of them are multiplied; raises ParameterError."""
    most = float(np.abs(array).max(initial=0.0))
    if most > _LARGEST:
        raise ParameterError(f"{name} has an entry of size {most:g}; expected at most {_LARGEST:g}")
