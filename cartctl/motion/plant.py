"""The robot that is really there: as the controller's model has it, or differently, and pushed about."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.dynamics.friction import Friction
from cartctl.errors import ParameterError, ShapeError
from cartctl.levels.loads import Loads, require_actuated
from cartctl.model.payload import Payload
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.model.wrench import Wrench


class Plant:
    """The robot that is really there, where it differs from the model: ``cc.simulate(..., plant=cc.Plant(...))``.

    robot: another Robot with the same joints; None for the controller's. payload: a Payload, or a sequence, that the
    robot holds beside what its model says. masses: a factor > 0 on mass and inertia of all links
    of the model, not on ``payload``, not on rotors. friction: instead
    of the one the controller's level knows of; None for that one, ``cc.Friction()`` for none. wrenches: what acts on
    the robot beside the wrenches the level knows of. noise: standard deviation of the torques, N m or N, a number or
    (nv,), drawn anew each step of the controller from ``seed``.

    Raises ParameterError, ShapeError, NonFiniteError; FrameNotFound, UnderactuatedRobot when a rollout begins.
    """

    def __init__(
        self,
        robot: Robot | None = None,
        *,
        payload: Payload | Sequence[Payload] = (),
        masses: float = 1.0,
        friction: Friction | None = None,
        wrenches: Wrench | Sequence[Wrench] = (),
        noise: float | FloatArray = 0.0,
        seed: int = 0,
    ) -> None:
        if not (robot is None or isinstance(robot, Robot)):
            raise ParameterError(f"robot is a {type(robot).__name__}; expected a Robot from cc.load(...), or None")
        self.robot = robot
        given = (payload,) if isinstance(payload, Payload) else payload
        if not isinstance(given, Sequence) or not all(isinstance(load, Payload) for load in given):
            raise ParameterError(f"payload is {payload!r}; expected cc.Payload(...), or a sequence of them")
        self.payloads = tuple(given)
        self.masses = checks.number("masses", masses, low=0.0, strict=True)
        self.loads = Loads(friction, wrenches)
        self.noise = checks.amounts("noise", noise, "standard deviations of at least 0")
        if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
            raise ParameterError(f"seed is {seed!r}; expected a whole number of at least 0")
        self.seed = int(seed)

    def body(self, robot: Robot, loads: Loads | None = None) -> Body:
        """The plant of a controller's robot and of what its level knows of: see :class:`Body`."""
        real = robot if self.robot is None else self.robot
        if real.dof_names != robot.dof_names or real.nq != robot.nq:
            raise ShapeError(
                f"the plant has the joints {real.dof_names}; expected {robot.dof_names}, as the controller"
            )
        if self.masses != 1.0:
            real = _scaled(real, self.masses)
        for payload in self.payloads:  # last: a payload weighs what it says
            real = real.carrying(payload)
        known = Loads() if loads is None else loads
        friction = known.friction if self.loads.friction is None else self.loads.friction
        every = Loads(friction, (*known.wrenches, *self.loads.wrenches))
        checks.fits("noise", self.noise, robot.nv)
        return Body(real, every, self.noise, self.seed)


class Body:
    """A robot that moves by its torques: ``M a + c + g + f(v) = tau + sum J^T w(t)``, with Pinocchio's aba.

    robot: as it really is. loads: friction and wrenches. Raises ShapeError, FrameNotFound, UnderactuatedRobot.
    """

    def __init__(self, robot: Robot, loads: Loads, noise: float | FloatArray = 0.0, seed: int = 0) -> None:
        require_actuated(robot)
        loads.check(robot)
        self.robot, self.loads = robot, loads
        self._noise = noise
        self._noisy = bool(np.any(noise))
        self._seed = seed
        self._state = State(robot)
        self._data = robot.model.createData()
        self._still = np.zeros(robot.nv)
        self.reset()

    def reset(self) -> None:
        """Begin the noise anew."""
        self._rng = np.random.default_rng(self._seed)

    def move(self, q: FloatArray, displacement: FloatArray) -> FloatArray:
        """``q (+) displacement``, (nq,), unchecked."""
        return pin.integrate(self.robot.model, q, displacement)  # type: ignore[no-any-return]

    def driven(self, torque: FloatArray) -> FloatArray:
        """The torques (nv,) that arrive, held for one step of the controller."""
        return torque + self._noise * self._rng.standard_normal(len(torque)) if self._noisy else torque

    def friction(self, v: FloatArray) -> FloatArray:
        """``f(v)`` (nv,)."""
        return self._still if self.loads.friction is None else self.loads.friction.torque(v)

    def pushed(self, q: FloatArray, v: FloatArray, t: float) -> FloatArray:
        """``sum J^T w`` (nv,) at time t."""
        if not self.loads.wrenches:
            return self._still
        self._state.set(q, v)
        return sum((w.torque(self._state, t) for w in self.loads.wrenches), self._still)

    def acceleration(self, q: FloatArray, v: FloatArray, torque: FloatArray) -> FloatArray:
        """``a`` (nv,) under the sum of all torques, friction and wrenches included."""
        return np.array(pin.aba(self.robot.model, self._data, q, v, torque))

    def kinetic(self, q: FloatArray, v: FloatArray) -> float:
        """``T = 1/2 v^T M v``, J."""
        return float(pin.computeKineticEnergy(self.robot.model, self._data, q, v))

    def potential(self, q: FloatArray) -> float:
        """``U(q)``, J, zero at the origin of the world."""
        return float(pin.computePotentialEnergy(self.robot.model, self._data, q))


def _scaled(robot: Robot, factor: float) -> Robot:
    """The same robot, all its links ``factor`` times as heavy."""
    heavier = copy.copy(robot)
    heavier.model = robot.model.copy()
    for i, body in enumerate(robot.model.inertias):
        heavier.model.inertias[i] = pin.Inertia(factor * body.mass, body.lever, factor * np.array(body.inertia))
    return heavier
