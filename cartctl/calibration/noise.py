"""How far to trust each number of a measurement: known standard deviations, or those the residuals show.

Unknown ones are the variance components of positions and of angles, estimated with the fit (Helmert 1924; Rao 1971):
sigma_g^2 = sum e_g^2 / (rows_g - sum of their leverages).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.calibration.measurements import Measurements
from cartctl.calibration.robust import OUTSIDE, quantile, robust_scale
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError

FLOOR = 1e-9  # m or rad: measurements without any noise still have round-off, of sines and of the file they are in


def given(noise: Any, data: Measurements) -> FloatArray | None:
    """``noise`` as one sigma a unit of the measurements, m before rad; None for unknown.

    Raises ParameterError, ShapeError, NonFiniteError.
    """
    if noise is None:
        return None
    count = len(data.parts)
    if count == 2 and np.size(noise) == 1:
        raise ParameterError(f"noise is {noise!r}; expected (m, rad) for poses, two standard deviations")
    sigma = checks.vector("noise", np.atleast_1d(noise), count)
    if (sigma <= 0.0).any():
        raise ParameterError(f"noise is {noise!r}; expected standard deviations above 0")
    return np.maximum(sigma, FLOOR)


def start(data: Measurements, e: FloatArray) -> FloatArray:
    """A first guess: what half of the measurements stay below."""
    return _floored([robust_scale((e[:, part] ** 2).sum(axis=1), _size(part)) for part in data.parts.values()])


class Spread(NamedTuple):
    """sigma: one a unit. freedom: degrees of freedom behind the least certain of them."""

    sigma: FloatArray
    freedom: float


def spread(data: Measurements, e: FloatArray, leverage: FloatArray, loss: str) -> Spread:
    """Of residuals (N, rows) with leverages (N, rows), of a fit under ``loss``.

    A robust fit counts the measurements that are no outliers by the median; the median alone would be uncertain.
    """
    sound = np.ones(len(e), dtype=bool)
    if loss != "linear":
        norms = (e / per_row(data, start(data, e))) ** 2
        sound = norms.sum(axis=1) <= quantile(OUTSIDE, data.rows)
    e, leverage = e[sound], leverage[sound]
    free = float(e.size - leverage.sum())
    sums = [float((e[:, part] ** 2).sum()) for part in data.parts.values()]
    own = [float(e[:, part].size - leverage[:, part].sum()) for part in data.parts.values()]
    if min(own) < 1.0:  # too few to tell the units apart
        own, sums = [max(free, 1.0)] * len(own), [sum(sums)] * len(own)
    return Spread(_floored([(s / f) ** 0.5 for s, f in zip(sums, own, strict=True)]), max(min(own), 1.0))


def per_row(data: Measurements, sigma: FloatArray) -> FloatArray:
    """The sigma of each number of a measurement, (rows,)."""
    row = np.empty(data.rows)
    for part, value in zip(data.parts.values(), sigma, strict=True):
        row[part] = value
    return row


def _floored(values: list[float]) -> FloatArray:
    return np.asarray(np.maximum(np.array(values), FLOOR))


def _size(part: slice) -> int:
    return int(part.stop - part.start)
