"""What frame tasks share: a pose error and its rows.

e = [p_d - p; log3(R_d R^T)] in the axes the pose is given in: an angle-axis vector, never a difference of Euler angles.
With ``orientation="ZYZ"`` (any of the twelve sequences) the angular rows are phi_d - phi and J_A = T(phi)^-1 J_omega
instead, with a gimbal lock where det T(phi) = 0.
"""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.algebra.svd import scale, svd
from cartctl.checks import FloatArray
from cartctl.errors import CartctlWarning
from cartctl.model.axes import pose_rows
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.spatial import EULER_SEQUENCES, euler_angles, euler_rates, pose_error
from cartctl.tasks.base import Reference, Task
from cartctl.tasks.target import Goal, pose_target, read

_LOCK = 1e-3  # |det T| below which one of the Euler rates is no longer determined


class Anchor(NamedTuple):
    """The pose of the first step, for what a target leaves open."""

    position: FloatArray
    rotation: FloatArray


class PoseTask(Task):
    """A task on some rows of a pose; FrameTask and RelativeFrameTask say which pose."""

    def __init__(
        self,
        frame: str,
        axes: Any,
        target: Any,
        orientation: str,
        length: float,
        *,
        gain: Any,
        weight: float,
        fit: str,
        name: str,
    ) -> None:
        super().__init__(gain=gain, weight=weight, fit=fit, name=name)
        self._frame = frame
        self.rows = pose_rows(axes)
        checks.choice("orientation", orientation, ("angle-axis", *EULER_SEQUENCES))
        self.orientation = orientation
        self.length = checks.number("length", length, low=0.0, strict=True)
        self._euler = orientation != "angle-axis"
        self._linear = self.rows[0] < 3
        self._angular = self.rows[-1] >= 3
        self._all = self.rows == (0, 1, 2, 3, 4, 5)
        self._index = np.array(self.rows)
        self._row_scale = np.where(self._index < 3, 1.0, self.length) if self.length != 1.0 and self._angular else None
        self.target = target

    @property
    def frame(self) -> str:
        """The frame that moves."""
        return self._frame

    def take_target(self, value: Any, label: str) -> None:
        """A pose (pin.SE3 or 4x4), a position, a rotation, a path, or None: hold what the first step finds."""
        goal = pose_target(value, label)
        self._goal: Goal | None = goal if isinstance(goal, Goal) else None
        self._path: Callable[[float], Any] | None = None if isinstance(goal, Goal) else goal

    def check(self, robot: Robot) -> None:
        """Its frame must exist; compiles the error's kernel too, so that the first step need not wait for it."""
        super().check(robot)
        robot.frame_id(self._frame)
        _ = pose_error.compiled

    @property
    def rests(self) -> bool:
        """Whether it follows no path."""
        return self._path is None

    def units(self, robot: Robot) -> list[str]:
        """M for linear rows, rad for angular ones."""
        return ["m" if r < 3 else "rad" for r in self.rows]

    @abstractmethod
    def pose(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Position (3,) and rotation (3, 3) that this task controls; may be views."""

    @abstractmethod
    def pose_jacobian(self, state: State) -> FloatArray:
        """(6, nv), all rows, in the axes the pose is given in."""

    @abstractmethod
    def pose_drift(self, state: State) -> FloatArray:
        """(6,), all rows."""

    def anchor(self, state: State) -> Anchor:
        """The pose at the first step."""
        p, R = self.pose(state)
        return Anchor(np.array(p), np.array(R))

    def holding(self, position: FloatArray, rotation: FloatArray) -> Anchor:
        """What :meth:`anchor` says of a pose."""
        return Anchor(position, rotation)

    @property
    def path(self) -> Callable[[float], Any] | None:
        """The path that the target follows, None where it rests."""
        return self._path

    def goal(self, t: float) -> Any:
        """The target at time t: a Goal or a path's sample."""
        return self._goal if self._path is None else read(self._path(t), f"task {self.name!r}")

    def jacobian(self, state: State) -> FloatArray:
        """``J`` (m, nv)."""
        J = self.pose_jacobian(state)
        if self._euler and self._angular:
            J = np.concatenate([J[:3], self._rates_inverse(state) @ J[3:]])
        return self._select(J)

    def size(self, state: State) -> float:
        """The norm of all six rows, where only some are controlled."""
        return 0.0 if self._all else scale(self.pose_jacobian(state))

    def drift(self, state: State) -> FloatArray:
        """``J_dot v`` (m,); with Euler angles ``T^-1 (J_omega_dot v - T_dot phi_dot)`` in the angular rows."""
        d = self.pose_drift(state)
        if self._euler and self._angular:
            d = np.concatenate([d[:3], self._euler_acceleration(state, d[3:])])
        return self._select(d)

    def reference(self, state: State, t: float, anchor: Anchor | None) -> Reference:
        """The pose error and the target's rates."""
        goal = self.goal(t)
        p, R = self.pose(state)
        wanted_p, wanted_R = goal.position, goal.rotation
        if wanted_p is None:
            wanted_p = p if anchor is None else anchor.position
        if wanted_R is None:
            wanted_R = R if anchor is None else anchor.rotation
        error = np.empty(6)
        pose_error.compiled(p, R, wanted_p, wanted_R, error)
        if self._euler and self._angular:
            error[3:] = self._euler_error(wanted_R, R)
        if goal.twist is None:
            return Reference(self._select(self._turn(state, error)))
        return self._moving(state, error, goal, wanted_R)

    def _moving(self, state: State, error: FloatArray, goal: Any, rotation: FloatArray) -> Reference:
        rate, acceleration = np.asarray(goal.twist), np.asarray(goal.acceleration)
        if self._euler and self._angular:
            T = euler_rates(self.orientation, euler_angles(self.orientation, rotation))
            phi_dot = _inverse(T, self.name) @ rate[3:]
            bend = self._rates_derivative(rotation, phi_dot) @ phi_dot
            acceleration = np.concatenate([acceleration[:3], _inverse(T, self.name) @ (acceleration[3:] - bend)])
            rate = np.concatenate([rate[:3], phi_dot])
        turn, select = self._turn, self._select
        return Reference(select(turn(state, error)), select(turn(state, rate)), select(turn(state, acceleration)))

    def _turn(self, state: State, rows: FloatArray) -> FloatArray:
        """Rows of the pose's own axes seen in the axes the task is expressed in."""
        return rows

    def _select(self, rows: FloatArray) -> FloatArray:
        """The controlled rows; angular ones in m by the characteristic length."""
        if not self._all:
            rows = rows[self._index]
        if self._row_scale is None:
            return rows
        return rows * (self._row_scale if rows.ndim == 1 else self._row_scale[:, None])

    def _rates_inverse(self, state: State) -> FloatArray:
        return _inverse(euler_rates(self.orientation, euler_angles(self.orientation, self.pose(state)[1])), self.name)

    def _euler_error(self, wanted: FloatArray, R: FloatArray) -> FloatArray:
        difference = euler_angles(self.orientation, wanted) - euler_angles(self.orientation, R)
        return (difference + np.pi) % (2.0 * np.pi) - np.pi

    def _euler_acceleration(self, state: State, drift: FloatArray) -> FloatArray:
        R = self.pose(state)[1]
        T_inverse = self._rates_inverse(state)
        phi_dot = T_inverse @ (self.pose_jacobian(state)[3:] @ state.v)
        return T_inverse @ (drift - self._rates_derivative(R, phi_dot) @ phi_dot)

    def _rates_derivative(self, R: FloatArray, phi_dot: FloatArray) -> FloatArray:
        """``T_dot`` along phi_dot: column k turns with the angular velocity of the columns before it."""
        T = euler_rates(self.orientation, euler_angles(self.orientation, R))
        derivative = np.zeros((3, 3))
        derivative[:, 1] = np.cross(T[:, 0] * phi_dot[0], T[:, 1])
        derivative[:, 2] = np.cross(T[:, 0] * phi_dot[0] + T[:, 1] * phi_dot[1], T[:, 2])
        return derivative


def _inverse(T: FloatArray, name: str) -> FloatArray:
    """T^-1, or at a gimbal lock the inverse on what is left, so that the task loses rank instead of exploding."""
    U, s, Vt = svd(np.asfortranarray(T))
    if s[-1] > _LOCK:
        return (Vt.T / s) @ U.T  # type: ignore[no-any-return]
    warnings.warn(
        f"task {name!r} is at a gimbal lock of its Euler angles; use angle-axis or another sequence",
        CartctlWarning,
        stacklevel=2,
    )
    kept = s > _LOCK
    return (Vt[kept].T / s[kept]) @ U[:, kept].T  # type: ignore[no-any-return]
