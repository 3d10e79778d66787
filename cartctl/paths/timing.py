"""Timing laws: how far along its path a target is, s in [0, 1], at normalised time tau in [0, 1].

A law starts and ends at rest: s(0) = 0, s(1) = 1, and s', s'' are zero at both ends, so that velocity and
acceleration of any path timed by it are continuous. Over a duration T the derivatives scale by 1/T and 1/T^2.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NamedTuple

from scipy.optimize import brentq

from cartctl.errors import ParameterError
from cartctl.paths.arguments import number, show


class TimingSample(NamedTuple):
    """Progress and its derivatives with respect to normalised time."""

    s: float
    s_dot: float
    s_ddot: float


class TimingLaw(ABC):
    """A rest-to-rest law s(tau); write your own by giving ``__call__`` and pass an instance as ``timing=``.

    A path checks the instance it is given: end values, end rates, s' >= 0, and s', s'' as derivatives of s.
    """

    @abstractmethod
    def __call__(self, tau: float) -> TimingSample:
        """Return s, ds/dtau, d2s/dtau2 at tau in [0, 1]."""

    def inverse(self, s: float) -> float:
        """Return the tau in [0, 1] at which progress s in [0, 1] is reached, by bracketing (Brent 1973).

        Exact to round-off where s' is not small; raises ParameterError outside [0, 1].
        """
        s = number("progress s", s)
        if not 0.0 <= s <= 1.0:
            raise ParameterError(f"progress s is {s:g}: expected a number in [0, 1]")
        if s in (0.0, 1.0):
            return s
        return float(brentq(lambda tau: self(tau).s - s, 0.0, 1.0, xtol=1e-16, rtol=1e-15))


@dataclass(frozen=True)
class Quintic(TimingLaw):
    """Minimum jerk: s = 10 tau^3 - 15 tau^4 + 6 tau^5 (Flash & Hogan 1985); peak rate 1.875 x the mean."""

    def __call__(self, tau: float) -> TimingSample:
        """Return s, ds/dtau, d2s/dtau2 at tau in [0, 1]."""
        rest = 1.0 - tau
        return TimingSample(
            tau * tau * tau * (10.0 + tau * (6.0 * tau - 15.0)),
            30.0 * tau * tau * rest * rest,
            60.0 * tau * rest * (1.0 - 2.0 * tau),
        )


@dataclass(frozen=True)
class SmoothTrapezoid(TimingLaw):
    """Constant rate v = 1/(1 - ramp) between two ramps, each a fraction ``ramp`` of the duration.

    On the first ramp, x = tau/ramp: s' = v (3 x^2 - 2 x^3), s = v ramp (x^3 - x^4/2), so that s'' is
    continuous, and zero at both ends of it; the last ramp mirrors it. Raises ParameterError unless
    0.001 <= ramp <= 0.5.
    """

    ramp: float = 0.2

    def __post_init__(self) -> None:
        """Check the ramp."""
        object.__setattr__(self, "ramp", number("SmoothTrapezoid ramp", self.ramp))
        if not 0.001 <= self.ramp <= 0.5:
            raise ParameterError(f"SmoothTrapezoid ramp is {self.ramp:g}: expected a fraction from 0.001 to 0.5")

    def __call__(self, tau: float) -> TimingSample:
        """Return s, ds/dtau, d2s/dtau2 at tau in [0, 1]."""
        ramp, cruise = self.ramp, 1.0 / (1.0 - self.ramp)
        if tau > 1.0 - ramp:
            s, s_dot, s_ddot = self._ramp(1.0 - tau)
            return TimingSample(1.0 - s, s_dot, -s_ddot)
        if tau < ramp:
            return self._ramp(tau)
        return TimingSample(cruise * (tau - 0.5 * ramp), cruise, 0.0)

    def _ramp(self, tau: float) -> TimingSample:
        ramp, cruise = self.ramp, 1.0 / (1.0 - self.ramp)
        x = tau / ramp
        return TimingSample(
            cruise * ramp * x * x * x * (1.0 - 0.5 * x),
            cruise * x * x * (3.0 - 2.0 * x),
            cruise / ramp * 6.0 * x * (1.0 - x),
        )


LAWS: dict[str, TimingLaw] = {"quintic": Quintic(), "trapezoid": SmoothTrapezoid()}


def timing_law(timing: Any) -> TimingLaw:
    """Return the law of a name, or the instance itself once it has been checked; raises ParameterError."""
    if isinstance(timing, TimingLaw):
        if type(timing) not in (Quintic, SmoothTrapezoid):
            _check(timing)
        return timing
    if not isinstance(timing, str):
        raise ParameterError(
            f"timing is {show(timing)}: expected {_names()} or a TimingLaw instance, as SmoothTrapezoid(0.1)"
        )
    if timing in ("constant", "linear"):
        raise ParameterError(
            f"timing is {timing!r}: a path must start and end at rest, and constant speed would jump there; "
            "use 'trapezoid', or SmoothTrapezoid(ramp=0.05) for short ramps"
        )
    if timing not in LAWS:
        close = get_close_matches(timing, LAWS, n=1)
        advice = f"did you mean {close[0]!r}?" if close else f"expected {_names()} or a TimingLaw"
        raise ParameterError(f"timing is {timing!r}: {advice}")
    return LAWS[timing]


def _names() -> str:
    return ", ".join(map(repr, LAWS))


def _check(law: TimingLaw) -> None:
    """Hold a user's law to the mathematics it must satisfy (comparisons are written so that NaN fails)."""
    _demand(law, "s, s', s'' at 0", law(0.0), (0.0, 0.0, 0.0), 1e-9)
    _demand(law, "s, s', s'' at 1", law(1.0), (1.0, 0.0, 0.0), 1e-9)
    step = 1e-5
    for k in range(41):
        tau = 0.0137 + 0.0243 * k  # off the round numbers at which a law may change its formula
        (s0, v0, _), here, (s1, v1, _) = law(tau - step), law(tau), law(tau + step)
        slopes = (s0 + (s1 - s0) / 2, (s1 - s0) / (2 * step), (v1 - v0) / (2 * step))
        _demand(law, f"s, s', s'' at {tau:.4f}", here, slopes, 1e-3 * (1.0 + abs(slopes[1]) + abs(slopes[2])))
        if here[1] < -1e-9:
            raise ParameterError(f"timing {show(law)} has s' = {here[1]:g} at {tau:.4f}: expected s' >= 0")


def _demand(law: TimingLaw, what: str, found: Any, expected: tuple[float, ...], tolerance: float) -> None:
    try:
        gaps = [abs(f - e) for f, e in zip(found, expected, strict=True)]
    except (TypeError, ValueError):
        raise ParameterError(f"timing {show(law)} returns {show(found)}: expected (s, s', s'')") from None
    if not all(gap <= tolerance for gap in gaps):
        values, wanted = (", ".join(f"{x:.6g}" for x in numbers) for numbers in (found, expected))
        raise ParameterError(f"timing {show(law)} has {what} = {values}: expected {wanted}")
