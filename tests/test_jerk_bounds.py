"""Jerk limits beside the others, at both levels: whatever is chosen, against a linear programme, from outside."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from scipy.optimize import linprog

from cartctl.errors import ParameterError
from cartctl.levels import jerk_bounds, jerk_manoeuvre
from cartctl.levels.acceleration_bounds import AccelerationBounds
from cartctl.levels.velocity_bounds import VelocityBounds
from tests import joint_rollouts as jr
from tests import oracles
from tests.joint_rollouts import INF, limits

LEVELS = pytest.mark.parametrize("kind", jr.LEVELS)
LIMITS = {"position": 0.1, "velocity": 1.0, "acceleration": 10.0, "jerk": 300.0}


def one(x):
    return np.array([float(x)])


# ---------------------------------------------------------------- inside


@LEVELS
@pytest.mark.parametrize("dt", [1e-4, 1e-3, 2e-2])
def test_limits_are_kept_whatever_is_chosen(kind, dt):
    rng, n = np.random.default_rng(1), 200 // jr.FEWER
    lim = jr.random_limits(rng, n, dt, missing=0.1)
    q = jr.resting_inside(rng, lim)
    far = 10.0 if kind is VelocityBounds else 10.0 / dt
    nearest = jr.check_kept(kind, lim, dt, q, jr.Adversary(rng, n, far), 1500 // jr.FEWER, jerk=True)
    assert (np.abs(nearest) < 1e-9).mean() > 0.1 or not jr.COMPILED


def least_acceleration(p, v, a, dt, sign, n=50):
    """The least (sign = 1) or most (-1) next acceleration after which some motion keeps LIMITS and ends at rest.

    A linear programme over the n accelerations that follow; nothing of the stopping manoeuvre is in it.
    """
    ones = np.tril(np.ones((n, n)))
    velocity, position, jerk = dt * ones, dt * dt * ones @ ones, (np.eye(n) - np.eye(n, k=-1)) / dt
    start = np.zeros(n)
    start[0] = -a / dt
    drift = p + v * dt * np.arange(1, n + 1)
    rows = [(velocity, np.full(n, v), 1.0), (position, drift, 0.1), (jerk, start, 300.0)]
    A = np.vstack([s * M for M, _, _ in rows for s in (1.0, -1.0)])
    b = np.concatenate([limit - s * offset for _, offset, limit in rows for s in (1.0, -1.0)])
    rest = np.vstack([np.eye(n)[-1], velocity[-1]])
    result = linprog(sign * np.eye(n)[0], A, b, rest, [0.0, -v], bounds=[(-10.0, 10.0)] * n)
    assert result.status == 0, "no motion keeps the limits"
    return result.x[0]


@LEVELS
def test_inside_what_a_linear_programme_allows(kind):
    dt, rng, exact = 0.01, np.random.default_rng(2), []
    box = kind(limits(1, **LIMITS), dt, jerk=True)
    q, v, a = one(0.0), one(0.0), one(0.0)
    for k in range(300):
        bounds = box(q, v)
        if k % 5 == 0:
            p = q + v * dt / 2.0 if kind is AccelerationBounds else q
            lower, upper = bounds[:2] if kind is AccelerationBounds else ((bound - v) / dt for bound in bounds[:2])
            least, most = (least_acceleration(p[0], v[0], a[0], dt, sign) for sign in (1.0, -1.0))
            assert least - 1e-7 <= lower[0] <= upper[0] <= most + 1e-7
            exact += [lower[0] < least + 1e-7, upper[0] > most - 1e-7]
        u = (bounds.lower, bounds.upper)[int(rng.random() < 0.5) if k % 60 < 30 else k // 60 % 2]
        q, v, a = jr.move(kind, q, v, u, dt)
    assert np.mean(exact) > 0.7  # and mostly as wide as that


@given(oracles.SEEDS, oracles.magnitudes(1e-3, 2e-2))
def test_manoeuvres_keep_their_order(seed, dt):
    """What the search rests on: a larger a+ leaves no more room above, sample by sample; constant parts included."""
    rng = np.random.default_rng(seed)
    j, a = rng.uniform(10.0, 1000.0, 2), rng.uniform(0.5, 20.0, 2)
    v, grid = rng.normal(), np.linspace(-a[0], a[1], 12)
    args = (dt, -j[0], j[1], -a[0], a[1])
    for v_max, p_max in ((0.3, INF), (INF, 0.1)):
        rooms = [jerk_manoeuvre.headroom(0.0, v, x, *args, v_max, p_max) for x in grid]
        assert (np.diff(rooms) <= 1e-12 * (1.0 + np.abs(rooms[1:]))).all()
        expected = [plain_headroom(v, x, *args, v_max, p_max) for x in grid]
        np.testing.assert_allclose(np.minimum(rooms, v_max), expected, atol=1e-10)  # it ends at v = 0


def plain_headroom(v, a, dt, j_min, j_max, a_min, a_max, v_max, p_max):
    """The manoeuvre after a, every sample of it."""
    v += a * dt
    p = v * dt
    tops = [v, p]
    for _ in range(20_000):
        a = min(max(jerk_manoeuvre.stopping(v, dt, j_min, j_max, a_min, a_max), a + j_min * dt), a + j_max * dt)
        v += a * dt
        p += v * dt
        tops = [max(tops[0], v), max(tops[1], p)]
        if abs(v) + abs(a) < 1e-14:
            return min(v_max - tops[0], p_max - tops[1])
    raise AssertionError("it never stops")


@LEVELS
def test_without_a_jerk_limit_the_bounds_are_the_plain_ones(kind):
    rng, dt, n = np.random.default_rng(4), 1e-2, 300 // jr.FEWER
    lim = jr.random_limits(rng, n, dt).replace(jerk_lower=-INF, jerk_upper=INF)
    plain, jerky = kind(lim, dt), kind(lim, dt, jerk=True)
    q, v, choose = jr.resting_inside(rng, lim), np.zeros(n), jr.Adversary(rng, n, 10.0)
    for _ in range(200):
        bounds = plain(q, v)
        np.testing.assert_allclose(jerky(q, v)[:2], bounds[:2], rtol=1e-9, atol=1e-10 / dt)
        q, v, _ = jr.move(kind, q, v, choose(bounds), dt)


def test_a_joint_without_lower_limits_may_run_away():
    """To stop it would take millions of steps, but nothing asks it to."""
    dt, lim = 1e-3, limits(1, position_upper=1.0, jerk=1.0)
    box = AccelerationBounds(lim, dt, jerk=True)
    box(one(0.0), one(-1e6))
    bounds = box(one(-1e3), one(-1e6 - 10.0))
    assert not bounds.recovering
    np.testing.assert_allclose(bounds[:2], np.array([[-1.0], [1.0]]) * dt - 1e4, rtol=1e-6)


# ---------------------------------------------------------------- memory


def test_the_first_step_counts_from_acceleration_zero():
    dt, lim = 0.01, limits(1, **LIMITS)
    box = AccelerationBounds(lim, dt, jerk=True)
    np.testing.assert_allclose(box(one(0.0), one(0.2))[:2], [[-3.0], [3.0]])
    np.testing.assert_allclose(box(one(0.0), one(0.23))[:2], [[0.0], [6.0]], atol=1e-9)  # a = 3
    box.reset()
    np.testing.assert_allclose(box(one(0.0), one(0.23))[:2], [[-3.0], [3.0]])
    box = VelocityBounds(lim, dt, jerk=True)
    np.testing.assert_allclose(box(one(0.0), one(0.2))[:2], [[0.17], [0.23]])
    np.testing.assert_allclose(box(one(0.0), one(0.23))[:2], [[0.23], [0.29]])


def test_the_velocity_given_is_copied():
    box, v = VelocityBounds(limits(1, **LIMITS), 0.01, jerk=True), one(0.2)
    box(one(0.0), v)
    v += 0.03
    np.testing.assert_allclose(box(one(0.0), v)[:2], [[0.23], [0.29]])


# ---------------------------------------------------------------- outside, disabled, refused


@LEVELS
@pytest.mark.parametrize("dt", [1e-3, 2e-2])
def test_back_inside_in_time_from_anywhere(kind, dt):
    jr.check_recovery(kind, np.random.default_rng(3), 100, dt, jerk=True, steps=1000)


@LEVELS
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_from_rest_outside(kind, side):
    """0.05 outside: 2 (d/a)^(1/2) + a/j = 0.175 s in continuous time; it arrives at rest."""
    dt, lim = 0.005, limits(1, position=1.0, velocity=1.0, acceleration=10.0, jerk=300.0)
    box, q, v = kind(lim, dt, jerk=True), one(side * 1.05), one(0.0)
    for _ in range(40):
        bounds = box(q, v)
        q, v, _ = jr.move(kind, q, v, bounds.upper if side > 0.0 else bounds.lower, dt)
    assert abs(q[0] - side) < 1e-10 and abs(v[0]) < 1e-7


@LEVELS
def test_a_disabled_joint_brakes_softly_and_stays(kind):
    dt = 0.01
    box = kind(limits(2, **LIMITS), dt, disabled=[0], jerk=True)
    q, v, a = np.zeros(2), np.array([0.5, 0.0]), np.zeros(2)
    for _ in range(60):
        bounds = box(q, v)
        assert bounds.lower[0] == bounds.upper[0]
        before = a
        q, v, a = jr.move(kind, q, v, bounds.lower, dt)
        assert abs(a[0] - before[0]) <= 300.0 * dt + 1e-9 and abs(a[0]) <= 10.0 + 1e-9
        assert v[0] >= -1e-12
    assert abs(v[0]) < 1e-12 and abs(a[0]) < 1e-9


@LEVELS
def test_interpreted_and_compiled_agree(kind):
    rng, dt, n = np.random.default_rng(5), 1e-2, 40
    lim = jr.random_limits(rng, n, dt)
    box = kind(lim, dt, jerk=True)
    q, before = jr.resting_inside(rng, lim) + rng.choice([0.0, 0.1, -0.1], n), rng.normal(size=n)
    v = before + 0.01 * rng.normal(size=n)
    box(q, before)
    bounds, lower, upper = box(q, v), np.empty(n), np.empty(n)
    at_acceleration = kind is AccelerationBounds
    with np.errstate(all="ignore"):
        flag = jerk_bounds.jerk_bounds.function(q, v, before, box._packed, dt, at_acceleration, lower, upper)
    np.testing.assert_allclose(bounds[:2], [lower, upper], rtol=1e-8, atol=1e-8)
    assert flag == bounds.recovering


@pytest.mark.parametrize(
    "given, word", [({"jerk_upper": 0.0}, "above 0"), ({"jerk_lower": 3.0, "jerk_upper": 9.0}, "below 0")]
)
def test_jerk_limits_that_cannot_brake_are_refused(given, word):
    with pytest.raises(ParameterError, match=word):
        AccelerationBounds(limits(1, **given), 0.01, jerk=True)
