"""Penrose's four conditions: which kind of inverse a matrix is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra.svd import ROUND_OFF, scale
from cartctl.checks import FloatArray

_SLACK = 8.0  # of round-off: X has been computed, in a way that is not ours


@dataclass(frozen=True)
class Penrose:
    """How well X meets the four conditions of an inverse of A; made by :func:`penrose`.

    residuals: (4,), of 1. ``A X A = A``, 2. ``X A X = X``, 3. ``(A X)^T = A X``, 4. ``(X A)^T = X A``, relative to the
    size of what is compared (docstring of :func:`penrose`). conditions: (4,), which of them hold.
    """

    residuals: tuple[float, float, float, float]
    conditions: tuple[bool, bool, bool, bool]

    def __bool__(self) -> bool:
        """All four conditions hold: X is the pseudo-inverse."""
        return self.pseudo_inverse

    @property
    def generalised(self) -> bool:
        """Condition 1: X b solves A u = b wherever that can be solved."""
        return self.conditions[0]

    @property
    def reflexive(self) -> bool:
        """Conditions 1 and 2: A is a generalised inverse of X, too, and both have the same rank."""
        return self.conditions[0] and self.conditions[1]

    @property
    def pseudo_inverse(self) -> bool:
        """All four: X = A#, the only one there is."""
        return all(self.conditions)

    @property
    def kind(self) -> str:
        """The narrowest class: ``"pseudo-inverse"``, ``"reflexive"``, ``"generalised"`` or ``"none"``."""
        if self.pseudo_inverse:
            return "pseudo-inverse"
        if self.reflexive:
            return "reflexive"
        return "generalised" if self.generalised else "none"


def penrose(A: Any, X: Any, tolerance: float | None = None) -> Penrose:
    """The four conditions of Penrose (1955) for X (n, m) as an inverse of A (m, n).

    With ``k = ||A|| ||X||`` (Frobenius) residual 1 is ``||A X A - A|| / (||A|| max(k, 1))``, residual 2 the same for X,
    and 3 and 4 are ``||(A X)^T - A X|| / k`` and ``||(X A)^T - X A|| / k``: what the round-off of a good X is relative
    to. tolerance: the largest residual that passes; None is round-off, about 1e-14 per row. For an X with d printed
    digits give ``tolerance=10**-d``.

    Raises ShapeError, NonFiniteError, ParameterError.
    """
    A = checks.matrix("A", A)
    m, n = A.shape
    X = checks.matrix("X", X, n, m)
    limit = _SLACK * ROUND_OFF * max(m, n, 1) if tolerance is None else checks.number("tolerance", tolerance, low=0.0)
    (B, a), (Y, x) = _unit(A), _unit(X)
    k = a * x  # may be inf: only its reciprocal is used then
    AX, XA = B @ Y, Y @ B
    one, two = (_compared(M, N, k) for M, N in ((AX @ B, B), (XA @ Y, Y)))
    residuals = (one, two, _norm(AX.T - AX), _norm(XA.T - XA))
    return Penrose(residuals, tuple(r <= limit for r in residuals))  # type: ignore[arg-type]


def _compared(product: FloatArray, wanted: FloatArray, k: float) -> float:
    """``||k product - wanted|| / max(k, 1)``."""
    return _norm(product - wanted / k) if k > 1.0 else _norm(k * product - wanted)


def _unit(A: FloatArray) -> tuple[FloatArray, float]:
    """A over its norm, and the norm; its squares may be beyond the largest float."""
    largest = float(np.abs(A).max(initial=0.0))
    if largest == 0.0:
        return A, 0.0
    B = A / largest
    size = scale(B)
    return B / size, largest * size


def _norm(A: FloatArray) -> float:
    return float(np.linalg.norm(A))
