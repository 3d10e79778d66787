"""A controller and the robot it moves, one step after the other; the controller may change, the robot stays."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from cartctl.checks import FloatArray
from cartctl.errors import CartctlError
from cartctl.levels import Command
from cartctl.model.robot import Robot
from cartctl.motion.controller import Controller
from cartctl.motion.mover import Mover, mover

_RUNAWAY = 10.0  # times a joint's velocity limit
_FAST = 20.0  # rad/s or m/s, the limit of a joint that has none


class Session:
    """Where a robot is, and who moves it: as :func:`cartctl.simulate`, but without an end and without a record.

    q (nq,), v (nv,), t in s: the state now. command: that of the last step, None before the first. trouble: why the
    last step was not made, or "". spent: s that a step takes, a running mean.
    """

    def __init__(self, controller: Controller) -> None:
        self.q = controller.start(controller.robot.home)
        self.v = np.zeros(controller.robot.nv)
        self.t, self.spent = 0.0, 0.0
        limits = controller.robot.limits
        fastest = np.minimum(limits.velocity_upper, -limits.velocity_lower)
        self._fastest = np.where(np.isfinite(fastest) & (fastest > 0.0), fastest, _FAST)
        self.command: Command | None = None
        self.trouble = ""
        self.switch(controller)

    def switch(self, controller: Controller) -> None:
        """Let another controller go on from here; it forgets whatever it knew.

        One that keeps limits finds the joints within them, where whole turns lead there: without limits a joint may
        have wound up.
        """
        controller.reset()
        self.controller = controller
        if controller.limits is not None:
            self.q = unwound(controller.robot, self.q)
        self._mover: Mover = mover(controller, None, None, 1, 1)
        self._mover.begin(self.q, self.v)

    def step(self) -> None:
        """One step of the controller's dt. One that is refused or runs away leaves the robot at rest where it was."""
        started = perf_counter()
        try:
            command = self.controller.step(self.q, self.v, self.t)
            took = perf_counter() - started
            moved = self._mover.advance(0, self.q, self.v, command, self.t)
        except CartctlError as error:
            self._rest(str(error))
            return
        share = np.inf if moved is None else float((np.abs(moved.v) / self._fastest).max(initial=0.0))
        if moved is None or not share < _RUNAWAY:
            told = f"{share:.3g} times a joint's velocity limit" if np.isfinite(share) else "without bounds"
            self._rest(f"the motion would run away, {told}; the robot rests until it is asked for less")
            self.command = command
            return
        self.q, self.v = moved
        self.t += self.controller.dt
        self.spent += (took - self.spent) * (0.02 if self.spent else 1.0)
        self.command, self.trouble = command, ""

    def home(self, q: FloatArray) -> None:
        """Put the robot to q (nq,), at rest."""
        self.q, self.v = self.controller.start(q), np.zeros(self.controller.robot.nv)
        self.switch(self.controller)

    def _rest(self, trouble: str) -> None:
        self.v = np.zeros(self.controller.robot.nv)
        self.controller.reset()
        self.t += self.controller.dt
        self.trouble = trouble


def unwound(robot: Robot, q: FloatArray) -> FloatArray:
    """The posture q (nq,), its turning joints that are outside their limits turned back by whole turns."""
    at, limits = robot.coordinates(q), robot.limits
    values = {}
    for name in robot.single_joints:
        i = robot.dof(name)
        low, high = limits.position_lower[i], limits.position_upper[i]
        if not robot.is_prismatic(name) and not low <= at[i] <= high:
            values[name] = at[i] - 2.0 * np.pi * np.round((at[i] - 0.5 * (low + high)) / (2.0 * np.pi))
    return robot.configuration(values, q) if values else q
