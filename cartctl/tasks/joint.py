"""Joint coordinates: some joints to a target, or all of them to a posture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cartctl.checks import FloatArray
from cartctl.errors import ParameterError, TargetError, UnsupportedProblem
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.tasks.base import Reference, Task
from cartctl.tasks.target import point_target


class JointTask(Task):
    """Bring one-dof joints to target coordinates, rad or m; a continuous joint takes the short way round.

    joints: names, or None for every one-dof joint. target: (m,) coordinates, a path t -> (value, rate, acceleration),
    each (m,), or None (hold what the first step finds). gain (1/s), weight, fit, name as in :class:`cartctl.FrameTask`.
    J holds rows of the identity, the drift is zero. Raises ParameterError, TargetError; JointNotFound when a controller
    is made.
    """

    kind: ClassVar[str] = "joint"

    def __init__(
        self,
        joints: str | Sequence[str] | None = None,
        target: Any = None,
        gain: Any = 10.0,
        *,
        weight: float = 1.0,
        fit: str = "scale",
        name: str = "joints",
    ) -> None:
        super().__init__(gain=gain, weight=weight, fit=fit, name=name)
        self.joints = (joints,) if isinstance(joints, str) else None if joints is None else tuple(joints)
        if self.joints == ():
            raise ParameterError(f"task {name!r}: joints is empty; expected names, or None for all")
        self.target = target
        self._known: tuple[Robot, NDArray[np.intp], FloatArray] | None = None

    def take_target(self, value: Any, label: str) -> None:
        """(m,) coordinates, a path, or None."""
        size = None if self.joints is None else len(self.joints)
        self._point, self._path = point_target(value, label, size)

    @property
    def rests(self) -> bool:
        """Whether it follows no path."""
        return self._path is None

    def units(self, robot: Robot) -> list[str]:
        """Rad or m, one a joint."""
        return [_unit(robot, name) for name in self._names(robot)]

    def check(self, robot: Robot) -> None:
        """The joints must exist and the target must have one value for each."""
        super().check(robot)
        if self._point is not None:
            self._expect(self._point, len(self._names(robot)))

    def jacobian(self, state: State) -> FloatArray:
        """Rows of the identity, (m, nv)."""
        return self._rows(state.robot)[1]

    def drift(self, state: State) -> FloatArray:
        """Zero, (m,)."""
        return np.zeros(len(self._rows(state.robot)[0]))

    def anchor(self, state: State) -> FloatArray:
        """The coordinates at the first step."""
        return self._values(state)

    def reference(self, state: State, t: float, anchor: FloatArray | None) -> Reference:
        """Target minus coordinates, and the target's rates."""
        values = self._values(state)
        if self._path is None:
            held = self._point if self._point is not None else self._default(state.robot, anchor)
            return Reference(self._shortest(state.robot, values - values if held is None else held - values))
        try:
            wanted, rate, acceleration = (np.asarray(x, dtype=np.float64) for x in self._path(t))
        except (TypeError, ValueError):
            raise TargetError(
                f"task {self.name!r}: the path must return (value, rate, acceleration), each (m,)"
            ) from None
        for part in (wanted, rate, acceleration):
            self._expect(part, len(values))
        return Reference(self._shortest(state.robot, wanted - values), rate, acceleration)

    def fixed_target(self, robot: Robot) -> tuple[NDArray[np.intp], FloatArray | None]:
        """Tangent coordinates (m,), their target or None for what the first step finds; raises UnsupportedProblem."""
        if self._path is not None:
            raise UnsupportedProblem(f"task {self.name!r} follows a path of joint coordinates")
        return self._rows(robot)[0], self._point if self._point is not None else self._default(robot, None)

    def _default(self, robot: Robot, anchor: FloatArray | None) -> FloatArray | None:
        """The target where none is given: what the first step found."""
        return anchor

    def _values(self, state: State) -> FloatArray:
        return state.robot.coordinates(state.q)[self._rows(state.robot)[0]]

    def _rows(self, robot: Robot) -> tuple[NDArray[np.intp], FloatArray]:
        """Tangent coordinates and their rows of the identity, worked out once a robot."""
        if self._known is None or self._known[0] is not robot:
            index = np.array([robot.dof(name) for name in self._names(robot)], dtype=np.intp)
            rows = np.eye(robot.nv)[index]
            rows.flags.writeable = False
            self._known = (robot, index, rows)
        return self._known[1], self._known[2]

    def _names(self, robot: Robot) -> tuple[str, ...]:
        if self.joints is None:
            return robot.single_joints
        for name in self.joints:
            robot.dof(name)
        return self.joints

    def _shortest(self, robot: Robot, error: FloatArray) -> FloatArray:
        turning = robot.continuous[self._rows(robot)[0]]
        if not turning.any():
            return error
        return np.where(turning, (error + np.pi) % (2.0 * np.pi) - np.pi, error)

    def _expect(self, value: FloatArray, m: int) -> None:
        if value.shape != (m,):
            raise TargetError(f"task {self.name!r}: target has shape {value.shape}; expected ({m},), one value a joint")


class PostureTask(JointTask):
    """Bring the joints to a posture, by default the robot's home: ``fit="least_squares"``, for below other tasks.

    target: (m,) coordinates or None for home; everything else as in :class:`cartctl.JointTask`. A moving base is left
    out.

    >>> import cartctl as cc
    >>> robot = cc.planar([1.0, 1.0, 1.0])
    >>> tasks = [cc.FrameTask("tool", "xy"), cc.PostureTask(gain=2.0)]  # the posture with what the tip leaves free
    >>> controller = cc.Controller(robot, tasks, solver="task-priority", limits=None, dt=0.01)
    >>> run = cc.simulate(controller, [0.1, 0.9, 0.4], duration=1.0)
    >>> run.metrics().tasks[0].max_m < 1e-4
    True
    """

    kind: ClassVar[str] = "posture"

    def __init__(
        self,
        target: Any = None,
        joints: str | Sequence[str] | None = None,
        gain: Any = 1.0,
        *,
        weight: float = 1.0,
        fit: str = "least_squares",
        name: str = "posture",
    ) -> None:
        super().__init__(joints, target, gain, weight=weight, fit=fit, name=name)

    def _default(self, robot: Robot, anchor: FloatArray | None) -> FloatArray:
        """Home."""
        return robot.coordinates(robot.home)[self._rows(robot)[0]]


def _unit(robot: Robot, joint: str) -> str:
    return "m" if robot.is_prismatic(joint) else "rad"
