"""Christoffel symbols of the mass matrix, and three matrices S(q, v) with S v = c(q, v).

With ``D_k = dM/dq_k``, exact from the derivatives of the recursive Newton-Euler algorithm (Carpentier & Mansard 2018):
column a of D_k is ``d/dq_k`` of the torque ``M(q) e_a`` for the unit acceleration e_a at rest.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.dynamics.energy import require_state
from cartctl.errors import UnsupportedJoint
from cartctl.model.state import State

KINDS = ("christoffel", "pinocchio", "plain")

# Pinocchio differentiates as if the motion subspace of a joint were constant in the joint's own frame. For these joints
# of several freedoms it is; for others (Euler angles, composites, universal joints) its answer is wrong without a word.
_CONSTANT = ("JointModelTranslation", "JointModelPlanar", "JointModelSpherical", "JointModelFreeFlyer")
_TURNING = _CONSTANT[1:]
_NO_RATES = 'has no coordinates whose rates are v, so no Christoffel symbols; use coriolis(state, "pinocchio")'


def mass_matrix_derivatives(state: State) -> FloatArray:
    """``D`` (nv, nv, nv), ``D[k] = dM/dq_k``: kg m^2/rad, kg m or kg/m, as the joints are.

    Along the tangent coordinate k; for a planar, spherical or free-flyer joint along its body-fixed velocity k.
    Raises UnsupportedJoint for mimic, composite, universal and Euler-angle joints.
    """
    _refuse_varying(state)
    model, n = state.robot.model, state.robot.nv
    data, rest = model.createData(), np.zeros(n)
    # a Robot's model may have any gravity: what it adds to the derivative is the same for every acceleration
    weight = _square(pin.computeRNEADerivatives(model, data, state.q, rest, rest)[0], n)
    D = np.empty((n, n, n))
    for a, unit in enumerate(np.eye(n)):
        D[:, :, a] = (_square(pin.computeRNEADerivatives(model, data, state.q, rest, unit)[0], n) - weight).T
    return 0.5 * (D + D.transpose(0, 2, 1))  # type: ignore[no-any-return]


def mass_matrix_rate(state: State) -> FloatArray:
    """``M_dot = sum_k D_k v_k`` (nv, nv); errors as :func:`mass_matrix_derivatives`."""
    return _along(mass_matrix_derivatives(state), state.v)


def christoffel(state: State) -> FloatArray:
    """``C`` (nv, nv, nv), one symmetric matrix a joint, with ``c_i(q, v) = v^T C[i] v``.

    ``C_i = 1/2 (dM_i/dq + (dM_i/dq)^T - dM/dq_i)``, M_i column i of M (Siciliano et al. 2009, eq. 7.44). Needs joint
    rates that are the derivatives of coordinates: one-dof (continuous ones too) and translation joints. Raises
    UnsupportedJoint for planar, spherical and free-flyer joints, whose body-fixed velocities are none and which
    ``coriolis(state, "pinocchio")`` takes, and for those of :func:`mass_matrix_derivatives`.
    """
    _refuse(state, _TURNING, _NO_RATES)
    return christoffel_of(mass_matrix_derivatives(state))


def christoffel_of(D: FloatArray) -> FloatArray:
    """``C[i, j, k] = 1/2 (D[k, i, j] + D[j, i, k] - D[i, j, k])`` from ``D[k] = dM/dq_k``, (n, n, n)."""
    return 0.5 * (D.transpose(1, 2, 0) + D.transpose(1, 0, 2) - D)  # type: ignore[no-any-return]


def coriolis(state: State, kind: str = "christoffel") -> FloatArray:
    """``S(q, v)`` (nv, nv) with ``S v = c(q, v)``, the Coriolis and centrifugal torques; one of the many such S.

    kind: ``"christoffel"``, rows ``v^T C_i``, so that ``M_dot - 2 S`` is skew-symmetric; ``"pinocchio"``, the recursive
    algorithm (Echeandia & Wensing 2021), which also holds for planar, spherical and free-flyer joints and is the same
    matrix where both exist; ``"plain"``, ``M_dot - 1/2 [v^T dM/dq_i]_i``, what Euler-Lagrange leaves when nothing is
    shared out: ``M_dot - 2 S`` is not skew-symmetric, although ``v^T (M_dot - 2 S) v = 0``.

    Raises ParameterError for another kind, UnsupportedJoint as :func:`christoffel` (``"pinocchio"``: as
    :func:`mass_matrix_derivatives`).
    """
    checks.choice("kind", kind, KINDS)
    if kind == "christoffel":
        return christoffel(state) @ state.v
    if kind == "plain":
        _refuse(state, _TURNING, _NO_RATES)
        D = mass_matrix_derivatives(state)
        return _along(D, state.v) - 0.5 * (D @ state.v)
    _refuse_varying(state)
    model = state.robot.model
    return _square(pin.computeCoriolisMatrix(model, model.createData(), state.q, state.v), state.robot.nv)


def _along(D: FloatArray, v: FloatArray) -> FloatArray:
    return np.tensordot(v, D, 1)


def _square(matrix: Any, n: int) -> FloatArray:
    """A copy of Pinocchio's memory; with one joint, it hands out a vector."""
    return np.array(matrix, dtype=np.float64).reshape(n, n)


def _refuse_varying(state: State) -> None:
    _refuse(state, ("JointModelMimic",), "has no freedom of its own; load the robot with that joint locked")
    _refuse(state, (), "has axes that turn with the joint itself; split it into joints of one freedom")


def _refuse(state: State, kinds: tuple[str, ...], why: str) -> None:
    """Raise for a joint of one of the kinds; without kinds, for any whose axes turn with it."""
    model = require_state(state).robot.model
    for name, joint in zip(model.names[1:], model.joints[1:], strict=True):
        kind = joint.shortname()
        unknown = kind == "JointModelComposite" or (joint.nv != 1 and kind not in _CONSTANT)
        if kind in kinds or (not kinds and unknown):
            raise UnsupportedJoint(f"joint {name!r} of {state.robot.name!r} ({kind}) {why}")
