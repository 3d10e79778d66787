"""A coarse search among all postures: dynamic programming on a grid of self-motion, where one degree is left.

Curves of self-motion at a few instants are carried along the path by Newton's method, so that every sample has a layer
of configurations on its task. Bellman's recursion then finds the least sum of ``h (1/2 v^T W v + H)`` from layer to
layer, v the difference over h. A path that is best of its kind, in another posture than those found before, becomes a
start. With more degrees left, the starts are random postures carried along.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray
from cartctl.wholepath.costs.base import PathCost
from cartctl.wholepath.manifold import newton
from cartctl.wholepath.selfmotion import curves, inside, random_postures
from cartctl.wholepath.setting import Setting

LAYERS = 41
_POINTS = 240  # of a layer
_RANDOM = 16  # random postures tried at each of the instants
_APART = 0.4  # rad or m: ends that may be made to meet
_JUMP = 0.8  # rad or m: no edge is longer
_HASTE = 1.5  # edges may be this much faster than the limits: the grid is coarse
_KEPT = 8  # paths that become starts
_OTHER = 0.8  # rad or m at some sample: paths that are not alike
_LOOKED_AT = 300  # of the cheapest, for paths that are not alike
_ENDS = 24  # first configurations from which closed paths are sought


class Found(NamedTuple):
    """A path Q (L, nq) through all layers, and its cost on the grid."""

    Q: FloatArray
    cost: float


def searched(setting: Setting, cost: PathCost, known: list[FloatArray], rng: np.random.Generator) -> list[Found]:
    """Up to eight paths, best first; ``known`` paths (L, nq) each pass through the grid too."""
    layers = _layers(setting, known, rng)
    if any(len(layer) == 0 for layer in layers):
        return []
    return _recursion(setting, cost, layers)


def carried(setting: Setting, k: int, Q: FloatArray) -> dict[int, FloatArray]:
    """Configurations of sample k carried to all others, those lost on the way left out: sample -> (G, nq)."""
    found = {k: Q}
    for way in (1, -1):
        now, j = Q, k + way
        while 0 <= j < setting.size and len(now):
            now, met = newton(setting, j, now, rounds=6)
            now = now[met & inside(setting, now)]
            found[j] = now
            j += way
    return found


def _layers(setting: Setting, known: list[FloatArray], rng: np.random.Generator) -> list[FloatArray]:
    last = setting.size - 1
    instants = sorted({0, last // 2, last})
    parts: list[list[FloatArray]] = [[Q[k][None] for Q in known] for k in range(setting.size)]
    for k in instants:
        starts = [*(Q[k] for Q in known), *random_postures(setting, k, _RANDOM, rng)]
        if not starts:
            continue
        grid = curves(setting, k, np.array(starts)).Q
        grid = grid[:: max(1, -(-len(grid) * len(instants) // _POINTS))]
        for j, Q in carried(setting, k, grid).items():
            parts[j].append(Q)
    if setting.start is not None:
        parts[0] = [setting.start[None]]
        if setting.closed:
            parts[-1] = [setting.start[None]]
    empty = np.zeros((0, setting.robot.nq))
    return [np.concatenate(part) if part else empty for part in parts]


def _recursion(setting: Setting, cost: PathCost, layers: list[FloatArray]) -> list[Found]:
    """Bellman's: the best path through every configuration halfway; if closed and free, from some first ones."""
    nodes, paces = _weighed(setting, cost, layers)
    edges = []
    for k in range(len(layers) - 1):
        moves = _edges(setting, layers[k], layers[k + 1], paces[k], paces[k + 1])
        edges.append(moves + 0.5 * setting.h * (nodes[k][:, None] + nodes[k + 1][None]))
    if setting.closed and len(layers[0]) > 1:
        return _loops(setting, layers, edges, paces)
    return _passages(setting, layers, edges)


def _passages(setting: Setting, layers: list[FloatArray], edges: list[FloatArray]) -> list[Found]:
    """The best path through each configuration halfway: forward to it, and backward from the end."""
    middle = len(layers) // 2
    J, came = np.zeros(len(layers[0])), []
    for E in edges[:middle]:
        through = J[:, None] + E
        came.append(through.argmin(axis=0))
        J = through.min(axis=0)
    B, goes = np.zeros(len(layers[-1])), []
    for E in reversed(edges[middle:]):
        through = E + B[None]
        goes.append(through.argmin(axis=1))
        B = through.min(axis=1)

    def path(node: int) -> FloatArray:
        way, ahead = [node], [node]
        for step in reversed(came):
            way.append(int(step[way[-1]]))
        for step in reversed(goes):
            ahead.append(int(step[ahead[-1]]))
        return _along(setting, layers, [*way[::-1], *ahead[1:]])

    return _distinct(setting, J + B, path)


