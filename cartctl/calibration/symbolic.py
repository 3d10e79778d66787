"""Regressors of small tables in symbols, as a lecture prints them. Needs SymPy, the extra ``symbolic``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl.calibration.dh_chain import DHChain
from cartctl.calibration.motions import Motion
from cartctl.calibration.selection import Parameters
from cartctl.dynamics.expressions import require_sympy
from cartctl.errors import ParameterError

MOST = 4  # joints; beyond it nobody reads the formulas


@dataclass(frozen=True, eq=False)
class SymbolicRegressor:
    """position: (3, 1) of the end, regressor: (3, p) = d position / d parameters at the table's values; SymPy.

    names: (p,). Lengths of the table that are not 0 stand as the symbols ``a1``, ``d1``, ..., joints as ``q1``, ...;
    angles, and lengths that are 0, as their values. ``print(regressor)`` shows it line by line.
    """

    position: Any
    regressor: Any
    names: tuple[str, ...]
    _order: tuple[Any, ...]

    def __str__(self) -> str:
        from cartctl.dynamics.printing import TextbookPrinter

        printer = TextbookPrinter(self._order)
        lines = [f"p{axis} = {printer.doprint(e)}" for axis, e in zip("xyz", self.position, strict=True)]
        for k, name in enumerate(self.names):
            column = ", ".join(printer.doprint(e) for e in self.regressor[:, k])
            lines.append(f"dp/d{name} = [{column}]")
        return "\n".join(lines)

    def latex(self) -> str:
        """The regressor as a LaTeX matrix."""
        return str(require_sympy().latex(self.regressor))


def symbolic_regressor(chain: DHChain, parameters: Parameters = None) -> SymbolicRegressor:
    """``Phi = [dp/da dp/dalpha dp/dd dp/dtheta]`` over the chosen parameters of a table, in symbols.

    Sines and cosines of sums of joints are collected, as ``cos(q1 + q2)``. Raises ParameterError for more than 4
    joints, a base or a tool; MissingDependencyError, ParameterNotFound.
    """
    sympy = require_sympy()
    from cartctl.dynamics.textbook import compact
    from cartctl.dynamics.trigsum import Ground

    if not isinstance(chain, DHChain):
        raise ParameterError(f"chain is a {type(chain).__name__}; expected a cc.DHChain")
    if chain.n > MOST:
        raise ParameterError(
            f"the table has {chain.n} rows; expected at most {MOST}, beyond which nobody reads formulas"
        )
    names = chain.select(parameters)
    if any(name.startswith(("base.", "tool.")) for name in names) or any(
        (T != np.eye(4)).any() for T in (chain.base, chain.tool)
    ):
        raise ParameterError("symbols are of the table alone; expected a chain without base and tool, and none chosen")
    q = [sympy.Symbol(f"q{i + 1}") for i in range(chain.n)]
    lengths = [f"{c}{i + 1}" for i in range(chain.n) for c in "ad" if getattr(chain, c)[i]]
    order = [sympy.Symbol(name) for name in lengths]
    ground = Ground([], [*order, *q])
    zero, one = ground.constant(0), ground.constant(1)

    def walk(watched: str | None) -> list[Any]:
        """The end's position, or its derivative: one factor replaced by its own."""
        R = [[one if i == j else zero for j in range(3)] for i in range(3)]
        p, dR, dp = [zero] * 3, None, None
        for i in range(chain.n):
            for step in chain.row(i):
                assert isinstance(step, Motion)
                A, t = _factor(ground, step, order, q)
                if dR is not None and dp is not None:
                    dp, dR = _moved(dR, dp, A, t)
                elif step.name == watched:
                    dA, dt = _derivative(ground, step, A)
                    dp, dR = _times(R, dt), _product(R, dA)
                p, R = _moved(R, p, A, t)
        return p if watched is None else dp or [zero] * 3

    columns = [[compact(e) for e in walk(name)] for name in names]
    position = sympy.Matrix([compact(e) for e in walk(None)])
    return SymbolicRegressor(position, sympy.Matrix(3, len(names), lambda i, j: columns[j][i]), names, (*order, *q))


def _factor(ground: Any, step: Motion, lengths: list[Any], q: list[Any]) -> tuple[Any, Any]:
    """Rotation and translation of one factor; the translation is along one axis."""
    zero, one = ground.constant(0), ground.constant(1)
    axis = int(abs(step.axis).argmax())
    eye = [[one if i == j else zero for j in range(3)] for i in range(3)]
    coordinate = None if step.joint < 0 else q[step.joint]
    if step.turns:
        c, s = ground.turned(step.value, coordinate)
        return _rotation(axis, c, s, one, zero), [zero] * 3
    length = zero
    symbol = next((x for x in lengths if str(x) == step.name), None)
    if symbol is not None:
        length = length + ground.generator(symbol)
    if coordinate is not None:
        length = length + ground.generator(coordinate)
    return eye, [length if i == axis else zero for i in range(3)]


def _derivative(ground: Any, step: Motion, A: Any) -> tuple[Any, Any]:
    """d(factor)/d(parameter): ``S(axis) A`` of a turn, the axis of a slide."""
    zero, one = ground.constant(0), ground.constant(1)
    axis = int(abs(step.axis).argmax())
    if not step.turns:
        return [[zero] * 3 for _ in range(3)], [one if i == axis else zero for i in range(3)]
    S = [[zero] * 3 for _ in range(3)]
    j, k = (axis + 1) % 3, (axis + 2) % 3
    S[j][k], S[k][j] = -one, one
    return _product(S, A), [zero] * 3


def _rotation(axis: int, c: Any, s: Any, one: Any, zero: Any) -> Any:
    R = [[zero] * 3 for _ in range(3)]
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R[axis][axis], R[j][j], R[k][k], R[j][k], R[k][j] = one, c, c, -s, s
    return R


def _moved(R: Any, p: Any, A: Any, t: Any) -> tuple[Any, Any]:
    return [x + y for x, y in zip(p, _times(R, t), strict=True)], _product(R, A)


def _times(R: Any, t: Any) -> Any:
    return [_sum(x * y for x, y in zip(row, t, strict=True)) for row in R]


def _product(R: Any, A: Any) -> Any:
    return [[_sum(row[k] * A[k][j] for k in range(3)) for j in range(3)] for row in R]


def _sum(terms: Any) -> Any:
    first, *rest = terms
    for term in rest:
        first = first + term
    return first
