"""Torques: ``integral 1/2 ||D tau||^2 dt`` with ``tau = M a + h(q, v)``, the timing being given.

At sample k, ``v = (v_{k-1} + v_k)/2`` and ``a = (v_k - v_{k-1})/h``, of second order in h. A sum of squares: H of
Gauss-Newton from the derivatives of Newton-Euler (Carpentier & Mansard 2018).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError, UnderactuatedRobot
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.wholepath.blocks import Quadratic
from cartctl.wholepath.costs.base import PathCost, positive_weights
from cartctl.wholepath.trace import Trace


@dataclass(frozen=True, eq=False)
class SquaredTorque(PathCost):
    """``integral 1/2 ||D tau||^2 dt``, N^2 m^2 s with D = 1, gravity included.

    scale: diag D (nv,), >= 0, 1 each if None, ``"limits"`` for shares of the robot's torque limits. Raises
    ParameterError, ShapeError, NonFiniteError; UnderactuatedRobot for a robot with a moving base or mimic joints.
    """

    scale: Any = None

    def __post_init__(self) -> None:
        """Check the scale."""
        if isinstance(self.scale, str):
            checks.choice("scale", self.scale, ("limits",))
        else:
            object.__setattr__(self, "scale", positive_weights("scale", self.scale))

    @property
    def name(self) -> str:
        """For reports."""
        return "squared torque"

    def check(self, robot: Robot) -> None:
        """Every coordinate must be a joint with a motor, and the scale must fit."""
        if not robot.single.all() or robot.mimics:
            raise UnderactuatedRobot(f"{robot.name!r} has coordinates without a motor; plan with another objective")
        if isinstance(self.scale, str):
            top = robot.limits.torque_upper
            if not (np.isfinite(top) & (top > 0.0)).all():
                raise ParameterError("scale is 'limits', but not every joint has a torque limit; give one number each")
        elif self.scale is not None:
            checks.vector("scale", self.scale, robot.nv)

    def value(self, trace: Trace) -> float:
        """The integral."""
        model, data = trace.setting.robot.model, trace.setting.robot.model.createData()
        D, total = self._d(trace.setting.robot), 0.0
        for k, w, v, a in self._motion(trace):
            total += 0.5 * w * float(np.sum((D * pin.rnea(model, data, trace.Q[k], v, a)) ** 2))
        return total

    def quadratic(self, trace: Trace) -> Quadratic:
        """Gauss-Newton over three samples each."""
        setting = trace.setting
        model, data, h, n = setting.robot.model, setting.robot.model.createData(), setting.h, setting.robot.nv
        full = Quadratic.zeros(setting.size, n)
        D, S = self._d(trace.setting.robot), setting.size
        for k, w, v, a in self._motion(trace):
            tq, tv, ta = (np.reshape(x, (n, n)) for x in pin.computeRNEADerivatives(model, data, trace.Q[k], v, a))
            ta = np.triu(ta) + np.triu(ta, 1).T
            tau = D * pin.rnea(model, data, trace.Q[k], v, a)
            at: dict[int, FloatArray] = {k: np.array(tq)}
            for j, sign in ((k, 1.0), (k - 1, -1.0)):  # v_j = (q_{j+1} - q_j)/h, with its weight in v and a
                part = (0.5 * tv + sign * ta / h) / h
                if 0 <= j < S - 1 or (setting.closed and not setting.rest):
                    j %= S - 1
                    at[j + 1] = at.get(j + 1, np.zeros((n, n))) + part
                    at[j] = at.get(j, np.zeros((n, n))) - part
            at = {i: D[:, None] * T for i, T in at.items()}
            # across the seam of a closed path the two ends are not neighbours: |a + b|^2 <= 2 |a|^2 + 2 |b|^2
            share = 1.0 if max(at) - min(at) <= 2 else 2.0
            for i, T in at.items():
                full.g[i] += w * (T.T @ tau)
                for j, U in at.items():
                    if 0 <= j - i <= 2:
                        (full.H0, full.H1, full.H2)[j - i][i] += w * share * (T.T @ U)
        return full

    def node(self, state: State) -> float:
        """Of gravity alone."""
        return 0.5 * float(np.sum((self._d(state.robot) * state.gravity) ** 2))

    def _motion(self, trace: Trace) -> Any:
        """(k, weight, v, a) of every sample at which both are known."""
        setting, V = trace.setting, trace.V
        for k in range(setting.size):
            before = V[k - 1] if k else trace.before
            after = V[k] if k < len(V) else trace.after
            if before is not None and after is not None:
                yield k, trace.weights[k], 0.5 * (before + after), (after - before) / setting.h

    def _d(self, robot: Robot) -> FloatArray:
        if isinstance(self.scale, str):
            return 1.0 / robot.limits.torque_upper
        return np.ones(robot.nv) if self.scale is None else self.scale
