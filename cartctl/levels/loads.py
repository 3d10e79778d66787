"""What the joints have to hold beside inertia: Coriolis, centrifugal and gravity torques, friction, known wrenches.

``M a + h = tau`` with ``h = c(q, v) + g(q) + f(v) - sum J_c^T w``: everything the controller knows of. A payload is
part of the robot's model (:meth:`cartctl.Robot.carrying`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cartctl.algebra.metric import as_metric
from cartctl.checks import FloatArray
from cartctl.dynamics.friction import Friction
from cartctl.errors import MetricError, ParameterError, UnderactuatedRobot
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.model.wrench import Wrench


class Loads:
    """Friction (None for none) and wrenches that a level knows of; raises ParameterError."""

    def __init__(self, friction: Friction | None = None, wrenches: Wrench | Sequence[Wrench] = ()) -> None:
        if not (friction is None or isinstance(friction, Friction)):
            raise ParameterError(f"friction is a {type(friction).__name__}; expected a cc.Friction, or None")
        self.friction = friction
        self.wrenches = checked_wrenches(wrenches)
        self._bare = friction is None and not self.wrenches
        self.time = 0.0

    def check(self, robot: Robot) -> None:
        """Refuse what does not fit the robot; raises ShapeError, FrameNotFound."""
        if self.friction is not None:
            self.friction.check(robot.nv)
        for wrench in self.wrenches:
            wrench.check(robot)

    def effects(self, state: State, time: float | None = None) -> FloatArray:
        """``h`` (nv,), N m or N, at the time it is, or another one; raises NonFiniteError for a wrench that is not."""
        h = state.nonlinear_effects
        if self._bare:
            return h
        if self.friction is not None:
            h = h + self.friction.torque(state.v)
        for wrench in self.wrenches:
            h = h - wrench.torque(state, self.time if time is None else time)
        return h


def checked_wrenches(wrenches: Any) -> tuple[Wrench, ...]:
    """``wrenches`` as a tuple; raises ParameterError."""
    given = (wrenches,) if isinstance(wrenches, Wrench) else wrenches
    if not isinstance(given, Sequence) or not all(isinstance(w, Wrench) for w in given):
        raise ParameterError(f"wrenches is {wrenches!r}; expected cc.Wrench(...), or a sequence of them")
    return tuple(given)


def actuated(robot: Robot) -> bool:
    """Whether every coordinate has a motor of its own: a base that moves freely has none."""
    return len(robot.single_joints) == robot.nv


def require_actuated(robot: Robot) -> None:
    """Raise UnderactuatedRobot where torques cannot give any acceleration there is."""
    if not actuated(robot):
        free = [n for n in robot.joint_names if n not in robot.single_joints]
        raise UnderactuatedRobot(
            f"robot {robot.name!r} has joints without a motor ({', '.join(map(repr, free))}), so torques cannot give "
            "every acceleration; use level 'acceleration' or 'velocity', or root_joint='fixed'"
        )
    try:
        as_metric(robot.state(robot.home).mass_matrix, robot.nv)
    except MetricError:
        raise UnderactuatedRobot(
            f"robot {robot.name!r} has a singular inertia matrix at home: nothing that has mass follows a joint; "
            "lock this joint (active_joints=), or give its links an inertia in the URDF"
        ) from None


def later(loads: Loads, state: State, a: FloatArray) -> Callable[[], FloatArray]:
    """The function that returns ``tau = M a + h`` (nv,) of this instant, whenever it is called."""
    robot, q, v, time, stamp = state.robot, np.array(state.q), np.array(state.v), loads.time, state.stamp

    def torque() -> FloatArray:
        own = state
        if state.stamp != stamp:  # it has moved on
            own = State(robot)
            own.set(q, v)
        return np.asarray(own.mass_matrix @ a + loads.effects(own, time))

    return torque
