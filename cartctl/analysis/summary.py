"""All of it at one configuration of a robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cartctl import checks
from cartctl.analysis.ellipsoids import Ellipsoid, force_ellipsoid, velocity_ellipsoid
from cartctl.analysis.kinematic import POSE_NAMES, KinematicSingularity, kinematic_singularity
from cartctl.analysis.spectrum import Spectrum, spectrum
from cartctl.checks import FloatArray

if TYPE_CHECKING:
    from cartctl.model.state import State


@dataclass(frozen=True, eq=False)
class Block:
    """The linear or the angular rows of a Jacobian on their own, whatever the other rows do meanwhile.

    velocity: in m/s or rad/s for unit joint velocities. force: in N or N m for unit joint torques.
    """

    spectrum: Spectrum
    velocity: Ellipsoid
    force: Ellipsoid


@dataclass(frozen=True, eq=False)
class Summary:
    """A frame's Jacobian at one configuration; made by :func:`summary`.

    names: of the m rows. jacobian: (m, nv), angular rows times ``length``. spectrum: ranks, singular values, condition
    number, manipulability, determinant. singularity: what is lost. position, orientation: the blocks without
    ``length``; None where the axes hold no such row.
    """

    frame: str
    names: tuple[str, ...]
    length: float
    q: FloatArray
    jacobian: FloatArray
    spectrum: Spectrum
    singularity: KinematicSingularity
    position: Block | None
    orientation: Block | None


def summary(
    state: State,
    frame: str | None = None,
    axes: Any = "pose",
    length: float = 1.0,
    *,
    metric: Any = None,
    tolerance: float | None = None,
) -> Summary:
    """What ``frame`` (the robot's tool if None) can do at ``state``, in LOCAL_WORLD_ALIGNED axes.

    axes: as in :class:`cartctl.FrameTask`. length: m per rad, makes the angular rows comparable with the linear ones;
    singular values, condition number, manipulability and determinant depend on it. metric: of the ellipsoids, as in
    :func:`velocity_ellipsoid`. tolerance: as in :func:`spectrum`.

    Raises FrameNotFound, ParameterError, ShapeError, NonFiniteError, MetricError.
    """
    from cartctl.model.axes import pose_rows  # the rest of this package works without Pinocchio

    rows = np.array(pose_rows(axes))
    scale = checks.number("length", length, low=0.0, strict=True)
    name = state.robot.tool if frame is None else frame
    J = np.array(state.jacobian(name)[rows])
    linear, angular = J[rows < 3], J[rows >= 3]
    weighed = np.concatenate([linear, scale * angular])
    labels = tuple(POSE_NAMES[row] for row in rows)
    return Summary(
        frame=name,
        names=labels,
        length=scale,
        q=np.array(state.q),
        jacobian=weighed,
        spectrum=spectrum(weighed, tolerance),
        singularity=kinematic_singularity(weighed, labels, tolerance),
        position=_block(linear, metric, tolerance),
        orientation=_block(angular, metric, tolerance),
    )


def _block(J: FloatArray, metric: Any, tolerance: float | None) -> Block | None:
    if not J.shape[0]:
        return None
    return Block(
        spectrum(J, tolerance),
        velocity_ellipsoid(J, metric, tolerance),
        force_ellipsoid(J, metric, tolerance),
    )
