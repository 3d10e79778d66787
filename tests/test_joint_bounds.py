"""Velocity and acceleration bounds alike: limits are kept whatever is chosen within them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl.levels.acceleration_bounds import AccelerationBounds
from cartctl.levels.velocity_bounds import VelocityBounds
from tests import joint_rollouts as jr
from tests import oracles

DTS = [1e-4, 1e-3, 2e-2]
SHARES = st.lists(st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0.0, 1.0)), min_size=1, max_size=60)


def per_step(bounds, dt):
    """How much of a velocity of one unit a command of this level stands for."""
    return 1.0 if bounds is VelocityBounds else dt


@pytest.mark.parametrize("dt", DTS)
@pytest.mark.parametrize(("bounds", "driven"), [(VelocityBounds, 0.3), (AccelerationBounds, 0.2)])
def test_limits_are_kept_whatever_is_chosen(bounds, driven, dt):
    rng, n = np.random.default_rng(1), 1000 // jr.FEWER
    lim = jr.random_limits(rng, n, dt)
    q = jr.resting_inside(rng, lim)
    adversary = jr.Adversary(rng, n, 10.0 / per_step(bounds, dt))
    nearest = jr.check_kept(bounds, lim, dt, q, adversary, 5000 // jr.FEWER)
    assert (np.abs(nearest) < 1e-9).mean() > driven or not jr.COMPILED  # many were driven into their limits


@pytest.mark.parametrize("bounds", [VelocityBounds, AccelerationBounds])
@given(seed=oracles.SEEDS, dt=oracles.magnitudes(1e-4, 2e-2), shares=SHARES)
def test_limits_are_kept_by_any_sequence(bounds, seed, dt, shares):
    rng = np.random.default_rng(seed)
    lim = jr.random_limits(rng, 5, dt)
    sequence, most = iter(shares * 40), 20.0 / per_step(bounds, dt)

    def u_of(box):
        low, high = np.maximum(box.lower, -most), np.minimum(box.upper, most)
        return np.minimum(low + next(sequence) * (high - low), high)

    jr.check_kept(bounds, lim, dt, jr.resting_inside(rng, lim), u_of, 40 * len(shares))
