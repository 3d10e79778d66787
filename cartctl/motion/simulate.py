"""Rolling a controller out on a robot that does what it is told."""

from __future__ import annotations

import os
from collections.abc import Callable
from time import perf_counter_ns
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError, RunInterrupted, TimeStepError
from cartctl.motion.controller import Controller
from cartctl.motion.integrate import advance
from cartctl.motion.recorder import Recorder
from cartctl.motion.run import Run

_MOST = 10_000_000  # steps a rollout records
_TELL_EVERY = 0.05  # s of wall time between calls of progress


def simulate(
    controller: Controller,
    q0: Any = None,
    duration: float = 1.0,
    *,
    v0: Any = None,
    t0: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
    save: str | os.PathLike[str] | None = None,
) -> Run:
    """Run ``controller`` from q0 (nq,) (home if None) for ``duration`` s, in whole steps of controller.dt: a Run.

    A solver that keeps an objective extremal starts on that set (:meth:`Controller.start`).

    Kinematic: the robot moves exactly as commanded, ``q <- q (+) u dt`` by velocities, ``q <- q (+) (v dt + u dt^2/2)``
    and ``v <- v + u dt`` by accelerations. The controller is reset first. progress(k, n) is called now and then with
    steps made and to make. save: a .npz file, written however the rollout ends.

    Raises RunInterrupted on Ctrl-C, with every step made so far in ``.run``; TimeStepError for a duration that is not
    positive or takes too many steps, and whatever :meth:`Controller.step` raises.
    """
    if not isinstance(controller, Controller):
        raise ParameterError(f"controller is a {type(controller).__name__}; expected a cc.Controller")
    if progress is not None and not callable(progress):
        raise ParameterError(f"progress is a {type(progress).__name__}; expected a function of steps made and to make")
    robot, dt = controller.robot, controller.dt
    steps = _steps(checks.duration("duration", duration), dt)
    q = controller.start(robot.home if q0 is None else q0)
    v = np.zeros(robot.nv) if v0 is None else checks.vector("v0", v0, robot.nv, largest=checks.LARGEST)
    controller.reset()
    recorder = Recorder(controller, steps, checks.number("t0", t0))
    try:
        _roll(controller, recorder, q, v, progress)
    except KeyboardInterrupt:
        raise RunInterrupted(_kept(recorder, save, interrupted=True)) from None
    except BaseException:
        _kept(recorder, save, interrupted=True)
        raise
    return _kept(recorder, save, interrupted=False)


def _kept(recorder: Recorder, save: str | os.PathLike[str] | None, *, interrupted: bool) -> Run:
    """What was made, saved if asked for; a rollout without a step leaves an older file alone."""
    run = recorder.finish(interrupted=interrupted)
    if save is not None and len(run):
        run.save(save)
    return run


def _steps(duration: float, dt: float) -> int:
    """Whole steps that cover the duration, forgiving the round-off of duration / dt."""
    wanted = np.ceil(duration / dt - 1e-9)
    if not wanted <= _MOST:
        raise TimeStepError(
            f"duration {duration:g} s in steps of dt = {dt:g} s is {wanted:.3g} steps; expected at most {_MOST:.0e}: "
            "a larger dt, or several rollouts"
        )
    steps = int(wanted)
    if steps < 1:
        raise TimeStepError(f"duration is {duration:g} s; expected at least one step of {dt:g} s")
    return steps


def _roll(
    controller: Controller,
    recorder: Recorder,
    q: FloatArray,
    v: FloatArray,
    progress: Callable[[int, int], None] | None,
) -> None:
    robot, dt, steps = controller.robot, controller.dt, recorder.steps
    told = 0
    for k in range(steps):
        t = recorder.time_of(k)
        started = perf_counter_ns()
        command = controller.step(q, v, t)
        spent = perf_counter_ns() - started
        recorder.record(k, q, v, command, spent)
        q, v = advance(robot, q, v, command, dt)
        if progress is not None and (started - told > _TELL_EVERY * 1e9 or k + 1 == steps):
            told = started
            progress(k + 1, steps)
    recorder.close(q, v)
