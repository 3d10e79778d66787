"""Which configurations to measure: those that tell the most about the parameters.

    max over S, |S| = k, of log det M(S),    M(S) = sum_{i in S} J_i^T J_i,    J_i = Sigma^-1 H_i D V_r

(D-optimality: the smallest confidence ellipsoid; Fedorov 1972, Mitchell 1974). Exchanges: each chosen configuration in
turn gives way to the candidate that raises the determinant most, until none does. With M_- = L L^T without the one,

    log det(M_- + J^T J) = log det M_- + log det(I + (L^-1 J^T)^T (L^-1 J^T)).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from cartctl import checks
from cartctl.calibration import noise as noise_model
from cartctl.calibration.calibrate import as_chain
from cartctl.calibration.chain import Chain
from cartctl.calibration.identifiability import identify
from cartctl.calibration.measurements import KINDS, Measurements
from cartctl.calibration.selection import Parameters
from cartctl.checks import FloatArray, IntArray
from cartctl.errors import ParameterError

_GAIN = 1e-9  # of the log-determinant: a smaller one is round-off
_RIDGE = 1e-9  # times the information of all candidates: what stands in while too few are chosen


@dataclass(frozen=True, eq=False)
class Choice:
    """chosen: (k,) numbers of the candidates, ascending. log_det: of their information, over what candidates can show.

    rank: of all candidates. condition: sigma_1 / sigma_r of the chosen ones' scaled regressor, inf where they see less
    than all candidates do. exchanges: how many improved the choice.
    """

    chosen: IntArray
    log_det: float
    rank: int
    condition: float
    exchanges: int


def choose_configurations(
    chain_or_robot: Any,
    candidates: Any,
    count: int,
    *,
    parameters: Parameters = None,
    kind: str = "pose",
    frame: str | None = None,
    base: Any = None,
    tool: Any = None,
    anchor: Any = None,
    noise: Any = None,
    seed: int = 0,
) -> Choice:
    """``count`` of the ``candidates`` (N, n) that determine the parameters best, by D-optimal exchange.

    Arguments as of :func:`cartctl.calibrate`; noise: m, for poses (m, rad), by default 1 mm and 1 mrad. The exchange
    starts from the candidates that add most one after the other, and once from a random choice by ``seed``.

    Raises ParameterError where count is not in [1, N], ShapeError, NonFiniteError, ParameterNotFound.
    """
    chain = as_chain(chain_or_robot, frame, base, tool)
    angles = chain.coordinates(candidates)
    k = checks.whole("count", count, 1, len(angles))
    rng = np.random.default_rng(checks.whole("seed", seed, least=0))
    J = _information(chain, angles, parameters, kind, anchor, noise)
    if not J.shape[2]:
        raise ParameterError("the candidates see none of the parameters; measure another kind, or choose others")
    ridge = _RIDGE * np.einsum("nij,nik->jk", J, J) / len(J)
    ridge[np.diag_indices(len(ridge))] += 1e-12 * max(float(np.trace(ridge)) / len(ridge), 1e-300)
    starts = [_greedy(J, k, ridge), rng.permutation(len(J))[:k].tolist()]
    chosen, value, swaps = max((_exchanged(J, start, ridge) for start in starts), key=lambda found: found[1])
    sigma = np.linalg.svd(J[chosen].reshape(-1, J.shape[2]), compute_uv=False)
    full = len(sigma) == J.shape[2] and sigma[-1] > 1e-9 * sigma[0]
    condition = float(sigma[0] / sigma[-1]) if full else float("inf")
    return Choice(np.array(sorted(chosen), dtype=np.int64), value, J.shape[2], condition, swaps)


def _information(
    chain: Chain, angles: FloatArray, parameters: Parameters, kind: str, anchor: Any, noise: Any
) -> FloatArray:
    """J (N, rows, r): whitened, over the combinations that all candidates together see."""
    checks.choice("kind", kind, KINDS)
    poses, Phi = chain.product.regressor(angles, chain.indices(parameters))
    count = len(angles)
    anchors = np.zeros((count, 3)) if anchor is None else np.broadcast_to(checks.floats("anchor", anchor), (count, 3))
    data = Measurements(kind, poses.position, poses.rotation, np.zeros(count), anchors)
    H = data.derivative(poses, Phi, np.zeros((count, data.rows)))
    sigma = noise_model.given(noise, data)
    white = H / (np.full(data.rows, 1e-3) if sigma is None else noise_model.per_row(data, sigma))[:, None]
    seen = identify(white.reshape(-1, white.shape[2]), chain.select(parameters), 1e-6)
    return np.asarray(white @ seen.basis)


def _gains(J: FloatArray, M: FloatArray) -> FloatArray:
    """``log det(I + J_i M^-1 J_i^T)`` (N,) of each candidate."""
    L = np.linalg.cholesky(M)
    count, rows, r = J.shape
    X = solve_triangular(L, J.reshape(-1, r).T, lower=True).T.reshape(count, rows, r)
    G = np.eye(rows) + X @ np.swapaxes(X, 1, 2)
    return np.asarray(np.linalg.slogdet(G)[1])


def _greedy(J: FloatArray, k: int, ridge: FloatArray) -> list[int]:
    """One after the other, the one that adds most."""
    M, chosen = ridge.copy(), list[int]()
    for _ in range(k):
        gains = _gains(J, M)
        gains[chosen] = -np.inf
        best = int(np.argmax(gains))
        chosen.append(best)
        M = M + J[best].T @ J[best]
    return chosen


def _exchanged(J: FloatArray, start: list[int], ridge: FloatArray) -> tuple[list[int], float, int]:
    """Exchanges until none helps: the choice, its log-determinant, and how many there were."""
    chosen, swaps, still = list(start), 0, 0
    place = 0
    while still < len(chosen):
        others = [i for n, i in enumerate(chosen) if n != place]
        M = ridge + np.einsum("nij,nik->jk", J[others], J[others])
        gains = _gains(J, M)
        kept = float(gains[chosen[place]])
        gains[others] = -np.inf
        best = int(np.argmax(gains))
        if float(gains[best]) > kept + _GAIN * max(1.0, abs(kept)):
            chosen[place] = best
            swaps, still = swaps + 1, 0
        else:
            still += 1
        place = (place + 1) % len(chosen)
    M = ridge + np.einsum("nij,nik->jk", J[chosen], J[chosen])
    return chosen, float(np.linalg.slogdet(M)[1]), swaps
