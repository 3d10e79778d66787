"""Exact scaling for a loop of one's own: arrays that stay, filled in place, solved without a Problem."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import numpy as np

from cartctl import checks
from cartctl.algebra.problem import FITS, Equation, Problem
from cartctl.algebra.solution import Status
from cartctl.checks import FloatArray, IntArray
from cartctl.errors import ParameterError
from cartctl.solvers.exact import prepared_kernel as at
from cartctl.solvers.exact.kinds import CONTRADICTORY, EXTREME, LOST_RANK, STUCK, UNPROVEN
from cartctl.solvers.sns import SNS


def _status(flags: int) -> Status | None:
    """What the engine's flags amount to; None for what it leaves to the general way."""
    if flags & (EXTREME | CONTRADICTORY):
        return None
    named = {
        STUCK: Status.FAILED,
        UNPROVEN: Status.UNPROVEN,
        at.MISSING: Status.SKIPPED,
        LOST_RANK: Status.SINGULAR,
        at.SLOWED: Status.SCALED,
    }
    return next((status for flag, status in named.items() if flags & flag), Status.OPTIMAL)


_STATUS = tuple(_status(flags) for flags in range(2 * at.MISSING))
_OPTIONS = {"lower": "bounds=True", "upper": "bounds=True", "drift": "drift=True", "reference": "reference=True"}
_OPTIONS |= dict.fromkeys(("C", "c_lower", "c_upper"), "constraints=how many rows")


