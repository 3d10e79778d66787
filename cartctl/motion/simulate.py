"""Rolling a controller out: on a robot that does what it is told, or on one that has mass and is driven by torques."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from time import perf_counter_ns
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import CartctlWarning, ParameterError, RunInterrupted
from cartctl.motion.controller import Controller
from cartctl.motion.mover import RUNAWAY, Mover, mover
from cartctl.motion.plant import Plant
from cartctl.motion.recorder import Recorder
from cartctl.motion.run import Run
from cartctl.motion.steps import whole_steps

_TELL_EVERY = 0.05  # s of wall time between calls of progress


def simulate(
    controller: Controller,
    q0: Any = None,
    duration: float = 1.0,
    *,
    v0: Any = None,
    t0: float = 0.0,
    plant: Plant | None = None,
    integrator: str | None = None,
    substeps: int = 1,
    progress: Callable[[int, int], None] | None = None,
    save: str | os.PathLike[str] | None = None,
) -> Run:
    """Run ``controller`` from q0 (nq,) (home if None) for ``duration`` s, in whole steps of controller.dt: a Run.

    A solver that keeps an objective extremal starts on that set (:meth:`Controller.start`).

    Kinematic: the robot moves exactly as commanded, ``q <- q (+) u dt`` by velocities, ``q <- q (+) (v dt + u dt^2/2)``
    and ``v <- v + u dt`` by accelerations. At the torque level, and with a ``plant`` at the acceleration level
    (computed torque), it moves by its dynamics under the torque, held for a step; ``run.energy`` keeps the books.
    plant: a Plant that differs from the controller's model, None for one that does not. integrator:
    ``"semi-implicit"`` (Euler, the default) or ``"rk4"``. substeps: parts of each step dt that are taken. A motion that
    runs away ends the rollout, with a CartctlWarning and ``run.interrupted``.

    The controller is reset first. progress(k, n) is called now and then with steps made and to make. save: a .npz
    file, written however the rollout ends.

    Raises RunInterrupted on Ctrl-C, with every step made so far in ``.run``; TimeStepError for a duration that is not
    positive or takes too many steps; ParameterError, ShapeError, FrameNotFound, UnderactuatedRobot for a plant that
    does not fit, and whatever :meth:`Controller.step` raises.

    >>> import cartctl as cc
    >>> robot = cc.planar([1.0, 1.0, 1.0])
    >>> tip = cc.FrameTask("tool", "xy", gain=4.0, target=[1.5, 1.5, 0.0])
    >>> run = cc.simulate(cc.Controller(robot, tip, solver="dls", limits=None, dt=0.01), duration=3.0)
    >>> run.metrics().tasks[0].final_m < 1e-4
    True
    """
    if not isinstance(controller, Controller):
        raise ParameterError(f"controller is a {type(controller).__name__}; expected a cc.Controller")
    if progress is not None and not callable(progress):
        raise ParameterError(f"progress is a {type(progress).__name__}; expected a function of steps made and to make")
    robot, dt = controller.robot, controller.dt
    steps = whole_steps(checks.duration("duration", duration), dt)
    q = controller.start(robot.home if q0 is None else q0)
    v = np.zeros(robot.nv) if v0 is None else checks.vector("v0", v0, robot.nv, largest=checks.LARGEST)
    controller.reset()
    moves = mover(controller, plant, integrator, substeps, steps)
    recorder = Recorder(controller, steps, checks.number("t0", t0), moves)
    try:
        whole = _roll(controller, recorder, moves, q, v, progress)
    except KeyboardInterrupt:
        raise RunInterrupted(_kept(recorder, save, interrupted=True)) from None
    except BaseException:
        _kept(recorder, save, interrupted=True)
        raise
    return _kept(recorder, save, interrupted=not whole)


def _kept(recorder: Recorder, save: str | os.PathLike[str] | None, *, interrupted: bool) -> Run:
    """What was made, saved if asked for; a rollout without a step leaves an older file alone."""
    run = recorder.finish(interrupted=interrupted)
    if save is not None and len(run):
        run.save(save)
    return run


def _roll(
    controller: Controller,
    recorder: Recorder,
    moves: Mover,
    q: FloatArray,
    v: FloatArray,
    progress: Callable[[int, int], None] | None,
) -> bool:
    """Make all steps; whether the motion stayed one of a robot."""
    steps, told = recorder.steps, 0
    moves.begin(q, v)
    for k in range(steps):
        t = recorder.time_of(k)
        started = perf_counter_ns()
        command = controller.step(q, v, t)
        spent = perf_counter_ns() - started
        moved = moves.advance(k, q, v, command, t)
        recorder.record(k, q, v, command, spent)
        if moved is None:
            warnings.warn(
                f"the motion ran away at t = {t:g} s, beyond {RUNAWAY:g} rad/s; the run ends there. Damp the null "
                "space, bound the torques, or use more substeps",
                CartctlWarning,
                stacklevel=3,
            )
            return False
        q, v = moved
        if progress is not None and (started - told > _TELL_EVERY * 1e9 or k + 1 == steps):
            told = started
            progress(k + 1, steps)
    recorder.close(q, v)
    return True
