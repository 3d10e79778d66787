"""What moves the robot between two steps of its controller: kinematics that obey, or dynamics under torques."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.levels import Command
from cartctl.model.robot import Robot
from cartctl.motion.controller import Controller
from cartctl.motion.energy import EnergyBooks
from cartctl.motion.forward import INTEGRATORS, Work
from cartctl.motion.integrate import Moved, advance
from cartctl.motion.plant import Body, Plant
from cartctl.motion.steps import parts

RUNAWAY = 1e4  # rad/s or m/s: nothing that moves so fast is a robot


class Mover(ABC):
    """Moves a robot through steps of dt s, each in ``substeps`` equal parts."""

    def __init__(self, dt: float, substeps: int) -> None:
        self.dt, self.substeps = dt, parts(substeps)

    def begin(self, q: FloatArray, v: FloatArray) -> None:
        """Take note of the state before the first step."""
        return

    @abstractmethod
    def advance(self, k: int, q: FloatArray, v: FloatArray, command: Command, t: float) -> Moved | None:
        """Where step k leads from (q, v) at time t; None where the motion runs away."""


class Obedient(Mover):
    """The robot moves exactly as commanded (:mod:`cartctl.motion.integrate`)."""

    def __init__(self, robot: Robot, dt: float, substeps: int) -> None:
        super().__init__(dt, substeps)
        self._robot, self._part = robot, dt / self.substeps

    def advance(self, k: int, q: FloatArray, v: FloatArray, command: Command, t: float) -> Moved:
        """The command is held over the parts of the step."""
        for _ in range(self.substeps):
            q, v = advance(self._robot, q, v, command, self._part)
        return Moved(q, v)


class Driven(Mover):
    """The robot moves as torques, friction and wrenches make it.

    torque: (N, nv) what arrived. books: EnergyBooks of N + 1 samples.
    """

    def __init__(self, body: Body, dt: float, substeps: int, integrator: str, steps: int) -> None:
        super().__init__(dt, substeps)
        self._body, self._step = body, INTEGRATORS[integrator]
        self._work = Work()
        self.torque = np.zeros((steps, body.robot.nv))
        self.books = EnergyBooks.empty(steps + 1)

    def begin(self, q: FloatArray, v: FloatArray) -> None:
        """The first entry of the books."""
        self._write(0, q, v)

    def advance(self, k: int, q: FloatArray, v: FloatArray, command: Command, t: float) -> Moved | None:
        """The torque is held over the parts of the step."""
        told = command.torque
        if told is None:
            raise ParameterError("the command holds no torque; expected one, to move the plant by")
        return self.push(k, q, v, told, t)

    def push(self, k: int, q: FloatArray, v: FloatArray, torque: FloatArray, t: float) -> Moved | None:
        """The same under a torque (nv,) from anywhere."""
        self.torque[k] = torque = self._body.driven(torque)
        part = self.dt / self.substeps
        for i in range(self.substeps):
            q, v, self._work = self._step(self._body, q, v, torque, t + i * part, part, self._work)
            if not float(v @ v) < RUNAWAY**2:
                return None
        self._write(k + 1, q, v)
        return Moved(q, v)

    def _write(self, k: int, q: FloatArray, v: FloatArray) -> None:
        books, work = self.books, self._work
        books.kinetic[k], books.potential[k] = self._body.kinetic(q, v), self._body.potential(q)
        books.motors[k], books.friction[k], books.wrenches[k] = work


def mover(controller: Controller, plant: Any, integrator: Any, substeps: Any, steps: int) -> Mover:
    """What ``cc.simulate`` moves by; raises ParameterError, and what :meth:`Plant.body` raises."""
    if not (plant is None or isinstance(plant, Plant)):
        raise ParameterError(f"plant is a {type(plant).__name__}; expected a cc.Plant, or None")
    if integrator is not None:
        checks.choice("integrator", integrator, tuple(INTEGRATORS))
    level, robot = controller.level, controller.robot
    if plant is None and not level.limits_are_rows:
        if integrator is not None:
            raise ParameterError(
                f"integrator is {integrator!r}, but at level {level.name!r} the robot moves as it is told; give a "
                "plant=cc.Plant() to simulate its dynamics, or drop it"
            )
        return Obedient(robot, controller.dt, substeps)
    if level.loads is None:
        raise ParameterError(
            f"plant is given, but level {level.name!r} commands no torques that could drive it; use level 'torque', or "
            "'acceleration' (computed torque), or drop it"
        )
    body = (Plant() if plant is None else plant).body(robot, level.loads)
    return Driven(body, controller.dt, substeps, integrator or "semi-implicit", steps)
