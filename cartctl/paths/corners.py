"""The edges of a polygon and the rounding of its corners, over the length along the sharp polygon."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from cartctl.errors import PathError
from cartctl.paths.arguments import SMALLEST, Array, number


class Edge(NamedTuple):
    """A straight edge over sigma in [begin, end], m."""

    origin: Array  # (3,) m
    direction: Array  # (3,) unit
    begin: float
    end: float


class Piece(NamedTuple):
    """p(sigma) = origin + direction x + turn g(x), x = sigma - begin; see :meth:`at` for g.

    Plain floats, since they are evaluated one sample at a time.
    """

    begin: float  # m
    origin: list[float]  # (3,) m
    direction: list[float]  # (3,) unit, at the beginning
    turn: list[float]  # (3,) by how much the direction changes over the width: zero on an edge
    width: float  # m

    def at(self, sigma: float) -> tuple[list[float], list[float], list[float]]:
        """Return p, dp/dsigma and d2p/dsigma2, with g = x^3/w^2 - x^4/(2 w^3), w the width."""
        x = sigma - self.begin
        y = x / self.width
        g, slope, bend = (
            x * y * y * (1.0 - 0.5 * y),
            y * y * (3.0 - 2.0 * y),
            6.0 * y * (1.0 - y) / self.width,
        )
        triples = list(zip(self.origin, self.direction, self.turn, strict=True))
        position = [o + d * x + t * g for o, d, t in triples]
        return position, [d + t * slope for _, d, t in triples], [t * bend for t in self.turn]


def edges_between(vertices: Array, closed: bool) -> list[Edge]:
    """Return the edges in order, a closing one last; raises PathError for too few or coinciding vertices."""
    if len(vertices) < 2:
        raise PathError(f"Polygon vertices has {len(vertices)} point(s): expected at least 2")
    edges: list[Edge] = []
    sigma = 0.0
    corners = [*vertices, vertices[0]] if closed else [*vertices]
    for k, (start, end) in enumerate(pairwise(corners)):
        length = float(np.linalg.norm(end - start))
        if length < SMALLEST:
            other = (k + 1) % len(vertices)
            advice = "a closed polygon does not repeat its first vertex" if other == 0 else "drop one"
            raise PathError(f"Polygon vertices {k} and {other} coincide at {start.tolist()}: {advice}")
        edges.append(Edge(start, (end - start) / length, sigma, sigma + length))
        sigma += length
    return edges


def checked_blend(blend: Any, edges: list[Edge]) -> float:
    """Return the blend in m, 0 for none; raises PathError where it does not fit into an edge."""
    b = number("Polygon blend", blend)
    if b < 0.0:
        raise PathError(f"Polygon blend is {b:g} m: expected zero (a stop at every corner) or more")
    for k, edge in enumerate(edges):
        count = (k > 0) + (k < len(edges) - 1)  # the path's first and last vertex stay sharp
        room = (edge.end - edge.begin) / max(count, 1)
        if count and b > room * (1.0 + 1e-9):
            raise PathError(
                f"Polygon blend is {b:g} m: expected at most {room:g} m, as edge {k} of "
                f"{edge.end - edge.begin:g} m has {count} rounded corner(s)"
            )
    return b if b >= SMALLEST else 0.0


def straight(edge: Edge, begin: float) -> Piece:
    """Return the rest of an edge from sigma = begin."""
    origin = edge.origin + (begin - edge.begin) * edge.direction
    return Piece(begin, origin.tolist(), edge.direction.tolist(), [0.0, 0.0, 0.0], 1.0)


def rounded(edges: list[Edge], blend: float) -> list[Piece]:
    """Return edges and corners in turn, a corner from ``blend`` before its vertex to ``blend`` after."""
    pieces = [straight(edges[0], 0.0)]
    for edge, following in pairwise(edges):
        u, w = edge.direction, following.direction
        origin = following.origin - blend * u
        corner = Piece(edge.end - blend, origin.tolist(), u.tolist(), (w - u).tolist(), 2.0 * blend)
        pieces += [corner, straight(following, following.begin + blend)]
    return pieces
