"""Timing laws: rest at both ends, derivatives, symmetry, inverse, and which ones are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from cartctl.errors import CartctlError, NonFiniteError, ParameterError
from cartctl.paths import Circle, Line, Quintic, SmoothTrapezoid, TimingLaw, TimingSample

RAMPS = st.floats(0.01, 0.5)
LAWS = st.one_of(st.just(Quintic()), RAMPS.map(SmoothTrapezoid))


class Septic(TimingLaw):
    """A user's own: jerk vanishes at the ends too."""

    def __call__(self, tau: float) -> TimingSample:
        rest = 1.0 - tau
        return TimingSample(
            35 * tau**4 - 84 * tau**5 + 70 * tau**6 - 20 * tau**7,
            140 * tau**3 * rest**3,
            420 * tau**2 * rest**2 * (1 - 2 * tau),
        )


class Broken(TimingLaw):
    """Septic with one of its three values spoilt."""

    def __init__(self, spoil) -> None:
        self.spoil = spoil

    def __call__(self, tau: float) -> TimingSample:
        return self.spoil(tau, *Septic()(tau))


@given(LAWS)
def test_rest_at_both_ends(law):
    assert tuple(law(0.0)) == (0.0, 0.0, 0.0)
    np.testing.assert_allclose(law(1.0), (1.0, 0.0, 0.0), atol=1e-14)


@given(LAWS, st.floats(0.001, 0.999))
def test_derivatives_by_finite_differences(law, tau):
    h = 1e-6
    for joint in (law.ramp, 1.0 - law.ramp) if isinstance(law, SmoothTrapezoid) else ():
        if abs(tau - joint) < 2 * h:  # s''' jumps there
            tau = joint + 4 * h if joint + 4 * h < 1.0 - h else joint - 4 * h
    before, here, after = law(tau - h), law(tau), law(tau + h)
    scale = 1.0 / law.ramp if isinstance(law, SmoothTrapezoid) else 1.0
    assert here.s_dot == pytest.approx((after.s - before.s) / (2 * h), abs=1e-8 * scale**2)
    assert here.s_ddot == pytest.approx((after.s_dot - before.s_dot) / (2 * h), abs=1e-8 * scale**3)


@given(LAWS, st.floats(0.0, 1.0))
def test_the_way_out_mirrors_the_way_in(law, tau):
    s, s_dot, s_ddot = law(tau)
    np.testing.assert_allclose(law(1.0 - tau), (1.0 - s, s_dot, -s_ddot), atol=1e-9 / getattr(law, "ramp", 1.0))


def test_quintic_polynomial_and_peak_rate():
    taus = np.linspace(0, 1, 1001)
    s, s_dot, _ = np.array([Quintic()(t) for t in taus.tolist()]).T
    np.testing.assert_allclose(s, 10 * taus**3 - 15 * taus**4 + 6 * taus**5, atol=1e-15)
    assert s_dot.max() == pytest.approx(1.875, abs=1e-15)
    assert s_dot.argmax() == 500


@given(RAMPS)
def test_trapezoid_cruises_at_one_over_one_minus_ramp(ramp):
    law = SmoothTrapezoid(ramp)
    cruise = 1.0 / (1.0 - ramp)
    for tau in np.linspace(ramp, 1.0 - ramp, 7).tolist():
        _, s_dot, s_ddot = law(tau)
        assert s_dot == pytest.approx(cruise, rel=1e-13)
        assert s_ddot == pytest.approx(0.0, abs=1e-10 / ramp)
    assert quad(lambda tau: law(tau).s_dot, 0.0, 1.0, points=(ramp, 1 - ramp))[0] == pytest.approx(1.0, abs=1e-10)


@given(RAMPS, st.floats(0.0, 1.0))
def test_trapezoid_ramp_is_a_smoothstep(ramp, x):
    assert SmoothTrapezoid(ramp)(x * ramp).s_dot == pytest.approx((3 * x**2 - 2 * x**3) / (1 - ramp), abs=1e-12)


