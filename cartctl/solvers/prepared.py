"""Exact scaling for a loop of one's own: arrays that stay, filled in place, solved without a Problem."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cartctl import checks
from cartctl.algebra.problem import FITS, Equation, Problem
from cartctl.algebra.solution import Status
from cartctl.checks import FloatArray
from cartctl.errors import NonFiniteError, ParameterError, ProblemError
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


class Prepared:
    """``sns`` for problems of one shape, solved again and again: ``A_k u + d_k = s_k b_k`` in order of priority.

    n: unknowns. rows: of each equation, highest first; fits: ``"scale"`` or ``"least_squares"`` of each, all
    ``"scale"`` if None. bounds, drift, reference: whether there are any; constraints: how many rows ``c_lower <= C u <=
    c_upper`` there are.

    Fill these in place, they are views of one store: A, b, drift (tuples of (m_k, n), (m_k,), (m_k,)), lower, upper,
    reference (n,), C (r, n), c_lower, c_upper (r,), and sizes (p,), the norm that each A has by nature (see
    :class:`cartctl.Equation`). :meth:`solve` fills u (n,) and scales (p,), nan where a level was skipped. All are zeros
    at first, bounds infinite. Raises ParameterError, ShapeError.

    >>> import cartctl as cc
    >>> fast = cc.Prepared(3, [1])
    >>> fast.A[0][:], fast.b[0][:] = [1.0, 1.0, 0.0], 4.0
    >>> fast.lower[:], fast.upper[:] = -1.0, 1.0
    >>> fast.solve().name, fast.u.tolist(), fast.scales.tolist()
    ('SCALED', [1.0, 1.0, 0.0], [0.5])
    """

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
        sizes = [checks.whole(f"rows[{k}]", m, 0) for k, m in enumerate(rows)]
        fits = ["scale"] * len(sizes) if fits is None else [checks.choice("fits", fit, FITS) for fit in fits]
        if not sizes or len(fits) != len(sizes):
            raise ParameterError(f"rows are {list(rows)} and fits {list(fits)}; expected one of each a level")
        M, p, k = sum(sizes), len(sizes), n if bounds else 0
        head = [n, M, p, r, int(bool(bounds)), int(bool(drift)), int(bool(reference)), 0]
        self._ints = np.array([*head, *sizes, *(FITS.index(fit) for fit in fits), *[0] * (n + 3)], dtype=np.int64)
        lengths = {
            "A": M * n, "C": r * n, "b": M, "drift": M * bool(drift), "reference": n * bool(reference), "sizes": p,
            "c_lower": r, "c_upper": r, "lower": k, "upper": k, "u": n, "scales": p,
        }  # fmt: skip
        edges = np.cumsum([0, *lengths.values()]).tolist()
        self._floats = np.zeros(edges[-1])
        part = {name: self._floats[i:j] for name, i, j in zip(lengths, edges[:-1], edges[1:], strict=True)}
        self._begins = dict(zip(lengths, edges, strict=False))
        cuts = np.cumsum(sizes)[:-1]
        self.A: tuple[FloatArray, ...] = tuple(np.split(part["A"].reshape(M, n), cuts))
        self.b: tuple[FloatArray, ...] = tuple(np.split(part["b"], cuts))
        self.drift: tuple[FloatArray, ...] = tuple(np.split(part["drift"], cuts)) if drift else ()
        self.C, self.reference, self.sizes = part["C"].reshape(r, n), part["reference"], part["sizes"]
        self.c_lower, self.c_upper, self.lower, self.upper = (
            part[name] for name in ("c_lower", "c_upper", "lower", "upper")
        )
        self.u, self.scales = part["u"], part["scales"]
        for low, high in ((self.lower, self.upper), (self.c_lower, self.c_upper)):
            low[:], high[:] = -np.inf, np.inf
        self._fits, self._call = fits, at.solve_prepared.compiled

    def solve(self, warm: bool = True) -> Status:
        """The exact optimum, as ``cc.solve(problem, "sns")`` finds it; how it went.

        warm: start from the active bounds of the last answer. What the engine leaves to the general way, rows that the
        bounds forbid and entries 1e120 apart, is solved there. Raises NonFiniteError, ProblemError, naming the array.
        """
        self._ints[at.WARM] = warm
        flags = self._call(self._ints, self._floats)
        if flags < 0:
            self._refuse(-1 - flags)
        return _STATUS[flags] or self._by_problem()

    def _by_problem(self) -> Status:
        found = SNS().solve(self.problem())
        self.u[:], self.scales[:] = found.u, found.scales
        self._ints[at.HEAD + 2 * len(self.A)] = 0
        return found.status

    def problem(self) -> Problem:
        """What the arrays hold now, copied: to be solved by any solver, or certified.

        Raises NonFiniteError, ProblemError.
        """
        drifts = self.drift or (None,) * len(self.A)
        equations = [
            Equation(A.copy(), b.copy(), None if d is None else d.copy(), fit, size=size)
            for A, b, d, fit, size in zip(self.A, self.b, drifts, self._fits, self.sizes.tolist(), strict=True)
        ]
        box = (self.lower.copy(), self.upper.copy()) if len(self.lower) else (None, None)
        hard = (self.C.copy(), self.c_lower.copy(), self.c_upper.copy()) if len(self.C) else None
        reference = self.reference.copy() if len(self.reference) else None
        return Problem(tuple(equations), lower=box[0], upper=box[1], constraints=hard, reference=reference)

    def _refuse(self, k: int) -> None:
        """Name the number that is none."""
        name = [name for name, begin in self._begins.items() if begin <= k][-1]  # of those without length, the next
        value = self._floats[k]
        if name in ("lower", "c_lower"):
            i, other = k - self._begins[name], name.replace("lower", "upper")
            above = self._floats[self._begins[other] + i]
            raise ProblemError(
                f"{name}[{i}] is {value:g} and {other}[{i}] {above:g}; expected no lower above its upper"
            )
        raise NonFiniteError(f"{name} holds {value:g}; expected finite numbers")
