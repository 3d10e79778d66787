"""What the bounds of every level share: their result, the limits they are packed from, and how they are called."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError, ShapeError
from cartctl.kernels import Kernel
from cartctl.levels.bound_checks import require_viable
from cartctl.levels.jerk_bounds import jerk_bounds
from cartctl.levels.velocity_kernel import velocity_bounds
from cartctl.model.limits import Limits

RETURN_SPEED = 1.0  # rad/s or m/s, back inside, where neither velocity nor acceleration is limited


class Bounds(NamedTuple):
    """The box ``lower <= u <= upper``, each (nv,), finite or +-inf, never crossed.

    recovering: whether some joint is outside a limit, or in a state from which one cannot be kept, and is brought back.
    """

    lower: FloatArray
    upper: FloatArray
    recovering: bool


class JointBounds:
    """A robot's joint limits as bounds on the unknown of one level, at a step of ``dt`` seconds.

    From rest inside the limits, any u inside the bounds keeps position, velocity and acceleration limits, at every
    later step, and the bounds never cross. Where a state rules out all of them (it started outside, limits changed,
    somebody pushed), jerk yields last, then acceleration, velocity, position: what is outside is brought back as fast
    as the limits before it allow, and arrives at rest after a finite number of steps. Without a velocity and an
    acceleration limit, the way back inside is taken at RETURN_SPEED.

    disabled: indices (of nv) of joints that brake to rest and stay there. jerk: whether ``limits.jerk_*`` hold, too;
    the acceleration before this step is then the difference of the velocities of the last two calls, so call once a
    step, and ``reset()`` before a new start (from acceleration zero). names: of the joints, for error messages.

    Raises ParameterError for limits that no joint can keep, TimeStepError, ShapeError.
    """

    at_acceleration: ClassVar[bool]

    def __init__(
        self,
        limits: Limits,
        dt: float,
        disabled: Sequence[int] = (),
        jerk: bool = False,
        names: Sequence[str] | None = None,
    ) -> None:
        self.dt = checks.duration("dt", dt)
        if not isinstance(limits, Limits):
            raise ParameterError(f"limits is a {type(limits).__name__}; expected Limits such as robot.limits")
        if not isinstance(jerk, bool):
            raise ParameterError(f"jerk is {jerk!r}; expected True or False")
        require_viable(limits, self.dt, jerk, names)
        self.limits = limits
        self.jerk = jerk
        self._shape = limits.position_lower.shape
        self._packed = _packed(limits, _mask(disabled, self._shape[0]), jerk)
        self._before: FloatArray | None = None
        kernel: Kernel[..., bool] = jerk_bounds if jerk else velocity_bounds
        self._kernel = kernel.compiled

    def __call__(self, q: FloatArray, v: FloatArray) -> Bounds:
        """The bounds at joint coordinates q (nv,) and velocity v (nv,), finite; fresh arrays. Raises ShapeError."""
        if q.shape != self._shape or v.shape != self._shape:
            raise ShapeError(f"q and v have shapes {q.shape} and {v.shape}; expected {self._shape} each")
        lower, upper = np.empty(self._shape), np.empty(self._shape)
        if not self.jerk:
            recovering = self._kernel(q, v, self._packed, self.dt, self.at_acceleration, lower, upper)
            return Bounds(lower, upper, recovering)
        if self._before is None:
            self._before = np.array(v)
        recovering = self._kernel(q, v, self._before, self._packed, self.dt, self.at_acceleration, lower, upper)
        self._before[:] = v
        return Bounds(lower, upper, recovering)

    @property
    def packed(self) -> FloatArray:
        """The limits as the kernels read them, (11, nv)."""
        return self._packed

    def reset(self) -> None:
        """Forget the previous velocity: the acceleration before the next call counts as zero."""
        self._before = None


def _mask(disabled: Sequence[int], n: int) -> FloatArray:
    """1 for disabled joints, (n,); raises ParameterError."""
    mask = np.zeros(n)
    for i in disabled:
        if isinstance(i, (bool, np.bool_)) or not isinstance(i, (int, np.integer)) or not 0 <= i < n:
            raise ParameterError(f"disabled holds {i!r}; expected indices of joints, whole numbers in [0, {n - 1}]")
        mask[i] = 1.0
    return mask


def _packed(limits: Limits, disabled: FloatArray, jerk: bool) -> FloatArray:
    """The rows that the kernels read, (11, nv): each array argument of a call costs as much as a few joints."""
    abrupt = np.isinf(limits.jerk_lower) | np.isinf(limits.jerk_upper) | (not jerk)
    down, up = limits.velocity_lower, limits.velocity_upper
    down = np.where(np.isinf(down) & np.isinf(limits.acceleration_upper) & abrupt, -RETURN_SPEED, down)
    up = np.where(np.isinf(up) & np.isinf(limits.acceleration_lower) & abrupt, RETURN_SPEED, up)
    rows = [
        limits.position_lower,
        limits.position_upper,
        limits.velocity_lower,
        limits.velocity_upper,
        limits.acceleration_lower,
        limits.acceleration_upper,
        limits.jerk_lower,
        limits.jerk_upper,
        down,
        up,
        disabled,
    ]
    return np.ascontiguousarray(np.array(rows))
