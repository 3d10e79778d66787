"""Speeds: ``integral 1/2 v^T W v dt``, W constant weights of the joints, or the mass matrix: the kinetic energy.

Between two samples v is constant and W the mean of both ends: ``sum_k h/4 v_k^T (W_k + W_{k+1}) v_k``, exact to second
order in h. With ``C(q, v)`` of Christoffel symbols, ``d(1/2 v^T M v)/dq = C^T v``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.wholepath.blocks import Quadratic
from cartctl.wholepath.costs.base import PathCost, positive_weights
from cartctl.wholepath.trace import Trace

_STEP = 1e-5  # rad or m: of central differences


@dataclass(frozen=True, eq=False)
class JointSpeed(PathCost):
    """``integral 1/2 v^T W v dt``, rad^2/s where all joints turn: short ways of the joints, evenly paced.

    weights: diag W (nv,), >= 0, 1 each if None. Raises ParameterError, ShapeError, NonFiniteError.
    """

    weights: Any = None

    def __post_init__(self) -> None:
        """Check the weights."""
        object.__setattr__(self, "weights", positive_weights("weights", self.weights))

    @property
    def name(self) -> str:
        """For reports."""
        return "joint speed" if self.weights is None else "weighted joint speed"

    def check(self, robot: Robot) -> None:
        """One weight a joint."""
        if self.weights is not None:
            checks.vector("weights", self.weights, robot.nv)

    def value(self, trace: Trace) -> float:
        """The integral."""
        return 0.5 * trace.setting.h * float(np.sum(self._w(trace) * trace.V**2))

    def quadratic(self, trace: Trace) -> Quadratic:
        """Exact where every coordinate is a joint of its own."""
        W = np.broadcast_to(np.diag(self._w(trace)), (len(trace.V), trace.setting.robot.nv, trace.setting.robot.nv))
        return of_differences(trace, W, *_slopes(trace))

    def pace(self, state: State) -> FloatArray:
        """W."""
        return np.diag(np.ones(state.robot.nv) if self.weights is None else self.weights)

    def _w(self, trace: Trace) -> FloatArray:
        return np.ones(trace.setting.robot.nv) if self.weights is None else self.weights


@dataclass(frozen=True, eq=False)
class PathEnergy(PathCost):
    """``integral 1/2 v^T M(q) v dt``, J s: as ``objective="kinetic-energy"`` or ``cc.KineticEnergy()``."""

    @property
    def name(self) -> str:
        """For reports."""
        return "kinetic energy"

    def value(self, trace: Trace) -> float:
        """The integral."""
        mean = 0.5 * (trace.M[:-1] + trace.M[1:])
        return 0.5 * trace.setting.h * float(np.einsum("ki,kij,kj->", trace.V, mean, trace.V))

    def quadratic(self, trace: Trace) -> Quadratic:
        """Gauss-Newton with M held; X is the rest of the second derivative, where every coordinate is a joint."""
        setting, V = trace.setting, trace.V
        mean = 0.5 * (trace.M[:-1] + trace.M[1:])
        full = of_differences(trace, mean, *_slopes(trace))
        ahead, behind = np.concatenate([V, V[-1:]]), np.concatenate([V[:1], V])
        if not setting.plain:
            slopes = [trace.each(lambda s: 0.5 * (s.v @ s.inertia_gradient(s.v)), W) for W in (ahead, behind)]
        else:
            slopes = [self._bend(trace, full, W, first) for W, first in ((ahead, True), (behind, False))]
        full.g[:-1] += 0.5 * setting.h * slopes[0][:-1]
        full.g[1:] += 0.5 * setting.h * slopes[1][1:]
        return full

    def check(self, robot: Robot) -> None:
        """There must be masses to move."""
        if not has_inertia(robot):
            raise ParameterError(
                f"{robot.name!r} has a singular mass matrix at home (a URDF without masses?), so that its kinetic "
                "energy says nothing; plan with the objective 'joint-speed'"
            )

    def pace(self, state: State) -> FloatArray:
        """M."""
        return state.mass_matrix

    def _bend(self, trace: Trace, full: Quadratic, V: FloatArray, first: bool) -> FloatArray:
        """Add to X what M's change with q does to ``h/4 v^T M v`` of the pairs whose first or second end is q_k.

        Returns ``C^T v``, (S, nv).
        """
        setting, n, Z = trace.setting, trace.setting.robot.nv, trace.Z
        model, data = setting.robot.model, setting.robot.model.createData()
        used = range(setting.size - 1) if first else range(1, setting.size)
        slope = np.empty((setting.size, n))
        momenta, turns = np.zeros((2, setting.size, Z.shape[2], n)), np.zeros((2, setting.size, Z.shape[2], n))
        for k in used:
            v, q = V[k], trace.Q[k]
            slope[k] = pin.computeCoriolisMatrix(model, data, q, v).reshape(n, n).T @ v
            for i, z in enumerate(_STEP * Z[k].T):
                for side, step in enumerate((z, -z)):
                    near = pin.integrate(model, q, step)
                    turns[side, k, i] = pin.computeCoriolisMatrix(model, data, near, v).reshape(n, n).T @ v
                    momenta[side, k, i] = pin.crba(model, data, near, pin.Convention.WORLD).reshape(n, n) @ v
        half = 0.5 / _STEP
        E = half * np.einsum("kin,kmi->knm", momenta[0] - momenta[1], Z)  # d(M v)/dq, along the free directions
        F = half * np.einsum("kin,kmi->knm", turns[0] - turns[1], Z)  # d(C^T v)/dq
        sign = -0.5 if first else 0.5
        full.X0 += sign * (E + E.transpose(0, 2, 1)) + 0.25 * setting.h * (F + F.transpose(0, 2, 1))
        full.X1 += 0.5 * E[:-1].transpose(0, 2, 1) if first else -0.5 * E[1:]
        return slope


def has_inertia(robot: Robot) -> bool:
    """Whether the mass matrix at home is positive definite, to twelve digits."""
    values = np.linalg.eigvalsh(robot.state(robot.home).mass_matrix)
    return bool(values[0] > 1e-12 * values[-1] > 0.0)


def _slopes(trace: Trace) -> tuple[FloatArray, FloatArray]:
    """``dv_k/dq_k`` and ``dv_k/dq_{k+1}``, (S - 1, nv, nv)."""
    h, n = trace.setting.h, trace.setting.robot.nv
    if trace.transports is not None:
        return trace.transports[0] / h, trace.transports[1] / h
    one = np.broadcast_to(np.eye(n) / h, (len(trace.V), n, n))
    return -one, one


def of_differences(trace: Trace, W: FloatArray, B0: FloatArray, B1: FloatArray) -> Quadratic:
    """The model of ``sum_k h/2 v_k^T W_k v_k`` whose residual changes by ``W^1/2 (B0 delta_k + B1 delta_{k+1})``."""
    h = trace.setting.h
    full = Quadratic.zeros(trace.setting.size, trace.setting.robot.nv)
    left, right = h * (W @ B0), h * (W @ B1)
    full.H0[:-1] += B0.transpose(0, 2, 1) @ left
    full.H0[1:] += B1.transpose(0, 2, 1) @ right
    full.H1 += B0.transpose(0, 2, 1) @ right
    p = h * np.einsum("kij,kj->ki", W, trace.V)
    full.g[:-1] += np.einsum("kij,ki->kj", B0, p)
    full.g[1:] += np.einsum("kij,ki->kj", B1, p)
    return full
