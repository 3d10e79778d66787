"""The quadratic programme of one step: ``min g y + 1/2 y^T P y`` with ``lower <= A y <= upper``, sparse and banded.

Without a row in the way one banded factorisation answers it. Else OSQP does (Stellato et al. 2020), told only of the
rows that are near: rows its answer violates are added until there is none, a tenth of the time that all rows take.
While the rows stay the same it is updated and warm-started instead of set up. :func:`nearest` brings a path back to its
limits, where that is what is asked for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import osqp
import scipy.sparse as sp
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.wholepath.banded import Factor

_SOLVED, _INACCURATE = (1,), (2, 7)  # OSQP's codes; 7: out of iterations
ACCURACY = 1e-5  # before polishing, which takes it to round-off where the active rows are found
_NEAR = 0.02  # half-ranges from a limit: rows that OSQP is told of
_BEYOND = 1e-6  # half-ranges: rows that count as violated
_ADDITIONS = 12


class Step(NamedTuple):
    """y (size,) and how it was found: "direct", "osqp", "osqp, inaccurate", or "none" where there is none."""

    y: FloatArray
    how: str


class Programmes:
    """OSQP and the rows it knows of, kept from step to step."""

    def __init__(self) -> None:
        self._solver: osqp.OSQP | None = None
        self._near: NDArray[np.bool_] = np.zeros(0, dtype=bool)
        self._told: NDArray[np.bool_] = np.zeros(0, dtype=bool)
        self._structure: tuple[NDArray[np.int32], NDArray[np.int32]] | None = None
        self.calls = self.setups = self.iterations = 0

    def solve(
        self, P: sp.csc_matrix, factor: Factor, g: FloatArray, A: sp.csr_matrix, lower: FloatArray, upper: FloatArray
    ) -> Step:
        """The minimiser; P is positive definite, and ``factor`` its factorisation."""
        y = factor.solve(-g)
        if not len(lower):
            return Step(y, "direct")
        near = self._near if len(self._near) == len(lower) else np.zeros(len(lower), dtype=bool)
        how = "direct"
        for _ in range(_ADDITIONS):
            Ay = A @ y
            beyond = (Ay < lower - _BEYOND) | (Ay > upper + _BEYOND)
            if not (beyond & ~near).any() and (how != "direct" or not beyond.any()):
                break
            near = near | beyond | (Ay < lower + _NEAR) | (Ay > upper - _NEAR)
            found = self._ask(P, g, A, lower, upper, near)
            if found.how == "none":
                return found
            y, how = found
        Ay = A @ y
        self._near = (Ay < lower + _NEAR) | (Ay > upper - _NEAR) if how != "direct" else np.zeros(len(lower), bool)
        return Step(y, how)

    def _ask(
        self,
        P: sp.csc_matrix,
        g: FloatArray,
        A: sp.csr_matrix,
        lower: FloatArray,
        upper: FloatArray,
        near: NDArray[np.bool_],
    ) -> Step:
        """OSQP's answer under the rows ``near``."""
        scale = float(np.abs(g).max()) or 1.0  # long waves cost little: accuracy is told by the gradient
        half, rows = sp.triu(P, format="csc"), sp.csc_matrix(A[near])
        low, high = np.maximum(lower[near], -1e20), np.minimum(upper[near], 1e20)
        structure = (half.indices, rows.indices)
        self.calls += 1
        if (
            self._solver is not None
            and np.array_equal(near, self._told)
            and self._structure is not None
            and all(map(np.array_equal, structure, self._structure))
        ):
            self._solver.update(Px=half.data / scale, Ax=rows.data, q=g / scale, l=low, u=high)
        else:
            self._solver, self._told, self._structure = osqp.OSQP(), near, structure
            self.setups += 1
            self._solver.setup(
                P=half / scale, q=g / scale, A=rows, l=low, u=high, verbose=False, eps_abs=ACCURACY, eps_rel=ACCURACY,
                max_iter=4000, polishing=True, warm_starting=True,
            )  # fmt: skip
        answer = self._solver.solve(raise_error=False)
        self.iterations += int(answer.info.iter)
        status = int(answer.info.status_val)
        if status not in _SOLVED + _INACCURATE or not np.isfinite(answer.x).all():
            self._solver = None  # its multipliers have run away
            return Step(np.zeros(len(g)), "none")
        return Step(np.asarray(answer.x), "osqp" if status in _SOLVED else "osqp, inaccurate")


def nearest(P: sp.csc_matrix, A: sp.csr_matrix, lower: FloatArray, upper: FloatArray, soft: float) -> FloatArray:
    """``argmin 1/2 dist(A y, [lower, upper])^2 + soft/2 y^T P y / max P_ii``, by a semismooth Newton method.

    Piecewise quadratic and convex, so that Newton's method ends after a few changes of the pieces.
    """
    y = np.zeros(A.shape[1])
    scale = float(P.diagonal().max())
    quiet = sp.csc_matrix((soft / scale) * P + sp.diags_array(np.full(A.shape[1], 1e-3 * soft), format="csc"))

    def miss(y: FloatArray) -> FloatArray:
        Ay = A @ y
        return np.asarray(np.minimum(Ay - lower, 0.0) + np.maximum(Ay - upper, 0.0))

    def height(y: FloatArray, m: FloatArray) -> float:
        return 0.5 * float(m @ m) + 0.5 * float(y @ (quiet @ y))

    m = miss(y)
    for _ in range(60):
        out = m != 0.0
        gradient = A.T @ m + quiet @ y
        B = A[out]
        factor = Factor.of(sp.csc_matrix(B.T @ B + quiet))
        if factor is None:
            break
        step = factor.solve(-gradient)
        now, slope, alpha = height(y, m), float(gradient @ step), 1.0
        if slope > -1e-16:
            break
        while True:
            trial = y + alpha * step
            changed = miss(trial)
            if height(trial, changed) <= now + 1e-4 * alpha * slope or alpha < 1e-6:
                break
            alpha *= 0.5
        y, m = trial, changed
        if alpha == 1.0 and np.array_equal(out, m != 0.0):
            break
    return y
