"""Velocity bounds: limits kept whatever is chosen, bounds as wide as they can be, and the way back from outside."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cartctl as cc
from cartctl.errors import NonFiniteError, ParameterError, ShapeError, TimeStepError
from cartctl.levels import velocity_kernel
from cartctl.levels.bounds import RETURN_SPEED
from cartctl.levels.velocity_bounds import VelocityBounds
from tests import joint_rollouts as jr
from tests import oracles
from tests.joint_rollouts import INF, limits

DTS = [1e-4, 1e-3, 2e-2]


def one(x):
    return np.array([float(x)])


def box_of(dt, q, v, **given):
    return VelocityBounds(limits(1, **given), dt)(one(q), one(v))


# ---------------------------------------------------------------- inside


@given(oracles.SEEDS, oracles.magnitudes(1e-3, 2e-2), oracles.magnitudes(1e-2, 1e3), st.floats(0.0, 1.0))
def test_no_wider_and_no_narrower_than_full_braking_allows(seed, dt, steps, share):
    """Against braking simulated step by step, where the position decides; X = d/(a dt^2) of every size."""
    rng = np.random.default_rng(seed)
    brake, q_min = rng.uniform(0.5, 20.0), rng.uniform(-2.0, 2.0)
    q = q_min + share * steps * brake * dt**2
    box = box_of(dt, q, 0.0, position_lower=q_min, acceleration_upper=brake)
    expected = jr.least_stoppable(VelocityBounds, q, 0.0, q_min, brake, dt, -(q - q_min) / dt - 1.0, 0.0)
    np.testing.assert_allclose(box.lower, expected, atol=jr.TIGHT * (1.0 + abs(expected)) + 1e-15 / dt)
    assert not box.recovering


def test_the_formula():
    """X = 4.5 steps' worth of braking: k = 2, w = (4.5 + 3)/3 = 2.5, and 2.5 + 1.5 + 0.5 = 4.5."""
    dt, a = 0.01, 8.0
    box = box_of(dt, 1.0 + 4.5 * a * dt**2, 0.0, position_lower=1.0, acceleration_upper=a, acceleration_lower=-90.0)
    np.testing.assert_allclose(box.lower, max(-2.5 * a * dt, -90.0 * dt), rtol=1e-12)


def test_what_each_limit_does_alone():
    assert box_of(0.1, 0.0, 0.0)[:2] == (-INF, INF)
    np.testing.assert_allclose(box_of(0.1, 0.3, 5.0, position=1.0)[:2], [[-13.0], [7.0]])
    np.testing.assert_allclose(box_of(0.1, 9.0, 0.5, velocity=1.0)[:2], [[-1.0], [1.0]])
    np.testing.assert_allclose(box_of(0.1, 9.0, 0.5, acceleration_upper=2.0)[:2], [[-INF], [0.7]])
    np.testing.assert_allclose(box_of(0.1, 9.0, 0.5, acceleration_lower=-4.0)[:2], [[0.1], [INF]])


def test_braking_takes_the_opposite_acceleration_limit():
    """Before the lower limit the joint accelerates upwards."""
    given = {"position": 1.0, "acceleration_lower": -1.0, "acceleration_upper": 100.0}
    near_lower = box_of(0.1, -0.9, 0.0, **given | {"acceleration_lower": -INF})
    near_upper = box_of(0.1, 0.9, 0.0, **given | {"acceleration_upper": INF})
    np.testing.assert_allclose(near_lower.lower, -1.0)  # 0.1 away, stops at once
    assert 0.0 < near_upper.upper[0] < math.sqrt(2.0 * 1.0 * 0.1)


def test_the_square_root_is_not_viable():
    """What the formula is for: the continuous braking ramp asks for up to twice the acceleration there is."""
    a, dt, q, v = 10.0, 0.01, 1.0, 0.0
    worst = 0.0
    for _ in range(300):
        u = max(v - a * dt, -math.sqrt(2.0 * a * max(q, 0.0)))
        worst = max(worst, (u - v) / dt)
        q, v = q + u * dt, u
    assert worst > 1.2 * a


