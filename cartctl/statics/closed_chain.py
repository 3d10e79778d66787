"""Several arms on one object: a closed chain at rest, its contact wrenches, its internal wrenches, its torques."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from cartctl import checks
from cartctl.algebra.nullspace import basis
from cartctl.checks import FloatArray
from cartctl.errors import ShapeError
from cartctl.statics.duality import balanced_wrench


@dataclass(frozen=True, eq=False)
class Contacts:
    """The wrenches in a closed chain at rest.

    wrenches: (m_k,) each, of hand k on the object. torques: (n_k,) each, that make the hands push so. unbalanced:
    (m,), of the load, what no wrenches of the hands carry; zero where they can carry it.
    """

    wrenches: tuple[FloatArray, ...]
    torques: tuple[FloatArray, ...]
    unbalanced: FloatArray


class ClosedChain:
    """Arms k with Jacobians J_k (m_k, n_k) that hold one object by hands k.

    grasps: G_k (m, m_k) each, the wrench at the object's frame = G_k times the wrench of hand k on it:
    ``spatial.wrench_adjoint(T)`` with T the pose of the hand's frame in the object's, or some columns of it where the
    contact bears less; by default identities, hands in one point and one set of axes. At rest

        sum_k G_k w_k + load = 0,   tau_k = J_k^T w_k

    with the load (m,) that acts on the object. Hands that move with it, ``J_k v_k = G_k^T xi``, do the work of the load
    in reverse: ``sum_k tau_k^T v_k + load^T xi = 0`` (Murray, Li & Sastry 1994, chapter 5).

    Raises ShapeError, NonFiniteError.
    """

    def __init__(self, jacobians: Sequence[Any], grasps: Sequence[Any] | None = None) -> None:
        given = checks.listed("jacobians", jacobians)
        if not given:
            raise ShapeError("jacobians is empty; expected one Jacobian (m_k, n_k) an arm")
        self.jacobians = tuple(checks.matrix(f"jacobians[{k}]", J) for k, J in enumerate(given))
        if grasps is None:
            m = self.jacobians[0].shape[0]
            other = next((k for k, J in enumerate(self.jacobians) if J.shape[0] != m), None)
            if other is not None:
                raise ShapeError(
                    f"jacobians[{other}] has {self.jacobians[other].shape[0]} rows, jacobians[0] {m}; "
                    "expected as many in all, or grasps"
                )
            grasps = [np.eye(m)] * len(self.jacobians)
        grasps = checks.listed("grasps", grasps, len(self.jacobians))
        rows = checks.matrix("grasps[0]", grasps[0]).shape[0]
        self.grasps = tuple(
            checks.matrix(f"grasps[{k}]", G, rows, J.shape[0])
            for k, (G, J) in enumerate(zip(grasps, self.jacobians, strict=True))
        )
        self._rows = np.cumsum([0, *(J.shape[0] for J in self.jacobians)])

    @property
    def grasp(self) -> FloatArray:
        """``G = [G_1 ... G_K]``, (m, sum m_k)."""
        return np.hstack(self.grasps)

    @property
    def internal(self) -> FloatArray:
        """Columns (sum m_k, d): an orthonormal basis of the contact wrenches that cancel in the object, ``G w = 0``."""
        return basis(self.grasp)

    @property
    def motions(self) -> FloatArray:
        """Columns (sum n_k + m, d): an orthonormal basis of the motions (v_1, ..., v_K, xi) the closed chain allows."""
        return basis(np.hstack([block_diag(*self.jacobians), -self.grasp.T]))

    def hold(self, load: Any = None, squeeze: Any = None) -> Contacts:
        """Carry the load (m,), zero by default, by the least contact wrenches, plus a squeeze.

        squeeze: (sum m_k,), contact wrenches wanted on top; what of them would move the object is taken away, so that
        ``G squeeze = 0``. Raises ShapeError, NonFiniteError.
        """
        G = self.grasp
        load = np.zeros(G.shape[0]) if load is None else checks.vector("load", load, G.shape[0])
        carried = balanced_wrench(G.T, -load)
        w = carried.wrench
        if squeeze is not None:
            inner = self.internal
            w = w + inner @ (inner.T @ checks.vector("squeeze", squeeze, G.shape[1]))
        return self._answer(w, -carried.unbalanced)

    def contacts(self, torques: Sequence[Any], load: Any = None) -> Contacts:
        """The contact wrenches that go with joint torques (n_k,) an arm, by least squares over all balances at once.

        The torques handed back are those the wrenches stand for: the rest of the ones given sets the chain moving, as
        does ``unbalanced``. Statically indeterminate wrenches are the least. Raises ShapeError, NonFiniteError.
        """
        arms = enumerate(zip(checks.listed("torques", torques, len(self.jacobians)), self.jacobians, strict=True))
        given = [checks.vector(f"torques[{k}]", tau, J.shape[1]) for k, (tau, J) in arms]
        G = self.grasp
        load = np.zeros(G.shape[0]) if load is None else checks.vector("load", load, G.shape[0])
        stack = np.hstack([block_diag(*self.jacobians), G.T])
        found = balanced_wrench(stack, np.concatenate([*given, -load]))
        return self._answer(found.wrench, load + G @ found.wrench)

    def _answer(self, stacked: FloatArray, unbalanced: FloatArray) -> Contacts:
        wrenches = tuple(stacked[a:b] for a, b in pairwise(self._rows))
        torques = tuple(J.T @ w for J, w in zip(self.jacobians, wrenches, strict=True))
        return Contacts(wrenches, torques, unbalanced)
