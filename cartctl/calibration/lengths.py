"""Link lengths from tip positions: linear, so that one step is exact and no nominal values are needed.

With the angles of the table known, the tip is affine in its lengths, p(q; l) = p_0(q) + Phi(q) l, and the stacked
equations have the least-squares solution l = Phi# (p - p_0) (De Luca, Robotics 2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.calibration.dh_chain import DHChain
from cartctl.calibration.identifiability import Indistinct, identify
from cartctl.calibration.measurements import read
from cartctl.calibration.selection import Parameters
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError


@dataclass(frozen=True, eq=False)
class LinkLengths:
    """chain: with the lengths found. names, lengths, delta: (p,), m; delta is what they differ from the chain given.

    agreed: whether the data agreed with the given lengths, so that nothing was solved. before, residuals: (N, 3), m,
    with the given lengths and with those found. rank, unidentifiable: as of a calibration.
    """

    chain: DHChain
    names: tuple[str, ...]
    lengths: FloatArray
    delta: FloatArray
    agreed: bool
    before: FloatArray
    residuals: FloatArray
    rank: int
    unidentifiable: tuple[Indistinct, ...]


def link_lengths(
    chain: DHChain,
    q: Any,
    positions: Any,
    parameters: Parameters = "a",
    *,
    nominal: bool = True,
    agreement: float = 1e-9,
    rank_tolerance: float = 1e-9,
) -> LinkLengths:
    """The lengths among a, d, base.x ... tool.z of ``chain`` that fit tip positions (N, 3), m, at q (N, n) best.

    nominal=False ignores what the chain says of them: nothing but its angles and the other lengths is used; lengths
    that the data do not see are then the shortest that fit, with nominal=True they stay as given. agreement: m; where
    no position misses the given lengths by more, nothing is solved.

    Raises ParameterError for parameters that are angles, ShapeError, NonFiniteError, ParameterNotFound.
    """
    if not isinstance(chain, DHChain):
        raise ParameterError(f"chain is a {type(chain).__name__}; expected a cc.DHChain")
    angles = chain.coordinates(q)
    data = read("position", positions, len(angles))
    names = chain.select(parameters)
    wrong = [name for name, unit in zip(names, chain.units(names), strict=True) if unit != "m"]
    if wrong:
        raise ParameterError(f"parameters hold the angle {wrong[0]!r}; expected lengths only, or use cc.calibrate")
    start = chain if nominal else _without(chain, names)
    agreement = checks.number("agreement", agreement, low=0.0)
    tolerance = checks.number("rank_tolerance", rank_tolerance, low=1e-13, high=0.1)
    poses, Phi = start.product.regressor(angles, start.indices(list(names)))
    e = data.residuals(poses)
    seen = identify(Phi[:, :3].reshape(-1, len(names)), names, tolerance)
    agreed = nominal and bool(np.abs(e).max() <= agreement)
    change = np.zeros(len(names))
    if not agreed and seen.rank:
        Q, R = np.linalg.qr(Phi[:, :3].reshape(-1, len(names)) @ seen.basis)
        change = seen.basis @ np.linalg.solve(R, Q.T @ e.ravel())
    found = start.changed(dict(zip(names, change.tolist(), strict=True)))
    lengths = np.array([start.value(name) for name in names]) + change
    return LinkLengths(
        chain=found,
        names=names,
        lengths=lengths,
        delta=lengths - [chain.value(name) for name in names],
        agreed=agreed,
        before=data.residuals(chain.product.poses(angles)),
        residuals=data.residuals(found.product.poses(angles)),
        rank=seen.rank,
        unidentifiable=seen.unidentifiable,
    )


def _without(chain: DHChain, names: tuple[str, ...]) -> DHChain:
    """The chain with these lengths at 0."""
    table: dict[str, Any] = {
        c: np.array([0.0 if f"{c}{i + 1}" in names else x for i, x in enumerate(getattr(chain, c))]) for c in "ad"
    }
    return replace(chain, **table)
