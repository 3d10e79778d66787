"""Second derivatives of a frame's position along constant rates, and how far a step may stray from its tangent.

With J = [V; Omega] of a frame, ``d^2 p/dt^2 = sum_ij u_i u_j (omega_i x v_j)`` with i the column nearer to the root:
what turns at i carries along all that lies behind it. Columns of one joint of several axes turn together. For a
direction n this is ``u^T H u`` with a symmetric H, and ``u^T H u = n^T J_dot(u) u``, ``H u = 1/2 d(u^T H u)/du``.
"""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.model.robot import Robot

_LEVI_CIVITA = np.zeros((3, 9))  # n @ this, as (3, 3), is S(n) with S(n) a = n x a
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _LEVI_CIVITA[_i, 3 * _k + _j], _LEVI_CIVITA[_i, 3 * _j + _k] = 1.0, -1.0


def curvatures(J: FloatArray, normals: FloatArray, order: FloatArray) -> FloatArray:
    """``H`` (k, nv, nv), one for each of ``normals`` (k, 3); J (6, nv) of the frame, order from :func:`joint_order`."""
    turned = (normals @ _LEVI_CIVITA).reshape(-1, 3, 3) @ J[3:]  # n . (omega_i x v_j) = (n x omega_i) . v_j
    half = order * (turned.transpose(0, 2, 1) @ J[:3])
    H: FloatArray = half + half.transpose(0, 2, 1)
    return H


def joint_order(robot: Robot) -> FloatArray:
    """(nv, nv): 1 where coordinate i belongs to a joint before that of j, 1/2 where to the same, 0 behind."""
    joint_of = np.zeros(robot.nv)
    for index, joint in enumerate(robot.model.joints):
        if joint.nv > 0 and joint.idx_v >= 0:
            joint_of[joint.idx_v : joint.idx_v + joint.nv] = index
    order: FloatArray = 0.5 * (1.0 + np.sign(joint_of[None, :] - joint_of[:, None]))
    return order


def largest_form(H: FloatArray, radius: FloatArray) -> FloatArray:
    """An upper bound (k,) of ``w^T H w`` over ``|w_i| <= radius_i``; H (k, n, n).

    Squares lie in [0, radius_i^2] and so count only where H_ii > 0; products of two have either sign.
    """
    squares = np.minimum(H.diagonal(axis1=1, axis2=2), 0.0) @ radius**2
    bound: FloatArray = (np.abs(H) @ radius) @ radius + squares
    return bound


def third_order(J: FloatArray, rates: FloatArray, dt: float) -> float:
    """An upper bound, m, of what a step adds beyond second order: ``dt^3/6 Omega^2 S exp(2 Omega dt)``.

    ``|u_i| <= rates_i``, ``Omega = sum rates_i ||omega_i||``, ``S = sum rates_i ||v_i||``. Every third derivative is an
    ``omega_i x (omega_j x v_k)``, and S grows by at most the factor ``exp(2 Omega dt)`` within the step.
    """
    turning = float(rates @ np.sqrt((J[3:] ** 2).sum(axis=0)))
    moving = float(rates @ np.sqrt((J[:3] ** 2).sum(axis=0)))
    return dt**3 / 6.0 * turning**2 * moving * float(np.exp(min(2.0 * turning * dt, 50.0)))