def _loops(setting: Setting, layers: list[FloatArray], edges: list[FloatArray], paces: list[FloatArray]) -> list[Found]:
    """The best path from each of some first configurations back to where it began, or near."""
    ends = np.linspace(0, len(layers[0]) - 1, min(_ENDS, len(layers[0]))).astype(int)
    J = np.full((len(ends), len(layers[0])), np.inf)
    J[np.arange(len(ends)), ends] = 0.0
    came = []
    for E in edges:
        step = np.array([(row[:, None] + E).argmin(axis=0) for row in J])
        J = np.array([row[s] + E[s, np.arange(E.shape[1])] for row, s in zip(J, step, strict=True)])
        came.append(step)
    away = _distances(setting, layers[0][ends], layers[-1])
    inertia = float(np.median(np.trace(paces[0], axis1=1, axis2=2)))
    J = np.where(away < _APART, J + 0.5 * away**2 * inertia / setting.h, np.inf)

    def path(flat: int) -> FloatArray:
        row, node = divmod(flat, J.shape[1])
        way = [node]
        for step in reversed(came):
            way.append(int(step[row, way[-1]]))
        return _along(setting, layers, way[::-1])

    return _distinct(setting, J.ravel(), path)


def _along(setting: Setting, layers: list[FloatArray], way: list[int]) -> FloatArray:
    """The path through these configurations, without jumps by whole turns."""
    robot, Q = setting.robot, [layers[0][way[0]]]
    for layer, i in zip(layers[1:], way[1:], strict=True):
        Q.append(robot.integrate(Q[-1], setting.shortest(robot.difference(Q[-1], layer[i]))))
    return np.array(Q)


def _distinct(setting: Setting, J: FloatArray, path: Callable[[int], FloatArray]) -> list[Found]:
    """The cheapest paths that are not alike."""
    found: list[Found] = []
    for index in np.argsort(J)[:_LOOKED_AT].tolist():
        if not np.isfinite(J[index]) or len(found) >= _KEPT:
            break
        Q = path(index)
        if setting.closed and np.linalg.norm(setting.robot.difference(Q[0], Q[-1])) > 2.0 * _APART:
            continue  # a joint went round once
        if all(_far(setting, Q, other.Q) for other in found):
            found.append(Found(Q, float(J[index])))
    return found


def _far(setting: Setting, Q: FloatArray, other: FloatArray) -> bool:
    return max(setting.apart(a, b) for a, b in zip(Q, other, strict=True)) > _OTHER


def _weighed(setting: Setting, cost: PathCost, layers: list[FloatArray]) -> tuple[list[FloatArray], list[FloatArray]]:
    """Cost of standing there, and W of moving there, of every configuration of every layer."""
    nodes, paces = [], []
    state, n = setting.state, setting.robot.nv
    for k, layer in enumerate(layers):
        values, weights = np.empty(len(layer)), np.empty((len(layer), n, n))
        for i, q in enumerate(layer):
            state.set(q, setting.robot_rest, float(setting.times[k]))
            values[i] = cost.node(state)
            W = cost.pace(state)
            weights[i] = 1e-3 * np.eye(n) if W is None else W
        nodes.append(np.nan_to_num(values, nan=1e30, posinf=1e30, neginf=-1e30))
        paces.append(weights)
    return nodes, paces


def _edges(setting: Setting, Q: FloatArray, R: FloatArray, WQ: FloatArray, WR: FloatArray) -> FloatArray:
    """``h/2 v^T W v`` (G, G'); inf where an edge is too long or too fast."""
    robot, h = setting.robot, setting.h
    if robot.single.all():
        delta = setting.coordinates(R)[None] - setting.coordinates(Q)[:, None]
    else:
        delta = np.array([[robot.difference(a, b) for b in R] for a in Q])
    delta = setting.shortest(delta)
    value = (
        0.25
        / h
        * (
            np.einsum("abi,aij,abj->ab", delta, WQ, delta, optimize=True)
            + np.einsum("abi,bij,abj->ab", delta, WR, delta, optimize=True)
        )
    )
    longest = np.abs(delta).max(axis=2)
    barred = longest > _JUMP
    if setting.limits is not None:
        top = np.maximum(setting.limits.velocity_upper, -setting.limits.velocity_lower)
        barred |= (np.abs(delta) > _HASTE * h * top).any(axis=2)
    return np.where(barred, np.inf, value)


def _distances(setting: Setting, Q: FloatArray, R: FloatArray) -> FloatArray:
    return np.array([[setting.apart(a, b) for b in R] for a in Q])
