"""The smallest of several distances, smoothed where some are nearly equal, and fading out towards a range.

``H = -tau log(exp(-rho/tau) + sum_i e(d_i))`` over the d_i < rho, where ``e(d) = exp(-d/tau) - exp(-rho/tau) (1 +
(rho - d)/tau)`` is zero, with its slope, at rho: H is the smallest distance where one is near, less at most tau
log(their number) where several are, and rests at rho where none is. ``dH = sum_i w_i dd_i`` with w_i >= 0, together at
most 1.19 where H fades out, 1 where it does not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray


class Smallest(NamedTuple):
    """H in m, and the weights (K,) of the distances' gradients in its own."""

    value: float
    weights: FloatArray


def smallest(distance: FloatArray, tau: float, rho: float) -> Smallest:
    """Of distances (K,), K > 0, all below rho, m; rho may be inf."""
    least = float(distance.min())
    scaled = np.exp((least - distance) / tau)  # all times exp(least/tau), which may be anything
    if rho == np.inf:
        total = float(scaled.sum())
        return Smallest(least - tau * float(np.log(total)), scaled / total)
    far = float(np.exp((least - rho) / tau))
    total = float((scaled - far * (1.0 + (rho - distance) / tau)).sum()) + far
    return Smallest(least - tau * float(np.log(total)), (scaled - far) / total)
