"""Polyhedra inside the unit ball: few rows ``|n_i . x| <= h`` that keep ||x|| <= 1 whatever the direction of x.

The polar dual of the hull of +-n_i: h is the hull's inradius. Rows along the present or the wanted direction would be
fewer, but leave every other direction open.

| facets | rows | shape | h, the least share of the ball's radius that is allowed |
|---|---|---|---|
| 6 | 3 | cube | 0.577 |
| 12 | 6 | dodecahedron | 0.795 |
| 32 | 16 | truncated icosahedron | 0.923 |

The share is h along a facet's normal and 1 along a vertex.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray

_PHI = (1.0 + 5.0**0.5) / 2.0


class Polyhedron(NamedTuple):
    """``|normals @ x| <= height`` implies ||x|| <= 1; normals (r, 3), of unit length."""

    normals: FloatArray
    height: float


def _cycled(*triples: tuple[float, float, float]) -> FloatArray:
    """Each triple in its three cyclic orders, as unit vectors."""
    rows: FloatArray = np.array([np.roll(triple, k) for triple in triples for k in range(3)])
    rows = rows / np.linalg.norm(rows, axis=1)[:, None]
    rows.flags.writeable = False
    return rows


_FIVEFOLD = ((0.0, 1.0, _PHI), (0.0, 1.0, -_PHI))  # one of each two opposite vertices of an icosahedron
_THREEFOLD = ((0.0, _PHI, 1.0 / _PHI), (0.0, _PHI, -1.0 / _PHI))  # of a dodecahedron, with the diagonals of a cube
_DIAGONALS = np.array([[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]]) / 3.0**0.5

INSIDE_BALL = {
    6: Polyhedron(np.eye(3), 3.0**-0.5),
    12: Polyhedron(_cycled(*_FIVEFOLD), ((5.0 + 2.0 * 5.0**0.5) / 15.0) ** 0.5),
    32: Polyhedron(np.concatenate([_cycled(*_FIVEFOLD, *_THREEFOLD), _DIAGONALS]), 0.92260219454398),
}
