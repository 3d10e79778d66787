"""A serial chain as a product of elementary motions, for all configurations at once.

    T(q) = prod_k exp(s_k (c_k + x_k + q_k))    a constant, a parameter, a joint coordinate, each or none

s_k a unit screw: a turn about, or a slide along, an axis through the origin of the frame reached so far. A parameter
moves what comes behind it about that axis: with w the axis and p_k the origin in the world, p the end,

    d(p, R)/dx_k = [w x (p - p_k); w]  of a turn,   [w; 0]  of a slide

linear part first, world axes (LOCAL_WORLD_ALIGNED). Denavit-Hartenberg tables, their Hayati rows and the placements of
a URDF are such products, so all regressors are this one line.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray, IntArray
from cartctl.spatial.rotations import rotation_about, skew

AXES = {"x": np.array([1.0, 0.0, 0.0]), "y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}
SIX = ("x", "y", "z", "rx", "ry", "rz")


class Motion(NamedTuple):
    """One factor. turns: or slides. axis: (3,) unit. value: c_k. name: of its parameter, "". joint: number, -1."""

    turns: bool
    axis: FloatArray
    value: float = 0.0
    name: str = ""
    joint: int = -1


class Fixed(NamedTuple):
    """A constant pose (4, 4) between two motions."""

    pose: FloatArray


Step = Motion | Fixed


class Poses(NamedTuple):
    """rotation: (N, 3, 3), position: (N, 3), m, of the chain's end in its base."""

    rotation: FloatArray
    position: FloatArray


def correctable(name: str, pose: FloatArray) -> list[Step]:
    """A pose with six small parameters behind it: ``T . Tx Ty Tz Rx Ry Rz``, named ``name.x`` ... ``name.rz``."""
    steps: list[Step] = [Fixed(pose)]
    steps += [Motion(len(s) == 2, AXES[s[-1]], name=f"{name}.{s}") for s in SIX]
    return steps


def corrected(pose: FloatArray, six: Sequence[float] | FloatArray) -> FloatArray:
    """The pose (4, 4) that :func:`correctable` stands for at the parameters ``six`` (6,), m and rad."""
    T = pose.copy()
    for s, x in zip(SIX, six, strict=True):
        T = T @ placed(len(s) == 2, AXES[s[-1]], float(x))
    return np.asarray(T)


def placed(turns: bool, axis: FloatArray, value: float) -> FloatArray:
    """One elementary motion, (4, 4)."""
    T = np.eye(4)
    if turns:
        T[:3, :3] = rotation_about(axis, value)
    else:
        T[:3, 3] = value * axis
    return T


class Product:
    """steps: the factors from the base to the end. names: of the parameters in their order, angles: which are rad."""

    def __init__(self, steps: Sequence[Step], n: int) -> None:
        self.steps, self.n = tuple(steps), n
        motions = [s for s in self.steps if isinstance(s, Motion) and s.name]
        self.names = tuple(m.name for m in motions)
        self.angles = np.array([m.turns for m in motions], dtype=bool)

    def poses(self, q: FloatArray) -> Poses:
        """At q (N, n), rad or m, with all parameters as the steps have them."""
        return self._walk(q, None, None)[0]

    def regressor(self, q: FloatArray, chosen: IntArray, x: FloatArray | None = None) -> tuple[Poses, FloatArray]:
        """Poses at ``x`` (p,) (zeros if None) and their derivative (N, 6, len(chosen)) by the chosen parameters."""
        poses, marks = self._walk(q, set(chosen.tolist()), x)
        Phi = np.zeros((len(q), 6, len(chosen)))
        for column, k in enumerate(chosen.tolist()):
            axis, origin, turns = marks[k]
            if turns:
                Phi[:, :3, column] = _cross(axis, poses.position - origin)
                Phi[:, 3:, column] = axis
            else:
                Phi[:, :3, column] = axis
        return poses, Phi

    def at(self, q: FloatArray, x: FloatArray) -> Poses:
        """Poses at the parameters x (p,)."""
        return self._walk(q, None, x)[0]

    def _walk(
        self, q: FloatArray, watched: set[int] | None, x: FloatArray | None
    ) -> tuple[Poses, dict[int, tuple[FloatArray, FloatArray, bool]]]:
        count = len(q)
        R, p = np.broadcast_to(np.eye(3), (count, 3, 3)).copy(), np.zeros((count, 3))
        marks: dict[int, tuple[FloatArray, FloatArray, bool]] = {}
        k = -1
        for step in self.steps:
            if isinstance(step, Fixed):
                p = p + R @ step.pose[:3, 3]
                R = _times(R, step.pose[:3, :3])
                continue
            value = step.value
            if step.name:
                k += 1
                value += 0.0 if x is None else float(x[k])
                if watched and k in watched:
                    marks[k] = (R @ step.axis, p, step.turns)  # p and R are replaced below, never written to
            if step.joint < 0:
                if value:
                    if step.turns:
                        R = _times(R, rotation_about(step.axis, value))
                    else:
                        p = p + R @ (value * step.axis)
                continue
            values = q[:, step.joint] + value
            if step.turns:
                R = R @ _rotations(step.axis, values)
            else:
                p = p + (R @ step.axis) * values[:, None]
        return Poses(R, p), marks


def _times(R: FloatArray, A: FloatArray) -> FloatArray:
    """All (N, 3, 3) times one (3, 3), as one product of matrices."""
    return (R.reshape(-1, 3) @ A).reshape(R.shape)


def _rotations(axis: FloatArray, angles: FloatArray) -> FloatArray:
    """Rodrigues' formula for angles (N,), (N, 3, 3)."""
    K = skew(axis)
    s, c = np.sin(angles)[:, None, None], 1.0 - np.cos(angles)[:, None, None]
    return np.asarray(np.eye(3) + s * K + c * (K @ K))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Row by row, (N, 3)."""
    out = np.empty_like(a)
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        out[:, i] = a[:, j] * b[:, k] - a[:, k] * b[:, j]
    return out
