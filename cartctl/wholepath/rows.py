"""Joint limits at every sample, as numbers on a path and as rows of the quadratic programme.

Positions at the S samples, velocities ``(q_{k+1} (-) q_k)/h`` held between them, accelerations ``(v_k - v_{k-1})/h`` at
them; all are measured in half-ranges of their limits, so that 1e-3 is a thousandth of what the joint may do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.model.limits import Limits
from cartctl.wholepath.blocks import Layout
from cartctl.wholepath.trace import Trace

KINDS = ("position", "velocity", "acceleration")


class Worst(NamedTuple):
    """The worst of a path's violations; excess in half-ranges, <= 0 where nothing is violated."""

    excess: float
    kind: str
    sample: int
    joint: int
    value: float
    limit: float


class Rows:
    """The limits of one robot as rows; joints without a limit of a kind have none."""

    def __init__(self, limits: Limits, margin: float = 0.0) -> None:
        self._kinds = {kind: _Kind(limits, kind) for kind in KINDS}
        self.margin = margin

    def excess(self, trace: Trace) -> FloatArray:
        """By how much each row is violated, in half-ranges; negative inside."""
        parts = [np.zeros(0)]
        for kind, values in _values(trace).items():
            part = self._kinds[kind]
            parts.append(
                np.maximum((values - part.upper)[:, part.joints], (part.lower - values)[:, part.joints]).ravel()
                / np.tile(part.width[part.joints], len(values))
            )
        return np.concatenate(parts)

    def worst(self, trace: Trace) -> Worst | None:
        """The row that is violated most, or nearest to it; None without limits."""
        found: Worst | None = None
        for kind, values in _values(trace).items():
            part = self._kinds[kind]
            if not len(part.joints) or not len(values):
                continue
            over = np.maximum(values - part.upper, part.lower - values)[:, part.joints] / part.width[part.joints]
            k, i = np.unravel_index(int(over.argmax()), over.shape)
            if found is None or over[k, i] > found.excess:
                joint = int(part.joints[i])
                value = float(values[k, joint])
                limit = (
                    part.upper[joint] if value - part.upper[joint] > part.lower[joint] - value else part.lower[joint]
                )
                found = Worst(float(over[k, i]), kind, int(k) + _first(trace, kind), joint, value, float(limit))
        return found

    def violated(self, trace: Trace) -> NDArray[np.bool_]:
        """Which of the S - 1 intervals begin, or go on, beyond a limit."""
        bad = np.zeros(len(trace.V), dtype=bool)
        for kind, values in _values(trace).items():
            part = self._kinds[kind]
            out = ((values > part.upper + 1e-9 * part.width) | (values < part.lower - 1e-9 * part.width)).any(axis=1)
            where = np.flatnonzero(out) + _first(trace, kind)
            bad[np.minimum(where, len(bad) - 1)] = True
        return bad

    def linear(self, trace: Trace, layout: Layout) -> tuple[sp.csr_matrix, FloatArray, FloatArray]:
        """``lower <= A y <= upper`` for the step from ``trace``, tightened by the margin."""
        blocks, lower, upper, count = [], [], [], 0
        for kind, values in _values(trace).items():
            part = self._kinds[kind]
            j = part.joints
            if not len(j) or not len(values):
                continue
            w = part.width[j]
            numbers = count + np.arange(len(values) * len(j)).reshape(len(values), len(j))
            for block, samples in _derivatives(trace, kind):
                blocks.append((block[:, j, :] / w[None, :, None], numbers[samples[1]], samples[0]))
            lower.append(((part.lower - values)[:, j] / w + self.margin).ravel())
            upper.append(((part.upper - values)[:, j] / w - self.margin).ravel())
            count += numbers.size
        if not count:
            return sp.csr_matrix((0, layout.size)), np.zeros(0), np.zeros(0)
        low, high = np.concatenate(lower), np.concatenate(upper)
        if self.excess(trace).max(initial=-np.inf) <= 0.0:  # what is inside need not go back to the margin
            low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
        middle = 0.5 * (low + high)
        crossed = low > high  # a joint that may not move at all
        low[crossed] = high[crossed] = middle[crossed]
        return layout.rows(blocks, count).tocsr(), low, high


class _Kind:
    """One kind of limit: (nv,) each, and which joints have one."""

    def __init__(self, limits: Limits, kind: str) -> None:
        self.lower: FloatArray = getattr(limits, f"{kind}_lower")
        self.upper: FloatArray = getattr(limits, f"{kind}_upper")
        both = np.isfinite(self.lower) & np.isfinite(self.upper)
        with np.errstate(invalid="ignore"):
            half = np.where(both, 0.5 * (self.upper - self.lower), 1.0)
        self.width = np.maximum(half, 1e-6)
        self.joints: NDArray[np.intp] = np.flatnonzero(np.isfinite(self.lower) | np.isfinite(self.upper))


def _values(trace: Trace) -> dict[str, FloatArray]:
    """What each kind of limit is about, (K, nv)."""
    V = trace.V
    ends = [x[None] for x in (trace.before,) if x is not None], [x[None] for x in (trace.after,) if x is not None]
    chain = np.concatenate([*ends[0], V, *ends[1]])
    if trace.setting.closed and not trace.setting.rest:
        chain = chain[:-1]  # the acceleration at the seam counts once
    return {
        "position": trace.setting.coordinates(trace.Q),
        "velocity": V,
        "acceleration": np.diff(chain, axis=0) / trace.setting.h,
    }


def _first(trace: Trace, kind: str) -> int:
    """The sample of the first row of a kind."""
    return 1 if kind == "acceleration" and trace.before is None else 0


def _derivatives(trace: Trace, kind: str) -> list[tuple[FloatArray, tuple[NDArray[np.int64], NDArray[np.int64]]]]:
    """(blocks (K, nv, r), (samples (K,), rows (K,))): how the rows of a kind depend on the free directions."""
    Z, S, h = trace.Z, trace.setting.size, trace.setting.h
    all_ = np.arange(S)
    if kind == "position":
        return [(Z, (all_, all_))]
    if trace.transports is None:
        behind, ahead = -Z[:-1] / h, Z[1:] / h
    else:
        behind, ahead = trace.transports[0] @ Z[:-1] / h, trace.transports[1] @ Z[1:] / h
    k = np.arange(S - 1)
    if kind == "velocity":
        return [(behind, (k, k)), (ahead, (k + 1, k))]
    first = _first(trace, kind)
    found = []
    rows = S if trace.setting.rest else S - 1 if trace.setting.closed else S - 2
    for block, sample in ((behind, k), (ahead, k + 1)):
        for row, sign in ((k - first, 1.0), (k + 1 - first, -1.0)):  # v_k enters at samples k and k + 1
            if trace.setting.closed and not trace.setting.rest:
                row = row % (S - 1)
            kept = (row >= 0) & (row < rows)
            found.append((sign * block[kept] / h, (sample[kept], row[kept])))
    return found
