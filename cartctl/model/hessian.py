"""The kinematic Hessian of a frame from the columns of its Jacobian: how J turns as the joints move.

A joint i nearer to the root carries the whole motion field of joint j with it, frame included, so that both halves of
column j turn with its angular velocity: ``d(v_j, w_j)/dq_i = (w_i x v_j, w_i x w_j)``. A joint i nearer to the frame
leaves the field of j and moves only the frame within it: ``d(v_j, w_j)/dq_i = (w_j x v_i, 0)``. Joints that the frame
does not hang on have columns of zeros, and so have their derivatives.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cartctl.checks import FloatArray, IntArray
from cartctl.kernels import kernel, part

# Joints of several dofs whose rates are those of the body: each of them turns with all of them.
_OF_THE_BODY = ("FreeFlyer", "Planar", "Spherical")


def order_of(model: pin.Model) -> IntArray:
    """(nv,): column j of a Jacobian turns with every dof i of ``order[i] <= order[j]`` that moves the same frame."""
    order = np.arange(model.nv)
    for joint in model.joints:
        if joint.nv > 1 and joint.shortname().removeprefix("JointModel") in _OF_THE_BODY:
            order[joint.idx_v : joint.idx_v + joint.nv] = joint.idx_v
    return order


def carried(order: IntArray) -> NDArray[np.bool_]:
    """(nv, nv): whether column j turns with dof i, as [i, j]."""
    return order[:, None] <= order[None]


def kinematic_hessian(J: FloatArray, carried: NDArray[np.bool_]) -> FloatArray:
    """``dJ_aj / dq_i``, (6, nv, nv) as [a, j, i], of a LOCAL_WORLD_ALIGNED J (6, nv)."""
    n = J.shape[1]
    w = np.zeros((n, 3, 3))  # S(w_i)
    w[:, 2, 1], w[:, 0, 2], w[:, 1, 0] = J[3:]
    w -= w.transpose(0, 2, 1)
    crossed = w @ np.concatenate([J[:3], J[3:]], axis=1)  # [i, xyz, j]: w_i x v_j, and then w_i x w_j
    linear, angular = crossed[:, :, :n].transpose(1, 2, 0), crossed[:, :, n:].transpose(1, 2, 0)
    H = np.empty((6, n, n))
    H[:3] = np.where(carried.T, linear, linear.transpose(0, 2, 1))
    np.multiply(angular, carried.T, out=H[3:])
    return H


@part
def _drift(J: FloatArray, v: FloatArray, order: IntArray, drift: FloatArray) -> None:
    a = b = c = 0.0  # Omega_<j
    drift[:] = 0.0
    j, n = 0, J.shape[1]
    while j < n:
        x = y = z = p = q = r = 0.0
        i = j
        while i < n and order[i] == order[j]:
            x, y, z = x + J[0, i] * v[i], y + J[1, i] * v[i], z + J[2, i] * v[i]
            p, q, r = p + J[3, i] * v[i], q + J[4, i] * v[i], r + J[5, i] * v[i]
            i += 1
        d, e, f = 2.0 * a + p, 2.0 * b + q, 2.0 * c + r
        drift[0] += e * z - f * y
        drift[1] += f * x - d * z
        drift[2] += d * y - e * x
        drift[3] += b * r - c * q
        drift[4] += c * p - a * r
        drift[5] += a * q - b * p
        a, b, c = a + p, b + q, c + r
        j = i


@kernel("void(matrix, vector, ints, out_vector)")
def jacobian_drift(J: FloatArray, v: FloatArray, order: IntArray, drift: FloatArray) -> None:
    """Fill ``J_dot v = sum_ij dJ_j/dq_i v_i v_j`` (6,), by running sums of the twists on the way to the frame.

    With Omega_j the angular velocity of all that carries j, itself included, and Omega_<j that of what carries it and
    is not it, the linear part is ``sum_j (Omega_j + Omega_<j) x v_j``, the angular one ``sum_j Omega_j x w_j``.
    """
    _drift(J, v, order, drift)


@kernel("void(matrix, matrix, ints, out_matrix)")
def jacobian_drifts(J: FloatArray, V: FloatArray, order: IntArray, drifts: FloatArray) -> None:
    """The same of several velocities, the rows of V (k, nv), as columns of drifts (6, k)."""
    for i in range(V.shape[0]):
        _drift(J, V[i], order, drifts[:, i])
