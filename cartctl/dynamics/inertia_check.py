"""Whether a matrix M(q) can be the inertia matrix of a robot: four steps, and the name of the one that fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy.optimize import minimize

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError

STEPS = ("independent of the base", "symmetric", "positive definite", "serial structure")
COORDINATES = ("any", "relative", "absolute")
_SUBSETS = 8  # joints up to which every set of absolute coordinates is tried


@dataclass(frozen=True, eq=False)
class InertiaCheck:
    """The verdict of :func:`check_inertia_matrix`; true in an ``if`` where M may be an inertia matrix.

    failed: the step of STEPS that fails, None if none does. reason: a sentence. q: (n,) where it fails. entry: (row,
    column) of M, from 0, where one is at fault. moved: the coordinates, from 0, that turn the whole robot when they
    grow together: (0,) with joint angles, (0, 1, ...) with absolute angles, () unknown.
    """

    failed: str | None
    reason: str
    q: FloatArray | None = None
    entry: tuple[int, int] | None = None
    moved: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        return self.failed is None


def check_inertia_matrix(
    M: Any,
    n: int | None = None,
    *,
    coordinates: str = "any",
    lower: Any = None,
    upper: Any = None,
    samples: int = 200,
    seed: int = 0,
    tolerance: float = 1e-9,
) -> InertiaCheck:
    """Whether M(q) may be an inertia matrix: four steps, in this order.

    M(q) is

    1. independent of where the fixed base stands: M(q + s w) = M(q) for every s, with w = e_1 for joint coordinates
       (``coordinates="relative"``), w = (1, ..., 1) for angles all measured from the base (``"absolute"``), or for a w
       of zeros and ones that has w_1 = 1 (``"any"``), so that M may depend on q_2 - q_1;
    2. symmetric;
    3. positive definite, at ``samples`` random q and where a descent from the worst of them leads;
    4. with ``"relative"`` only: M_ij is independent of q_1, ..., q_min(i,j), as of a serial chain; so M_nn is constant.

    M: (n, n), or a function of q (n,), then give ``n``. lower, upper: (n,) where q is drawn from, -pi and pi by
    default. tolerance: relative to the largest entry of M; in step 3 to the diagonal. What passes may still be no
    robot's: the steps are necessary, and looked at where q was drawn.

    Raises ShapeError, NonFiniteError, ParameterError.
    """
    checks.choice("coordinates", coordinates, COORDINATES)
    matrix, size = _function(M, n)
    samples, seed = checks.whole("samples", samples, 1), checks.whole("seed", seed, 0)
    low = checks.vector("lower", np.full(size, -np.pi) if lower is None else lower, size)
    high = checks.vector("upper", np.full(size, np.pi) if upper is None else upper, size)
    if not (low <= high).all():
        raise ParameterError(f"lower is {low}, upper {high}; expected lower <= upper")
    drawn = np.random.default_rng(seed).uniform(low, high, (samples, size))
    scale = max(float(np.abs(matrix(q)).max()) for q in drawn)
    limit = checks.number("tolerance", tolerance, low=0.0) * max(scale, np.finfo(float).tiny)
    moved, verdict = _base(matrix, drawn, limit, coordinates)
    if verdict is None:
        verdict = _asymmetric(matrix, drawn, limit)
    if verdict is None:
        verdict = _indefinite(matrix, drawn, low, high, tolerance)
    if verdict is None and coordinates == "relative":
        verdict = _serial(matrix, drawn, limit)
    if verdict is None:
        verdict = InertiaCheck(None, "symmetric, positive definite, independent of the base", moved=moved)
    return verdict


def _function(M: Any, n: int | None) -> tuple[Callable[[FloatArray], FloatArray], int]:
    if not callable(M):
        constant = checks.matrix("M", M)
        if constant.shape[0] != constant.shape[1] or not constant.size:
            raise ParameterError(f"M has shape {constant.shape}; expected (n, n)")
        if n is not None and n != constant.shape[0]:
            raise ParameterError(f"n is {n!r}, but M has shape {constant.shape}; leave n out where M is an array")
        return lambda q: constant, constant.shape[0]
    if isinstance(n, bool) or not isinstance(n, (int, np.integer)) or n < 1:
        raise ParameterError(f"n is {n!r}; expected the number of coordinates of the function M, a positive integer")
    size = int(n)

    def value(q: FloatArray) -> FloatArray:
        return checks.matrix(f"M({np.array2string(q, precision=3)})", M(q.copy()), size, size)

    return value, size


def _asymmetric(matrix: Callable[[FloatArray], FloatArray], drawn: FloatArray, limit: float) -> InertiaCheck | None:
    for q in drawn:
        gap = np.abs(matrix(q) - matrix(q).T)
        if gap.max() > limit:
            i, j = sorted(int(k) for k in np.unravel_index(int(gap.argmax()), gap.shape))
            return _no(1, f"M_{i + 1}{j + 1} and M_{j + 1}{i + 1} differ by {gap.max():.3g}", q, (i, j))
    return None


def _indefinite(
    matrix: Callable[[FloatArray], FloatArray], drawn: FloatArray, low: FloatArray, high: FloatArray, tolerance: float
) -> InertiaCheck | None:
    # one unit for each coordinate, the same at every q: scaled to one each time, a diagonal would leave no slope
    size = np.abs([matrix(q).diagonal() for q in drawn]).max(axis=0)
    root = np.sqrt(np.where(size > 0.0, size, 1.0))

    def least(q: FloatArray) -> float:
        return float(np.linalg.eigvalsh(matrix(np.clip(q, low, high)) / root / root[:, None])[0])

    values = np.array([least(q) for q in drawn])
    worst = drawn[int(values.argmin())]
    if values.min() > tolerance:  # between the samples it may be worse
        found = minimize(least, worst, method="Nelder-Mead", options={"maxiter": 200 * drawn.shape[1], "xatol": 1e-9})
        worst = np.clip(found.x, low, high)
    if least(worst) > tolerance:
        return None
    M = matrix(worst)
    i = int(M.diagonal().argmin())
    if M[i, i] <= 0.0:
        return _no(2, f"M_{i + 1}{i + 1} is {M[i, i]:.3g} on the diagonal", worst, (i, i))
    return _no(2, f"the determinant is {np.linalg.det(M):.3g}, an eigenvalue {np.linalg.eigvalsh(M)[0]:.3g}", worst)


def _base(
    matrix: Callable[[FloatArray], FloatArray], drawn: FloatArray, limit: float, coordinates: str
) -> tuple[tuple[int, ...], InertiaCheck | None]:
    """The coordinates that turn the whole robot, or the verdict that there are none."""
    n = drawn.shape[1]
    first, everything = (0,), tuple(range(n))
    if coordinates == "any":
        every = [(0, *more) for k in range(n) for more in combinations(range(1, n), k)] if n <= _SUBSETS else []
        subsets = every or [first, everything]
    else:
        subsets = [first if coordinates == "relative" else everything]
    for moved in subsets:
        if _change(matrix, drawn, moved).max() <= limit:
            return moved, None
    q, i, j, _ = _largest(_change(matrix, drawn, subsets[0]))
    what = "q_1" if len(subsets[0]) == 1 else "all angles turned together"
    also = ", and not on differences to it alone" if len(subsets) > 1 else ""
    return (), _no(0, f"M_{i + 1}{j + 1} depends on {what}{also}", drawn[q], (i, j))


def _serial(matrix: Callable[[FloatArray], FloatArray], drawn: FloatArray, limit: float) -> InertiaCheck | None:
    for k in range(1, drawn.shape[1]):
        q, i, j, change = _largest(_change(matrix, drawn, (k,))[:, k:, k:])
        if change > limit:
            entry = (i + k, j + k)
            reason = f"M_{entry[0] + 1}{entry[1] + 1} depends on q_{k + 1}, which moves all that these joints move"
            return _no(3, reason, drawn[q], entry)
    return None


def _largest(change: FloatArray) -> tuple[int, int, int, float]:
    q, i, j = (int(x) for x in np.unravel_index(int(change.argmax()), change.shape))
    return q, i, j, float(change[q, i, j])


def _change(matrix: Callable[[FloatArray], FloatArray], drawn: FloatArray, moved: tuple[int, ...]) -> FloatArray:
    """|M(q + s w) - M(q)|, (samples, n, n), for steps s of no rational fraction of a turn."""
    w = np.zeros(drawn.shape[1])
    w[list(moved)] = 1.0
    return np.array([np.abs(matrix(q + (1.0 + 0.1 * i) * w) - matrix(q)) for i, q in enumerate(drawn[:20])])


def _no(step: int, reason: str, q: FloatArray, entry: tuple[int, int] | None = None) -> InertiaCheck:
    return InertiaCheck(STEPS[step], f"{'no' if step == 3 else 'not'} {STEPS[step]}: {reason}", q.copy(), entry)
