"""Where a command will lie, and bounds that must not contradict each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray


class Box(NamedTuple):
    """Where a command will lie: ``lower <= u <= upper``, each (nv,), +-inf where that is not known."""

    lower: FloatArray
    upper: FloatArray


class Spread(NamedTuple):
    """A box as its centre and its half-width, (nv,) each."""

    centre: FloatArray
    radius: FloatArray


def spread(box: Box | None, lower: FloatArray, upper: FloatArray, otherwise: FloatArray) -> Spread:
    """``box`` as a Spread; ``lower`` and ``upper`` where it says nothing, and no spread about ``otherwise`` beyond."""
    low, high = (lower, upper) if box is None else (_known(box[0], lower), _known(box[1], upper))
    known = np.isfinite(low) & np.isfinite(high)
    low, high = np.where(known, low, otherwise), np.where(known, high, otherwise)
    return Spread(0.5 * (low + high), 0.5 * np.maximum(high - low, 0.0))


def _known(bound: FloatArray, otherwise: FloatArray) -> FloatArray:
    return np.where(np.isfinite(bound), bound, otherwise)


def ordered(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two bounds that contradict each other (a gap narrower than its margins) meet half-way."""
    crossed = low > high
    if not crossed.any():
        return low, high
    middle = 0.5 * (np.where(crossed, low, 0.0) + np.where(crossed, high, 0.0))
    return np.where(crossed, middle, low), np.where(crossed, middle, high)
