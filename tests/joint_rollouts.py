"""Random joint limits, and many joints driven at once by somebody adverse who takes any u inside the bounds.

Braking is simulated here step by step and not with the formulas of the package.
"""

from __future__ import annotations

import os
from typing import NamedTuple

import numpy as np

from cartctl.levels.acceleration_bounds import AccelerationBounds
from cartctl.levels.bounds import RETURN_SPEED
from cartctl.levels.velocity_bounds import VelocityBounds
from cartctl.model.limits import Limits

INF = np.inf
KEPT = 1e-11  # by how much a limit may be passed, per unit of what is limited: thousands of steps of round-off
TIGHT = 1e-9  # between a bound and one found by bisection over simulated braking
LEVELS = (VelocityBounds, AccelerationBounds)
COMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
FEWER = 1 if COMPILED else 10  # joints, and steps, where kernels run as Python


# ---------------------------------------------------------------- limits


def limits(n, **given):
    """n joints without limits but those given, each a number or (n,); ``velocity=`` is short for both sides."""
    fields = {}
    for quantity in ("position", "velocity", "acceleration", "jerk", "torque"):
        both = given.pop(quantity, INF)
        for side, sign in (("lower", -1.0), ("upper", 1.0)):
            fields[f"{quantity}_{side}"] = np.broadcast_to(given.pop(f"{quantity}_{side}", sign * np.asarray(both)), n)
    assert not given
    return Limits(**fields)


def mirrored(lim):
    """The limits of the same joints counted the other way."""
    names = ("position", "velocity", "acceleration", "jerk")
    lower = {f"{name}_lower": -getattr(lim, f"{name}_upper") for name in names}
    return lim.replace(**lower, **{f"{name}_upper": -getattr(lim, f"{name}_lower") for name in names})


def random_limits(rng, n, dt, missing=0.2, jerk_steps=(0.3, 30.0)):
    """Lopsided limits of many magnitudes; a position range is crossed in a few or in thousands of steps, or is nothing.

    jerk_steps: the steps that it takes to build up the acceleration limit.
    """

    def magnitude(low, high):
        return np.exp(rng.uniform(np.log(low), np.log(high), n))

    def limit(values):
        return np.where(rng.random(n) < missing, INF, values * rng.uniform(0.2, 1.0, n))

    v = magnitude(0.1, 10.0)
    a = v / (dt * magnitude(0.1, 300.0))  # the velocity limit is reached after so many steps
    j = a / (dt * magnitude(*jerk_steps))
    width = np.where(rng.random(n) < 0.05, 0.0, v * dt * magnitude(0.1, 1000.0))
    middle, lean = rng.uniform(-2.0, 2.0, n), rng.random(n)
    return limits(
        n,
        position_lower=np.where(rng.random(n) < missing, -INF, middle - lean * width),
        position_upper=np.where(rng.random(n) < missing, INF, middle + (1.0 - lean) * width),
        velocity_lower=-limit(v),
        velocity_upper=limit(v),
        acceleration_lower=-limit(a),
        acceleration_upper=limit(a),
        jerk_lower=-limit(j),
        jerk_upper=limit(j),
    )


def resting_inside(rng, lim):
    """Positions inside, (n,), a third of them at a limit."""
    low = np.where(np.isfinite(lim.position_lower), lim.position_lower, np.minimum(lim.position_upper, 3.0) - 3.0)
    high = np.where(np.isfinite(lim.position_upper), lim.position_upper, np.maximum(lim.position_lower, -3.0) + 3.0)
    share = rng.choice([0.0, 0.3, 0.5, 0.7, 0.9, 1.0], len(low))
    return np.minimum(np.maximum(low + share * (high - low), low), high)


# ---------------------------------------------------------------- motion


class Moved(NamedTuple):
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray


def move(kind, q, v, u, dt):
    """One step of the integrator that the bounds are made for."""
    if kind is VelocityBounds:
        return Moved(q + u * dt, u, (u - v) / dt)
    return Moved(q + v * dt + 0.5 * u * dt**2, v + u * dt, u)


class Adversary:
    """Always up, always down, any corner, long runs of one corner, anything inside: joint by joint one of these."""

    def __init__(self, rng, n, far):
        self.rng, self.far, self.kind = rng, far, rng.integers(0, 5, n)
        self.up = rng.random(n) < 0.5

    def __call__(self, bounds):
        n = len(self.kind)
        low = np.where(np.isfinite(bounds.lower), bounds.lower, np.minimum(bounds.upper, 0.0) - self.far)
        high = np.where(np.isfinite(bounds.upper), bounds.upper, np.maximum(bounds.lower, 0.0) + self.far)
        self.up ^= self.rng.random(n) < 0.02
        share = self.rng.random(n)
        share = np.choose(self.kind, [np.ones(n), np.zeros(n), np.round(share), self.up, share])
        inside = np.minimum(np.maximum(low + share * (high - low), low), high)
        return np.where(share == 1.0, high, inside)


def excess(x, low, high):
    """By how much x is outside [low, high], per unit of what is there, (n,)."""
    return np.maximum(np.maximum(low - x, x - high), 0.0) / (1.0 + np.abs(x))


def check_box(bounds):
    assert not np.isnan(bounds.lower).any() and not np.isnan(bounds.upper).any()
    assert (bounds.lower <= bounds.upper).all()


