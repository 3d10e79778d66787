"""Acceleration bounds: limits kept at the samples and between them, and the way back from outside."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cartctl as cc
from cartctl.errors import ParameterError
from cartctl.levels import velocity_kernel
from cartctl.levels.acceleration_bounds import AccelerationBounds
from cartctl.levels.bounds import RETURN_SPEED
from cartctl.levels.velocity_bounds import VelocityBounds
from tests import joint_rollouts as jr
from tests import oracles
from tests.joint_rollouts import INF, limits

DTS = [1e-4, 1e-3, 2e-2]


def one(x):
    return np.array([float(x)])


def box_of(dt, q, v, **given):
    return AccelerationBounds(limits(1, **given), dt)(one(q), one(v))


# ---------------------------------------------------------------- inside


def test_positions_hold_between_the_samples():
    """The parabola of a step passes its ends where the velocity changes sign."""
    rng, dt, n = np.random.default_rng(5), 0.02, 1000 // jr.FEWER
    lim = jr.random_limits(rng, n, dt)
    box, choose = AccelerationBounds(lim, dt), jr.Adversary(rng, n, 10.0 / dt)
    q, v = jr.resting_inside(rng, lim), np.zeros(n)
    turns = 0
    for _ in range(1000):
        u = choose(box(q, v))
        after = v + u * dt
        turning = v * after < 0.0
        peak = np.where(turning, q - v**2 / np.where(turning, 2.0 * u, 1.0), q)
        assert (jr.excess(peak, lim.position_lower, lim.position_upper) <= jr.KEPT).all()
        turns += turning.sum()
        q, v, _ = jr.move(AccelerationBounds, q, v, u, dt)
    assert turns > 10_000 // jr.FEWER


@given(
    oracles.SEEDS, oracles.magnitudes(1e-3, 2e-2), oracles.magnitudes(1e-2, 1e3), st.floats(0.0, 1.0), st.floats(-1, 1)
)
def test_no_wider_and_no_narrower_than_stopping_in_whole_steps_allows(seed, dt, steps, share, speed):
    """Against braking simulated step by step; the state is one from which that is possible."""
    rng = np.random.default_rng(seed)
    brake, q_min = rng.uniform(0.5, 20.0), rng.uniform(-2.0, 2.0)
    v = speed * math.sqrt(steps) * brake * dt
    stop = q_min - jr.full_braking(AccelerationBounds, q_min, v, min(brake, -v / dt), brake, dt) if v < 0.0 else 0.0
    q = q_min + stop + share * steps * brake * dt**2
    box = box_of(dt, q, v, position_lower=q_min, acceleration_upper=brake)
    expected = jr.least_stoppable(AccelerationBounds, q, v, q_min, brake, dt, -4.0 * (steps + 2.0) * brake, brake)
    expected = max(expected, -4.0 * (steps + 2.0) * brake)
    np.testing.assert_allclose(
        max(box.lower[0], -4.0 * (steps + 2.0) * brake), expected, atol=1e-7 * (1.0 + abs(expected)) + 1e-14 / dt**2
    )
    assert not box.recovering and box.upper == brake


@given(oracles.SEEDS, oracles.magnitudes(1e-4, 2e-2))
def test_the_room_given_away(seed, dt):
    """States that recover are at most a dt^2/8 away from those from which nothing can stop the joint in time."""
    rng = np.random.default_rng(seed)
    a, v = rng.uniform(0.5, 20.0), -abs(rng.normal()) * 10.0 ** rng.uniform(-3.0, 0.0)
    given = {"position_lower": 0.0, "acceleration": a}
    assert not box_of(dt, v**2 / (2.0 * a) + 0.1251 * a * dt**2 + 1e-9, v, **given).recovering
    hopeless = v**2 / (2.0 * a) - 0.001 * a * dt**2 - 1e-8 * (1.0 + abs(v))
    assert box_of(dt, hopeless, v, **given).recovering


def test_the_formula():
    """Control point 4.5 a dt^2 from the limit: the next velocity may be -2.5 a dt, as at the velocity level."""
    dt, a, v = 0.01, 8.0, -2.0 * 8.0 * 0.01
    q = 1.0 + 4.5 * a * dt**2 - v * dt / 2.0
    box = box_of(dt, q, v, position_lower=1.0, acceleration=a)
    np.testing.assert_allclose(box.lower, -0.5 * a, rtol=1e-9)
    assert box.upper == a


def test_what_each_limit_does_alone():
    assert box_of(0.1, 0.0, 0.0)[:2] == (-INF, INF)
    np.testing.assert_allclose(box_of(0.1, 9.0, 0.5, velocity=1.0)[:2], [[-15.0], [5.0]])
    assert box_of(0.1, 9.0, 0.5, acceleration_lower=-3.0, acceleration_upper=2.0)[:2] == (-3.0, 2.0)
    np.testing.assert_allclose(box_of(0.1, 0.3, 0.2, position=1.0)[:2], [[-133.0], [67.0]])


def test_the_position_at_the_next_sample_alone_is_not_viable():
    """What the form is for: ``2 (q_min - q - v dt)/dt^2`` asks for many times the acceleration there is."""
    a, dt, q, v, worst = 10.0, 0.01, 1.0, 0.0, 0.0
    for _ in range(100):
        u = max(-a, 2.0 * (-q - v * dt) / dt**2)
        worst = max(worst, u)
        q, v = q + v * dt + u * dt**2 / 2.0, v + u * dt
    assert worst > 10.0 * a


def test_a_joint_comes_to_rest_at_its_limit():
    """Pushed down all the time, it stands at the limit and does not bounce."""
    box, dt, q, v = (
        AccelerationBounds(limits(1, position=1.0, velocity=2.0, acceleration=10.0), 0.01),
        0.01,
        one(0),
        one(0),
    )
    for _ in range(200):
        bounds = box(q, v)
        q, v, _ = jr.move(AccelerationBounds, q, v, bounds.lower, dt)
    np.testing.assert_allclose([q, v, bounds.lower], [[-1.0], [0.0], [0.0]], atol=1e-9)
    assert bounds.upper == 10.0


def test_the_same_motion_as_at_the_velocity_level():
    """The control point p = q + v dt/2 under acceleration bounds moves as a joint under velocity bounds does."""
    rng, dt, n = np.random.default_rng(6), 1e-2, 100
    lim = jr.random_limits(rng, n, dt, missing=0.0)
    by_velocity, by_acceleration = VelocityBounds(lim, dt), AccelerationBounds(lim, dt)
    p = q = jr.resting_inside(rng, lim)
    y = v = np.zeros(n)
    for _ in range(300):
        share = rng.random(n).round()
        first, second = by_velocity(p, y), by_acceleration(q, v)
        y = np.where(share, first.upper, first.lower)
        p = p + y * dt
        q, v, _ = jr.move(AccelerationBounds, q, v, np.where(share, second.upper, second.lower), dt)
        np.testing.assert_allclose(q + v * dt / 2.0, p, atol=1e-10)
        np.testing.assert_allclose(v, y, atol=1e-7)


def test_mirrored():
    rng = np.random.default_rng(2)
    lim = jr.random_limits(rng, 500, 1e-3)
    q, v = rng.normal(size=500), rng.normal(size=500)
    box, other = AccelerationBounds(lim, 1e-3)(q, v), AccelerationBounds(jr.mirrored(lim), 1e-3)(-q, -v)
    np.testing.assert_allclose(other.lower, -box.upper, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(other.upper, -box.lower, rtol=1e-9, atol=1e-9)
    assert box.recovering == other.recovering


# ---------------------------------------------------------------- outside


@pytest.mark.parametrize("dt", DTS)
def test_back_inside_in_time_from_anywhere(dt):
    jr.check_recovery(AccelerationBounds, np.random.default_rng(3), 500, dt)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_panda_joint_4(side):
    """At rest 0.05 rad outside: time-optimal motion takes 0.13 s, and ends at rest at the limit."""
    lim, dt = cc.load("panda").limits, 0.01
    q, v = (lim.position_lower + lim.position_upper) / 2.0, np.zeros(7)
    limit = lim.position_lower[3] if side < 0.0 else lim.position_upper[3]
    q[3] = limit + side * 0.05
    box, only = AccelerationBounds(lim, dt), np.arange(7) == 3
    for _ in range(15):
        bounds = box(q, v)
        u = bounds.lower if side < 0.0 else bounds.upper
        assert abs(u[3]) <= 12.5
        q, v, _ = jr.move(AccelerationBounds, q, v, u * only, dt)
    assert abs(q[3] - limit) < 1e-12 and abs(v[3]) < 1e-9
    assert not box(q, v).recovering


def test_the_return_is_bounded_without_acceleration_limits():
    fast = box_of(0.01, 3.0, 0.0, position=1.0, velocity=0.5)
    np.testing.assert_allclose(fast[:2], [[-50.0], [-50.0]])
    free = box_of(0.01, 3.0, 0.0, position=1.0)
    np.testing.assert_allclose(free.upper, -RETURN_SPEED / 0.01)
    assert free.recovering


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_too_fast_to_stop_brakes_fully_overshoots_and_returns(side):
    lim, dt = limits(1, position=1.0, acceleration=5.0, velocity=3.0), 0.01
    box, q, v, top = AccelerationBounds(lim, dt), one(side * 0.9), one(side * 2.0), 0.0
    for _ in range(200):
        bounds = box(q, v)
        u = bounds.upper if side > 0.0 else bounds.lower
        if side * v > 1e-9:
            assert bounds.recovering
            assert bounds.lower == bounds.upper == -side * 5.0
        q, v, _ = jr.move(AccelerationBounds, q, v, u, dt)
        top = max(top, side * q[0])
    np.testing.assert_allclose(top, 0.9 + 2.0**2 / (2.0 * 5.0), rtol=1e-9)
    assert not bounds.recovering and abs(side * q[0] - 1.0) < 1e-12


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_velocity_outside_comes_back_at_the_acceleration_limit(side):
    bounds = box_of(0.01, 0.0, side * 2.0, velocity=1.0, acceleration=5.0)
    assert bounds.lower == bounds.upper == -side * 5.0
    assert bounds.recovering
    assert not box_of(0.01, 0.0, side * 1.0, velocity=1.0, acceleration=5.0).recovering


# ---------------------------------------------------------------- disabled joints, the class itself


def test_a_disabled_joint_brakes_and_stays():
    lim, dt = limits(3, position=1.0, velocity=2.0, acceleration=5.0), 0.01
    box = AccelerationBounds(lim, dt, disabled=[1])
    resting = box(np.zeros(3), np.zeros(3))
    assert resting.lower[1] == resting.upper[1] == 0.0 and resting.lower[0] < 0.0 < resting.upper[2]
    moving = box(np.zeros(3), np.array([0.0, -0.12, 0.0]))
    assert moving.lower[1] == moving.upper[1] == 5.0
    last = box(np.zeros(3), np.array([0.0, -0.02, 0.0]))
    np.testing.assert_allclose([last.lower[1], last.upper[1]], 2.0)


def test_fresh_arrays_every_call():
    box = AccelerationBounds(limits(2, position=1.0, acceleration=1.0), 0.01)
    first = box(np.array([0.9, 0.0]), np.array([0.01, 0.0]))
    kept = first.lower.copy(), first.upper.copy()
    box(np.zeros(2), np.ones(2))
    np.testing.assert_array_equal(first[:2], kept)


def test_interpreted_and_compiled_agree():
    rng = np.random.default_rng(4)
    lim = jr.random_limits(rng, 300, 1e-3)
    box = AccelerationBounds(lim, 1e-3)
    for v in (np.zeros(300), rng.normal(size=300)):
        q = jr.resting_inside(rng, lim) + rng.choice([0.0, 0.1, -0.1], 300)
        lower, upper = np.empty(300), np.empty(300)
        with np.errstate(all="ignore"):
            recovering = velocity_kernel.velocity_bounds.function(q, v, box._packed, 1e-3, True, lower, upper)
        bounds = box(q, v)
        np.testing.assert_allclose(bounds[:2], [lower, upper], rtol=1e-9, atol=1e-9)
        assert recovering == bounds.recovering


def test_the_same_checks_as_at_the_velocity_level():
    with pytest.raises(ParameterError, match="acceleration_lower of joint 0 is 0; expected a number below 0"):
        AccelerationBounds(limits(2, acceleration_lower=0.0), 0.01)
