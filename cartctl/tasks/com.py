"""The centre of mass."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from cartctl.algebra.svd import scale
from cartctl.checks import FloatArray
from cartctl.model.axes import pose_rows
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.tasks.base import Observation, Reference, Task
from cartctl.tasks.target import point_target, read


class ComTask(Task):
    """Bring the centre of mass, or some of its axes, to a target (3,) in the world, m.

    axes: ``"position"``, letters as in ``"xy"``, or a mask of three. target: (3,), a path, or None (hold what the first
    step finds). gain (1/s), weight, fit, name as in :class:`cartctl.FrameTask`. Raises ParameterError, TargetError.
    """

    kind: ClassVar[str] = "com"

    def __init__(
        self,
        axes: Any = "position",
        gain: Any = 10.0,
        *,
        target: Any = None,
        weight: float = 1.0,
        fit: str = "scale",
        name: str = "com",
    ) -> None:
        super().__init__(gain=gain, weight=weight, fit=fit, name=name)
        self.rows = pose_rows(axes, size=3)
        self._index = np.array(self.rows)
        self.target = target

    def take_target(self, value: Any, label: str) -> None:
        """A point (3,), a path, or None."""
        self._point, self._path = point_target(value, label, 3, in_space=True)

    @property
    def rests(self) -> bool:
        """Whether it follows no path."""
        return self._path is None

    def units(self, robot: Robot) -> list[str]:
        """M."""
        return ["m"] * len(self.rows)

    def jacobian(self, state: State) -> FloatArray:
        """``J_com`` (m, nv)."""
        return state.com_jacobian[self._index]  # type: ignore[no-any-return]

    def size(self, state: State) -> float:
        """The norm of all three rows."""
        return scale(state.com_jacobian)

    def drift(self, state: State) -> FloatArray:
        """``J_com_dot v`` (m,)."""
        return state.com_drift[self._index]  # type: ignore[no-any-return]

    def anchor(self, state: State) -> FloatArray:
        """The centre of mass at the first step."""
        return state.com

    def reference(self, state: State, t: float, anchor: FloatArray | None) -> Reference:
        """Target minus centre of mass, and the target's rates."""
        if self._path is None:
            return Reference((self._wanted(anchor, state) - state.com)[self._index])
        goal = read(self._path(t), f"task {self.name!r}")
        parts = (goal.position - state.com, goal.twist, goal.acceleration)
        return Reference(*(np.asarray(part)[self._index] for part in parts))

    def observe(self, state: State, t: float, anchor: FloatArray | None) -> Observation:
        """Centre of mass and target, x y z."""
        wanted = self._wanted(anchor, state) if self._path is None else self._path(t).position
        return Observation(state.com, np.asarray(wanted))

    def _wanted(self, anchor: FloatArray | None, state: State) -> FloatArray:
        if self._point is not None:
            return self._point
        return state.com if anchor is None else anchor
