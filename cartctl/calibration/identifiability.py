"""Which parameters the measurements can tell apart.

The stacked regressor H has its columns scaled to unit norm, so that metres and radians compare, H D = U Sigma V^T.
Directions with sigma_i <= tolerance sigma_1 move no measurement: the estimate stays at the nominal values along them,

    delta = D V_r z,    z (r,) free

and its null space, reduced to as few parameters a direction as pivoting finds, says which ones are indistinguishable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lu_factor, lu_solve, qr

from cartctl.calibration.tall import tall_r
from cartctl.checks import FloatArray

_SHARE = 1e-6  # of a null direction's largest entry, below which a parameter has no part in it
_TIE = 1e-6  # by how much more a parameter counts than the one before it


@dataclass(frozen=True)
class Indistinct:
    """A change of several parameters that no measurement sees; of one parameter alone, if it has no effect.

    parameters: their names. direction: how they change together, m and rad, the largest by 1.
    """

    parameters: tuple[str, ...]
    direction: tuple[float, ...]

    def __str__(self) -> str:
        if len(self.parameters) == 1:
            return f"{self.parameters[0]} has no effect on the measurements"
        change = " ".join(f"{x:+.3g} {name}" for name, x in zip(self.parameters, self.direction, strict=True))
        return f"{', '.join(self.parameters)} cannot be told apart: {change} changes nothing"


@dataclass(frozen=True, eq=False)
class Identifiability:
    """basis: (p, r), the changes D V_r that are seen, in m and rad. scale: (p,) D. values: (p,) sigma, descending.

    seen: (p,) which parameters are determined by themselves. unidentifiable: the directions that are not. independent:
    r parameters that the data tell apart once the others are fixed.
    """

    basis: FloatArray
    scale: FloatArray
    values: FloatArray
    seen: np.ndarray
    unidentifiable: tuple[Indistinct, ...]
    independent: tuple[str, ...]

    @property
    def rank(self) -> int:
        """How many directions are seen, r."""
        return int(self.basis.shape[1])

    @property
    def condition(self) -> float:
        """sigma_1 / sigma_r of the scaled regressor; 1 where nothing is seen."""
        return float(self.values[0] / self.values[self.rank - 1]) if self.rank else 1.0


def identify(H: FloatArray, names: Sequence[str], tolerance: float) -> Identifiability:
    """Rank and null space of the stacked regressor H (rows, p)."""
    norms = np.linalg.norm(H, axis=0)
    # a column that is round-off beside the others is zero, not a parameter of its own
    active = norms > 1e-12 * norms.max(initial=0.0)
    scale = np.where(active, 1.0 / np.where(active, norms, 1.0), 1.0)
    p = H.shape[1]
    R = tall_r(np.where(active, H * scale, 0.0))
    _, sigma, Vt = np.linalg.svd(R, full_matrices=True)
    values = np.zeros(p)
    values[: len(sigma)] = sigma
    rank = int((values > tolerance * values[0]).sum()) if p and values[0] > 0.0 else 0
    null = Vt[rank:].T
    seen = np.linalg.norm(null, axis=1) <= _SHARE if null.size else np.ones(p, dtype=bool)
    found, pivots = _relations(null, scale, names)
    return Identifiability(
        basis=scale[:, None] * Vt[:rank].T,
        scale=scale,
        values=values,
        seen=seen,
        unidentifiable=tuple(Indistinct(*one) for one in found),
        independent=tuple(name for i, name in enumerate(names) if i not in pivots),
    )


def _relations(
    null: FloatArray, scale: FloatArray, names: Sequence[str]
) -> tuple[list[tuple[tuple[str, ...], tuple[float, ...]]], set[int]]:
    """The null space (p, k) as k directions, each with a parameter of its own and few others; and these parameters."""
    k = null.shape[1]
    if not k:
        return [], set()
    # of parameters that do the same, round-off would choose: the later ones are taken for the directions' own
    later = 1.0 + _TIE * np.arange(len(null))
    pivots = qr(null.T * later, mode="r", pivoting=True)[1][:k]
    reduced = lu_solve(lu_factor(null[pivots].T), null.T).T  # the pivots' rows become unit vectors
    found = []
    for column in reduced.T:
        part = np.flatnonzero(np.abs(column) > _SHARE * np.abs(column).max())
        change = column[part] * scale[part]
        change = change / change[np.argmax(np.abs(change))]
        found.append((tuple(names[int(i)] for i in part), tuple(float(x) for x in change)))
    return sorted(found, key=lambda one: (len(one[0]), one[0])), {int(i) for i in pivots}
