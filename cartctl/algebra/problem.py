"""One instant's question: equations in order of priority, bounds, a metric and a reference.

Satisfy ``A_k u + d_k = s_k b_k`` as well as priorities and bounds allow, then minimise
``1/2 (u - u0)^T W (u - u0)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra.metric import as_metric
from cartctl.algebra.svd import scale
from cartctl.checks import FloatArray
from cartctl.errors import ProblemError, ShapeError

FITS = ("scale", "least_squares")


@dataclass(frozen=True, slots=True, eq=False)
class Equation:
    """``A u + d = s b``, one task's rows.

    A: (m, n). b: (m,), the command, slowed by s where a method scales. drift: (m,), never slowed; zeros.
    fit: ``"scale"`` (exact, with s as large as possible in [0, 1]) or ``"least_squares"`` (s = 1, least error);
    a method that does not scale has s = 1 and meets both as well as it can. weight: >= 0, counts where a method
    weighs equations against each other instead of ranking them. name: shown in reports. size: the norm that A has by
    nature, where A is a few rows of something larger: cutoffs are relative to the larger of it and ||A||, so that rows
    which are zero up to round-off are never inverted.

    Raises ShapeError, NonFiniteError, ParameterError.

    >>> import cartctl as cc
    >>> hand = cc.Equation([[1.0, 1.0, 0.0]], [0.5], drift=[0.1], name="hand")
    >>> hand.rhs
    array([0.4])
    """

    A: FloatArray
    b: FloatArray
    drift: FloatArray | None = None
    fit: str = "scale"
    weight: float = 1.0
    name: str = ""
    size: float = 0.0

    def __post_init__(self) -> None:
        label = f"equation {self.name!r}: " if self.name else "equation: "
        put = object.__setattr__
        put(self, "A", checks.matrix(label + "A", self.A))
        rows = self.A.shape[0]
        put(self, "b", checks.vector(label + "b", self.b, rows))
        if self.drift is not None:
            put(self, "drift", checks.vector(label + "drift", self.drift, rows))
        checks.choice(label + "fit", self.fit, FITS)
        put(self, "weight", checks.number(label + "weight", self.weight, low=0.0))
        put(self, "size", checks.number(label + "size", self.size, low=0.0))

    @classmethod
    def trusted(
        cls, A: FloatArray, b: FloatArray, drift: FloatArray | None, fit: str, weight: float, name: str, size: float
    ) -> Equation:
        """The same without checks or copies, for levels whose arrays are known to be good."""
        self = _new(cls)
        _set_matrix(self, A)
        _set_b(self, b)
        _set_drift(self, drift)
        _set_fit(self, fit)
        _set_weight(self, weight)
        _set_name(self, name)
        _set_size(self, size)
        return self

    @property
    def ratio(self) -> float:
        """How much larger than ||A|| the equation is by nature; at least 1."""
        if self.size == 0.0:
            return 1.0
        norm = scale(self.A)
        return max(1.0, self.size / norm) if norm > 0.0 else 1.0

    @property
    def rhs(self) -> FloatArray:
        """``b - d``: what A u has to become when nothing is scaled."""
        return self.b if self.drift is None else self.b - self.drift

    def miss(self, u: FloatArray, s: float) -> FloatArray:
        """``A u + d - s b``, (m,)."""
        drift = 0.0 if self.drift is None else self.drift
        return self.A @ u + drift - s * self.b


@dataclass(frozen=True, slots=True, eq=False)
class Inequality:
    """``lower <= A u <= upper`` at a priority of its own: kept, or missed by as little as what ranks above allows.

    A: (m, n). lower, upper: (m,) or None, +-inf allowed. name: shown in reports. It stands among a Problem's equations,
    for solvers that honour it (``hqp``); hard rows that outrank every equation are the Problem's ``constraints``.

    Raises ShapeError, NonFiniteError, ProblemError.

    >>> import cartctl as cc
    >>> stay = cc.Inequality([[1.0, 0.0]], lower=[-0.1], upper=[0.1])
    >>> solution = cc.solve(cc.Problem([stay, ([[1.0, 0.0]], [0.5])]), "hqp")
    >>> print(solution.u.round(6), solution.status)
    [0.1 0. ] INEXACT
    """

    A: FloatArray
    lower: Any = None
    upper: Any = None
    name: str = ""
    fit: str = field(default="inequality", init=False)
    weight: float = field(default=1.0, init=False)

    def __post_init__(self) -> None:
        label = f"inequality {self.name!r}: " if self.name else "inequality: "
        put = object.__setattr__
        put(self, "A", checks.matrix(label + "A", self.A))
        rows = self.A.shape[0]
        for name, open_side in (("lower", -np.inf), ("upper", np.inf)):
            given = getattr(self, name)
            bound = np.full(rows, open_side) if given is None else given
            put(self, name, checks.vector(label + name, bound, rows, infinite=True))
        _ordered(label + "lower", self.lower, label + "upper", self.upper)

    def miss(self, u: FloatArray, s: float) -> FloatArray:
        """How far each row of A u is outside its interval, signed, (m,)."""
        x = self.A @ u
        return np.minimum(x - self.lower, 0.0) + np.maximum(x - self.upper, 0.0)  # type: ignore[no-any-return]


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Equations in order of priority (highest first), bounds, metric and reference.

    equations: a sequence of Equation or ``(A, b)`` with A (m_k, n) and b (m_k,); an Inequality may stand among them.
    lower, upper: (n,) or None, +-inf allowed. constraints: ``(C, c_lower, c_upper)`` with C (r, n) or None.
    metric: W as (n,) positive or (n, n) symmetric positive definite; None is the identity.
    reference: u0 (n,); None is zero.

    Raises ShapeError, NonFiniteError, MetricError, ProblemError (no equations, crossed bounds).

    >>> import cartctl as cc
    >>> problem = cc.Problem([([[1.0, 1.0, 0.0]], [1.5])], lower=[-1, -0.5, -1], upper=[1, 0.5, 1])
    >>> problem.n, problem.bounded
    (3, True)
    >>> print(cc.solve(problem.without_bounds(), "pinv").u)
    [0.75 0.75 0.  ]
    >>> print(cc.solve(problem, "sns").u)
    [1.  0.5 0. ]
    """

    equations: tuple[Equation, ...]
    lower: FloatArray | None = None
    upper: FloatArray | None = None
    constraints: tuple[FloatArray, FloatArray, FloatArray] | None = None
    metric: FloatArray | None = None
    reference: FloatArray | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "equations", _equations(self.equations))
        n = self.n
        for name in ("lower", "upper"):
            bound = getattr(self, name)
            if bound is not None:
                put(self, name, checks.vector(name, bound, n, infinite=True))
        if self.constraints is not None:
            put(self, "constraints", _constraints(self.constraints, n))
            _ordered("c_lower", self.constraints[1], "c_upper", self.constraints[2])
        _ordered("lower", self.lower, "upper", self.upper)
        if self.metric is not None:
            put(self, "metric", as_metric(self.metric, n))
        if self.reference is not None:
            put(self, "reference", checks.vector("reference", self.reference, n))

    @classmethod
    def trusted(
        cls,
        equations: tuple[Equation, ...],
        metric: FloatArray | None,
        reference: FloatArray | None,
        lower: FloatArray | None = None,
        upper: FloatArray | None = None,
        constraints: tuple[FloatArray, FloatArray, FloatArray] | None = None,
    ) -> Problem:
        """A problem without checks or copies, for levels whose arrays are known to be good."""
        self = _new(cls)
        _set_equations(self, equations)
        _set_lower(self, lower)
        _set_upper(self, upper)
        _set_constraints(self, constraints)
        _set_metric(self, metric)
        _set_reference(self, reference)
        return self

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return self.equations[0].A.shape[1]  # type: ignore[no-any-return]

    @property
    def sizes(self) -> tuple[int, ...]:
        """Rows of each equation."""
        return tuple(e.A.shape[0] for e in self.equations)

    @property
    def bounded(self) -> bool:
        """Whether there are bounds on u."""
        return self.lower is not None or self.upper is not None

    def clip(self, u: FloatArray) -> FloatArray:
        """The point of the box nearest to u, (n,); at half the price of ``np.clip``."""
        if self.lower is not None:
            u = np.maximum(u, self.lower)
        return u if self.upper is None else np.minimum(u, self.upper)

    def without_bounds(self) -> Problem:
        """The same problem without bounds and constraint rows."""
        return replace(self, lower=None, upper=None, constraints=None)

    def without_reference(self) -> Problem:
        """The same problem with u0 = 0."""
        return replace(self, reference=None)


