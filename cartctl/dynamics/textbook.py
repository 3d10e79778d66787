"""Sums of cosines and sines as the textbooks print them: ``m2 l1 dc2 cos(q2)``, ``m3 (l1^2 + dc3^2)``, ``sin(q2)^2``.

What multiplies one monomial of the parameters is a short sum with rational coefficients. It is folded into products and
squares where that leaves fewer terms (``cos(q3) + cos(2 q2 + q3)`` is ``2 cos(q2) cos(q2 + q3)``); then equal products
of sines and cosines are collected, and what multiplies them factored. Needs SymPy.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import sympy

from cartctl.dynamics.trigsum import Frequency, Ground, TrigSum, combined, normal

Wave = tuple[bool, Frequency]  # (sine?, frequency)
Folded = list[tuple[tuple[tuple[Wave, int], ...], Any]]  # products of powers of waves, with their rational factors


def compact(total: TrigSum, masses: Iterable[Any] = (), rates: Iterable[Any] = ()) -> Any:
    """A SymPy expression; what does not factor is collected by polynomials in ``rates``, then by ``masses``."""
    ground = total.ground
    by_monomial: dict[Any, dict[Wave, Any]] = {}
    for f, pair in total.terms.items():
        for sine, p in zip((False, True), pair, strict=True):
            for monomial, value in p.terms():
                by_monomial.setdefault(monomial, {})[sine, f] = value
    products: dict[Any, Any] = {}
    for monomial, waves in by_monomial.items():
        for product, value in _fold(waves):
            p = products.get(product, ground.ring.zero)
            products[product] = p + ground.ring({monomial: value})
    indices = {g: k for k, g in enumerate(ground.generators)}
    heavy, quick = ([indices[x] for x in group if x in indices] for group in (masses, rates))
    terms: list[Any] = []
    for product, p in products.items():
        waves_ = sympy.Mul(*(_wave(ground, wave) ** power for wave, power in product))
        terms.extend(x * waves_ for x in _factored(ground, p, heavy, quick))
    return sympy.Add(*(term.xreplace(ground.lumps) for term in terms))


def spread(total: TrigSum) -> Any:
    """The same sum as a SymPy expression term by term, for numbers: what :func:`compact` folds is not looked for."""
    ground = total.ground
    terms = (
        ground.coefficient(p) * _wave(ground, (sine, f))
        for f, pair in total.terms.items()
        for sine, p in zip((False, True), pair, strict=True)
    )
    return sympy.Add(*(term.xreplace(ground.lumps) for term in terms))


def _wave(ground: Ground, wave: Wave) -> Any:
    return (sympy.sin if wave[0] else sympy.cos)(ground.frequency(wave[1]))


def _factored(ground: Ground, p: Any, heavy: Sequence[int], quick: Sequence[int]) -> list[Any]:
    """Summands of p: each a polynomial of the parameters times one of the rates."""
    content, whole = sympy.factor(ground.coefficient(p)).as_coeff_Mul()
    if not whole.is_Add:
        return [content * _by_mass(ground, whole, heavy)]
    by_parameters: dict[Any, Any] = {}
    for monomial, value in p.terms():
        key, rest = _split(monomial, quick)
        by_parameters[key] = by_parameters.get(key, ground.ring.zero) + ground.ring({rest: value})
    by_rates: dict[Any, Any] = {}
    for key, motion in by_parameters.items():
        factor, primitive = motion.primitive()
        if primitive.LC < 0:
            factor, primitive = -factor, -primitive
        by_rates[primitive] = by_rates.get(primitive, ground.ring.zero) + ground.ring({key: factor})
    return [
        _collected(ground, parameters, heavy) * sympy.factor(ground.coefficient(motion))
        for motion, parameters in by_rates.items()
    ]


def _collected(ground: Ground, p: Any, heavy: Sequence[int]) -> Any:
    """Factored, or else each mass with what it is multiplied by."""
    content, whole = sympy.factor(ground.coefficient(p)).as_coeff_Mul()
    if not whole.is_Add:
        return content * _by_mass(ground, whole, heavy)
    groups: dict[Any, Any] = {}
    for monomial, value in (p * (1 / sympy.QQ(content.p, content.q))).terms():
        key = tuple(monomial[k] for k in heavy)
        groups[key] = groups.get(key, ground.ring.zero) + ground.ring({monomial: value})
    inside = sympy.Add(*(sympy.factor(ground.coefficient(part)) for part in groups.values()))
    return sympy.Mul(content, inside, evaluate=False) if content != 1 else inside


def _by_mass(ground: Ground, whole: Any, heavy: Sequence[int]) -> Any:
    """A product whose sums say what each mass is multiplied by."""
    masses = [ground.generators[k] for k in heavy]
    return sympy.Mul(*(sympy.collect(f, masses) if f.is_Add else f for f in sympy.Mul.make_args(whole)))


def _split(monomial: Any, chosen: Sequence[int]) -> tuple[Any, Any]:
    """The monomial without and with nothing but the chosen generators."""
    without = tuple(0 if k in chosen else n for k, n in enumerate(monomial))
    return without, tuple(n if k in chosen else 0 for k, n in enumerate(monomial))


# ---------------------------------------------------------------- folding


def _fold(waves: dict[Wave, Any]) -> Folded:
    """Rational multiples of waves as fewer products and squares, equal in sum."""
    left = {wave: value for wave, value in waves.items() if value}
    folded: Folded = []
    while True:
        pair = _best_pair(left)
        if pair is None:
            break
        first, second, product, value = pair
        del left[first], left[second]
        folded.append((product, value))
    constant: Wave = (False, ())
    wave = _completed(left) if constant in left else None
    if wave is not None:  # k + a cos 2f = (k - a') + 2 a' cos^2 f, or with sin^2 f, a' = +-a with the sign of k
        k, a = left.pop(constant), left.pop(wave)
        squared = abs(a) if k > 0 else -abs(a)
        folded.append(((((a != squared, _halved(wave[1])), 2),), 2 * squared))
        if k != squared:
            left[constant] = k - squared
    folded.extend((((wave, 1),) if wave[1] else (), value) for wave, value in left.items())
    return folded


def _best_pair(left: dict[Wave, Any]) -> tuple[Wave, Wave, tuple[tuple[Wave, int], ...], Any] | None:
    """Two waves of one kind with the same coefficient up to its sign, whose half sum and half difference are whole."""
    best, size = None, 0
    waves = [w for w in left if w[1]]
    for i, first in enumerate(waves):
        for second in waves[i + 1 :]:
            if first[0] != second[0] or abs(left[first]) != abs(left[second]):
                continue
            plus, minus = combined(first[1], second[1], 1), combined(first[1], second[1], -1)
            if any(n % 2 for n in (*plus.values(), *minus.values())):
                continue
            weight = sum(abs(n) for n in (*plus.values(), *minus.values()))
            if best is None or weight < size:
                best, size = (first, second, plus, minus), weight
    if best is None:
        return None
    first, second, plus, minus = best
    p, sign_p = normal({k: n // 2 for k, n in plus.items()})
    m, sign_m = normal({k: n // 2 for k, n in minus.items()})
    a, same = left[first], left[first] == left[second]
    if not first[0]:  # cos f + cos g = 2 cos p cos m, cos f - cos g = -2 sin p sin m
        kinds, value = ((False, False), 2 * a) if same else ((True, True), -2 * a * sign_p * sign_m)
    else:  # sin f + sin g = 2 sin p cos m, sin f - sin g = 2 cos p sin m
        kinds, value = ((True, False), 2 * a * sign_p) if same else ((False, True), 2 * a * sign_m)
    product = sorted([((kinds[0], p), 1), ((kinds[1], m), 1)])
    return first, second, tuple(product), value


def _completed(left: dict[Wave, Any]) -> Wave | None:
    """A cosine of an even frequency, no larger than the constant, that it completes to a square."""
    for wave, value in left.items():
        if not wave[0] and wave[1] and not any(n % 2 for _, n in wave[1]) and abs(value) <= abs(left[False, ()]):
            return wave
    return None


def _halved(f: Frequency) -> Frequency:
    return tuple((k, n // 2) for k, n in f)
