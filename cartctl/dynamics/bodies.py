"""Uniform bodies: mass, centre of mass and inertia matrix; turned, moved and added by the parallel-axes theorem.

Each shape has its centroid at the origin and, where it has one, its axis along x, y or z.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError

_ORTHOGONAL = 1e-9


@dataclass(frozen=True, eq=False)
class Body:
    """mass: kg. inertia: (3, 3) about the centre of mass, kg m^2, or its diagonal (3,). com: (3,), m, in the same axes.

    Raises ShapeError, NonFiniteError, and ParameterError where no distribution of mass has this inertia: not
    symmetric, or one principal moment above the sum of the others.
    """

    mass: float
    inertia: FloatArray
    com: FloatArray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", checks.number("mass", self.mass, low=0.0))
        given = checks.floats("inertia", self.inertia)
        full = np.diag(checks.vector("inertia", given, 3)) if given.ndim == 1 else given
        object.__setattr__(self, "inertia", checks.matrix("inertia", full, 3, 3))
        object.__setattr__(self, "com", checks.vector("com", self.com, 3))
        _check_inertia(self.inertia)

    def about(self, point: Any) -> FloatArray:
        """``I_c + m (r^T r E - r r^T)``, r = com - point: the inertia (3, 3) about ``point`` (3,) (parallel axes).

        Raises ShapeError, NonFiniteError.
        """
        r = self.com - checks.vector("point", point, 3)
        return self.inertia + self.mass * (r @ r * np.eye(3) - np.outer(r, r))

    def moved(self, translation: Any = (0.0, 0.0, 0.0), rotation: Any = None) -> Body:
        """The body at another pose: com' = R com + p, I' = R I R^T, for p (3,) and R (3, 3).

        Raises ShapeError, NonFiniteError, ParameterError where R is no rotation.
        """
        p = checks.vector("translation", translation, 3)
        R = np.eye(3) if rotation is None else checks.matrix("rotation", rotation, 3, 3)
        error = float(np.abs(R @ R.T - np.eye(3)).max())
        determinant = float(np.linalg.det(R))
        if error > _ORTHOGONAL or determinant < 0.0:
            raise ParameterError(
                f"rotation misses R R^T = I by {error:.3g}, its determinant is {determinant:.3g}; expected a rotation"
            )
        turned = R @ self.inertia @ R.T
        return Body(self.mass, 0.5 * (turned + turned.T), R @ self.com + p)

    def __add__(self, other: Body) -> Body:
        """Both as one rigid body."""
        if not isinstance(other, Body):
            return NotImplemented
        mass = self.mass + other.mass
        # two massless bodies have their centre of mass anywhere
        com = (self.mass * self.com + other.mass * other.com) / mass if mass > 0.0 else self.com
        return Body(mass, self.about(com) + other.about(com), com)


def box(mass: float, size: Any) -> Body:
    """Parallelepiped of sides ``size`` = (x, y, z), m: ``I = m/12 diag(y^2 + z^2, x^2 + z^2, x^2 + y^2)``."""
    mass = checks.number("mass", mass, low=0.0)
    x, y, z = _positive("size", size, 3) ** 2
    return Body(mass, mass / 12.0 * np.array([y + z, x + z, x + y]))


def cylinder(mass: float, radius: float, length: float, inner_radius: float = 0.0, axis: str = "z") -> Body:
    """Cylinder, hollow with ``inner_radius`` = a > 0, outer radius b, m: ``I = m/12 diag(6 (a^2 + b^2), s, s)``.

    ``s = 3 (a^2 + b^2) + length^2``; the first moment is that about the axis.

    >>> import cartctl as cc
    >>> rod = cc.dynamics.cylinder(2.0, radius=0.1, length=1.0)
    >>> print(rod.inertia.diagonal().round(6))
    [0.171667 0.171667 0.01    ]
    """
    mass = checks.number("mass", mass, low=0.0)
    b, h = checks.number("radius", radius, low=0.0), checks.number("length", length, low=0.0)
    a = checks.number("inner_radius", inner_radius, low=0.0, high=b)
    across = mass / 12.0 * (3.0 * (a * a + b * b) + h * h)
    return Body(mass, _about_axis(mass / 2.0 * (a * a + b * b), across, axis))


def rod(mass: float, length: float, axis: str = "x") -> Body:
    """A thin rod: ``m length^2 / 12`` across, nothing about its axis."""
    return cylinder(mass, 0.0, length, axis=axis)


def disk(mass: float, radius: float, axis: str = "z") -> Body:
    """A thin disk: ``m radius^2 / 2`` about its axis, half of it across."""
    return cylinder(mass, radius, 0.0, axis=axis)


def sphere(mass: float, radius: float, inner_radius: float = 0.0) -> Body:
    """Ball of radius b, hollow with ``inner_radius`` = a: ``2/5 m (b^5 - a^5)/(b^3 - a^3)``; a = b is a shell."""
    mass = checks.number("mass", mass, low=0.0)
    b = checks.number("radius", radius, low=0.0, strict=True)
    a = checks.number("inner_radius", inner_radius, low=0.0, high=b)
    # both differences divided by b - a, so that a thin shell keeps its digits
    t = a / b
    moment = 0.4 * mass * b * b * (1.0 + t + t**2 + t**3 + t**4) / (1.0 + t + t**2)
    return Body(mass, np.full(3, moment))


def ellipsoid(mass: float, semi_axes: Any) -> Body:
    """Solid ellipsoid of ``semi_axes`` = (a, b, c), m: ``I = m/5 diag(b^2 + c^2, a^2 + c^2, a^2 + b^2)``."""
    mass = checks.number("mass", mass, low=0.0)
    a, b, c = _positive("semi_axes", semi_axes, 3) ** 2
    return Body(mass, mass / 5.0 * np.array([b + c, a + c, a + b]))


def cone(mass: float, radius: float, height: float, axis: str = "z") -> Body:
    """Solid circular cone about its centre of mass, height/4 above the base, the apex along +``axis``.

    ``3/10 m r^2`` about the axis, ``3/20 m (r^2 + h^2/4)`` across; ``.moved((0, 0, height / 4))`` puts the base at 0.
    """
    mass = checks.number("mass", mass, low=0.0)
    r, h = checks.number("radius", radius, low=0.0), checks.number("height", height, low=0.0)
    return Body(mass, _about_axis(0.3 * mass * r * r, 0.15 * mass * (r * r + 0.25 * h * h), axis))


def point_mass(mass: float, position: Any = (0.0, 0.0, 0.0)) -> Body:
    """All mass in one point (3,), m."""
    return Body(mass, np.zeros(3), position)


def _about_axis(along: float, across: float, axis: str) -> FloatArray:
    moments = np.full(3, across)
    moments["xyz".index(checks.choice("axis", axis, ("x", "y", "z")))] = along
    return moments


def _positive(name: str, value: Any, size: int) -> FloatArray:
    array = checks.vector(name, value, size)
    for i, x in enumerate(array):
        checks.number(f"{name}[{i}]", x, low=0.0)
    return array


def _check_inertia(inertia: FloatArray) -> None:
    """Raise unless the matrix is one a rigid body can have."""
    size = float(np.abs(inertia).max())
    if np.abs(inertia - inertia.T).max() > 1e-9 * size:
        raise ParameterError("inertia differs from its transpose; expected a symmetric (3, 3) matrix")
    least, middle, most = np.linalg.eigvalsh(inertia)
    if most - middle - least > 1e-9 * size:
        raise ParameterError(
            f"inertia has the principal moments {least:.4g}, {middle:.4g}, {most:.4g}; expected none above the sum of "
            "the others, as no distribution of mass has that"
        )