class Prepared:
    """``sns`` for problems of one shape, solved again and again: ``A_k u + d_k = s_k b_k`` in order of priority.

    n: unknowns. rows: of each equation, highest first; fits: ``"scale"`` or ``"least_squares"`` of each, all
    ``"scale"`` if None. bounds, drift, reference: whether there are any; constraints: how many rows ``c_lower <= C u <=
    c_upper`` there are.

    Fill these in place, they are views of one store: A, b, drift (tuples of (m_k, n), (m_k,), (m_k,)), lower, upper,
    reference (n,), C (r, n), c_lower, c_upper (r,), and sizes (p,), the norm that each A has by nature (see
    :class:`cartctl.Equation`). :meth:`solve` fills u (n,) and scales (p,), nan where a level was skipped. All are zeros
    at first, bounds infinite. A copy has a store of its own. Raises ParameterError.

    >>> import cartctl as cc
    >>> fast = cc.Prepared(3, [1])
    >>> fast.A[0][:], fast.b[0][:] = [1.0, 1.0, 0.0], 4.0
    >>> fast.lower[:], fast.upper[:] = -1.0, 1.0
    >>> fast.solve().name, fast.u.tolist(), fast.scales.tolist()
    ('SCALED', [1.0, 1.0, 0.0], [0.5])
    """

    A: tuple[FloatArray, ...]
    b: tuple[FloatArray, ...]
    drift: tuple[FloatArray, ...]
    C: FloatArray
    c_lower: FloatArray
    c_upper: FloatArray
    lower: FloatArray
    upper: FloatArray
    reference: FloatArray
    sizes: FloatArray
    u: FloatArray
    scales: FloatArray
    _shape: dict[str, Any]
    _ints: IntArray
    _floats: FloatArray
    _call: Callable[[IntArray, FloatArray], int]

    def __init__(
        self,
        n: int,
        rows: Sequence[int],
        fits: Sequence[str] | None = None,
        *,
        bounds: bool = True,
        constraints: int = 0,
        drift: bool = False,
        reference: bool = False,
    ) -> None:
        n, r = checks.whole("n", n, 1), checks.whole("constraints", constraints, 0)
        sizes = [checks.whole(f"rows[{k}]", m, 0) for k, m in enumerate(checks.listed("rows", rows))]
        given = ["scale"] * len(sizes) if fits is None else checks.listed("fits", fits)
        kinds = [checks.choice(f"fits[{k}]", fit, FITS) for k, fit in enumerate(given)]
        if not sizes or len(kinds) != len(sizes):
            raise ParameterError(f"rows are {sizes} and fits {kinds}; expected one of each a level, at least one")
        for name, value in (("bounds", bounds), ("drift", drift), ("reference", reference)):
            if not isinstance(value, bool):
                raise ParameterError(f"{name} is {value!r}; expected True or False, the numbers are filled in later")
        M, p, k, cuts = sum(sizes), len(sizes), n * bounds, np.cumsum(sizes)[:-1]
        lengths = {
            "A": M * n, "C": r * n, "b": M, "drift": M * drift, "reference": n * reference, "sizes": p,
            "c_lower": r, "c_upper": r, "lower": k, "upper": k, "u": n, "scales": p,
        }  # fmt: skip
        edges = np.cumsum([0, *lengths.values()]).tolist()
        floats = np.zeros(edges[-1])
        part: dict[str, Any] = {
            name: floats[i:j]
            for name, i, j in zip(lengths, edges[:-1], edges[1:], strict=True)
            if j > i or name not in _OPTIONS
        }
        part["A"] = tuple(np.split(part["A"].reshape(M, n), cuts))
        part |= {name: tuple(np.split(part[name], cuts)) for name in ("b", "drift") if name in part}
        if r:
            part["C"] = part["C"].reshape(r, n)
        for name in sorted(part.keys() & {"lower", "c_lower"}):
            part[name][:], part[name.replace("lower", "upper")][:] = -np.inf, np.inf
        head = [n, M, p, r, int(bounds), int(drift), int(reference), 0]
        ints = np.array([*head, *sizes, *(FITS.index(fit) for fit in kinds), *[0] * (n + 3)], dtype=np.int64)
        shape = {"n": n, "rows": sizes, "fits": kinds}
        shape |= {"bounds": bounds, "constraints": r, "drift": drift, "reference": reference}
        self.__dict__.update(part, _shape=shape, _ints=ints, _floats=floats, _call=at.solve_prepared.compiled)

    def solve(self, warm: bool = True) -> Status:
        """The exact optimum, as ``cc.solve(problem, "sns")`` finds it, and how it went.

        warm: start from the active bounds of the last answer. Residuals are not asked for, so INEXACT is none of the
        statuses but where the general way is gone: for rows that the bounds forbid, and numbers too far apart. FAILED
        leaves the u inside the bounds that is nearest to zero, and scales of 1. Raises NonFiniteError, ProblemError,
        ParameterError as a Problem does: u and scales are then as before.
        """
        self._ints[at.WARM] = bool(warm)
        try:
            flags = self._call(self._ints, self._floats)
        except (ValueError, ArithmeticError):  # a singular value decomposition met infinities
            flags = EXTREME
        status = _STATUS[flags] if flags >= 0 else None
        return self._by_problem() if status is None else status

    def _by_problem(self) -> Status:
        found = SNS().solve(self.problem())
        self.u[:], self.scales[:] = found.u, found.scales
        self._ints[at.HEAD + 2 * len(self.A)] = 0  # nobody is active
        return found.status

    def problem(self) -> Problem:
        """What the arrays hold now, copied: to be solved by any solver, or certified.

        Raises NonFiniteError, ProblemError, ParameterError.
        """
        has, fits = self.__dict__, self._shape["fits"]
        drifts = has.get("drift") or (None,) * len(self.A)
        levels: Any = zip(self.A, self.b, drifts, fits, self.sizes.tolist(), strict=True)
        equations = [
            Equation(A.copy(), b.copy(), None if d is None else d.copy(), fit, name=f"level {k}", size=size)
            for k, (A, b, d, fit, size) in enumerate(levels)
        ]
        box = (self.lower.copy(), self.upper.copy()) if "lower" in has else (None, None)
        hard = (self.C.copy(), self.c_lower.copy(), self.c_upper.copy()) if "C" in has else None
        reference = self.reference.copy() if "reference" in has else None
        return Problem(tuple(equations), lower=box[0], upper=box[1], constraints=hard, reference=reference)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise ParameterError(
            f"{name} cannot be set; expected an array to be filled in place, as in prepared.lower[:] = -1"
        )

    def __getattr__(self, name: str) -> NoReturn:
        if name in _OPTIONS:
            raise AttributeError(f"there is no {name} in this Prepared; expected cc.Prepared(..., {_OPTIONS[name]})")
        raise AttributeError(f"a Prepared has no {name!r}")

    def __getstate__(self) -> tuple[dict[str, Any], IntArray, FloatArray]:
        return self._shape, self._ints.copy(), self._floats.copy()

    def __setstate__(self, state: tuple[dict[str, Any], IntArray, FloatArray]) -> None:
        shape, ints, floats = state
        self.__init__(**shape)  # type: ignore[misc]
        self._ints[:], self._floats[:] = ints, floats

    def __repr__(self) -> str:
        return f"Prepared({', '.join(f'{name}={value!r}' for name, value in self._shape.items())})"
