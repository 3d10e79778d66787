"""Random numbers inside kernels: splitmix64, so that (seed, index) is all that a problem depends on."""

from __future__ import annotations

import math

import numpy as np

from cartctl.kernels import part

_STEP, _FIRST, _SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


@part
def new_state(seed, index):
    """The generator of one problem, (1,)."""
    state = np.empty(1, np.uint64)
    state[0] = np.uint64(seed)
    mixed = bits(state)
    state[0] = mixed ^ (np.uint64(index) * _FIRST)
    bits(state)
    return state


@part
def bits(state):
    """64 random bits."""
    state[0] += _STEP
    z = state[0]
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    return z ^ (z >> _31)


@part
def share(state):
    """Uniform in [0, 1)."""
    return np.float64(bits(state) >> _11) * 2.0**-53


@part
def between(state, low, high):
    """Uniform in [low, high)."""
    return low + (high - low) * share(state)


@part
def chance(state, p):
    """True with probability p."""
    return share(state) < p


@part
def whole(state, low, high):
    """An integer from low to high, both included."""
    return low + int(share(state) * (high - low + 1))


@part
def normal(state):
    """Of mean 0 and variance 1."""
    return math.sqrt(-2.0 * math.log(1.0 - share(state))) * math.cos(2.0 * math.pi * share(state))


@part
def power(state, low, high):
    """10 to a uniform power."""
    return 10.0 ** between(state, low, high)
