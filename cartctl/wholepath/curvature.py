"""How the set bends on which the tasks are met, and a Hessian that is safe to go by.

At an optimum ``g = J^T lambda``; off the tangent space, the cost of a curved step changes by ``-lambda . d2r/2`` more
than H says. ``d(J^T lambda)/dq`` is differenced along the free directions, r of them a sample. The sum may have
negative directions (a saddle): then a multiple of the identity is added, as little as makes it positive definite.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from cartctl.checks import FloatArray
from cartctl.wholepath.banded import Factor
from cartctl.wholepath.blocks import Layout, Quadratic
from cartctl.wholepath.trace import Trace

_STEP = 1e-5  # rad or m


class Model(NamedTuple):
    """``g . y + 1/2 y^T P y`` in the free directions, P positive definite, with its factorisation."""

    P: sp.csc_matrix
    g: FloatArray
    factor: Factor


def local_model(trace: Trace, quadratic: Quadratic, layout: Layout) -> Model:
    """The cost near a path, along the set where the tasks are met."""
    g = layout.gradient(quadratic, trace.Z)
    plain = layout.hessian(quadratic, trace.Z)
    bent = plain + layout.correction(quadratic, trace.Z) + layout.diagonal(bending(trace, quadratic.g))
    size = max(float(plain.diagonal().max(initial=0.0)), 1e-12)
    for P, shifts in ((bent, (1e-9, 1e-5, 1e-4, 1e-3, 1e-2)), (plain, (1e-9, 1e-6, 1e-3))):
        for shift in shifts:
            steady = sp.csc_matrix(P + sp.diags_array(np.full(layout.size, shift * size), format="csc"))
            factor = Factor.of(steady)
            if factor is not None:
                return Model(steady, g, factor)
    identity = sp.csc_matrix(sp.diags_array(np.full(layout.size, size), format="csc"))
    factor = Factor.of(identity)
    assert factor is not None
    return Model(identity, g, factor)


def bending(trace: Trace, g: FloatArray) -> FloatArray:
    """``-Z^T d(J^T lambda)/dq Z`` (S, r, r) with lambda the multipliers of g (S, nv), symmetric."""
    setting, Z = trace.setting, trace.Z
    r = Z.shape[2]
    multipliers = _multipliers(trace.J, g)
    found = np.zeros((setting.size, r, r))
    for k, q in enumerate(trace.Q):
        for i in range(r):
            ends = []
            for sign in (1.0, -1.0):
                setting.errors(k, setting.robot.integrate(q, sign * _STEP * Z[k, :, i]))
                ends.append(multipliers[k] @ setting.jacobian())
            found[k, :, i] = -((ends[0] - ends[1]) / (2.0 * _STEP)) @ Z[k]
    return np.asarray(0.5 * (found + found.transpose(0, 2, 1)))


def _multipliers(J: FloatArray, g: FloatArray) -> FloatArray:
    """``argmin ||J^T lambda - g||``, (S, m), truncated where J loses rank."""
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    kept = s > 1e-4 * s[:, :1]
    w = np.where(kept, np.einsum("kij,kj->ki", Vt, g) / np.where(kept, s, 1.0), 0.0)
    return np.asarray(np.einsum("kij,kj->ki", U, w))
