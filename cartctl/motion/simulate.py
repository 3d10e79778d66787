"""Rolling a controller out on a robot that does what it is told."""

from __future__ import annotations

import os
from collections.abc import Callable
from time import perf_counter_ns
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import RunInterrupted, TimeStepError
from cartctl.motion.controller import Controller
from cartctl.motion.recorder import Recorder
from cartctl.motion.run import Run

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
    """Run ``controller`` from q0 (nq,) (home if None) for ``duration`` s in steps of controller.dt: a Run.

    Kinematic: the robot moves exactly as commanded, ``q <- q (+) v dt``. The controller is reset first. progress(k, n)
    is called now and then with steps made and to make. save: a .npz file, written however the rollout ends.

    Raises RunInterrupted on Ctrl-C, with every step made so far in ``.run``; TimeStepError for a duration below one
    step, and whatever :meth:`Controller.step` raises.
    """
    robot, dt = controller.robot, controller.dt
    steps = _steps(checks.duration("duration", duration), dt)
    q = robot.home if q0 is None else robot.check_configuration(q0, "q0")
    v = np.zeros(robot.nv) if v0 is None else checks.vector("v0", v0, robot.nv)
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
    steps = int(np.ceil(duration / dt - 1e-9))
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
        assert command.velocity is not None
        v = command.velocity
        q = robot.integrate(q, v * dt)
        if progress is not None and (started - told > _TELL_EVERY * 1e9 or k + 1 == steps):
            told = started
            progress(k + 1, steps)
    recorder.close(q, v)
