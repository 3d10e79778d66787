"""Equations of motion as functions of arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray

_LARGEST = 1e100  # of accelerations: what they are multiplied by leaves a number


class NumericEquations:
    """The same equations for numbers: every method takes arrays (n,) and gives a fresh one.

    Raises ShapeError, NonFiniteError, ParameterError for entries beyond 1e9.
    """

    def __init__(self, n: int, *functions: Callable[..., Any]) -> None:
        self.n = n
        self._M, self._c, self._g, self._S, self._energies = functions

    def M(self, q: Any) -> FloatArray:
        """The inertia matrix (n, n)."""
        return self._call(self._M, q, np.zeros(self.n))

    def c(self, q: Any, dq: Any) -> FloatArray:
        """Coriolis and centrifugal terms (n,)."""
        return self._call(self._c, q, dq).ravel()

    def g(self, q: Any) -> FloatArray:
        """Gravity terms (n,)."""
        return self._call(self._g, q, np.zeros(self.n)).ravel()

    def S(self, q: Any, dq: Any) -> FloatArray:
        """The factorisation of c (n, n) with M_dot - 2 S skew-symmetric."""
        return self._call(self._S, q, dq)

    def T(self, q: Any, dq: Any) -> float:
        """Kinetic energy, J."""
        return float(self._call(self._energies, q, dq)[0, 0])

    def U(self, q: Any) -> float:
        """Potential energy, J."""
        return float(self._call(self._energies, q, np.zeros(self.n))[1, 0])

    def torque(self, q: Any, dq: Any, ddq: Any) -> FloatArray:
        """``M(q) ddq + c(q, dq) + g(q)`` (n,): inverse dynamics."""
        return self.M(q) @ checks.vector("ddq", ddq, self.n, largest=_LARGEST) + self.c(q, dq) + self.g(q)

    def _call(self, function: Callable[..., Any], q: Any, dq: Any) -> FloatArray:
        posture, rates = (checks.vector(name, x, self.n, largest=checks.LARGEST) for name, x in (("q", q), ("dq", dq)))
        return np.array(function(posture, rates), dtype=np.float64)