@given(RAMPS)
def test_trapezoid_acceleration_is_continuous_at_its_joints(ramp):
    law = SmoothTrapezoid(ramp)
    for joint in (ramp, 1.0 - ramp):
        before, after = law(joint - 1e-9), law(joint + 1e-9)
        np.testing.assert_allclose(before, after, atol=1e-6 / ramp**2)


@given(st.one_of(LAWS, st.just(Septic())), st.floats(0.01, 0.99))
def test_inverse(law, s):
    tau = law.inverse(s)
    assert 0.0 < tau < 1.0
    assert law(tau).s == pytest.approx(s, abs=1e-14)


def test_inverse_of_the_ends_is_exact():
    assert (Quintic().inverse(0), Quintic().inverse(1.0)) == (0.0, 1.0)


@pytest.mark.parametrize("s", [-1e-9, 1.0 + 1e-9, math.nan, True, "half"])
def test_inverse_refuses(s):
    with pytest.raises(CartctlError, match="progress s is"):
        Quintic().inverse(s)


def test_a_law_of_ones_own_drives_a_path():
    line = Line((0, 0, 0), (2, 0, 0), duration=4.0, timing=Septic())
    sample = line(1.0)
    s, s_dot, s_ddot = Septic()(0.25)
    assert sample.position[0] == pytest.approx(2 * s)
    assert sample.twist[0] == pytest.approx(2 * s_dot / 4)
    assert sample.acceleration[0] == pytest.approx(2 * s_ddot / 16)


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda tau, s, v, a: (s + 0.1, v, a), "at 0"),
        (lambda tau, s, v, a: (0.9 * s, 0.9 * v, 0.9 * a), "at 1"),
        (lambda tau, s, v, a: (tau, 1.0, 0.0), "at 0"),
        (lambda tau, s, v, a: (s, 1.01 * v, a), "expected"),
        (lambda tau, s, v, a: (s, v, -a), "expected"),
        (lambda tau, s, v, a: (math.nan if 0.4 < tau < 0.5 else s, v, a), "nan"),
        (lambda tau, s, v, a: s, "returns 0.0"),
        (lambda tau, s, v, a: (s, v), r"returns \(0.0, 0.0\)"),
        # s + 2 sin^3(2 pi tau): all ends are right, but it runs backwards in between
        (
            lambda tau, s, v, a: (
                s + 2 * math.sin(2 * math.pi * tau) ** 3,
                v + 12 * math.pi * math.sin(2 * math.pi * tau) ** 2 * math.cos(2 * math.pi * tau),
                a
                + 48 * math.pi**2 * math.sin(2 * math.pi * tau) * math.cos(2 * math.pi * tau) ** 2
                - 24 * math.pi**2 * math.sin(2 * math.pi * tau) ** 3,
            ),
            "s' >= 0",
        ),
    ],
)
def test_a_law_that_contradicts_itself_is_refused(spoil, complaint):
    with pytest.raises(ParameterError, match=complaint):
        Circle((0, 0, 0), timing=Broken(spoil))


@pytest.mark.parametrize(
    ("timing", "complaint"),
    [
        ("constant", "start and end at rest"),
        ("linear", "start and end at rest"),
        ("quintik", "did you mean 'quintic'"),
        ("zzz", "expected 'quintic', 'trapezoid'"),
        (None, "timing is None"),
        (Quintic, "TimingLaw instance"),
        (lambda tau: (tau, 1, 0), "TimingLaw instance"),
    ],
)
def test_unknown_timings_are_refused(timing, complaint):
    with pytest.raises(ParameterError, match=complaint):
        Line((0, 0, 0), (1, 0, 0), duration=1.0, timing=timing)


@pytest.mark.parametrize("ramp", [0.0, -0.1, 0.51, 1e-4, "0.2", True])
def test_ramps_outside_their_range_are_refused(ramp):
    with pytest.raises(ParameterError, match="SmoothTrapezoid ramp"):
        SmoothTrapezoid(ramp)


def test_a_ramp_that_is_not_finite_is_refused():
    with pytest.raises(NonFiniteError, match="SmoothTrapezoid ramp is nan"):
        SmoothTrapezoid(math.nan)
