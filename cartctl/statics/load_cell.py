"""A six-axis load cell behind a tool: its reading without bias and weight, moved to the tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra.svd import numerical_rank, round_off, svd
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.spatial import move_wrench, wrench_adjoint
from cartctl.spatial.frames import as_pose
from cartctl.spatial.rotations import checked_rotation, cross, skew

GRAVITY = (0.0, 0.0, -9.81)
_NOTHING = 1e-9  # of the readings: no weight, and no centre of mass


@dataclass(frozen=True, eq=False)
class LoadCell:
    """A load cell and the tool it carries.

    The reading is the wrench (f, m) (6,) that everything beyond the cell puts on it, in the cell's axes about its
    origin: ``reading = bias + weight + contact``.

    placement: the pose of the cell in the tool's frame, (4, 4) or pin.SE3. mass: of all beyond the cell, kg. com: its
    centre of mass in the cell's frame, (3,), m. bias: (6,), the reading without weight and contact. gravity: (3,), in
    the world, m/s^2. Accelerations of the tool are not taken away.

    Raises ParameterError, ShapeError, NonFiniteError.
    """

    placement: Any = field(default_factory=lambda: np.eye(4))
    mass: float = 0.0
    com: Any = (0.0, 0.0, 0.0)
    bias: Any = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    gravity: Any = GRAVITY

    def __post_init__(self) -> None:
        object.__setattr__(self, "placement", as_pose("placement", self.placement))
        object.__setattr__(self, "mass", checks.number("mass", self.mass, low=0.0))
        for name, size in (("com", 3), ("bias", 6), ("gravity", 3)):
            object.__setattr__(self, name, checks.vector(name, getattr(self, name), size))

    def weight(self, rotation: Any) -> FloatArray:
        """``[m g; com x m g]`` (6,): what the tool's weight reads, g in the cell's axes.

        rotation: (3, 3), the cell's axes in the world. Raises ParameterError where it is no rotation, ShapeError,
        NonFiniteError.
        """
        f = self.mass * (checked_rotation("rotation", rotation).T @ self.gravity)
        return np.concatenate([f, cross(self.com, f)])

    def contact(self, reading: Any, rotation: Any) -> FloatArray:
        """The wrench (6,) that the surroundings put on the tool, in the tool's axes about its origin.

        ``Ad(T)^-T (reading - bias - weight)``, T the placement. reading: (6,). The rest as in :meth:`weight`.
        """
        reading = checks.vector("reading", reading, 6)
        return move_wrench(self.placement, reading - self.bias - self.weight(rotation))

    @property
    def to_tool(self) -> FloatArray:
        """``Ad(T)^-T`` (6, 6): wrench at the tool = this times wrench at the cell."""
        return wrench_adjoint(self.placement)


def fit_load_cell(
    rotations: Sequence[Any], readings: Sequence[Any], placement: Any = None, gravity: Any = GRAVITY
) -> LoadCell:
    """Mass, centre of mass and bias from readings (6,) without contact, at the cell's rotations (3, 3) in the world.

    Least squares over all readings of what is linear: ``f = f_0 + R^T g mass``, then ``m = m_0 - S(R^T g) (mass com)``.
    Three orientations in which gravity points three ways along the cell's axes are needed; more average noise out.

    Raises ParameterError where the orientations leave something open, ShapeError, NonFiniteError.
    """
    g = checks.vector("gravity", gravity, 3)
    downs = [checked_rotation(f"rotations[{k}]", R).T @ g for k, R in enumerate(checks.listed("rotations", rotations))]
    given = enumerate(checks.listed("readings", readings, len(downs)))
    read = np.array([checks.vector(f"readings[{k}]", w, 6) for k, w in given]).reshape(-1, 6)
    force, mass = np.eye(3), [np.column_stack([np.eye(3), d]) for d in downs]
    f = _least_squares(mass, 4, read[:, :3])
    moments = [np.hstack([force, -skew(d)]) for d in downs]
    m = _least_squares(moments, 6, read[:, 3:])
    if f[3] * np.linalg.norm(g) <= _NOTHING * np.abs(read).max():
        raise ParameterError(f"readings give a mass of {f[3]:g} kg; expected readings of a tool with weight")
    bias = np.concatenate([f[:3], m[:3]])
    return LoadCell(np.eye(4) if placement is None else placement, f[3], m[3:] / f[3], bias, g)


def _least_squares(rows: list[FloatArray], unknowns: int, values: FloatArray) -> FloatArray:
    """The unknowns of the stacked rows, refused where they are not determined."""
    A = np.asfortranarray(np.vstack(rows)) if rows else np.zeros((0, unknowns))
    U, s, Vt = svd(A)
    rank = numerical_rank(s, max(round_off(A), 1e-6 * float(s[0]) if s.size else 0.0))
    if rank < unknowns:
        raise ParameterError(
            f"rotations has {len(rows)} orientations that leave {unknowns - rank} of {unknowns} unknowns open; "
            "expected at least three in which gravity points three ways along the cell's axes"
        )
    found: FloatArray = Vt[:rank].T @ ((U[:, :rank].T @ values.ravel()) / s[:rank])
    return found
