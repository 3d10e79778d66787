"""The pose of one frame, or some of its axes."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.tasks.base import Observation
from cartctl.tasks.pose import Anchor, PoseTask


class FrameTask(PoseTask):
    """Bring ``frame`` to a target pose in the world.

    frame: a name in robot.frame_names. axes: which rows, ``"pose"``, ``"position"``, ``"orientation"``, letters as in
    ``"xy"`` or ``"z rx ry"``, or a mask of six. expressed_in: the axes the rows refer to, ``"world"`` or a frame, its
    own name for tool axes (J and e turned by R^T at the instant). gain: 1/s. target: pose, position, rotation, path, or
    None: hold what the first step finds, as is done with the part that a target leaves open. orientation:
    ``"angle-axis"`` or an Euler sequence. length: m per rad, makes angular rows comparable with linear ones in weighted
    sums and singular values.

    J and e are in LOCAL_WORLD_ALIGNED axes, linear first, m and rad. Raises ParameterError, TargetError,
    NonFiniteError; FrameNotFound when a controller is made.

    >>> import cartctl as cc
    >>> robot = cc.planar([1.0, 1.0, 1.0])
    >>> tip = cc.FrameTask("tool", "xy", gain=5.0, target=[1.5, 1.5, 0.0])
    >>> command = cc.Controller(robot, tip, solver="pinv", limits=None, dt=0.01).step([0.3, 0.5, 0.7])
    >>> state = robot.state([0.3, 0.5, 0.7])
    >>> K_e = 5.0 * ([1.5, 1.5] - state.position("tool")[:2])
    >>> print((state.jacobian("tool")[:2] @ command.velocity / K_e).round(9))
    [1. 1.]
    """

    kind: ClassVar[str] = "frame"

    def __init__(
        self,
        frame: str,
        axes: Any = "pose",
        gain: Any = 20.0,
        *,
        target: Any = None,
        expressed_in: str = "world",
        orientation: str = "angle-axis",
        length: float = 1.0,
        weight: float = 1.0,
        fit: str = "scale",
        name: str | None = None,
    ) -> None:
        self.expressed_in = expressed_in
        self._turned = expressed_in != "world"
        super().__init__(
            frame, axes, target, orientation, length, gain=gain, weight=weight, fit=fit, name=name or str(frame)
        )
        if self._turned and self._euler:
            raise ParameterError(
                f"task {self.name!r}: expressed_in={expressed_in!r} with Euler angles; expected one or the other, "
                "for Euler rates have no axes to be turned"
            )

    def check(self, robot: Robot) -> None:
        """Both frames must exist."""
        super().check(robot)
        if self._turned:
            robot.frame_id(self.expressed_in)

    def pose(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Position and rotation in the world, as views."""
        placed = state.place(self._frame)
        return placed.translation, placed.rotation

    def pose_jacobian(self, state: State) -> FloatArray:
        """``J`` (6, nv), turned into the chosen axes."""
        J = state.jacobian(self._frame)
        return self._turn(state, J) if self._turned else J

    def pose_drift(self, state: State) -> FloatArray:
        """``J_dot v`` (6,), turned into the chosen axes: the projection of a vector equation, not a derivative."""
        return self._turn(state, state.drift(self._frame))

    def curvatures(self, state: State, V: FloatArray) -> FloatArray:
        """All at once, but for Euler angles."""
        if self._euler and self._angular:
            return super().curvatures(state, V)
        return self._select(self._turn(state, state.drifts(self._frame, V)))

    def _turn(self, state: State, rows: FloatArray) -> FloatArray:
        if not self._turned:
            return rows
        Rt = state.rotation(self.expressed_in).T
        return np.concatenate([Rt @ rows[:3], Rt @ rows[3:]])

    def observe(self, state: State, t: float, anchor: Anchor) -> Observation:
        """Pose and target pose in the world, x y z qx qy qz qw."""
        goal = self.goal(t)
        p, R = self.pose(state)
        wanted_p = anchor.position if goal.position is None else goal.position
        wanted_R = anchor.rotation if goal.rotation is None else goal.rotation
        return Observation(_xyz_quaternion(p, R), _xyz_quaternion(wanted_p, wanted_R))


def _xyz_quaternion(p: FloatArray, R: FloatArray) -> FloatArray:
    return np.concatenate([p, pin.Quaternion(np.asarray(R)).coeffs()])