# The slots' own setters pass by the frozen __setattr__, in half the time object.__setattr__ takes.
_new = object.__new__
_set_matrix, _set_b, _set_drift, _set_fit, _set_weight, _set_name, _set_size = (
    vars(Equation)[name].__set__ for name in ("A", "b", "drift", "fit", "weight", "name", "size")
)
_set_equations, _set_lower, _set_upper, _set_constraints, _set_metric, _set_reference = (
    vars(Problem)[name].__set__ for name in ("equations", "lower", "upper", "constraints", "metric", "reference")
)


def _equations(given: Any) -> tuple[Any, ...]:
    if isinstance(given, Equation | Inequality):
        given = (given,)
    if not isinstance(given, Sequence):
        raise ProblemError(f"equations is a {type(given).__name__}; expected a sequence of Equation or (A, b)")
    equations = tuple(_equation(k, e) for k, e in enumerate(given))
    if not equations:
        raise ProblemError("equations is empty; expected at least one Equation or (A, b)")
    n = equations[0].A.shape[1]
    if n == 0:
        raise ShapeError(f"equation 0: A has shape {equations[0].A.shape}; expected at least one column")
    for k, e in enumerate(equations):
        if e.A.shape[1] != n:
            raise ShapeError(f"equation {k}: A has shape {e.A.shape}; expected {n} columns as in equation 0")
    return equations