def test_mirrored():
    rng = np.random.default_rng(2)
    lim = jr.random_limits(rng, 500, 1e-3)
    q, v = rng.normal(size=500), rng.normal(size=500)
    box, other = VelocityBounds(lim, 1e-3)(q, v), VelocityBounds(jr.mirrored(lim), 1e-3)(-q, -v)
    np.testing.assert_allclose(other.lower, -box.upper, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(other.upper, -box.lower, rtol=1e-12, atol=1e-12)
    assert box.recovering == other.recovering


# ---------------------------------------------------------------- outside


@pytest.mark.parametrize("dt", DTS)
def test_back_inside_in_time_from_anywhere(dt):
    rng = np.random.default_rng(3)
    jr.check_recovery(VelocityBounds, rng, 500, dt)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_panda_joint_4(side):
    """At rest 0.05 rad outside: time-optimal motion takes 0.13 s, and ends at rest at the limit."""
    lim, dt = cc.load("panda").limits, 0.01
    q = np.array(lim.position_lower + lim.position_upper) / 2.0
    v = np.zeros(len(q))
    limit = lim.position_lower[3] if side < 0.0 else lim.position_upper[3]
    q[3] = limit + side * 0.05
    box = VelocityBounds(lim, dt)
    speeds = []
    for _ in range(15):
        bounds = box(q, v)
        assert bounds.recovering == (side * (q[3] - limit) > 1e-9)
        u = bounds.lower if side < 0.0 else bounds.upper
        assert abs(u[3] - v[3]) <= 12.5 * dt + 1e-12 and abs(u[3]) <= 2.175
        q, v = q + u * dt * (np.arange(7) == 3), u * (np.arange(7) == 3)
        speeds.append(abs(v[3]))
    assert abs(q[3] - limit) < 1e-12
    assert speeds[-1] < 1e-9 < 0.7 < max(speeds)


def test_the_return_is_bounded_without_acceleration_limits():
    fast = box_of(0.01, 3.0, 0.0, position=1.0, velocity=0.5)
    np.testing.assert_allclose(fast[:2], [[-0.5], [-0.5]])
    free = box_of(0.01, 3.0, 0.0, position=1.0)
    np.testing.assert_allclose(free.upper, -RETURN_SPEED)
    assert free.recovering
    np.testing.assert_allclose(box_of(0.01, 1.002, 0.0, position=1.0).upper, -0.2)  # there after this step


def test_too_fast_to_stop_brakes_fully_overshoots_and_returns():
    """0.1 before the limit at 2 with 5 of braking: 0.4 in all, so 0.3 beyond."""
    lim = limits(1, position_upper=0.0, acceleration=5.0, velocity=3.0)
    box, dt = VelocityBounds(lim, 0.01), 0.01
    q, v, top, done = one(-0.1), one(2.0), -INF, None
    for k in range(200):
        bounds = box(q, v)
        if v > 1e-9:
            assert bounds.recovering
            np.testing.assert_allclose(bounds[:2], np.full((2, 1), v - 5.0 * dt))
        q, v = q + bounds.upper * dt, bounds.upper
        top = max(top, q[0])
        done = k if done is None and top > 0.0 and q[0] <= 1e-12 else done
    assert 0.2 < top < 0.3 and not bounds.recovering and abs(q[0]) < 1e-12
    assert done is not None and done * dt < 0.4 + 2.0 * math.sqrt(top / 5.0) + 5.0 * dt


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_velocity_outside_comes_back_at_the_acceleration_limit(side):
    bounds = box_of(0.01, 0.0, side * 2.0, velocity=1.0, acceleration=5.0)
    np.testing.assert_allclose(bounds[:2], np.full((2, 1), side * 1.95))
    assert bounds.recovering
    assert not box_of(0.01, 0.0, side * 1.0, velocity=1.0, acceleration=5.0).recovering


def test_limits_that_close_in_while_running():
    wide, dt = limits(1, position=1.0, velocity=2.0, acceleration=10.0), 1e-3
    tight = wide.replace(position_lower=-0.2, position_upper=0.2, velocity_lower=-0.5, velocity_upper=0.5)
    q, v = one(0.5), one(1.5)
    assert not VelocityBounds(wide, dt)(q, v).recovering
    box = VelocityBounds(tight, dt)
    for _ in range(1500):
        bounds = box(q, v)
        jr.check_box(bounds)
        assert abs(bounds.upper[0] - v[0]) <= 10.0 * dt + 1e-12
        q, v = q + bounds.upper * dt, bounds.upper
    assert not bounds.recovering and abs(q[0] - 0.2) < 1e-12


# ---------------------------------------------------------------- disabled joints, the class itself


def test_a_disabled_joint_brakes_and_stays():
    lim, dt = limits(3, position=1.0, velocity=2.0, acceleration=5.0), 0.01
    box = VelocityBounds(lim, dt, disabled=[1])
    resting = box(np.zeros(3), np.zeros(3))
    assert resting.lower[1] == resting.upper[1] == 0.0 and resting.lower[0] < 0.0 < resting.upper[2]
    moving = box(np.zeros(3), np.array([0.0, -0.12, 0.0]))
    np.testing.assert_allclose([moving.lower[1], moving.upper[1]], -0.07)
    last = box(np.zeros(3), np.array([0.0, -0.02, 0.0]))
    assert last.lower[1] == last.upper[1] == 0.0
    outside = box(np.array([0.0, 5.0, 0.0]), np.zeros(3))
    assert outside.lower[1] == outside.upper[1] == 0.0 and not outside.recovering


def test_fresh_arrays_every_call_and_the_state_untouched():
    box = VelocityBounds(limits(2, position=1.0, acceleration=1.0), 0.01)
    q, v = np.array([0.9, 0.0]), np.array([0.01, 0.0])
    q.flags.writeable = v.flags.writeable = False
    first = box(q, v)
    kept = first.lower.copy(), first.upper.copy()
    box(-q, -v)
    np.testing.assert_array_equal(first[:2], kept)


def test_interpreted_and_compiled_agree():
    rng = np.random.default_rng(4)
    lim = jr.random_limits(rng, 300, 1e-3)
    box = VelocityBounds(lim, 1e-3)
    for v in (np.zeros(300), rng.normal(size=300)):
        q = jr.resting_inside(rng, lim) + rng.choice([0.0, 0.1, -0.1], 300)
        lower, upper = np.empty(300), np.empty(300)
        with np.errstate(all="ignore"):
            recovering = velocity_kernel.velocity_bounds.function(q, v, box._packed, 1e-3, False, lower, upper)
        bounds = box(q, v)
        np.testing.assert_allclose(bounds[:2], [lower, upper], rtol=1e-12, atol=1e-12)
        assert recovering == bounds.recovering


@pytest.mark.parametrize(
    "given, words",
    [
        (
            {"velocity_lower": [-1.0, 0.2], "velocity_upper": 1.0},
            ["velocity_lower", "joint 1 (b)", "0.2", "stand still"],
        ),
        ({"velocity_upper": [1.0, -0.2]}, ["velocity_upper", "joint 1 (b)", "-0.2", "stand still"]),
        (
            {"acceleration_upper": [1.0, 0.0]},
            ["acceleration_upper", "joint 1 (b)", "0", "above 0", "brake", "disabled"],
        ),
        ({"acceleration_lower": [-1.0, 0.5]}, ["acceleration_lower", "joint 1 (b)", "0.5", "below 0", "brake"]),
        ({"acceleration_upper": [1.0, 1e-200]}, ["acceleration_upper", "joint 1 (b)", "dt", "inf"]),
        ({"position_lower": [0.0, INF]}, ["position", "joint 1 (b)", "inf", "finite"]),
    ],
)
def test_limits_that_nobody_can_keep_are_named(given, words):
    with pytest.raises(ParameterError) as caught:
        VelocityBounds(limits(2, **given), 0.01, names=["a", "b"])
    line = str(caught.value)
    assert "\n" not in line and all(w in line for w in words), line


def test_jerk_limits_are_read_only_where_asked():
    lim = limits(2, jerk_upper=0.0)
    VelocityBounds(lim, 0.01)
    with pytest.raises(ParameterError, match="jerk_upper of joint 0 is 0"):
        VelocityBounds(lim, 0.01, jerk=True)


def test_narrow_ranges_and_one_way_joints_are_not_refused():
    VelocityBounds(limits(1, position=0.0, velocity=100.0, acceleration=1e6), 0.1)
    VelocityBounds(limits(1, velocity=0.0), 0.1)
    box = VelocityBounds(limits(1, position=1.0, velocity_lower=0.0, velocity_upper=1.0, acceleration=10.0), 0.01)
    assert box(one(2.0), one(0.0)).recovering  # it may not move down: outside it stays
    np.testing.assert_array_equal(box(one(2.0), one(0.0))[:2], np.zeros((2, 1)))


@pytest.mark.parametrize(
    "arguments, error",
    [
        ({"dt": 0.0}, TimeStepError),
        ({"dt": math.nan}, NonFiniteError),
        ({"disabled": [2]}, ParameterError),
        ({"disabled": [-1]}, ParameterError),
        ({"disabled": [True]}, ParameterError),
        ({"disabled": [0.5]}, ParameterError),
        ({"jerk": 1}, ParameterError),
        ({"names": ["a"]}, ShapeError),
        ({"limits": None}, ParameterError),
    ],
)
def test_misuse_is_named(arguments, error):
    with pytest.raises(error):
        VelocityBounds(**{"limits": limits(2), "dt": 0.01} | arguments)


def test_wrong_shapes_are_refused():
    box = VelocityBounds(limits(2), 0.01)
    with pytest.raises(ShapeError, match="expected \\(2,\\)"):
        box(np.zeros(3), np.zeros(3))
