"""Kinematic singularities: which directions of the task space a Jacobian has lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import qr

from cartctl import checks
from cartctl.algebra.svd import floor, numerical_rank, svd
from cartctl.checks import FloatArray
from cartctl.errors import ShapeError

POSE_NAMES = ("x", "y", "z", "rx", "ry", "rz")
_UNSEEN = 5e-3  # coefficients that would print as 0.00


@dataclass(frozen=True, eq=False)
class KinematicSingularity:
    """Whether ``rank J < m``, and what is lost: made by :func:`kinematic_singularity`.

    lost: (m, m - rank), orthonormal columns d with ``d^T J = 0``: no joint motion moves the task along d, and a force
    along d needs no torque. names: the same in words, one a column, such as ``"z"`` or ``"0.71 x - 0.71 y"``.
    """

    rank: int
    rows: int
    lost: FloatArray
    names: tuple[str, ...]

    def __bool__(self) -> bool:
        """It occurs."""
        return self.occurs

    @property
    def occurs(self) -> bool:
        """Whether ``rank J < m``."""
        return self.rank < self.rows

    @property
    def reason(self) -> str:
        """What is the matter, in a sentence."""
        if not self.occurs:
            return f"regular: rank {self.rank} of {self.rows}"
        return f"kinematic singularity: rank {self.rank} of {self.rows}, lost {', '.join(self.names)}"


def kinematic_singularity(
    J: Any, names: Sequence[str] | None = None, tolerance: float | None = None
) -> KinematicSingularity:
    """What J (m, n) has lost; more rows than columns are singular everywhere.

    names: of the m rows, such as ``("x", "y", "rz")``; ``row 0`` and so on if None. tolerance: as in :func:`spectrum`.
    Of a lost space of several dimensions the basis is chosen to be near the rows' own axes, since any other is hard to
    read. Raises ShapeError, NonFiniteError, ParameterError.
    """
    A = checks.matrix("J", J)
    m = A.shape[0]
    if names is not None and (isinstance(names, str) or len(names) != m):
        raise ShapeError(f"names is {names!r}; expected {m} names, one a row of J")
    labels = [f"row {i}" for i in range(m)] if names is None else [str(name) for name in names]
    transposed = svd(np.asfortranarray(A.T))
    rank = numerical_rank(transposed.s, floor(A, tolerance))
    lost = _readable(transposed.Vt[rank:].T)
    return KinematicSingularity(rank, m, lost, tuple(_words(column, labels) for column in lost.T))


def _readable(basis: FloatArray) -> FloatArray:
    """An orthonormal basis of the same space whose first column is the nearest there is to an axis, and so on.

    Pivoted QR of the projector onto the space does just that: column i is axis i seen from inside the space.
    """
    m, k = basis.shape
    if k == 0:
        return np.zeros((m, 0))
    Q, _, _ = qr(basis @ basis.T, pivoting=True)
    columns = Q[:, :k]
    columns[np.abs(columns) < 1e-14] = 0.0
    size = np.abs(columns)
    top = np.argmax(size > (1.0 - 1e-9) * size.max(axis=0), axis=0)  # of equals the first, whatever round-off says
    columns = columns * np.sign(columns[top, range(k)]) + 0.0  # no -0
    return columns[:, np.argsort(top, kind="stable")]  # type: ignore[no-any-return]


def _words(direction: FloatArray, labels: Sequence[str]) -> str:
    """``0.71 x - 0.71 y``; the name alone where there is one."""
    terms = [(c, label) for c, label in zip(direction, labels, strict=True) if abs(c) > _UNSEEN]
    if len(terms) == 1:
        return terms[0][1]
    text = " ".join(f"{'-' if c < 0.0 else '+'} {abs(c):.2f} {label}" for c, label in terms)
    return text[2:] if text.startswith("+") else "-" + text[2:]