def _equation(k: int, given: Any) -> Equation | Inequality:
    if isinstance(given, Equation | Inequality):
        return given
    if not isinstance(given, Sequence) or len(given) != 2:
        raise ProblemError(f"equation {k} is a {type(given).__name__}; expected an Equation or a pair (A, b)")
    return Equation(given[0], given[1], name=f"equation {k}")


def _constraints(given: Any, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    if not isinstance(given, Sequence) or len(given) != 3:
        size = f" of {len(given)}" if isinstance(given, Sequence) else ""
        raise ProblemError(
            f"constraints is a {type(given).__name__}{size}; expected three arrays (C, c_lower, c_upper)"
        )
    C = checks.matrix("constraints C", given[0], columns=n)
    rows = C.shape[0]
    return (
        C,
        checks.vector("c_lower", given[1], rows, infinite=True),
        checks.vector("c_upper", given[2], rows, infinite=True),
    )


def _ordered(low_name: str, low: FloatArray | None, high_name: str, high: FloatArray | None) -> None:
    for name, bound, closed in ((low_name, low, np.inf), (high_name, high, -np.inf)):
        if bound is not None and (bound == closed).any():
            i = int(np.argmax(bound == closed))
            raise ProblemError(f"{name}[{i}] is {closed:g}, which leaves no room; expected a number or {-closed:g}")
    if low is None or high is None:
        return
    bad = np.flatnonzero(low > high)
    if bad.size:
        i = int(bad[0])
        raise ProblemError(
            f"{low_name}[{i}] = {low[i]:g} and {high_name}[{i}] = {high[i]:g} leave no room; expected lower <= upper"
        )
