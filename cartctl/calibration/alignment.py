"""Where a robot stands in the frame of a measuring device, before anything else is known: a start for Gauss-Newton.

    min sum_i w_i |p_i - (R f(q_i) + t)|^2,    R = U diag(1, 1, det) V^T of  sum w_i (p_i - p)(f_i - f)^T = U S V^T

(Kabsch 1976; Umeyama 1991), w_i = 1 / (1 + (r_i / median r)^2), renewed a few times, so that outliers count little.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cartctl.calibration.calibrate import as_chain
from cartctl.calibration.chain import Chain
from cartctl.calibration.dh_chain import DHChain
from cartctl.calibration.measurements import read
from cartctl.calibration.robot_chain import RobotChain
from cartctl.checks import FloatArray
from cartctl.errors import MeasurementError

_ROUNDS = 10
_FLAT = 1e-3  # of the largest spread: below it positions lie on a line, about which they could turn


def aligned(
    chain_or_robot: Any,
    q: Any,
    measurements: Any,
    *,
    kind: str | None = None,
    frame: str | None = None,
    tool: Any = None,
) -> Chain:
    """The chain with the base that brings its positions closest to the measured ones; nothing else changes.

    For a measuring device whose frame is anywhere: calibrate the result with ``base`` among the parameters. kind:
    "pose" or "position", by their shape if None; the positions are used. Raises MeasurementError where they are
    fewer than 3 or lie on a line; otherwise as :func:`cartctl.calibrate`.
    """
    chain = as_chain(chain_or_robot, frame, None, tool)
    angles = chain.coordinates(q)
    data = read(kind, measurements, len(angles))
    if data.kind == "distance":
        raise MeasurementError(
            "the measurements are distances; expected 'pose' or 'position', as distances show no directions"
        )
    own = _with_base(chain, np.eye(4))
    T = _fitted(own.product.poses(angles).position, data.position)
    return _with_base(chain, T)


def _fitted(own: FloatArray, measured: FloatArray) -> FloatArray:
    weights = np.ones(len(own))
    T = np.eye(4)
    for _ in range(_ROUNDS):
        share = (weights / weights.sum())[:, None]
        a, b = (share * own).sum(axis=0), (share * measured).sum(axis=0)
        U, s, Vt = np.linalg.svd(((measured - b) * share).T @ (own - a))
        if len(own) < 3 or s[1] <= _FLAT**2 * max(s[0], 1e-300):
            raise MeasurementError(
                f"the {len(own)} positions are fewer than 3 or lie on a line; expected positions spread over a plane"
            )
        sign = np.sign(np.linalg.det(U) * np.linalg.det(Vt))
        T[:3, :3] = U @ np.diag([1.0, 1.0, sign]) @ Vt
        T[:3, 3] = b - T[:3, :3] @ a
        misses = np.linalg.norm(measured - own @ T[:3, :3].T - T[:3, 3], axis=1)
        weights = 1.0 / (1.0 + (misses / max(float(np.median(misses)), 1e-9)) ** 2)
    return T


def _with_base(chain: Chain, base: FloatArray) -> Chain:
    if isinstance(chain, DHChain):
        return replace(chain, base=base)
    assert isinstance(chain, RobotChain)
    other = RobotChain(chain.source, chain.frame, base=base, tool=chain.tool)
    other.corrections = dict(chain.corrections)
    return other
