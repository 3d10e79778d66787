"""What measures of a frame's Jacobian share: which rows, in which units, and the chain rule through the Hessian.

A measure f is a function of ``A = R J D``: the chosen rows of J, angular ones times a length (R), columns times a
constant scaling of the joints (D). A subclass gives f and ``F = df/dA`` from the singular values, and
``df/dq_i = sum_aj F_aj R_a (dJ_aj/dq_i) D_j`` is worked out here, once, with the kinematic Hessian dJ/dq.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cartctl import checks
from cartctl.algebra.svd import svd
from cartctl.checks import FloatArray
from cartctl.model.axes import pose_rows
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.objectives.base import Objective, checked_gain
from cartctl.objectives.scaling import check_scale, checked_scale, finite


class Spread(NamedTuple):
    """The thin SVD ``A = U diag(s) V^T`` of A (m, n), k = min(m, n)."""

    U: FloatArray  # (m, k)
    s: FloatArray  # (k,), descending
    V: FloatArray  # (n, k)


@dataclass(frozen=True, eq=False)
class FrameMeasure(Objective):
    """A function of the singular values and vectors of ``A = R J D``.

    frame: the robot's tool if None. axes: which rows, as in :class:`cartctl.FrameTask`, in world axes. length: m per
    rad, makes angular rows comparable with linear ones. scale: diag D (nv,), >= 0, the joint rates that count as 1;
    None is 1 each, ``"limits"`` the velocity limits (a joint without one, such as a moving base's, is refused or left
    out). gain: k > 0, (rad/s) per unit of the gradient.

    Raises ParameterError, NonFiniteError; FrameNotFound and ShapeError when a controller is made.
    """

    frame: str | None = None
    axes: Any = "pose"
    length: float = 1.0
    scale: Any = None
    gain: float = 1.0
    _rows: NDArray[np.intp] = field(init=False, repr=False)
    _lengths: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        checked_gain(self)
        checked_scale(self)
        object.__setattr__(self, "length", checks.number("length", self.length, low=0.0, strict=True))
        rows = np.array(pose_rows(self.axes))
        object.__setattr__(self, "_rows", rows)
        object.__setattr__(self, "_lengths", np.where(rows < 3, 1.0, self.length)[:, None])

    def check(self, robot: Robot) -> None:
        """The frame must exist, the scale must be this robot's."""
        robot.frame_id(self._frame(robot))
        check_scale(self.scale, robot, robot.limits.velocity_upper, "velocity")

    @abstractmethod
    def measure(self, spread: Spread) -> float:
        """``f(A)``."""

    @abstractmethod
    def slope(self, spread: Spread) -> FloatArray:
        """``F = df/dA``, (m, n); finite wherever A is."""

    def value(self, state: State) -> float:
        """``H(q)``."""
        return self.measure(self._spread(state))

    def gradient(self, state: State) -> FloatArray:
        """``dH/dq``, (nv,)."""
        F = self.slope(self._spread(state)) * self._lengths
        D = self._columns(state.robot)
        H = state.hessian(self._frame(state.robot))[self._rows]
        return np.tensordot(F if D is None else F * D, H, axes=2)

    def _spread(self, state: State) -> Spread:
        A = state.jacobian(self._frame(state.robot))[self._rows] * self._lengths
        D = self._columns(state.robot)
        U, s, Vt = svd(np.asfortranarray(A if D is None else A * D))
        return Spread(U, s, Vt[: s.shape[0]].T)

    def _frame(self, robot: Robot) -> str:
        return robot.tool if self.frame is None else self.frame

    def _columns(self, robot: Robot) -> FloatArray | None:
        """Diag D, (nv,); None for the identity."""
        return finite(robot.limits.velocity_upper) if isinstance(self.scale, str) else self.scale
