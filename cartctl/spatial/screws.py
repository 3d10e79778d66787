"""Screws: the axis and pitch of a twist, of a displacement (Chasles) and of a wrench (Poinsot); Ball 1900."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.spatial.motions import log6
from cartctl.spatial.rotations import cross

_LARGEST = 1e100  # squares of it are numbers still


@dataclass(frozen=True, eq=False)
class Screw:
    """A line, a pitch along it, and how much: ``size`` about the line and ``size * pitch`` along it, or the reverse.

    direction: (3,), unit; zeros where there is nothing, size = 0. point: (3,), m, of the line the one nearest to the
    origin; zeros where the pitch is inf. pitch: m per rad of a twist or displacement, N m per N of a wrench; inf of a
    pure translation or couple, whose line is anywhere. size: rad/s, rad or N; m/s, m or N m where the pitch is inf.
    """

    direction: FloatArray
    point: FloatArray
    pitch: float
    size: float

    @property
    def twist(self) -> FloatArray:
        """The twist (v, omega), (6,), at the origin: ``omega = size s``, ``v = point x omega + pitch omega``."""
        line, moment = self._parts()
        return np.concatenate([moment, line])

    @property
    def wrench(self) -> FloatArray:
        """The wrench (f, m), (6,), about the origin: ``f = size s``, ``m = point x f + pitch f``."""
        line, moment = self._parts()
        return np.concatenate([line, moment])

    def _parts(self) -> tuple[FloatArray, FloatArray]:
        along = self.size * self.direction
        if math.isinf(self.pitch):
            return np.zeros(3), along
        return along, cross(self.point, along) + self.pitch * along


def twist_screw(twist: Any, farthest: float = 1e9) -> Screw:
    """The instantaneous screw axis of a twist (v, omega), (6,).

    ``point = omega x v / |omega|^2``, ``pitch = omega.v / |omega|^2``. The body turns about the axis at ``size`` rad/s
    and slides along it at ``size * pitch`` m/s. farthest: where axis or pitch lie beyond it, m, the motion is a
    translation, and its omega round-off.

    Raises ShapeError, NonFiniteError, ParameterError.
    """
    twist = checks.vector("twist", twist, 6, largest=_LARGEST)
    return _screw(twist[3:], twist[:3], farthest)


def wrench_screw(wrench: Any, farthest: float = 1e9) -> Screw:
    """The central axis of a wrench (f, m) (6,): ``point = f x m / |f|^2``, ``pitch = f.m / |f|^2``.

    About points of the axis the moment is least: ``pitch * size``, along the force. farthest and errors as of
    :func:`twist_screw`; beyond it the wrench is a pure couple.
    """
    wrench = checks.vector("wrench", wrench, 6, largest=_LARGEST)
    return _screw(wrench[:3], wrench[3:], farthest)


def displacement_screw(T: Any, farthest: float = 1e9) -> Screw:
    """The screw of a displacement T, (4, 4) or pin.SE3: a turn by ``size`` in [0, pi] about the axis, with a slide.

    Chasles: ``pitch * size`` m along the axis; ``exp6(screw.twist)`` is T. At a half turn the direction is one of two.
    farthest as in :func:`twist_screw`. Errors as of :func:`log6`.
    """
    return twist_screw(log6(T), farthest)


def _screw(line: FloatArray, moment: FloatArray, farthest: float) -> Screw:
    farthest = checks.number("farthest", farthest, low=0.0, strict=True)
    size, length = math.hypot(*line.tolist()), math.hypot(*moment.tolist())
    if length > farthest * size:
        return Screw(moment / length, np.zeros(3), math.inf, length)
    if size == 0.0:
        return Screw(np.zeros(3), np.zeros(3), 0.0, 0.0)
    largest = float(np.abs(line).max())  # so that subnormal numbers, too, have a direction
    s = line / largest
    s /= math.hypot(*s.tolist())
    m = moment / size
    pitch = float(s @ m)
    return Screw(s, cross(s, m), pitch, size)
