"""Formulas written as text, ``"m1*dc1**2"``: arithmetic alone is read, nothing is executed.

The same text becomes a number (with the values of its names) or a SymPy expression. Names are what a letter begins;
``pi`` is pi, and sin, cos and sqrt are functions. ``E`` and ``I`` are names like any other, not e and sqrt(-1).
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from functools import lru_cache
from types import ModuleType
from typing import Any

from cartctl import checks
from cartctl.errors import MissingDependencyError, ParameterError

_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}
_FUNCTIONS = ("sin", "cos", "sqrt")
_LONGEST = 2000  # characters, so that nesting stays shallow
_POWER = 64  # of an exponent, so that 9**9**9 stays a message


def entry(name: str, value: Any) -> float | str:
    """``value`` as a finite float, or as the text of a formula; a SymPy expression gives its text.

    Raises ParameterError, NonFiniteError.
    """
    if hasattr(value, "free_symbols"):
        value = str(value)
    if not isinstance(value, str):
        return checks.number(name, value)
    _parse(name, value)
    return value


def names(value: float | str) -> set[str]:
    """The names in a formula."""
    if not isinstance(value, str):
        return set()
    tree = _parse("formula", value)
    called = {node.func.id for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} - called - {"pi"}


def number(name: str, value: float | str, given: Mapping[str, float]) -> float:
    """The formula's value; raises ParameterError for a name without one, a division by zero, a root of -1."""
    if not isinstance(value, str):
        return value
    try:
        known = {"pi": math.pi, **given}
        result = _evaluate(_parse(name, value).body, known, {k: getattr(math, k) for k in _FUNCTIONS}, float)
        if isinstance(result, complex):
            raise ValueError
        return checks.number(name, result)
    except (ArithmeticError, ValueError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(f"{name} = {value!r} has no real value here ({error})") from None


def expression(name: str, value: float | str) -> Any:
    """The formula as a SymPy expression, decimals as fractions; raises MissingDependencyError without SymPy."""
    sympy = require_sympy()
    if not isinstance(value, str):
        return sympy.Rational(repr(value))
    tree = _parse(name, value)
    known = {"pi": sympy.pi, **{n: sympy.Symbol(n) for n in names(value)}}
    functions = {k: getattr(sympy, k) for k in _FUNCTIONS}
    return _evaluate(tree.body, known, functions, lambda x: sympy.Rational(repr(x)))


def require_sympy() -> ModuleType:
    """SymPy, or a MissingDependencyError that says how to get it."""
    try:
        import sympy
    except ModuleNotFoundError:
        raise MissingDependencyError(
            "equations in symbols need SymPy, which is missing: pip install 'cartctl[symbolic]' (or pip install sympy)"
        ) from None
    return sympy  # type: ignore[no-any-return]


@lru_cache(maxsize=4096)
def _parse(name: str, text: str) -> ast.Expression:
    if len(text) > _LONGEST:
        raise ParameterError(f"{name} is a formula of {len(text)} characters; expected at most {_LONGEST}")
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
        for node in ast.walk(tree.body):
            _check(node)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ParameterError(
            f"{name} is {text[:60]!r}; expected a number or a formula of names, + - * / **, pi, sin, cos and sqrt"
        ) from None
    return tree


def _check(node: ast.AST) -> None:
    fine = (
        (isinstance(node, ast.Constant) and type(node.value) in (int, float))
        or (isinstance(node, ast.BinOp) and type(node.op) in _BINARY)
        or (isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY)
        or (isinstance(node, ast.Name) and node.id.isidentifier())
        or (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id in _FUNCTIONS
            and len(node.args) == 1
            and not node.keywords
        )
        or isinstance(node, (ast.operator, ast.unaryop, ast.expr_context))
    )
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
        exponent = node.right.operand if isinstance(node.right, ast.UnaryOp) else node.right
        fine = isinstance(exponent, ast.Constant) and abs(float(exponent.value)) <= _POWER  # type: ignore[arg-type]
    if not fine:
        raise ValueError


def _evaluate(
    node: ast.expr, known: Mapping[str, Any], functions: Mapping[str, Callable[[Any], Any]], read: Callable[[Any], Any]
) -> Any:
    if isinstance(node, ast.Constant):
        return read(node.value)
    if isinstance(node, ast.Name):
        if node.id not in known:
            raise ParameterError(f"the value of {node.id!r} is missing; known: {', '.join(sorted(known)) or 'none'}")
        return known[node.id]
    if isinstance(node, ast.UnaryOp):
        return _UNARY[type(node.op)](_evaluate(node.operand, known, functions, read))
    if isinstance(node, ast.BinOp):
        left, right = (_evaluate(side, known, functions, read) for side in (node.left, node.right))
        return _BINARY[type(node.op)](left, right)
    assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    return functions[node.func.id](_evaluate(node.args[0], known, functions, read))
