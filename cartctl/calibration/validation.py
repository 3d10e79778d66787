"""Cross-validation: how well a calibration predicts measurements it has not seen (Stone 1974)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.calibration.calibrate import as_chain, calibrate
from cartctl.calibration.measurements import read
from cartctl.calibration.result import Calibration, Errors, errors_of
from cartctl.calibration.selection import Parameters
from cartctl.checks import FloatArray, IntArray
from cartctl.errors import ParameterError


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Predictions of N measurements, each by a calibration without its own fold.

    folds: (N,) the fold of each. residuals: (N, rows), measured minus predicted. before, after: errors with the nominal
    values and as predicted. results: the Calibration of each fold.
    """

    folds: IntArray
    residuals: FloatArray
    before: tuple[Errors, ...]
    after: tuple[Errors, ...]
    results: tuple[Calibration, ...]


def cross_validate(
    chain_or_robot: Any,
    q: Any,
    measurements: Any,
    *,
    folds: int = 5,
    seed: int = 0,
    parameters: Parameters = None,
    kind: str | None = None,
    frame: str | None = None,
    base: Any = None,
    tool: Any = None,
    anchor: Any = None,
    noise: Any = None,
    loss: str = "linear",
    iterations: int = 50,
    agreement: float = 1e-9,
    rank_tolerance: float = 1e-6,
) -> CrossValidation:
    """Calibrate without each of ``folds`` parts of the data in turn, and predict that part.

    Arguments and errors as of :func:`cartctl.calibrate`; ParameterError where folds is not in [2, N].
    """
    chain = as_chain(chain_or_robot, frame, base, tool)
    q = checks.floats("q", q)
    angles = chain.coordinates(q)
    data = read(kind, measurements, len(angles), anchor)
    count = checks.whole("folds", folds, 2)
    if count > len(angles):
        raise ParameterError(f"folds is {count}; expected at most {len(angles)}, the number of measurements")
    rng = np.random.default_rng(checks.whole("seed", seed, least=0))
    fold = rng.permutation(np.arange(len(angles)) % count)
    residuals, results = np.empty((len(angles), data.rows)), list[Calibration]()
    for k in range(count):
        kept, left = np.flatnonzero(fold != k), np.flatnonzero(fold == k)
        part = data.part(kept)
        anchors = part.anchor if data.kind == "distance" else None
        found = calibrate(
            chain,
            q[kept],
            part.values,
            parameters=parameters,
            kind=data.kind,
            anchor=anchors,
            noise=noise,
            loss=loss,
            iterations=iterations,
            agreement=agreement,
            rank_tolerance=rank_tolerance,
        )
        residuals[left] = data.part(left).residuals(found.chain.product.poses(angles[left]))
        results.append(found)
    before = data.residuals(chain.product.poses(angles))
    return CrossValidation(fold, residuals, errors_of(data, before), errors_of(data, residuals), tuple(results))
