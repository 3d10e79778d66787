"""Equations of motion in symbols: T, U, M, c, g as SymPy expressions, as text, as LaTeX, as functions of numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import sympy

from cartctl import checks
from cartctl.dynamics.functions import NumericEquations
from cartctl.dynamics.printing import TextbookPrinter
from cartctl.dynamics.textbook import compact, spread
from cartctl.errors import ParameterError


class Equations:
    """``M(q) ddq + c(q, dq) + g(q) = u``; made by :func:`euler_lagrange` and :func:`from_inertia_matrix`.

    q, dq, ddq: the symbols. Everything else is computed compact when first asked for, SymPy expressions and matrices.
    ``print(equations)`` shows T, U, M, c and g line by line, :meth:`latex` the same for a paper.
    """

    def __init__(
        self,
        *,
        q: Sequence[Any],
        dq: Sequence[Any],
        kinetic: Sequence[Any],
        potential: Sequence[Any],
        M: Any,
        C: Any,
        S: Any,
        plain: Any,
        c: Any,
        g: Any,
        M_dot: Any,
        masses: Sequence[Any],
        order: Sequence[Any],
    ) -> None:
        self.q, self.dq = sympy.Matrix(q), sympy.Matrix(dq)
        self.ddq = sympy.Matrix([sympy.Symbol(f"dd{x}") for x in q])
        self._raw = {
            "T": kinetic,
            "U": potential,
            "M": M,
            "C": C,
            "S": S,
            "plain": plain,
            "c": c,
            "g": g,
            "M_dot": M_dot,
        }
        self._masses, self._order = list(masses), list(order)

    @property
    def n(self) -> int:
        """How many coordinates."""
        return len(self.q)

    @cached_property
    def kinetic(self) -> list[Any]:
        """T_i, one a link."""
        return [self._compact(T) for T in self._raw["T"]]

    @cached_property
    def potential(self) -> list[Any]:
        """U_i, one a link."""
        return [self._compact(U) for U in self._raw["U"]]

    @property
    def T(self) -> Any:
        """Kinetic energy, the sum of ``kinetic``."""
        return sympy.Add(*self.kinetic)

    @property
    def U(self) -> Any:
        """Potential energy, the sum of ``potential``."""
        return self._compact(sum(self._raw["U"][1:], self._raw["U"][0]))

    @cached_property
    def M(self) -> Any:
        """The inertia matrix."""
        return self._matrix("M")

    @cached_property
    def C(self) -> list[Any]:
        """Christoffel symbols: one symmetric matrix a coordinate, c_i = dq^T C_i dq."""
        return [sympy.Matrix(self.n, self.n, [self._compact(x) for x in part.ravel()]) for part in self._raw["C"]]

    @cached_property
    def S(self) -> Any:
        """The factorisation with rows dq^T C_i: ``M_dot - 2 S`` is skew-symmetric."""
        return self._matrix("S")

    @cached_property
    def S_plain(self) -> Any:
        """The factorisation ``M_dot - 1/2 [dq^T dM/dq_i]``: the same c, but ``M_dot - 2 S`` is not skew-symmetric."""
        return self._matrix("plain")

    @cached_property
    def M_dot(self) -> Any:
        """The rate of M along dq."""
        return self._matrix("M_dot")

    @cached_property
    def c(self) -> Any:
        """Coriolis and centrifugal terms, (n, 1)."""
        return sympy.Matrix([self._compact(x) for x in self._raw["c"]])

    @cached_property
    def g(self) -> Any:
        """Gravity terms dU/dq, (n, 1)."""
        return sympy.Matrix([self._compact(x) for x in self._raw["g"]])

    @property
    def torque(self) -> Any:
        """``M ddq + c + g``, (n, 1)."""
        return self.M * self.ddq + self.c + self.g

    def numeric(self, **values: float) -> NumericEquations:
        """The equations as functions of arrays, for a number for each name.

        Names of the table that cancel may be left out. Raises ParameterError for a name without value, or a value
        without name; NonFiniteError.
        """
        given = {sympy.Symbol(name): checks.number(name, value) for name, value in values.items()}
        # term by term: what makes them compact takes minutes for four joints at odd angles, and no number needs it
        M, c, g, S = (
            sympy.Matrix(*_shape(self._raw[k]), [spread(x) for x in np.ravel(self._raw[k])])
            for k in ("M", "c", "g", "S")
        )
        energies = sympy.Matrix([spread(sum(self._raw[k][1:], self._raw[k][0])) for k in ("T", "U")])
        wanted = set().union(*(x.free_symbols for x in (M, c, g, energies))) - {*self.q, *self.dq}
        missing, unknown = wanted - set(given), set(given) - {*self._masses, *self._order}
        if missing or unknown:
            what = f"{min(missing, key=str)} has no value" if missing else f"there is no {min(unknown, key=str)}"
            raise ParameterError(f"{what} among {sorted(values)}; expected one for each of {sorted(map(str, wanted))}")
        return NumericEquations(self.n, *(self._function(x.subs(given)) for x in (M, c, g, S, energies)))

    def text(self, expression: Any) -> str:
        """An expression of these symbols as a textbook prints it: ``m2 l1 dc2 cos(q2)``."""
        return str(TextbookPrinter([*self._order, *self.q]).doprint(expression))

    def lines(self) -> list[tuple[str, Any]]:
        """What ``print`` shows: ``("T1", expression)``, ..., upper triangle of M."""
        shown = [(f"T{i}", T) for i, T in enumerate(self.kinetic, start=1)] if len(self.kinetic) > 1 else []
        shown += [(f"U{i}", U) for i, U in enumerate(self.potential, start=1)] if len(self.potential) > 1 else []
        shown += [("T", self.kinetic[0])] if len(self.kinetic) == 1 else []
        shown += [("U", self.potential[0])] if len(self.potential) == 1 else []
        shown += [(f"M{i + 1}{j + 1}", self.M[i, j]) for i in range(self.n) for j in range(i, self.n)]
        shown += [(f"c{i + 1}", x) for i, x in enumerate(self.c)]
        return shown + [(f"g{i + 1}", x) for i, x in enumerate(self.g)]

    def latex(self) -> str:
        """The lines of ``print`` as LaTeX, for an ``aligned`` environment."""
        named = {x: sympy.Symbol(f"\\dot{{q}}_{{{i}}}") for i, x in enumerate(self.dq, start=1)}
        named |= {x: sympy.Symbol(f"q_{{{i}}}") for i, x in enumerate(self.q, start=1)}
        rows = []
        for name, x in self.lines():
            label = f"{name[0]}_{{{name[1:]}}}" if len(name) > 1 else name
            rows.append(f"{label} &= {sympy.latex(x.subs(named))}")
        return " \\\\\n".join(rows)

    def __str__(self) -> str:
        return "\n".join(f"{name} = {self.text(x)}" for name, x in self.lines())

    def _matrix(self, name: str) -> Any:
        return sympy.Matrix(self.n, self.n, [self._compact(x) for x in self._raw[name].ravel()])

    def _compact(self, total: Any) -> Any:
        return compact(total, self._masses, self.dq)

    def _function(self, value: Any) -> Callable[..., Any]:
        return sympy.lambdify([list(self.q), list(self.dq)], value, modules="numpy", cse=True)  # type: ignore[no-any-return]


def _shape(array: Any) -> tuple[int, int]:
    """Rows and columns; a vector is a column."""
    return array.shape if array.ndim == 2 else (len(array), 1)
