"""One joint path through all samples, and what costs and limits need of it, each thing worked out once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np
import pinocchio as pin

from cartctl.checks import FloatArray
from cartctl.model.state import State
from cartctl.wholepath.manifold import Projected, kernels, project
from cartctl.wholepath.setting import Setting


class Trace:
    """A joint path Q (S, nq) that :func:`project` has brought onto the tasks."""

    def __init__(self, setting: Setting, projected: Projected) -> None:
        self.setting = setting
        self.Q, self.E, self.J, self.met = projected

    @classmethod
    def through(cls, setting: Setting, Q: FloatArray, rounds: int = 30) -> Trace:
        """The path that Newton's method finds from Q."""
        return cls(setting, project(setting, Q, rounds))

    def moved(self, delta: FloatArray) -> Trace:
        """The path a step further, brought back onto the tasks."""
        return Trace.through(self.setting, self.setting.moved(self.Q, delta), rounds=8)

    @cached_property
    def V(self) -> FloatArray:
        """Velocities held between samples, (S - 1, nv)."""
        return self.setting.differences(self.Q)

    @cached_property
    def Z(self) -> FloatArray:
        """Free directions at every sample, (S, nv, r)."""
        Z = kernels(self.J)
        if self.setting.closed:
            Z[-1] = Z[0]
        return Z

    @cached_property
    def before(self) -> FloatArray | None:
        """Velocity before the first sample (nv,): rest, of a closed path the last one; None where nothing is known."""
        if self.setting.rest:
            return np.zeros(self.setting.robot.nv)
        return self.V[-1] if self.setting.closed else None

    @cached_property
    def after(self) -> FloatArray | None:
        """Velocity after the last sample (nv,)."""
        if self.setting.rest:
            return np.zeros(self.setting.robot.nv)
        return self.V[0] if self.setting.closed else None

    @cached_property
    def M(self) -> FloatArray:
        """Mass matrices (S, nv, nv)."""
        return np.array([state.mass_matrix for state in self.states()])

    @cached_property
    def transports(self) -> tuple[FloatArray, FloatArray] | None:
        """How ``q_{k+1} (-) q_k`` changes with q_k and q_{k+1}, (S - 1, nv, nv) each; None for -1 and 1."""
        if self.setting.plain:
            return None
        model, n = self.setting.robot.model, self.setting.robot.nv
        ends = (pin.ArgumentPosition.ARG0, pin.ArgumentPosition.ARG1)
        pairs = list(zip(self.Q[:-1], self.Q[1:], strict=True))
        first, second = (
            np.array([np.asarray(pin.dDifference(model, a, b, end)).reshape(n, n) for a, b in pairs]) for end in ends
        )
        return first, second

    def states(self, V: FloatArray | None = None) -> Iterator[State]:
        """The setting's State at one sample after the other, moving with V (S, nv) or standing."""
        setting = self.setting
        for k, q in enumerate(self.Q):
            v = setting.robot_rest if V is None else V[k]
            setting.state.set(q, v, float(setting.times[k]))
            yield setting.state

    def each(self, function: Callable[[State], FloatArray], V: FloatArray | None = None) -> FloatArray:
        """A function of every sample's state, stacked."""
        return np.array([function(state) for state in self.states(V)])

    @cached_property
    def weights(self) -> FloatArray:
        """Of the trapezoidal rule, (S,), s."""
        w = np.full(self.setting.size, self.setting.h)
        w[0] = w[-1] = 0.5 * self.setting.h
        return w
