"""What a task is, and how to add one.

A task is a quantity r(q) of size m with Jacobian J = dr/dq (in the tangent space) and drift J_dot v, and a target.
It knows no level and no solver: a level makes the command from the error and the target's rates, b = r_dot_ref + K e
at the velocity level.

Subclass :class:`Task`: give ``check``, ``units``, ``jacobian``, ``drift`` and ``reference``. For a function you already
have, :class:`cartctl.FunctionTask` takes it as it is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from itertools import count
from typing import Any, ClassVar, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.algebra.problem import FITS
from cartctl.checks import FloatArray
from cartctl.errors import ShapeError, TargetError
from cartctl.model.robot import Robot
from cartctl.model.state import State

_numbers = count(1)


class Reference(NamedTuple):
    """Where a task is to go, seen from where it is. None stands for zero."""

    error: FloatArray  # (m,) target minus value
    rate: FloatArray | None = None  # (m,) r_dot_ref
    acceleration: FloatArray | None = None  # (m,) r_ddot_ref
    pace: float = 1.0  # share of its rate at which a path is followed, where its clock may wait


class Observation(NamedTuple):
    """What a run records for pictures: the value and the target, as x y z qx qy qz qw or x y z."""

    value: FloatArray
    target: FloatArray


class Task(ABC):
    """A quantity to be brought to a target.

    gain: k in 1/s, > 0 or 0 for pure feedforward, one number or one a row: K = k at the velocity level, K_p = k^2 and
    K_d = 2 k above it. weight: >= 0, counts where a solver weighs tasks instead of ranking them. fit: ``"scale"`` or
    ``"least_squares"``, see :class:`cartctl.Equation`. name: for reports.

    Raises ParameterError, NonFiniteError.
    """

    kind: ClassVar[str]
    # Numbers, never the same twice, of when an attribute was last set: of this task, and of any. Who has made arrays of
    # tasks looks at them.
    changes: int = 0
    latest: ClassVar[int] = 0

    def __setattr__(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)
        number = next(_numbers)
        object.__setattr__(self, "changes", number)
        Task.latest = number

    def __init__(self, *, gain: Any, weight: float, fit: str, name: str) -> None:
        self.gain = checks.amounts("gain", gain, checks.PER_SECOND)
        self.weight = checks.number("weight", weight, low=0.0)
        self.fit = checks.choice("fit", fit, FITS)
        self.name = name

    @property
    def frame(self) -> str | None:
        """The frame that moves, where there is one."""
        return None

    @property
    def rests(self) -> bool:
        """Whether the target is known to stand still: then there is no path to wait for the hand."""
        return False

    @property
    def target(self) -> Any:
        """Where the task is to go, as given; assign to change it. A target that is refused leaves the old one."""
        return self._target

    @target.setter
    def target(self, value: Any) -> None:
        self.take_target(value, f"task {self.name!r}: target")
        self._target = value

    def take_target(self, value: Any, label: str) -> None:
        """Check a new target, keep what the task needs of it; raises TargetError, NonFiniteError naming ``label``."""
        raise TargetError(f"{label}: a {type(self).__name__} takes no target")

    @abstractmethod
    def units(self, robot: Robot) -> list[str]:
        """The unit of each row: ``"m"``, ``"rad"`` or ``""``."""

    def check(self, robot: Robot) -> None:
        """Refuse what does not fit the robot, once, when a controller is made."""
        m = len(self.units(robot))
        if isinstance(self.gain, np.ndarray) and self.gain.shape != (m,):
            raise ShapeError(f"task {self.name!r}: gain has shape {self.gain.shape}; expected a number or ({m},)")

    @abstractmethod
    def jacobian(self, state: State) -> FloatArray:
        """``J`` (m, nv)."""

    def size(self, state: State) -> float:
        """The norm J has by nature, where it is a few rows of something larger; 0 where J speaks for itself."""
        return 0.0

    @abstractmethod
    def drift(self, state: State) -> FloatArray:
        """``J_dot v`` (m,)."""

    def curvatures(self, state: State, V: FloatArray) -> FloatArray:
        """``J_dot(v_i) v_i`` for every row v_i of V (k, nv), as columns, (m, k); the state comes back as it was."""
        v = state.v
        try:
            columns = []
            for along in V:
                state.turn(along)
                columns.append(self.drift(state))
        finally:
            state.turn(v)
        return np.stack(columns, axis=1)

    @abstractmethod
    def reference(self, state: State, t: float, anchor: Any) -> Reference:
        """Error and target rates at time t; ``anchor`` is what :meth:`anchor` said at the first step."""

    def anchor(self, state: State) -> Any:
        """What this task holds on to where its target leaves something open; asked once, at the first step."""
        return None

    def observe(self, state: State, t: float, anchor: Any) -> Observation | None:
        """Value and target in the world, for pictures; None where there is nothing to draw."""
        return None
