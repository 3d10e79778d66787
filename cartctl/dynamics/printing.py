"""The text of an expression as a textbook sets it: ``m2 l1 dc2 cos(q2)``. Needs SymPy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy
from sympy.printing.str import StrPrinter


class TextbookPrinter(StrPrinter):  # type: ignore[misc]
    """Factors in the order numbers, the given symbols, sines and cosines, rates; blanks instead of stars."""

    def __init__(self, order: Sequence[Any]) -> None:
        super().__init__({"order": "none"})
        self._rank = {symbol: k for k, symbol in enumerate(order)}

    def _place(self, e: Any) -> tuple[int, int, str]:
        base = e.base if e.is_Pow else e
        if base.is_Number:
            return (0, 0, "")
        if isinstance(base, (sympy.sin, sympy.cos)):
            return (3, len(str(base)), str(base))
        if base.is_Symbol:
            name = base.name
            return (4 if name[0] == "d" and name.lstrip("d")[:1] == "q" else 1, self._rank.get(base, 999), name)
        symbols = sorted(self._rank.get(s, 999) for s in base.free_symbols)
        return (2, symbols[0] if symbols else 0, str(base))

    def _order_of_term(self, term: Any) -> tuple[Any, ...]:
        factors = sympy.Mul.make_args(term)
        waves = sorted((len(str(w)), str(w)) for w in term.atoms(sympy.sin, sympy.cos))
        places = sorted(self._place(f) for f in factors if not f.is_Number)
        degree = sum(f.exp if f.is_Pow else 1 + f.is_Add for f in factors if not f.is_Number)
        return (len(waves), waves, bool(term.could_extract_minus_sign()), degree, places, str(term))

    def _print_Add(self, expr: Any, order: Any = None) -> str:  # noqa: ARG002 - SymPy's signature
        text = ""
        for term in sorted(expr.args, key=self._order_of_term):
            part = self._print(term)
            if part.startswith("-"):
                text += f" - {part[1:].lstrip()}" if text else part
            else:
                text += f" + {part}" if text else part
        return text

    def _print_Mul(self, expr: Any) -> str:
        coefficient, rest = expr.as_coeff_Mul()
        sign, coefficient = ("-", -coefficient) if coefficient < 0 else ("", coefficient)
        factors = sorted(sympy.Mul.make_args(rest), key=self._place)
        parts = [] if coefficient == 1 else [str(coefficient)]
        for factor in factors:
            text = self._print(factor)
            parts.append(f"({text})" if factor.is_Add else text)
        return sign + " ".join(parts)

    def _print_Pow(self, expr: Any, rational: bool = False) -> str:
        if not (expr.exp.is_Integer and expr.exp > 0):
            return super()._print_Pow(expr, rational)  # type: ignore[no-any-return]
        base = self._print(expr.base)
        return f"({base})^{expr.exp}" if expr.base.is_Add or expr.base.is_Mul else f"{base}^{expr.exp}"
