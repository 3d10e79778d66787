"""What the last step says of itself, in the units in which it is shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cartctl.algebra.solution import Status
from cartctl.checks import FloatArray
from cartctl.levels import Command
from cartctl.model.robot import Robot
from cartctl.motion.controller import Controller

_OFF, _STILL = 1e-3, 1e-3  # m or rad off the target, and rad/s or m/s, at which a robot counts as standing


@dataclass(frozen=True)
class Joint:
    """One joint. position: 0 at its lower limit, 1 at the upper. rate, torque: over the limit in that direction.

    None where there is no limit. saturated: -1 or +1 where the command is at its bound, 0 where it is free.
    """

    name: str
    position: float | None
    rate: float | None
    torque: float | None
    saturated: int


@dataclass(frozen=True)
class Reading:
    """status: of the solution. scales: one a task, nan where skipped. errors: (name, m or None, rad or None) a task.

    stands: whether the robot rests without having reached its target.
    """

    status: Status
    scales: list[float]
    errors: list[tuple[str, float | None, float | None]]
    joints: list[Joint]
    stands: bool = False

    @classmethod
    def of(cls, controller: Controller, q: FloatArray, v: FloatArray, command: Command) -> Reading:
        """What is to be read of a step that led to q, v."""
        solution = command.solution
        errors: list[tuple[str, float | None, float | None]] = []
        for task, reference in zip(controller.tasks, command.references, strict=False):
            units = task.units(controller.robot)
            errors.append((task.name, _norm(reference.error, units, "m"), _norm(reference.error, units, "rad")))
        first = max(errors[0][1] or 0.0, errors[0][2] or 0.0)
        return cls(
            solution.status,
            [float(s) for s in solution.scales[: len(controller.tasks)]],
            errors,
            joints(controller.robot, q, v, command.torque, np.sign(solution.saturated)),
            stands=first > _OFF and float(np.abs(v).max(initial=0.0)) < _STILL,
        )


def joints(robot: Robot, q: FloatArray, v: FloatArray, torque: FloatArray | None, saturated: FloatArray) -> list[Joint]:
    """Every degree of freedom against the robot's own limits."""
    limits, at = robot.limits, robot.coordinates(q)
    position = _shares(
        len(at), lambda i: (at[i] - limits.position_lower[i], limits.position_upper[i] - limits.position_lower[i])
    )
    rate = _shares(len(at), lambda i: (v[i], limits.velocity_upper[i] if v[i] >= 0 else -limits.velocity_lower[i]))
    drive: list[float | None] = [None] * len(at)
    if torque is not None:
        drive = _shares(
            len(at), lambda i: (torque[i], limits.torque_upper[i] if torque[i] >= 0 else -limits.torque_lower[i])
        )
    return [Joint(*row) for row in zip(robot.dof_names, position, rate, drive, map(int, saturated), strict=True)]


def _shares(count: int, parts: Callable[[int], tuple[float, float]]) -> list[float | None]:
    """Value over limit of each; None without a limit."""
    out: list[float | None] = []
    for i in range(count):
        value, limit = parts(i)
        out.append(float(value / limit) if np.isfinite(limit) and limit > 0.0 else None)
    return out


def _norm(error: FloatArray, units: list[str], unit: str) -> float | None:
    rows = [i for i, u in enumerate(units) if u == unit]
    return float(np.linalg.norm(error[rows])) if rows else None
