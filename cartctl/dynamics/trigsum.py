"""Exact sums of cosines and sines: ``sum_f a_f cos(f) + b_f sin(f)``, f integer combinations of angles.

The coefficients are polynomials in everything else. Every product of sines and cosines is such a sum in one way only,
so that terms cancel by themselves (sin^2 + cos^2 is 1 as it arises) and equal means equal. Needs SymPy; imported only
by what makes equations in symbols.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import sympy
from sympy.polys.rings import PolyRing

from cartctl.dynamics.expressions import expression

Frequency = tuple[tuple[int, int], ...]  # (angle, how often), sorted; the first count is positive
_QUARTER = 1e-12  # rad: a float this close to a multiple of pi/2 is meant to be one


class Ground:
    """The angles and the polynomial ring that a set of sums shares; ``expressions`` names all that will be read.

    lumps: what each of up to ``lumps`` symbols made by :meth:`lump` stands for.
    """

    def __init__(self, expressions: Iterable[Any], symbols: Sequence[Any] = (), lumps: int = 0) -> None:
        generators: dict[Any, None] = dict.fromkeys(symbols)
        for e in expressions:
            for g in _generators(sympy.sympify(e)):
                generators.setdefault(g)
        self._free = [sympy.Dummy(f"lump{k}") for k in range(lumps)]
        self.lumps: dict[Any, Any] = {}
        self.generators = (*generators, *self._free)
        # the ring wants plain symbols; what they stand for (sqrt(3), 1/m) is put back at the end
        stand_ins = [g if g.is_Symbol else sympy.Dummy(f"g{k}") for k, g in enumerate(self.generators)]
        self.ring = PolyRing(stand_ins or [sympy.Dummy("none")], sympy.QQ, sympy.lex)
        self._of = dict(zip(self.generators, self.ring.gens, strict=False))
        self._moving = [self._of[x] for x in symbols]
        self.angles: list[Any] = []

    def constant(self, value: Any) -> TrigSum:
        """A rational number, or an element of the ring."""
        return TrigSum(self, {(): (self.ring(value), self.ring.zero)})

    def generator(self, symbol: Any) -> TrigSum:
        """One of the generators."""
        return self.constant(self._of[symbol])

    def read(self, value: float | str) -> TrigSum:
        """An entry of a table."""
        return self.convert(expression("entry", value))

    def convert(self, e: Any) -> TrigSum:
        """A SymPy expression."""
        e = sympy.sympify(e)
        if e.is_Rational:
            return self.constant(sympy.QQ(e.p, e.q))
        if e.is_Add:
            return sum((self.convert(x) for x in e.args), self.constant(0))
        if e.is_Mul or (e.is_Pow and e.exp.is_Integer and e.exp > 0):
            product = self.constant(1)
            for factor in e.args if e.is_Mul else (e.base,) * int(e.exp):
                product = product * self.convert(factor)
            return product
        if isinstance(e, (sympy.sin, sympy.cos)):
            return self.cos_sin(e.args[0])[isinstance(e, sympy.sin)]
        return self.generator(e)

    def lump(self, total: TrigSum) -> TrigSum:
        """A sum such as L3 - D as one symbol, so that powers are not multiplied out; as it is if it moves."""
        constant = total.terms.get((), (self.ring.zero, None))[0]
        if len(constant) < 2 or len(total.terms) > 1 or any(constant.degree(x) > 0 for x in self._moving):
            return total
        value = self.coefficient(constant)
        known = next((symbol for symbol, other in self.lumps.items() if other == value), None)
        if known is None:
            known = self._free.pop()
            self.lumps[known] = value
        return self.generator(known)

    def cos_sin(self, angle: Any) -> tuple[TrigSum, TrigSum]:
        """Cosine and sine of a sum of angles; quarter turns are exact, other constants are angles of their own."""
        turns, counts = 0, dict[int, int]()
        for term in sympy.Add.make_args(sympy.expand(angle)):
            coefficient, rest = term.as_coeff_Mul()
            if rest is sympy.pi and (2 * coefficient).is_Integer:
                turns += int(2 * coefficient)
                continue
            if not coefficient.is_Integer or rest is sympy.S.One:
                coefficient, rest = sympy.S.One, term
            if coefficient != 0 and rest != 0:
                k = self._angle(rest)
                counts[k] = counts.get(k, 0) + int(coefficient)
        f, sign = normal(counts)
        zero, one = self.ring.zero, self.ring.one
        c = TrigSum(self, {f: (one, zero)})
        s = TrigSum(self, {f: (zero, sign * one)} if f else {})
        return ((c, s), (-s, c), (-c, -s), (s, -c))[turns % 4]

    def turned(self, entry: float | str, coordinate: Any) -> tuple[TrigSum, TrigSum]:
        """Cosine and sine of an entry of a table plus a coordinate (None: without)."""
        quarters = round(entry / (math.pi / 2)) if isinstance(entry, float) else 0
        if isinstance(entry, float) and abs(entry - quarters * math.pi / 2) <= _QUARTER:
            angle = quarters * sympy.pi / 2
        else:
            angle = expression("angle", entry)
        return self.cos_sin(angle if coordinate is None else angle + coordinate)

    def _angle(self, symbol: Any) -> int:
        if symbol not in self.angles:
            self.angles.append(symbol)
        return self.angles.index(symbol)

    def frequency(self, f: Frequency) -> Any:
        """The frequency as a SymPy expression."""
        return sympy.Add(*(count * self.angles[k] for k, count in f))

    def coefficient(self, p: Any) -> Any:
        """An element of the ring as a SymPy expression, expanded."""
        return p.as_expr(*self.generators) if self.generators else p.as_expr()


class TrigSum:
    """terms: frequency -> (coefficient of its cosine, of its sine); the frequency () has a cosine alone, 1."""

    __slots__ = ("ground", "terms")

    def __init__(self, ground: Ground, terms: dict[Frequency, tuple[Any, Any]]) -> None:
        self.ground = ground
        self.terms = {f: ab for f, ab in terms.items() if ab[0] or ab[1]}

    def __add__(self, other: Any) -> TrigSum:
        if not isinstance(other, TrigSum):
            return NotImplemented
        terms = dict(self.terms)
        for f, (a, b) in other.terms.items():
            mine = terms.get(f)
            terms[f] = (a, b) if mine is None else (mine[0] + a, mine[1] + b)
        return TrigSum(self.ground, terms)

    def __neg__(self) -> TrigSum:
        return TrigSum(self.ground, {f: (-a, -b) for f, (a, b) in self.terms.items()})

    def __sub__(self, other: Any) -> TrigSum:
        return self + (-other) if isinstance(other, TrigSum) else NotImplemented

    def __mul__(self, other: Any) -> TrigSum:
        """By a sum, or by a rational number or element of the ring."""
        if not isinstance(other, TrigSum):
            if hasattr(other, "shape"):
                return NotImplemented
            return TrigSum(self.ground, {f: (a * other, b * other) for f, (a, b) in self.terms.items()})
        terms: dict[Frequency, tuple[Any, Any]] = {}
        zero = self.ground.ring.zero
        for f, (a, b) in self.terms.items():
            for g, (c, d) in other.terms.items():
                if not f or not g:  # one of them is constant
                    low = f or g
                    old = terms.get(low, (zero, zero))
                    terms[low] = (old[0] + a * c, old[1] + (a * d if not f else b * c))
                    continue
                ac, bd, ad, bc = a * c, b * d, a * d, b * c
                for h, cosine, sine in (
                    (combined(f, g, 1), ac - bd, ad + bc),
                    (combined(f, g, -1), ac + bd, bc - ad),
                ):
                    key, sign = normal(h)
                    old = terms.get(key, (zero, zero))
                    half = sympy.QQ(1, 2)
                    terms[key] = (old[0] + half * cosine, old[1] + (sign * half * sine if key else zero))
        return TrigSum(self.ground, terms)

    def diff(self, symbol: Any) -> TrigSum:
        """The derivative with respect to a symbol, as an angle and as a generator."""
        ground, terms = self.ground, dict[Frequency, tuple[Any, Any]]()
        angle = ground.angles.index(symbol) if symbol in ground.angles else -1
        generator = ground._of.get(symbol)
        for f, (a, b) in self.terms.items():
            n = dict(f).get(angle, 0)
            da, db = n * b, -n * a
            if generator is not None:
                da, db = da + a.diff(generator), db + b.diff(generator)
            terms[f] = (da, db)
        return TrigSum(ground, terms)

    def __bool__(self) -> bool:
        return bool(self.terms)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TrigSum) and not (self - other)

    __hash__ = None  # type: ignore[assignment]


def combined(f: Frequency, g: Frequency, sign: int) -> dict[int, int]:
    """The counts of ``f + sign g``."""
    counts = dict(f)
    for k, count in g:
        counts[k] = counts.get(k, 0) + sign * count
    return counts


def normal(counts: dict[int, int]) -> tuple[Frequency, int]:
    """The frequency with a positive first count, and the sign its sine takes."""
    f = tuple(sorted((k, count) for k, count in counts.items() if count))
    if f and f[0][1] < 0:
        return tuple((k, -count) for k, count in f), -1
    return f, 1


def _generators(e: Any) -> Iterable[Any]:
    """Everything in an expression that is neither a rational number, nor a sum, product or power, nor a sine."""
    if e.is_Rational or isinstance(e, (sympy.sin, sympy.cos)):
        return
    if e.is_Add or e.is_Mul:
        for x in e.args:
            yield from _generators(x)
    elif e.is_Pow and e.exp.is_Integer and e.exp > 0:
        yield from _generators(e.base)
    else:
        yield e
