"""What was measured, as residuals and their derivatives: poses, positions, distances.

    pose      e = [p_m - p; log3(R_m R^T)]     (6,), m and rad, world axes
    position  e = p_m - p                      (3,), m
    distance  e = l_m - |p - anchor|           (1,), m

and e(x + dx) = e(x) - H dx to first order, H from the chain's regressor Phi. The angle's derivative is exact away from
zero error, too: d log3(R_m R^T) = -J_r^-1(e) w (Chirikjian 2012).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from cartctl import checks
from cartctl.calibration.motions import Poses
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError, ShapeError

KINDS = ("pose", "position", "distance")
_ROTATION = 1e-4  # how far a measured rotation may be from one; it is then made one
_LARGEST = 1e6  # m


@dataclass(frozen=True, eq=False)
class Measurements:
    """N measurements of one kind. position: (N, 3), rotation: (N, 3, 3), length: (N,), anchor: (N, 3); m."""

    kind: str
    position: FloatArray
    rotation: FloatArray
    length: FloatArray
    anchor: FloatArray

    def __len__(self) -> int:
        return len(self.position)

    @property
    def rows(self) -> int:
        """Numbers in one measurement."""
        return {"pose": 6, "position": 3, "distance": 1}[self.kind]

    @property
    def parts(self) -> dict[str, slice]:
        """Rows of each unit."""
        return {"m": slice(0, 3), "rad": slice(3, 6)} if self.kind == "pose" else {"m": slice(0, self.rows)}

    @property
    def values(self) -> FloatArray:
        """As :func:`cartctl.calibrate` takes them: (N, 4, 4), (N, 3) or (N,)."""
        if self.kind == "position":
            return self.position
        if self.kind == "distance":
            return self.length
        T = np.tile(np.eye(4), (len(self), 1, 1))
        T[:, :3, :3], T[:, :3, 3] = self.rotation, self.position
        return T

    def part(self, which: Any) -> Measurements:
        """The measurements with the given numbers."""
        arrays = (self.position, self.rotation, self.length, self.anchor)
        return Measurements(self.kind, *(array[which] for array in arrays))

    def residuals(self, poses: Poses) -> FloatArray:
        """Measured minus computed, (N, rows)."""
        if self.kind == "position":
            return self.position - poses.position
        if self.kind == "distance":
            return np.asarray((self.length - np.linalg.norm(poses.position - self.anchor, axis=1))[:, None])
        turn = Rotation.from_matrix(self.rotation @ np.swapaxes(poses.rotation, 1, 2)).as_rotvec()
        return np.concatenate([self.position - poses.position, turn], axis=1)

    def derivative(self, poses: Poses, Phi: FloatArray, residuals: FloatArray) -> FloatArray:
        """``H`` (N, rows, p), how the computed values change."""
        if self.kind == "position":
            return Phi[:, :3]
        if self.kind == "distance":
            arm = poses.position - self.anchor
            length = np.linalg.norm(arm, axis=1)
            unit = arm / np.where(length > 0.0, length, 1.0)[:, None]  # at the anchor itself no direction is seen
            return np.asarray(np.einsum("ni,nij->nj", unit, Phi[:, :3])[:, None])
        H = Phi.copy()
        H[:, 3:] = _right_inverse(residuals[:, 3:]) @ Phi[:, 3:]
        return np.asarray(H)


def read(kind: Any, values: Any, count: int, anchor: Any = None) -> Measurements:
    """``values`` of ``count`` measurements; see :func:`cartctl.calibrate` for their shapes.

    Raises ParameterError, ShapeError, NonFiniteError.
    """
    kind = _by_shape(values) if kind is None else checks.choice("kind", kind, KINDS)
    if anchor is not None and kind != "distance":
        raise ParameterError(f"anchor is given with kind={kind!r}; expected it with kind='distance' only")
    position, rotation = np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1))
    length, anchors = np.zeros(count), np.zeros((count, 3))
    if kind == "pose":
        position, rotation = _poses(values, count)
    elif kind == "position":
        position = _sound("measurements", values, (count, 3))
    else:
        length = _sound("measurements", values, (count,))
        if (length < 0.0).any():
            raise ParameterError(f"measurements[{int(np.argmin(length))}] is {length.min():g}; expected distances >= 0")
        if anchor is not None:
            fixed = checks.floats("anchor", anchor)
            anchors = _sound("anchor", np.tile(fixed, (count, 1)) if fixed.ndim == 1 else fixed, (count, 3))
    return Measurements(kind, position, rotation, length, anchors)


def _by_shape(values: Any) -> str:
    """(N,) numbers are distances, (N, 3) positions, all else should be poses."""
    if not isinstance(values, np.ndarray):
        items = checks.listed("measurements", values)
        if any(hasattr(item, "homogeneous") for item in items):
            return "pose"
        values = checks.floats("measurements", items)
    return "distance" if values.ndim == 1 else "position" if values.shape[1:] in ((3,), (2,)) else "pose"


def _poses(values: Any, count: int) -> tuple[FloatArray, FloatArray]:
    """(N, 4, 4), N pin.SE3, or (N, 7): x y z and a quaternion x y z w."""
    if not isinstance(values, np.ndarray):
        values = np.array([getattr(v, "homogeneous", v) for v in checks.listed("measurements", values)])
    array = checks.floats("measurements", values)
    if array.shape == (count, 7):
        array = _sound("measurements", array, (count, 7))
        norm = np.linalg.norm(array[:, 3:], axis=1)
        if (np.abs(norm - 1.0) > 1e-2).any():
            k = int(np.argmax(np.abs(norm - 1.0)))
            raise ParameterError(f"the quaternion of measurements[{k}] has norm {norm[k]:.4g}; expected 1 (x y z w)")
        return array[:, :3], np.ascontiguousarray(Rotation.from_quat(array[:, 3:]).as_matrix())
    if array.shape != (count, 4, 4):
        raise ShapeError(
            f"measurements has shape {array.shape}; expected ({count}, 4, 4), {count} pin.SE3, or ({count}, 7): x y z "
            "and the quaternion x y z w, one for each row of q"
        )
    array = _sound("measurements", array, (count, 4, 4))
    R = array[:, :3, :3]
    off = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2)) + (np.linalg.det(R) < 0.0)
    off = np.maximum(off, np.abs(array[:, 3] - (0.0, 0.0, 0.0, 1.0)).max(axis=1))
    if off.max() > _ROTATION:
        k = int(np.argmax(off))
        raise ParameterError(
            f"measurements[{k}] is no pose: off R^T R = I, det R = 1 and a last row 0 0 0 1 by {off[k]:.2g}; expected "
            "rotation matrices and origins in m"
        )
    R = np.ascontiguousarray(Rotation.from_matrix(array[:, :3, :3]).as_matrix())
    return np.ascontiguousarray(array[:, :3, 3]), R


def _sound(name: str, values: Any, shape: tuple[int, ...]) -> FloatArray:
    array = checks.floats(name, values)
    if array.shape != shape:
        planar = "; give positions in a plane a z of 0" if array.shape == (shape[0], 2) else ""
        raise ShapeError(f"{name} has shape {array.shape}; expected {shape}, one entry for each row of q{planar}")
    flat = np.isfinite(array)
    if not flat.all():
        checks.matrix(name, array.reshape(len(array), -1))
    if array.size and float(np.abs(array).max()) > _LARGEST:
        k = int(np.argmax(np.abs(array).reshape(len(array), -1).max(axis=1)))
        raise ParameterError(f"{name}[{k}] holds {np.abs(array).max():g}; expected metres of at most {_LARGEST:g}")
    return array


def _right_inverse(phi: FloatArray) -> FloatArray:
    """``J_r^-1 = I + S(phi)/2 + c S(phi)^2``, c = 1/t^2 - (1 + cos t)/(2 t sin t), t = |phi| (N,)."""
    t = np.linalg.norm(phi, axis=1)
    small = t < 1e-2
    safe = np.where(small, 1.0, t)
    half = 0.5 * safe
    c = np.where(small, 1.0 / 12.0 + t * t / 720.0, (1.0 - half / np.tan(half)) / (safe * safe))
    S = np.zeros((len(phi), 3, 3))
    S[:, 0, 1], S[:, 0, 2], S[:, 1, 2] = -phi[:, 2], phi[:, 1], -phi[:, 0]
    S[:, 1, 0], S[:, 2, 0], S[:, 2, 1] = phi[:, 2], -phi[:, 1], phi[:, 0]
    return np.asarray(np.eye(3) + 0.5 * S + c[:, None, None] * (S @ S))
