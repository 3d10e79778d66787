"""Velocity and force ellipsoids at the hands of a run, as translucent balls that move and change their shape."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin

from cartctl.analysis.ellipsoids import velocity_ellipsoid
from cartctl.model.state import State
from cartctl.report import shapes
from cartctl.report.actor import rgb
from cartctl.report.elements import solid
from cartctl.report.mesh import Array, IntArray, shade, weld
from cartctl.report.palette import COLORS
from cartctl.report.timeline import Timeline

if TYPE_CHECKING:
    from cartctl.motion.run import Run, TaskRecord

VELOCITY, FORCE = COLORS[2], COLORS[3]
_SIZE = 0.24  # of the stage: the longest semi-axis that is drawn of velocities
_MOST, _LEAST = 0.32, 2e-3  # of the stage: longer semi-axes are cut, shorter ones would vanish
_MEDIAN = 0.12  # of the stage: the middle semi-axis of forces, half the time


class Shape(NamedTuple):
    """An ellipsoid at every frame shown: rotations (k, 4) as x y z w, semi-axes (k, 3) as drawn, m.

    unit: what one metre of the picture stands for, m/s of a hand with joint rates of norm 1, or N of one with joint
    torques of norm 1.
    """

    quaternions: Array
    lengths: Array
    unit: float


def shapes_of(run: Run, record: TaskRecord, shown: IntArray, size: float) -> tuple[Shape, Shape]:
    """Return the velocity and the force ellipsoid of a hand's position; size: of the stage, m.

    ``{J v : |v| <= 1}`` and ``{f : |J^T f| <= 1}`` with the three linear rows of J: the same axes, one over the
    lengths (Yoshikawa 1985).
    """
    state, turns, lengths = State(run.robot), [], []
    previous = np.eye(3)
    for k in shown:
        state.set(run.q[k], run.v[k])
        found = velocity_ellipsoid(state.jacobian(str(record.frame))[:3])
        order, signs = _nearest(found.axes, previous)
        previous = found.axes[:, order] * signs
        turns.append(pin.Quaternion(previous).coeffs())
        lengths.append(found.lengths[order])
    quaternions, reach = np.array(turns), np.array(lengths)
    scale = _SIZE * size / max(float(reach.max()), 1e-12)
    with np.errstate(divide="ignore"):
        bears = 1.0 / reach
    strong = (
        _MEDIAN * size / max(float(np.median(bears[np.isfinite(bears)])) if np.isfinite(bears).any() else 1.0, 1e-12)
    )
    clip = (_LEAST * size, _MOST * size)
    return (
        Shape(quaternions, np.clip(scale * reach, *clip), 1.0 / scale),
        Shape(quaternions, np.clip(strong * bears, *clip), 1.0 / strong),
    )


def draw(node: Any, timeline: Timeline, shape: Shape, positions: Array, color: str) -> None:
    """Draw an ellipsoid about ``positions`` (k, 3)."""
    node.set_object(solid(shade(weld(shapes.sphere(1.0, rgb(color)))), 0.32))
    node["<object>"].set_property("castShadow", False)
    start = np.eye(4)
    start[:3, :3] = pin.Quaternion(shape.quaternions[0]).matrix() * shape.lengths[0]
    start[:3, 3] = positions[0]
    node.set_transform(start)
    timeline.move(node, positions, shape.quaternions)
    timeline.stretch(node, shape.lengths)


def _nearest(axes: Array, previous: Array) -> tuple[IntArray, Array]:
    """The order and the signs by which axes (3, 3) are a rotation, turned least from the previous one.

    Axes have neither: without this the ball would spin from frame to frame.
    """
    order = np.empty(3, dtype=np.int64)
    match = np.abs(previous.T @ axes)
    for _ in range(3):
        i, j = np.unravel_index(int(match.argmax()), match.shape)
        order[i] = j
        match[i, :], match[:, j] = -1.0, -1.0
    signs = np.sign(np.einsum("ij,ij->j", axes[:, order], previous))
    signs[signs == 0.0] = 1.0
    if np.linalg.det(axes[:, order] * signs) < 0.0:
        signs[2] = -signs[2]
    return order, signs
