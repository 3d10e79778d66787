"""The least cost of a planar 3R's path by dense-grid dynamic programming: independent of the package's planner.

First the whole circle of phi, coarsely; then, around the best path of that, ever finer grids.

The self-motion of a 3R whose tip follows p(t) is the absolute angle phi of its last link, with the elbow up or down:
the first two links then reach the wrist by the law of cosines. Every sample has a grid over phi and the elbow;
Bellman's recursion adds up ``h/4 v^T (W_k + W_{k+1}) v`` from sample to sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class Layer:
    """q (2 G, 3), the elbow's two ways one after the other, nan where out of reach; W (2 G, 3, 3)."""

    q: np.ndarray
    W: np.ndarray


def at(lengths, p, phi):
    """(2, K, 3): the joint angles for tip position p (2,) and last-link angles phi (K,), elbow up and down."""
    l1, l2, l3 = lengths
    wx, wy = p[0] - l3 * np.cos(phi), p[1] - l3 * np.sin(phi)
    c2 = (wx**2 + wy**2 - l1**2 - l2**2) / (2.0 * l1 * l2)
    with np.errstate(invalid="ignore"):
        elbow = np.arccos(c2)
    both = []
    for q2 in (elbow, -elbow):
        q1 = np.arctan2(wy, wx) - np.arctan2(l2 * np.sin(q2), l1 + l2 * np.cos(q2))
        both.append(np.stack([q1, q2, phi - q1 - q2], axis=1))
    return np.array(both)


def configurations(lengths, p, count):
    """(2 count, 3) joint angles for tip position p (2,)."""
    return np.concatenate(at(lengths, p, np.linspace(-np.pi, np.pi, count, endpoint=False)))


def wrapped(angle):
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def best_path(lengths, points, h, weight, count, window, start=None, end=None):
    """The path (S, 3) of least cost over the whole grid; weight(q (K, 3)) -> (K, 3, 3). start, end: (3,), or free.

    Neighbouring layers are joined ``window`` grid steps each way, from elbow up to down and back, too.
    """
    layers = []
    for p in points:
        q = configurations(lengths, p, count)
        W = np.zeros((len(q), 3, 3))
        fine = np.isfinite(q).all(axis=1)
        W[fine] = weight(q[fine])
        layers.append(Layer(q, W))
    if start is not None:
        layers[0] = Layer(start[None], weight(start[None]))
    if end is not None:
        layers[-1] = Layer(end[None], weight(end[None]))
    J = np.where(np.isfinite(layers[0].q).all(axis=1), 0.0, np.inf)
    came = []
    for a, b in zip(layers[:-1], layers[1:], strict=True):
        J, step = advance(a, b, J, h, count, window)
        came.append(step)
    way = [int(J.argmin())]
    for step in reversed(came):
        way.append(int(step[way[-1]]))
    return np.array([layer.q[i] for layer, i in zip(layers, way[::-1], strict=True)]), float(J.min())


def advance(a, b, J, h, count, window):
    """Least cost to every configuration of b, and where from."""
    n = len(b.q)
    best, came = np.full(n, np.inf), np.zeros(n, dtype=int)

    def take(i, j, cost):
        better = cost < best[j]
        best[j[better]], came[j[better]] = cost[better], i[better]

    if len(a.q) == 1 or n == 1:
        for i in range(len(a.q)):
            take(np.full(n, i), np.arange(n), J[i] + edge(a.q[i][None], a.W[i][None], b.q, b.W, h))
        return best, came
    rows = np.arange(count)
    for shift in range(-window, window + 1):
        for way in (0, count):
            for other in (0, count):
                i, j = way + (rows + shift) % count, other + rows
                take(i, j, J[i] + edge(a.q[i], a.W[i], b.q[j], b.W[j], h))
    return best, came


def edge(q, Wq, r, Wr, h):
    v = wrapped(r - q) / h
    cost = 0.25 * h * np.einsum("...i,...ij,...j->...", v, Wq + Wr, v)
    return np.where(np.isfinite(cost), cost, np.inf)


def zoomed(lengths, points, h, weight, path, radius, rounds=9, count=61, start=None, end=None):
    """The least cost near a path (S, 3) of joint angles: ever finer grids around the best of the last one."""
    signs = np.where(wrapped(path[:, 1]) >= 0.0, 0, 1)
    phi = path.sum(axis=1)
    cost = np.inf
    for _ in range(rounds):
        offsets = np.linspace(-radius, radius, count)
        layers = []
        for p, middle, sign in zip(points, phi, signs, strict=True):
            q = at(lengths, p, middle + offsets)[sign]
            W = np.zeros((count, 3, 3))
            fine = np.isfinite(q).all(axis=1)
            W[fine] = weight(q[fine]) if fine.any() else 0.0
            layers.append(Layer(q, W))
        if start is not None:
            layers[0] = Layer(np.repeat(start[None], count, axis=0), weight(np.repeat(start[None], count, axis=0)))
        if end is not None:
            layers[-1] = Layer(np.repeat(end[None], count, axis=0), weight(np.repeat(end[None], count, axis=0)))
        J, came = np.zeros(count), []
        for a, b in zip(layers[:-1], layers[1:], strict=True):
            through = J[:, None] + edge(a.q[:, None], a.W[:, None], b.q[None], b.W[None], h)
            came.append(through.argmin(axis=0))
            J = through.min(axis=0)
        cost, best = float(J.min()), [int(J.argmin())]
        for step in reversed(came):
            best.append(int(step[best[-1]]))
        chosen = offsets[best[::-1]]
        phi = phi + chosen
        if np.abs(chosen).max() < 0.9 * radius:
            radius *= 0.35
    return cost
