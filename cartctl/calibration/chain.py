"""What a calibration needs of a kinematic chain, whether it came as a table or as a URDF."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.calibration.motions import SIX, Product
from cartctl.calibration.selection import Parameters, chosen
from cartctl.checks import FloatArray, IntArray
from cartctl.errors import ShapeError


class Chain(ABC):
    """A serial chain whose parameters can be changed: :class:`cartctl.DHChain` or :class:`RobotChain`.

    A subclass says what its factors are (:attr:`product`), which parameters go together (:attr:`groups`) and what it
    becomes when they change (:meth:`changed`); poses and regressors follow.
    """

    name: str

    @cached_property
    @abstractmethod
    def product(self) -> Product:
        """The chain as a product of elementary motions."""

    @property
    @abstractmethod
    def groups(self) -> Mapping[str, Sequence[str]]:
        """Names for several parameters at once, such as ``"a"`` or ``"tool"``, in the order of the joints."""

    @property
    @abstractmethod
    def usual(self) -> Sequence[str]:
        """The parameters that ``parameters=None`` means."""

    @abstractmethod
    def changed(self, delta: Mapping[str, float]) -> Chain:
        """The chain with ``delta`` added to the named parameters, m and rad."""

    @abstractmethod
    def urdf(self) -> str:
        """The chain as the text of a URDF, base and tool included."""

    def value(self, name: str) -> float:
        """A parameter as it stands in the chain: an entry of a table; corrections of a placement are 0."""
        return 0.0

    @property
    def n(self) -> int:
        """How many joints."""
        return self.product.n

    @property
    def names(self) -> tuple[str, ...]:
        """All parameters."""
        return self.product.names

    def units(self, names: Sequence[str]) -> tuple[str, ...]:
        """``"m"`` or ``"rad"``, one a name."""
        known = dict(zip(self.names, self.product.angles.tolist(), strict=True))
        return tuple("rad" if known[name] else "m" for name in names)

    def select(self, parameters: Parameters = None) -> tuple[str, ...]:
        """The names that ``parameters`` stands for, in the chain's order; see :func:`cartctl.calibrate`.

        Raises ParameterNotFound, ParameterError, ShapeError.
        """
        return chosen(parameters, self.names, self.groups, self.usual)

    def coordinates(self, q: Any) -> FloatArray:
        """``q`` as checked joint coordinates (N, n), rad or m; one configuration (n,) is N = 1.

        Raises ShapeError, NonFiniteError, ParameterError.
        """
        return configurations(q, self.n)

    def pose(self, q: Any) -> FloatArray:
        """The end in the base at one configuration q, (4, 4); errors as :meth:`poses`."""
        if np.ndim(q) != 1:
            raise ShapeError(f"q has shape {np.shape(q)}; expected one configuration, or use .poses")
        return np.asarray(self.poses(q)[0])

    def poses(self, q: Any) -> FloatArray:
        """The end in the base at each row of q, (N, 4, 4); raises ShapeError, NonFiniteError."""
        rotation, position = self.product.poses(self.coordinates(q))
        T = np.tile(np.eye(4), (len(position), 1, 1))
        T[:, :3, :3], T[:, :3, 3] = rotation, position
        return T

    def positions(self, q: Any) -> FloatArray:
        """The end's origin in the base at each row of q, (N, 3), m; raises ShapeError, NonFiniteError."""
        return self.product.poses(self.coordinates(q)).position

    def regressor(self, q: Any, parameters: Parameters = None) -> FloatArray:
        """``Phi`` (N, 6, p): the end's twist at a unit rate of each parameter, linear first, in world axes.

        ``delta r = Phi delta``, Phi = [J_a J_alpha J_d J_theta] over the chosen parameters, in their order of
        :meth:`select`. Raises ParameterNotFound, ShapeError, NonFiniteError.
        """
        return self.product.regressor(self.coordinates(q), self.indices(parameters))[1]

    def indices(self, parameters: Parameters) -> IntArray:
        """The numbers of the chosen parameters among :attr:`names`; errors as :meth:`select`."""
        place = {name: k for k, name in enumerate(self.names)}
        return np.array([place[name] for name in self.select(parameters)], dtype=np.int64)


def configurations(q: Any, width: int) -> FloatArray:
    """``q`` as (N, width), N >= 1; raises ShapeError, NonFiniteError, ParameterError."""
    array = checks.floats("q", q)
    if array.ndim == 1 and array.shape == (width,):
        array = array[None]
    if array.ndim != 2 or array.shape[1] != width or not len(array):
        raise ShapeError(f"q has shape {array.shape}; expected (N, {width}), one row a measurement and N >= 1")
    checks.matrix("q", array)
    if float(np.abs(array).max()) > checks.LARGEST:
        checks.vector("q", array.ravel(), largest=checks.LARGEST)
    return array


def six_names(name: str) -> list[str]:
    """``base.x`` ... ``base.rz``."""
    return [f"{name}.{s}" for s in SIX]
