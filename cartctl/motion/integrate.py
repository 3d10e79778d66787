"""How a robot that does what it is told moves within one step: the command is held, the motion is exact.

Bounds that are viable in discrete time are so for these integrators only.
"""

from __future__ import annotations

from typing import NamedTuple

from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.levels import Command
from cartctl.model.robot import Robot


class Moved(NamedTuple):
    """Where a step leads: configuration (nq,) and velocity (nv,)."""

    q: FloatArray
    v: FloatArray


def by_velocity(robot: Robot, q: FloatArray, velocity: FloatArray, dt: float) -> Moved:
    """``q <- q (+) u dt``, ``v <- u``."""
    return Moved(robot.integrate(q, velocity * dt), velocity)


def by_acceleration(robot: Robot, q: FloatArray, v: FloatArray, acceleration: FloatArray, dt: float) -> Moved:
    """``q <- q (+) (v dt + u dt^2/2)``, ``v <- v + u dt``."""
    change = acceleration * dt
    return Moved(robot.integrate(q, (v + 0.5 * change) * dt), v + change)


def advance(robot: Robot, q: FloatArray, v: FloatArray, command: Command, dt: float) -> Moved:
    """The step that ``command`` asks for, by whichever quantity it sets; raises ParameterError where it sets none."""
    if command.velocity is not None:
        return by_velocity(robot, q, command.velocity, dt)
    if command.acceleration is not None:
        return by_acceleration(robot, q, v, command.acceleration, dt)
    raise ParameterError("the command holds neither a velocity nor an acceleration; expected one of them to move by")
