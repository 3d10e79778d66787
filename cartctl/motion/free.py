"""A robot let go, or under torques of one's own: forward dynamics without a controller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import NonFiniteError, ParameterError
from cartctl.model.robot import Robot
from cartctl.motion.energy import EnergyBooks
from cartctl.motion.forward import INTEGRATORS
from cartctl.motion.mover import RUNAWAY, Driven
from cartctl.motion.plant import Plant
from cartctl.motion.steps import whole_steps

Torque = Callable[[float, FloatArray, FloatArray], Any]


@dataclass(eq=False)
class FreeMotion:
    """time (N+1,) s, q (N+1, nq), v (N+1, nv), torque (N, nv) and the books of energy."""

    time: FloatArray
    q: FloatArray
    v: FloatArray
    torque: FloatArray
    energy: EnergyBooks


def free_motion(
    robot: Robot,
    q0: Any = None,
    v0: Any = None,
    duration: float = 1.0,
    *,
    torque: Any = None,
    plant: Plant | None = None,
    dt: float = 1e-3,
    integrator: str = "rk4",
    substeps: int = 1,
) -> FreeMotion:
    """How ``robot`` moves from q0 (nq,) (home if None) and v0 (nv,) (zeros) for ``duration`` s, nobody controlling it.

    torque: (nv,), N m or N, or a function of (t, q, v) that returns it, held for a step of dt s; None for none. plant:
    friction, payloads and wrenches; None for the bare model. integrator, substeps as in :func:`cartctl.simulate`.

    Raises ParameterError, ShapeError, NonFiniteError (a motion that runs away, too), TimeStepError, ConfigurationError,
    UnderactuatedRobot.
    """
    if not isinstance(robot, Robot):
        raise ParameterError(f"robot is a {type(robot).__name__}; expected a Robot from cc.load(...)")
    checks.choice("integrator", integrator, tuple(INTEGRATORS))
    steps = whole_steps(checks.duration("duration", duration), checks.duration("dt", dt))
    q = robot.check_configuration(robot.home if q0 is None else q0, "q0")
    v = np.zeros(robot.nv) if v0 is None else checks.vector("v0", v0, robot.nv, largest=checks.LARGEST)
    drive = _drive(torque, robot.nv)
    moves = Driven((Plant() if plant is None else plant).body(robot), dt, substeps, integrator, steps)
    time = dt * np.arange(steps + 1, dtype=np.float64)
    qs, vs = np.empty((steps + 1, robot.nq)), np.empty((steps + 1, robot.nv))
    qs[0], vs[0] = q, v
    moves.begin(q, v)
    for k in range(steps):
        moved = moves.push(k, q, v, drive(time[k], q, v), time[k])
        if moved is None:
            raise NonFiniteError(
                f"the motion ran away at t = {time[k]:g} s, beyond {RUNAWAY:g} rad/s; use a smaller dt or more substeps"
            )
        q, v = qs[k + 1], vs[k + 1] = moved
    return FreeMotion(time, qs, vs, moves.torque, moves.books)


def _drive(torque: Any, nv: int) -> Torque:
    if callable(torque):
        return lambda t, q, v: checks.vector(f"the torque at t = {t:g} s", torque(t, q, v), nv, largest=checks.LARGEST)
    fixed = np.zeros(nv) if torque is None else checks.vector("torque", torque, nv, largest=checks.LARGEST)
    return lambda t, q, v: fixed
