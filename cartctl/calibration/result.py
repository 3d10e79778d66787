"""What a calibration found, how sure it is, and what it could not tell."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.special import betaincinv, stdtrit

from cartctl import checks
from cartctl.calibration import robust, written
from cartctl.calibration.chain import Chain
from cartctl.calibration.gauss_newton import Fit, Outcome
from cartctl.calibration.identifiability import Identifiability, Indistinct
from cartctl.calibration.measurements import Measurements
from cartctl.checks import FloatArray, IntArray


class Errors(NamedTuple):
    """Of N measurements in one unit, "m" or "rad": root mean square, median and largest norm of the residuals."""

    unit: str
    rms: float
    median: float
    largest: float


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibrated chain; made by :func:`cartctl.calibrate`.

    chain: with the estimate, a DHChain or RobotChain. nominal: as it was given. names: (p,) of the parameters, units
    "m" or "rad" each. delta: (p,) estimate minus nominal. rank: r <= p, how many combinations of them are seen.
    condition: of the column-scaled regressor on these. unidentifiable: the directions that no measurement sees, along
    which the parameters stay nominal (least change of the column-scaled ones); determined: (p,) bool, which parameters
    have no part in any. rank_after: the rank at the estimate; if larger than rank, the nominal chain hid something.
    noise: standard deviations, one a unit, given or estimated. weights: (N,) of the loss.
    outliers: numbers of the measurements farther off than 1 in 10,000 sound ones. outcome: how it ended. data, q: what
    was measured, and where, (N, n). before: residuals with the nominal values, (N, rows), m and rad. fit, seen: the
    numbers behind all this. noise_known: whether the noise was given.
    """

    chain: Chain
    nominal: Chain
    names: tuple[str, ...]
    units: tuple[str, ...]
    kind: str
    loss: str
    delta: FloatArray
    data: Measurements
    q: FloatArray
    before: FloatArray
    fit: Fit
    seen: Identifiability
    noise_known: bool
    rank_after: int

    @property
    def rank(self) -> int:
        """How many combinations of the parameters the measurements see."""
        return self.seen.rank

    @property
    def condition(self) -> float:
        """Largest over smallest singular value that counts, of the regressor with columns of norm 1."""
        return self.seen.condition

    @property
    def unidentifiable(self) -> tuple[Indistinct, ...]:
        """Which parameters cannot be told apart, and how they may change together unseen."""
        return self.seen.unidentifiable

    @property
    def independent(self) -> tuple[str, ...]:
        """As many parameters as the rank, which the data tell apart: ``parameters=result.independent`` fits as well."""
        return self.seen.independent

    @property
    def determined(self) -> Any:
        """(p,) bool: which parameters are determined by themselves."""
        return self.seen.seen

    @property
    def outcome(self) -> Outcome:
        """How the iteration ended; ``str(outcome)`` is a sentence."""
        return self.fit.outcome

    @property
    def iterations(self) -> int:
        """How many steps were taken."""
        return self.fit.iterations

    @property
    def noise(self) -> dict[str, float]:
        """Standard deviation of the measurements in each unit."""
        return {unit: float(s) for unit, s in zip(self.data.parts, self.fit.sigma, strict=True)}

    @property
    def residuals(self) -> FloatArray:
        """Measured minus computed with the estimate, (N, rows), m and rad; ``before``: with the nominal values."""
        return self.fit.residuals

    @property
    def weights(self) -> FloatArray:
        """(N,) how much each measurement counts under the loss, 1 for fully."""
        return self.fit.weights

    @property
    def spare(self) -> int:
        """Numbers measured minus rank."""
        return int(self.residuals.size - self.rank)

    @property
    def freedom(self) -> float:
        """Degrees of freedom behind the estimated noise, the least of the units; inf where the noise was given."""
        return self.fit.freedom

    @cached_property
    def outliers(self) -> IntArray:
        """Numbers of the measurements whose whitened residual 1 in 10,000 sound ones would exceed."""
        return np.flatnonzero(self.fit.norms**2 > robust.quantile(robust.OUTSIDE, self.data.rows))

    @cached_property
    def covariance(self) -> FloatArray:
        """(p, p) of ``delta``, m and rad, of the estimate with unseen directions held at the nominal values.

        inf throughout where there are no measurements to spare and the noise is not given.
        """
        if (not self.noise_known and self.spare <= 0) or not math.isfinite(self.fit.inflation):
            return np.full((len(self.names),) * 2, np.inf)
        root = self.seen.basis @ self._root() * math.sqrt(self.fit.inflation)
        return np.asarray(root @ root.T)

    def _root(self) -> FloatArray:
        """L (r, r) with L L^T = (J^T J)^-1, by the singular values of the factor."""
        if not self.rank:
            return np.zeros((0, 0))
        _, s, Vt = np.linalg.svd(self.fit.factor)
        return np.asarray(Vt.T / np.maximum(s, 1e-12 * s[0]))

    @cached_property
    def deviations(self) -> FloatArray:
        """(p,) standard deviations of ``delta``; inf for a parameter that is not determined by itself."""
        spread = np.sqrt(np.diagonal(self.covariance))
        return np.where(self.determined, spread, np.inf)

    def interval(self, level: float = 0.95) -> FloatArray:
        """(p, 2) confidence interval of each parameter's ``delta``; +-inf where it is not determined.

        Student's t with ``freedom`` degrees of freedom, normal where the noise was given. Raises ParameterError.
        """
        checks.number("level", level, low=0.0, high=1.0, strict=True)
        freedom = min(self.freedom, 1e9)
        half = float(stdtrit(freedom, 0.5 + 0.5 * min(level, 1.0 - 1e-12))) * self.deviations
        return np.column_stack([self.delta - half, self.delta + half])

    def distance(self, delta: Any) -> float:
        """``(z - z_hat)^T C_z^-1 (z - z_hat)`` of another change of the parameters (p,), on what the data see.

        Compare with :meth:`radius`. Raises ShapeError, NonFiniteError.
        """
        other = checks.vector("delta", delta, len(self.names))
        if not self.noise_known and self.spare <= 0:
            return 0.0
        # V_r has orthonormal columns: z = V_r^T D^-1 delta, and the basis is D V_r
        z = (self.seen.basis / self.seen.scale[:, None]).T @ (other / self.seen.scale)
        gap = self.fit.factor @ (z - self.fit.z)
        return float(gap @ gap) / self.fit.inflation

    def radius(self, level: float = 0.95) -> float:
        """The joint confidence region is ``distance <= radius``: r F(r, freedom), chi-squared if the noise was given.

        Raises ParameterError.
        """
        checks.number("level", level, low=0.0, high=1.0, strict=True)
        r, level = self.rank, min(level, 1.0 - 1e-12)
        if not r:
            return 0.0
        if self.noise_known:
            return robust.quantile(level, r)
        if self.spare <= 0:
            return math.inf
        share = float(betaincinv(0.5 * r, 0.5 * self.freedom, level))  # F by way of the beta distribution
        return self.freedom * share / (1.0 - share)

    def contains(self, delta: Any, level: float = 0.95) -> bool:
        """Whether ``delta`` (p,) lies in the joint confidence ellipsoid over what is identifiable."""
        return self.distance(delta) <= self.radius(level)

    def errors(self, after: bool = True, outliers: bool = True) -> tuple[Errors, ...]:
        """Norms of the residuals with the estimate, or with the nominal values, one entry a unit.

        outliers=False leaves these out.
        """
        e = self.residuals if after else self.before
        kept = np.ones(len(e), dtype=bool)
        if not outliers and len(self.outliers) < len(e):
            kept[self.outliers] = False
        return errors_of(self.data, e[kept])

    def table(self) -> list[tuple[str, str, float, float, float]]:
        """Name, unit, nominal value, estimate and standard deviation of every parameter; corrections start at 0."""
        start = np.array([self.nominal.value(name) for name in self.names])
        columns = (start.tolist(), (start + self.delta).tolist(), self.deviations.tolist())
        return list(zip(self.names, self.units, *columns, strict=True))

    def summary(self) -> str:
        """The result in a few lines."""
        return written.summary(self)

    def urdf(self) -> str:
        """The calibrated chain as the text of a URDF; see :meth:`DHChain.urdf` and :meth:`RobotChain.urdf`."""
        return self.chain.urdf()

    def write_urdf(self, path: str | os.PathLike[str]) -> Path:
        """Write :meth:`urdf` to a file, whole or not at all; raises ParameterError, FileError."""
        return written.save(path, self.urdf())

    def to_json(self) -> str:
        """Everything in numbers, as JSON; infinite deviations are null."""
        return json.dumps(written.facts(self), indent=1) + "\n"

    def write_json(self, path: str | os.PathLike[str]) -> Path:
        """Write :meth:`to_json` to a file, whole or not at all; raises ParameterError, FileError."""
        return written.save(path, self.to_json())


def errors_of(data: Measurements, e: FloatArray) -> tuple[Errors, ...]:
    """Norms of residuals (N, rows), one entry a unit."""
    found = []
    for unit, part in data.parts.items():
        norm = np.linalg.norm(e[:, part], axis=1)
        found.append(Errors(unit, float(np.sqrt(np.mean(norm**2))), float(np.median(norm)), float(norm.max())))
    return tuple(found)
