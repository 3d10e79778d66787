"""What the singular values of a matrix say: rank, redundancy, condition, manipulability; and its determinant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra import svd
from cartctl.checks import FloatArray
from cartctl.errors import ShapeError


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The singular values of A (m, n), m rows and n columns; made by :func:`spectrum`.

    values: (min(m, n),), descending. rank: how many are above round-off. determinant: None unless m = n.
    """

    rows: int
    columns: int
    values: FloatArray
    rank: int
    determinant: float | None

    @property
    def full(self) -> bool:
        """Whether no singular value is zero: rank = min(m, n)."""
        return self.rank == min(self.rows, self.columns)

    @property
    def nullity(self) -> int:
        """``n - rank``: the dimension of the null space."""
        return self.columns - self.rank

    @property
    def redundancy(self) -> int:
        """``n - rank``: the joint motions that this task leaves free here; n - m at a regular configuration."""
        return self.columns - self.rank

    @property
    def condition(self) -> float:
        """``sigma_max / sigma_min``, in [1, inf]; inf where rank is lost, 1 of a matrix without rows or columns."""
        if not self.full:
            return np.inf
        return float(self.values[0] / self.values[-1]) if self.rank else 1.0

    @property
    def manipulability(self) -> float:
        """The product of the singular values (Yoshikawa 1985), 0 where rank is lost, 1 of an empty matrix.

        ``sqrt(det(A A^T))`` for m <= n, ``sqrt(det(A^T A))`` for m > n, ``|det A|`` for m = n.
        """
        with np.errstate(over="ignore", under="ignore"):
            return float(np.prod(self.values)) if self.full else 0.0


def spectrum(A: Any, tolerance: float | None = None) -> Spectrum:
    """All that the singular values of A (m, n) say; raises ShapeError, NonFiniteError, ParameterError.

    tolerance: singular values of at most tolerance times the Frobenius norm of A are zero; None is round-off.

    >>> from cartctl import analysis
    >>> found = analysis.spectrum([[1.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    >>> found.rank, found.nullity, found.condition
    (2, 1, 2.0)
    """
    matrix = checks.matrix("A", A)
    values = svd.singular_values(matrix)
    rank = svd.numerical_rank(values, svd.floor(matrix, tolerance))
    m, n = matrix.shape
    return Spectrum(m, n, values, rank, _determinant(matrix, rank) if m == n else None)


def rank(A: Any, tolerance: float | None = None) -> int:
    """How many singular values of A (m, n) are not zero; arguments and errors as :func:`spectrum`."""
    return spectrum(A, tolerance).rank


def nullity(A: Any, tolerance: float | None = None) -> int:
    """``n - rank A``, the dimension of the null space; arguments and errors as :func:`spectrum`."""
    return spectrum(A, tolerance).nullity


def redundancy(J: Any, tolerance: float | None = None) -> int:
    """``n - rank J``, the degree of redundancy here; arguments and errors as :func:`spectrum`."""
    return spectrum(J, tolerance).redundancy


def singular_values(A: Any) -> FloatArray:
    """(min(m, n),), descending; raises ShapeError, NonFiniteError."""
    return svd.singular_values(checks.matrix("A", A))


def condition(A: Any, tolerance: float | None = None) -> float:
    """``sigma_max / sigma_min`` of A, inf where rank is lost; arguments and errors as :func:`spectrum`."""
    return spectrum(A, tolerance).condition


def manipulability(J: Any, tolerance: float | None = None) -> float:
    """``sqrt(det(J J^T))``, of J^T J for m > n (Yoshikawa 1985); arguments and errors as :func:`spectrum`."""
    return spectrum(J, tolerance).manipulability


def determinant(J: Any, tolerance: float | None = None) -> float:
    """``det J`` of a square J (n, n), exactly 0 where rank is lost; arguments and errors as :func:`spectrum`."""
    found = spectrum(J, tolerance)
    if found.determinant is None:
        raise ShapeError(
            f"J has shape {(found.rows, found.columns)}; expected a square matrix (manipulability is for all shapes)"
        )
    return found.determinant


def _determinant(A: FloatArray, rank: int) -> float:
    if rank < A.shape[0]:
        return 0.0
    with np.errstate(all="ignore"):
        value = float(np.linalg.det(A))
    if np.isfinite(value):
        return value
    return float(np.linalg.slogdet(A / svd.scale(A))[0]) * np.inf  # beyond the largest float