def check_kept(kind, lim, dt, q, u_of, steps, jerk=False):
    """From rest at q: no limit is passed, nothing recovers, whatever ``u_of`` takes. How near position limits came."""
    box = kind(lim, dt, jerk=jerk)
    v = a = np.zeros(len(q))
    nearest = np.full(len(q), INF)
    worst = np.zeros(4)
    for _ in range(steps):
        bounds = box(q, v)
        assert (bounds.lower <= bounds.upper).all() and not bounds.recovering
        before = a
        q, v, a = move(kind, q, v, u_of(bounds), dt)
        # a quotient of velocities has their round-off over dt, and one of those over dt^2
        worst[0] = max(worst[0], excess(q, lim.position_lower, lim.position_upper).max())
        worst[1] = max(worst[1], excess(v, lim.velocity_lower, lim.velocity_upper).max())
        noise = np.abs(v) / dt
        worst[2] = max(
            worst[2], excess(a, lim.acceleration_lower - noise * KEPT, lim.acceleration_upper + noise * KEPT).max()
        )
        if jerk:
            past = np.maximum(lim.jerk_lower - (a - before) / dt, (a - before) / dt - lim.jerk_upper)
            worst[3] = max(worst[3], (past * dt / (1.0 + np.abs(a) + noise)).max())
        nearest = np.minimum(nearest, np.minimum(q - lim.position_lower, lim.position_upper - q))
    assert (worst <= KEPT).all(), worst
    return nearest


# ---------------------------------------------------------------- braking, simulated


def full_braking(kind, q, v, u, brake, dt):
    """The lowest position, between samples too, of one joint that takes u and then brakes fully until it stands.

    At the acceleration level the last step brakes just enough to stand at its end.
    """
    lowest = q
    q, v, _ = move(kind, q, v, u, dt)
    if kind is AccelerationBounds and v > 0.0 > v - u * dt:
        lowest = min(lowest, q - v**2 / (2.0 * u))
    lowest = min(lowest, q)
    while v < 0.0:
        a = min(brake, -v / dt)
        u = v + a * dt if kind is VelocityBounds else a
        q, v, _ = move(kind, q, v, u, dt)
        lowest = min(lowest, q)
        if v > -1e-15:
            break
    return lowest


def least_stoppable(kind, q, v, q_min, brake, dt, low, high):
    """The least u in [low, high] after which full braking stops above q_min, by bisection."""
    if full_braking(kind, q, v, low, brake, dt) >= q_min:
        return low
    for _ in range(200):
        middle = 0.5 * (low + high)
        if full_braking(kind, q, v, middle, brake, dt) >= q_min:
            high = middle
        else:
            low = middle
    return high


# ---------------------------------------------------------------- the way back


def check_recovery(kind, rng, n, dt, steps=2000, jerk=False):
    """From positions and velocities outside everything: back in a computed time, inside ever after, gently."""
    n, steps = n // FEWER, steps // FEWER
    lim = random_limits(rng, n, dt)
    low, high = lim.velocity_lower, lim.velocity_upper
    speed = np.where(np.isfinite(np.minimum(-low, high)), np.minimum(-low, high), 1.0)
    q = resting_inside(rng, lim) + rng.choice([-1.0, 0.0, 1.0], n) * speed * dt * np.exp(rng.uniform(-2.0, 6.0, n))
    v = speed * rng.uniform(-2.0, 2.0, n) * rng.integers(0, 2, n)
    time = _recovery_time(lim, q, v, dt, jerk)
    quick = time < steps * dt
    assert quick.mean() > 0.5 or not COMPILED
    q, v, time = q[quick], v[quick], time[quick]
    lim = limits(len(q), **{f: x[quick] for f, x in vars(lim).items()})
    box, choose = (
        kind(lim, dt, jerk=jerk),
        Adversary(rng, len(q), speed[quick] * (1.0 if kind is VelocityBounds else 10.0)),
    )
    assert box(q, v).recovering
    box.reset()
    slow, a = np.zeros(len(q), dtype=bool), np.zeros(len(q))
    for k in range(steps):
        bounds = box(q, v)
        check_box(bounds)
        before = a
        q, v, a = move(kind, q, v, choose(bounds), dt)
        noise = KEPT * (1.0 + np.abs(v) / dt)
        assert (excess(a, lim.acceleration_lower - noise, lim.acceleration_upper + noise) <= KEPT).all()
        if jerk:
            past = np.maximum(lim.jerk_lower - (a - before) / dt, (a - before) / dt - lim.jerk_upper)
            assert (past * dt <= noise + KEPT * np.abs(a)).all()
        fast = excess(v, lim.velocity_lower, lim.velocity_upper) > TIGHT
        assert not (slow & fast).any()  # never beyond velocity limits once inside
        slow |= ~fast
        outside = excess(q, lim.position_lower, lim.position_upper) > TIGHT
        late = (outside | fast) & ((k + 1) * dt > time)
        assert not late.any(), (k, np.flatnonzero(late))
    assert not bounds.recovering


def _recovery_time(lim, q, v, dt, jerk):
    """Enough for stopping, and from where that ends for the way back: accelerating, at full speed, slowing down."""
    c = np.minimum(lim.acceleration_upper, -lim.acceleration_lower)
    j = np.minimum(lim.jerk_upper, -lim.jerk_lower) if jerk else np.full(len(q), INF)
    free = np.isinf(lim.acceleration_upper - lim.acceleration_lower)
    free &= np.isinf(lim.jerk_upper - lim.jerk_lower) | (not jerk)
    up, down = (np.where(np.isinf(x) & free, RETURN_SPEED, x) for x in (lim.velocity_upper, -lim.velocity_lower))
    cruise = np.minimum(up, down)
    stop = np.abs(v) / c + 2.0 * np.sqrt(np.abs(v) / j) + 2.0 * dt
    way = np.maximum(np.maximum(lim.position_lower - q, q - lim.position_upper), 0.0) + np.abs(v) * stop
    return stop + 2.0 * np.sqrt(way / c) + 4.0 * np.cbrt(way / j) + way / cruise + 10.0 * dt
